"""What is compressed in MCAP files, decompressed in steps and counted, so that no size needs to be believed."""

from __future__ import annotations

from collections.abc import Iterator
from io import BytesIO

from replay.skip_cause import SkipCause
from replay.sources.mcap.records import BadPart

COMPRESSIONS = {b"", b"lz4", b"zstd"}
"""Names of those that there are; the first stands for none."""

# larger steps take longer: their memory is asked of the system anew each time
_STEP_BYTES = 1 << 18


def decompressed(compression: bytes, data: bytes, most_bytes: int) -> bytes:
    """Return what is in the data, up to a little more than so many bytes; what is not compressed, all of it.

    Raises
    ------
    BadPart
        If it cannot be decompressed.
    """
    return _joined(_pieces(compression, data, most_bytes))


def _joined(pieces: Iterator[bytes]) -> bytes:
    """Return pieces as one, in the memory of one: each is let go of before the next one comes."""
    first = next(pieces, b"")
    second = next(pieces, None)
    if second is None:
        return first
    joined = BytesIO()
    joined.write(first)
    joined.write(second)
    del first, second
    for piece in pieces:
        joined.write(piece)
    return joined.getvalue()


def _pieces(compression: bytes, data: bytes, most_bytes: int) -> Iterator[bytes]:
    """Yield what is in the data in pieces, up to a little more than so many bytes; what is not compressed at once."""
    from zstandard import ZstdError

    if compression not in COMPRESSIONS:
        name = compression.decode(errors="replace")
        raise BadPart(SkipCause.DAMAGED, f"its compression is '{name}', not lz4, zstd or none")
    if not compression:
        yield data
        return
    steps = _zstd_steps(data) if compression == b"zstd" else _lz4_steps(data)
    left = most_bytes
    try:
        for step in steps:
            yield step
            left -= len(step)
            if left < 0:
                return
    # RuntimeError is lz4's
    except (ZstdError, RuntimeError) as error:
        found = " ".join(str(error).split())
        if "allocation" in found.lower():
            # which says nothing about the recording
            raise MemoryError(found) from error
        raise BadPart(SkipCause.DAMAGED, f"it cannot be decompressed ({found})") from error


def _zstd_steps(data: bytes) -> Iterator[bytes]:
    from zstandard import ZstdDecompressor

    with ZstdDecompressor().stream_reader(data, read_across_frames=True) as reader:
        while step := reader.read(_STEP_BYTES):
            yield step


def _lz4_steps(data: bytes) -> Iterator[bytes]:
    from lz4.frame import LZ4FrameDecompressor

    while data:
        decompressor = LZ4FrameDecompressor()
        step, data = decompressor.decompress(data, _STEP_BYTES), b""
        while step or not (decompressor.eof or decompressor.needs_input):
            yield step
            step = b"" if decompressor.eof else decompressor.decompress(b"", _STEP_BYTES)
        if decompressor.eof:
            data = decompressor.unused_data or b""
