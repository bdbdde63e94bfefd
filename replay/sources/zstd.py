"""The compression of ROS 2 bags: of whole files, or of each message.

rosbags brings this implementation along. The other one at hand, ``zstandard``, ends a file that was cut off without a
word.
"""

from __future__ import annotations

import errno
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

from replay.sources.memory import MOST_BYTES, TooLargeError

MAGIC = b"\x28\xb5\x2f\xfd"

_PIECE_BYTES = 1 << 20
# Of what is free where it is decompressed: other programs need some, too, and a few kilobytes can become any number.
_MOST_OF_FREE = 0.75

ZstdError = zstd.ZstdError


def decompress_file(source: Path, target: Path, beginnings: Sequence[bytes] = (b"",)) -> bool:
    """Decompress a file as a stream.

    Parameters
    ----------
    beginnings
        What it may begin with. Of what begins otherwise, and may grow without end, only the beginning is decompressed.

    Returns
    -------
    bool
        Whether all of it was there; if not, the target has as much as what is there yields.

    Raises
    ------
    ZstdError
        If it is damaged: what follows, and some of what precedes the damage, is not what it was.
    OSError
        If it takes nearly all that is free.
    """
    most_bytes = int(shutil.disk_usage(target.parent).free * _MOST_OF_FREE)
    with source.open("rb") as compressed, target.open("wb") as plain:
        decompressor = zstd.ZstdDecompressor()
        piece = compressed.read(_PIECE_BYTES)
        while piece or not (decompressor.needs_input or decompressor.eof):
            output = decompressor.decompress(piece, _PIECE_BYTES)
            is_first = plain.tell() == 0
            if plain.tell() + len(output) > most_bytes:
                raise OSError(errno.ENOSPC, f"decompressed, it takes more than {_MOST_OF_FREE:.0%} of what is free")
            plain.write(output)
            if is_first and not any(each.startswith(output[: len(each)]) for each in beginnings):
                return True
            if decompressor.eof:
                piece = decompressor.unused_data or compressed.read(_PIECE_BYTES)
                # there may be several frames, one after the other
                decompressor = zstd.ZstdDecompressor() if piece else decompressor
            else:
                piece = compressed.read(_PIECE_BYTES) if decompressor.needs_input else b""
    return decompressor.eof


def decompressed_cdr(data: bytes, most_bytes: int = MOST_BYTES) -> bytes:
    """Return a message in CDR as it was before a bag with message compression stored it.

    No message in CDR begins like compressed data, so that this needs no metadata.

    Raises
    ------
    ZstdError
        If it was cut off, or is damaged.
    TooLargeError
        If it would be larger than ``most_bytes``, whatever size it says it has.
    """
    if not data.startswith(MAGIC):
        return data
    decompressor = zstd.ZstdDecompressor()
    plain = decompressor.decompress(data, most_bytes + 1)
    if len(plain) > most_bytes:
        raise TooLargeError(most_bytes)
    if not decompressor.eof:
        raise ZstdError("it ends early")
    return plain
