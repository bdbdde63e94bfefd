"""ROS 2 bag folders: ``metadata.yaml`` and its parts, sqlite3 or MCAP, split and compressed as it may be."""

from __future__ import annotations

import functools
import heapq
import re
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path, PureWindowsPath
from tempfile import TemporaryDirectory
from typing import Any

from replay.errors import InputError
from replay.sources.base import RawMessage, Source, SourceInfo
from replay.sources.boundary import COMMON, Closing, translated
from replay.sources.mcap_file import McapFile
from replay.sources.sqlite3_file import Sqlite3File
from replay.sources.topics import topic_table
from replay.sources.zstd import MAGIC as ZSTD_MAGIC
from replay.sources.zstd import ZstdError, decompress_file

METADATA = "metadata.yaml"

_PART_SUFFIXES = (".db3", ".mcap", ".db3.zstd", ".mcap.zstd")
_HEAD_BYTES = 16


@functools.cache
def _foreign() -> tuple[type[Exception], ...]:
    from ruamel.yaml.error import YAMLError

    return (*COMMON, YAMLError, ZstdError)


class Rosbag2Folder(Closing):
    """A ROS 2 bag folder. Its parts are merged by time; each is opened for reading when its time has come.

    Parts compressed as files are decompressed into a temporary directory, which `close` removes. What is compressed
    is told by the files themselves, not by the metadata.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with ExitStack() as stack, translated(path, _foreign()):
            listed = _listed_parts(path) if (path / METADATA).exists() else []
            paths = listed or _parts_in(path)
            self._parts = [_opened_part(part, stack) for part in paths]
            self._resources = stack.pop_all()

    @classmethod
    def recognises(cls, path: Path, head: bytes) -> bool:
        """Tell whether this is a folder with ROS 2 bag files."""
        del head
        return path.is_dir() and ((path / METADATA).exists() or bool(_parts_in(path)))

    @property
    def info(self) -> SourceInfo:
        """What the parts hold together."""
        infos = [part.info for part in self._parts]
        return SourceInfo(
            "rosbag2",
            min((each.start_ns for each in infos if each.start_ns is not None), default=None),
            max((each.stop_ns for each in infos if each.stop_ns is not None), default=None),
            topic_table((each.name, each.msgtype, each.message_count) for info in infos for each in info.topics),
        )

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of these topics in order of log time, ties in the order of the parts."""
        return merged_by_time(self._parts, topics)

    def close(self) -> None:
        """Close the parts and remove temporary copies."""
        self._resources.close()


def merged_by_time(parts: Sequence[Source], topics: Collection[str]) -> Iterator[RawMessage]:
    """Yield the messages of several recordings in order of log time, ties in the order of the recordings.

    Unlike `heapq.merge` this begins to read a recording only when its first message is due, so that of a recording
    in a hundred parts, one after the other, only one is held in memory.
    """
    streams = [part.messages(topics) for part in parts]
    due: list[tuple[int, int, RawMessage | None]] = [
        (part.info.start_ns, index, None) for index, part in enumerate(parts) if part.info.start_ns is not None
    ]
    heapq.heapify(due)
    while due:
        _, index, message = due[0]
        if message is not None:
            yield message
        following = next(streams[index], None)
        if following is None:
            heapq.heappop(due)
        else:
            heapq.heapreplace(due, (following.log_time_ns, index, following))


def _parts_in(path: Path) -> list[Path]:
    """Return the bag files of a folder, ``bag_2`` before ``bag_10``; a part only once if it is there compressed too."""
    names = {each.name for each in path.iterdir() if each.name.endswith(_PART_SUFFIXES) and each.is_file()}
    parts = [name for name in names if name.removesuffix(".zstd") == name or name.removesuffix(".zstd") not in names]
    return [path / name for name in sorted(parts, key=_natural)]


def _natural(name: str) -> list[tuple[int, str]]:
    return [(int(digits or 0), text) for digits, text in re.findall(r"(\d*)(\D*)", name)]


def _listed_parts(path: Path) -> list[Path]:
    """Return the files that the metadata lists."""
    metadata = _metadata(path / METADATA)
    mode = str(metadata.get("compression_mode") or "none").lower()
    kind = metadata.get("compression_format")
    if mode != "none" and kind != "zstd":
        raise InputError(
            f"{path}: the bag is compressed with '{kind}'; zstd is read: convert it with `ros2 bag convert`"
        )
    # Before Foxy the names had the folder in front.
    names = [PureWindowsPath(str(each)).name for each in metadata.get("relative_file_paths") or ()]
    parts = [_present(path, name) for name in names]
    missing = [name for name, part in zip(names, parts, strict=True) if part is None]
    if missing:
        raise InputError(
            f"{path}: {len(missing)} of the {len(names)} parts that {METADATA} lists are missing: "
            f"{', '.join(missing[:3])}{', …' if len(missing) > 3 else ''}; copy them here as well, or take them out of "
            "the list"
        )
    return [part for part in parts if part is not None]


def _present(path: Path, name: str) -> Path | None:
    """Return the part of this name; a recorder that was stopped leaves a part that it has not compressed yet."""
    for candidate in (path / name, path / name.removesuffix(".zstd"), path / f"{name}.zstd"):
        if candidate.is_file():
            return candidate
    return None


def _metadata(path: Path) -> dict[str, Any]:
    from ruamel.yaml import YAML

    with translated(path, _foreign()):
        document = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    metadata = document.get("rosbag2_bagfile_information") if isinstance(document, dict) else None
    if not isinstance(metadata, dict):
        raise InputError(
            f"{path}: it has no 'rosbag2_bagfile_information'; expected the metadata of a ROS 2 bag: "
            "rebuild it with `ros2 bag reindex`, or remove it to read all bag files of the folder"
        )
    return metadata


def _opened_part(path: Path, stack: ExitStack) -> Source:
    """Return an open part; a compressed one is decompressed first."""
    plain = path
    if _head(path).startswith(ZSTD_MAGIC):
        folder = Path(stack.enter_context(TemporaryDirectory(prefix="replay-")))
        plain = folder / path.name.removesuffix(".zstd")
        with translated(path, _foreign()):
            decompress_file(path, plain)
    head = _head(plain)
    if McapFile.recognises(plain, head):
        return stack.enter_context(McapFile(plain, copy_of=path))
    if Sqlite3File.recognises(plain, head):
        return stack.enter_context(Sqlite3File(plain, copy_of=path))
    raise InputError(
        f"{path}: this part of a ROS 2 bag is neither MCAP nor SQLite; copy it again from where it was made"
    )


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_HEAD_BYTES)
