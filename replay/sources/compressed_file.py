"""Recordings that were compressed with zstd as whole files: ``.mcap.zstd``, ``.db3.zstd``, ``.bag.zst``."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path

from replay.errors import InputError
from replay.skip_cause import SkipCause
from replay.sources.base import RawMessage, Source, SourceInfo
from replay.sources.beginnings import HEAD_BYTES, nothing_there
from replay.sources.boundary import COMMON, COPY_AGAIN, Closing, translated
from replay.sources.lapses import AT_END
from replay.sources.losses import Loss
from replay.sources.mcap.file import McapFile
from replay.sources.memory import MOST_BYTES
from replay.sources.rosbag1.file import Rosbag1File
from replay.sources.sqlite3.file import Sqlite3File
from replay.sources.temporary import temporary_folder
from replay.sources.zstd import MAGIC, ZstdError, decompress_file

# of MCAP files, .db3 files and ROS 1 bags
_BEGINNINGS = (b"\x89MCAP", b"SQLite", b"#ROSBAG")


class CompressedFile(Closing):
    """A recording that was compressed as a file. It is decompressed into a temporary directory and read there.

    Parameters
    ----------
    most_bytes
        The largest message, or decompressed chunk, that is read.
    """

    def __init__(self, path: Path, most_bytes: int = MOST_BYTES) -> None:
        self.path = path
        with ExitStack() as stack, translated(path, (*COMMON, ZstdError)):
            plain, is_whole = plain_copy(path, stack)
            self._again = partial(_opened, plain, path, most_bytes, is_whole=is_whole)
            self._source = stack.enter_context(self._again())
            if not is_whole:
                name_early_end(self._source)
            self.losses = self._source.losses
            self._resources = stack.pop_all()

    @classmethod
    def recognises(cls, path: Path, head: bytes) -> bool:
        """Tell whether this is compressed with zstd, whatever is in it."""
        del path
        return head.startswith(MAGIC)

    def again(self) -> Source:
        """Open the copy once more, for as long as this is open."""
        return self._again()

    @property
    def info(self) -> SourceInfo:
        """What the recording holds."""
        return replace(self._source.info, format="zstd")

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of these topics in order of log time, ties in the order in which they were written."""
        return self._source.messages(topics)

    def close(self) -> None:
        """Close the file and remove its copy."""
        self._resources.close()


def head_of(path: Path) -> bytes:
    """Return how a file begins."""
    with path.open("rb") as file:
        return file.read(HEAD_BYTES)


def plain_copy(path: Path, stack: ExitStack) -> tuple[Path, bool]:
    """Return a file, or a copy of what it decompresses to, there as long as the stack; whether it was whole."""
    if not head_of(path).startswith(MAGIC):
        return path, True
    plain = stack.enter_context(temporary_folder()) / path.name.removesuffix(".zstd").removesuffix(".zst")
    return plain, decompress_file(path, plain, _BEGINNINGS)


def name_early_end(source: Source) -> None:
    """Name it that the compression ends early, unless it shows in what was decompressed."""
    if not any(each.cause == SkipCause.ENDS_EARLY for each in source.losses.all):
        detail = f"the file ends early at byte {source.path.stat().st_size}; {COPY_AGAIN}"
        source.losses.add(Loss(SkipCause.ENDS_EARLY, "its compression", detail, lapse=AT_END))


def too_early(path: Path) -> InputError:
    """Return the error for a compressed file of which nothing is left."""
    return InputError(
        f"{path}: the file ends early at byte {path.stat().st_size}, too early to decompress any of it; copy it again "
        "from where it was made"
    )


def _opened(plain: Path, path: Path, most_bytes: int, *, is_whole: bool) -> Source:
    head = head_of(plain)
    if McapFile.recognises(plain, head):
        return McapFile(plain, path, most_bytes=most_bytes)
    if Sqlite3File.recognises(plain, head):
        return Sqlite3File(plain, path, most_bytes)
    if Rosbag1File.recognises(plain, head):
        return Rosbag1File(plain, path, most_bytes)
    if not is_whole:
        raise too_early(path)
    found = nothing_there(head)
    if found:
        raise InputError(f"{path}: decompressed, {found}")
    raise InputError(
        f"{path}: it is compressed with zstd, and what is in it is no recording: it begins with {head[:8]!r}; expected "
        "a ROS 1 bag, an MCAP file or a .db3 file: decompress it with `zstd -d` to see what it is"
    )
