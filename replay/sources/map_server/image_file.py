"""The images of saved maps: PGM, PPM, PNG and BMP, whose size is known and checked before anything is decoded.

A few kilobytes can say that they are an image of any size. Other formats are not read: what is lossy bends walls, and
its damage does not show.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from replay.errors import InputError
from replay.sources.map_server.map_image import Pixels

MOST_PIXELS = 1 << 28
MOST_BYTES = 1 << 30

_PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
_PNG_CHUNK = struct.Struct(">I4s")
_CRC = struct.Struct(">I")
_PNM = re.compile(rb"P([2356])" + rb"(?:\s+(?:#[^\n]*\n\s*)*)(\d{1,9})" * 3 + rb"\s")
_BMP = struct.Struct("<10xI4xiiHHI")


@dataclass(frozen=True, slots=True)
class Header:
    """What the beginning of an image says.

    Parameters
    ----------
    missing
        What is wrong with the rest of the file; "" if it is all there.
    """

    width: int
    height: int
    missing: str = ""


def read_pixels(path: Path, image: Path) -> Pixels:
    """Return the pixels of a map's image as they are stored, 8 bits a channel, in OpenCV's order.

    Raises
    ------
    InputError
        If it is none of the formats, larger than any map, not all there, or of more than 8 bits.
    """
    import cv2

    size = image.stat().st_size
    if size > MOST_BYTES:
        raise InputError(f"{path}: its image {image} has {size} bytes; at most {MOST_BYTES} are read")
    # Not imread, which cannot open every name on Windows.
    content = np.fromfile(image, np.uint8)
    header = header_of(content.tobytes())
    if header is None:
        raise InputError(f"{path}: its image {image} cannot be read; expected PGM, PPM, PNG or BMP: convert it")
    if header.width * header.height > MOST_PIXELS:
        raise InputError(
            f"{path}: its image {image} has {header.width} × {header.height} pixels; at most {MOST_PIXELS} are read: "
            "cut it to what is known, or make it coarser"
        )
    if header.missing:
        raise InputError(f"{path}: its image {image} is damaged: {header.missing}; copy it again")
    pixels = cv2.imdecode(content, cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise InputError(f"{path}: its image {image} is damaged: it cannot be decoded; copy it again")
    if pixels.dtype != np.uint8:
        raise InputError(
            f"{path}: its image {image} is {pixels.dtype}; expected 8 bits a channel: convert it to 8 bits"
        )
    return pixels.astype(np.uint8, copy=False)


def header_of(content: bytes) -> Header | None:
    """Return what the beginning of an image says; None if it is of no format that is read."""
    if content.startswith(_PNG_MAGIC):
        return _png(content)
    if content.startswith(b"BM"):
        return _bmp(content)
    return _pnm(content)


def _pnm(content: bytes) -> Header | None:
    match = _PNM.match(content)
    if match is None:
        return None
    kind, width, height, most = (int(each) for each in match.groups())
    numbers = width * height * (3 if kind in {3, 6} else 1)
    if width * height > MOST_PIXELS:
        return Header(width, height)
    if kind in {5, 6}:
        return Header(width, height, _short(len(content) - match.end(), numbers * (2 if most > 255 else 1), "bytes"))
    return Header(width, height, _short(_words(content, match.end()), numbers, "numbers"))


def _words(content: bytes, start: int) -> int:
    """Return how many words there are from a byte on, without making any of them."""
    is_space = np.frombuffer(content, np.uint8)[start - 1 :] <= ord(" ")
    return int(np.count_nonzero(is_space[:-1] & ~is_space[1:]))


def _bmp(content: bytes) -> Header | None:
    if len(content) < _BMP.size:
        return None
    start, width, height, _, bits, compression = _BMP.unpack_from(content)
    if width <= 0 or height == 0:
        return None
    row_bytes = (width * bits + 31) // 32 * 4
    # What is compressed says itself where it ends, and is decoded only as far as that.
    missing = "" if compression in {1, 2} else _short(len(content) - start, row_bytes * abs(height), "bytes")
    return Header(width, abs(height), missing)


def _png(content: bytes) -> Header | None:
    if content[12:16] != b"IHDR" or len(content) < 24:
        return None
    width, height = struct.unpack_from(">II", content, 16)
    return Header(width, height, next(_png_damage(content), ""))


def _png_damage(content: bytes) -> Iterator[str]:
    """Yield what is wrong with the chunks of a PNG, each of which has a checksum."""
    start, view = len(_PNG_MAGIC), memoryview(content)
    while start + _PNG_CHUNK.size + _CRC.size <= len(content):
        length, kind = _PNG_CHUNK.unpack_from(content, start)
        end = start + _PNG_CHUNK.size + length
        if end + _CRC.size > len(content):
            break
        if _CRC.unpack_from(content, end)[0] != zlib.crc32(view[start + 4 : end]):
            yield f"the checksum (CRC) of its part at byte {start} is wrong"
        if kind == b"IEND":
            return
        start = end + _CRC.size
    yield f"it ends early, at byte {len(content)}"


def _short(found: int, expected: int, what: str) -> str:
    return "" if found >= expected else f"it ends early: it has {max(found, 0)} {what} of pixels, not {expected}"
