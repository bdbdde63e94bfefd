"""Recordings, whatever their format: `open_source` tells which it is by what is in it.

A format is one module, or one folder of them, with a class that has `SourceClass`'s shape, and one row of `SOURCES`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from importlib import import_module
from pathlib import Path
from typing import Protocol, cast, runtime_checkable

from replay.errors import InputError
from replay.sources.base import Source
from replay.sources.beginnings import HEAD_BYTES, nothing_there
from replay.sources.boundary import translated
from replay.sources.memory import MOST_BYTES

# Tried in this order. The modules are imported for their `recognises` and import what they read with only when they
# are used.
SOURCES: dict[str, str] = {
    "rosbag1": "replay.sources.rosbag1.file:Rosbag1File",
    "mcap": "replay.sources.mcap.file:McapFile",
    "rosbag2": "replay.sources.rosbag2.folder:Rosbag2Folder",
    "sqlite3": "replay.sources.sqlite3.file:Sqlite3File",
    "zstd": "replay.sources.compressed_file:CompressedFile",
    "map_server": "replay.sources.map_server.saved_map:SavedMap",
}

# Of all outputs together, of the Rerun library's threads (which abort the program if there are none), and of imports.
_SPARE_FILES = 16
# Its parts are opened when they are due: one, and a copy of it.
_FILES_OF_A_FOLDER = 2
_EXPECTED = "a ROS 1 bag, an MCAP file, a ROS 2 bag folder, a .db3 file or the .yaml of a saved map"
_OTHERS = (
    ((b"\x1f\x8b", b"BZh", b"\xfd7zXZ", b"PK\x03\x04", b"\x04\x22\x4d\x18"), "it is an archive: unpack it first"),
    ((b"P5", b"P2", b"\x89PNG", b"BM"), "it is an image: give the .yaml that describes it as a map"),
    ((b"RRF",), "it is Rerun's: give the recording that it was made of, or the .mcap beside it"),
)


class SourceClass(Protocol):
    """What a row of `SOURCES` names."""

    def __call__(self, path: Path, *, most_bytes: int) -> Source:
        """Open a recording, of which no chunk and no message is read that has more than ``most_bytes``."""

    def recognises(self, path: Path, head: bytes) -> bool:
        """Tell whether this class is the one to open, or to refuse, what is at ``path``.

        ``head`` is how the file begins; nothing for a folder.
        """


@runtime_checkable
class Reopening(Protocol):
    """A source of which something was made to read it by."""

    def again(self) -> Source:
        """Open what was made once more."""


def open_source(path: Path, most_bytes: int | None = None) -> Source:
    """Open the recording at ``path``, whatever its name.

    Parameters
    ----------
    most_bytes
        The largest message, or decompressed chunk, that is read; None for `replay.sources.memory.MOST_BYTES`.

    Raises
    ------
    InputError
        If there is none, or none that can be read.
    """
    with translated(path):
        head = _head(path)
        for name in SOURCES:
            source = _source_class(name)
            if source.recognises(path, head):
                return source(path, most_bytes=MOST_BYTES if most_bytes is None else most_bytes)
        raise InputError(_unknown(path, head))


def reopened(source: Source, most_bytes: int | None = None) -> Source:
    """Open a recording once more, to be read beside the first time; close it before that.

    What it was decompressed to is not made anew.

    Raises
    ------
    InputError
        If it cannot be read any more.
    """
    if isinstance(source, Reopening):
        with translated(source.path):
            return source.again()
    return open_source(source.path, most_bytes)


@contextmanager
def open_sources(paths: Sequence[Path], most_bytes: int | None = None) -> Iterator[list[Source]]:
    """Open several recordings, and see that as many files more can be open as a run needs.

    Raises
    ------
    InputError
        If one cannot be read, or too many files are open then: where libraries below can open none, the program ends.
    """
    with ExitStack() as stack:
        sources = [stack.enter_context(open_source(path, most_bytes)) for path in paths]
        for source in sources[-1:]:
            with translated(source.path):
                _open_and_close(_SPARE_FILES + _FILES_OF_A_FOLDER * sum(path.is_dir() for path in paths))
        yield sources


def _open_and_close(count: int) -> None:
    """Open as many files at once, and close them."""
    with ExitStack() as stack:
        for _ in range(count):
            stack.callback(os.close, os.open(os.devnull, os.O_RDONLY))


def _source_class(name: str) -> SourceClass:
    module, _, attribute = SOURCES[name].partition(":")
    return cast("SourceClass", getattr(import_module(module), attribute))


def _head(path: Path) -> bytes:
    """Return how a file begins; nothing for a folder."""
    if not path.exists():
        raise InputError(f"{path}: it does not exist; expected {_EXPECTED}")
    if path.is_dir():
        return b""
    if not path.is_file():
        raise InputError(f"{path}: this is no regular file; expected {_EXPECTED}")
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    if not head:
        raise InputError(f"{path}: {nothing_there(head)}")
    return head


def _unknown(path: Path, head: bytes) -> str:
    if path.is_dir():
        folders = sorted(each.parent.name for each in path.glob("*/metadata.yaml"))
        if folders:
            named = " ".join(str(path / each) for each in folders[:3])
            return f"{path}: this folder is no ROS 2 bag, but holds some; give these, such as {named}"
        bags = sorted(each.name for each in path.iterdir() if each.suffix in {".bag", ".yaml", ".yml"})
        hint = f"; give one of its files, such as {path / bags[0]}" if bags else ""
        return f"{path}: this folder is no ROS 2 bag: neither metadata.yaml nor .db3 nor .mcap files are in it{hint}"
    for magics, hint in _OTHERS:
        if head.startswith(magics):
            return f"{path}: this is no recording, {hint}"
    found = nothing_there(head)
    if found:
        return f"{path}: {found}"
    return f"{path}: this is no recording that can be read: it begins with {head[:8]!r}; expected {_EXPECTED}"
