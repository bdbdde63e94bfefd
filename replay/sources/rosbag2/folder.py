"""ROS 2 bag folders: ``metadata.yaml`` and its parts, sqlite3 or MCAP, split and compressed as it may be."""

from __future__ import annotations

import heapq
import re
from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from replay.errors import InputError
from replay.skip_cause import SkipCause
from replay.sources.base import RawMessage, Source, SourceInfo
from replay.sources.beginnings import nothing_there
from replay.sources.boundary import COMMON, Closing, translated
from replay.sources.compressed_file import head_of, name_early_end, plain_copy, too_early
from replay.sources.lapses import AT_END, Lapse, Written
from replay.sources.losses import Loss, Losses, place_in
from replay.sources.mcap.file import McapFile
from replay.sources.mcap.scan import Scan
from replay.sources.memory import MOST_BYTES
from replay.sources.rosbag2.metadata import METADATA, Parts, listed_parts, numbered_parts
from replay.sources.sqlite3.file import Sqlite3File
from replay.sources.topics import topic_table
from replay.sources.zstd import ZstdError

_MOST_OVERLAP_NS = 1_000_000_000

_PART_SUFFIXES = (".db3", ".mcap", ".db3.zstd", ".mcap.zstd")

_FOREIGN = (*COMMON, ZstdError)


class Rosbag2Folder(Closing):
    """A ROS 2 bag folder. Its parts are merged by time.

    What is lost of a part is named with the part's name in front; a part that is missing or cannot be read at all is
    left out and named, as long as there is another. Without metadata, or if it is damaged, all bag files of the folder
    are its parts.

    A part is open, and decompressed into a temporary directory if it was compressed as a file, only while its contents
    are listed and while its messages are due: a bag may have more parts than files may be open, and be larger
    decompressed than the disk. What is compressed is told by the files themselves, not by the metadata.

    Parameters
    ----------
    most_bytes
        The largest message, or decompressed chunk, that is read.
    """

    def __init__(self, path: Path, most_bytes: int = MOST_BYTES) -> None:
        self.path = path
        self.losses = Losses()
        with translated(path, _FOREIGN):
            listed = listed_parts(path, self.losses)
            known = listed if listed.paths else numbered_parts(_parts_in(path))
            if not known.paths:
                raise InputError(
                    f"{path}: this bag has no file with messages, and its {METADATA} lists none; copy its .db3 or "
                    ".mcap files here"
                )
            self._parts = _opened_parts(known, self.losses, most_bytes)
            if not listed.paths:
                _check_that_they_belong_together(path, self._parts)

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
        return merged_by_time([part for part in self._parts if part.holds(topics)], topics)

    def close(self) -> None:
        """Close the parts and remove temporary copies."""
        for part in self._parts:
            part.close()


class Part(Protocol):
    """What `merged_by_time` takes."""

    @property
    def info(self) -> SourceInfo:
        """What the part holds."""

    def messages(self, topics: Collection[str]) -> Generator[RawMessage, None, None]:
        """Yield the messages of these topics in order of log time; to close this releases what is open for it."""


def merged_by_time(parts: Sequence[Part], topics: Collection[str]) -> Iterator[RawMessage]:
    """Yield the messages of several parts in order of log time, ties in the order of the parts.

    Unlike `heapq.merge` this begins to read a part only when its first message is due, so that of a recording
    in a hundred parts, one after the other, only one is open and in memory.
    """
    with ExitStack() as stack:
        streams = [stack.enter_context(closing(part.messages(topics))) for part in parts]
        due: list[tuple[int, int, RawMessage | None]] = [
            (part.info.start_ns or 0, index, None) for index, part in enumerate(parts)
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


class _FilePart:
    """One file of a bag, open only while it is read."""

    def __init__(self, path: Path, losses: Losses, most_bytes: int) -> None:
        self._path = path
        self._lapses: list[tuple[str, Lapse]] = []
        self._all_of_it: Lapse | None = None
        self._behind_it = AT_END
        self._most_bytes = most_bytes
        self._losses = losses
        self._map_scan: Scan | None = None
        self._resources: set[ExitStack] = set()
        self._is_closed = False
        with self._opened() as source:
            self.info = source.info

    @property
    def name(self) -> str:
        """Name of the file."""
        return self._path.name

    def holds(self, topics: Collection[str]) -> bool:
        """Tell whether there are messages of any of these topics."""
        return any(each.message_count and each.name in topics for each in self.info.topics)

    def messages(self, topics: Collection[str]) -> Generator[RawMessage, None, None]:
        """Yield the messages of these topics in order of log time."""
        with self._opened() as source:
            for message in source.messages(topics):
                self._name_losses(source)
                yield message

    def place(self, all_of_it: Lapse, behind_it: Lapse) -> None:
        """Say when it was recorded, all of it and what of it may come behind all that is left of it."""
        self._all_of_it, self._behind_it = all_of_it, behind_it
        self._tell_lapses()

    def close(self) -> None:
        """Close the file and remove its copies, also those that are still being read."""
        self._is_closed = True
        for resources in tuple(self._resources):
            resources.close()

    @contextmanager
    def _opened(self) -> Iterator[Source]:
        """Open the file; what is opened is released at the end of the context, or by `close` if that comes first."""
        if self._is_closed:
            raise ValueError(f"{self._path} is read after it was closed")
        with ExitStack() as stack:
            with translated(self._path, _FOREIGN):
                plain, is_whole = plain_copy(self._path, stack)
                source = stack.enter_context(self._source(plain, is_whole=is_whole))
                if not is_whole:
                    name_early_end(source)
            self._resources.add(stack)
            stack.callback(self._resources.discard, stack)
            try:
                yield source
            finally:
                self._name_losses(source)
                if isinstance(source, McapFile):
                    self._map_scan = source.map_scan or self._map_scan

    def _name_losses(self, source: Source) -> None:
        for loss in source.losses.new():
            # its lapse is told as that of the recording
            self._losses.add(replace(loss, place=place_in(self.name, loss.place), maybe_of=(), lapse=AT_END))
        self._lapses += source.losses.new_lapses()
        self._tell_lapses()

    def _tell_lapses(self) -> None:
        if self._all_of_it is None:
            return
        for topic, lapse in self._lapses:
            placed = self._behind_it if lapse == AT_END else lapse.within(self._all_of_it)
            self._losses.add_lapse(topic, placed)
        self._lapses.clear()

    def _source(self, plain: Path, *, is_whole: bool) -> Source:
        head = head_of(plain)
        if McapFile.recognises(plain, head):
            return McapFile(plain, self._path, self._map_scan, self._most_bytes)
        if Sqlite3File.recognises(plain, head):
            return Sqlite3File(plain, self._path, self._most_bytes)
        if not is_whole:
            raise too_early(self._path)
        found = nothing_there(head)
        if found:
            raise InputError(f"{self._path}: {found}")
        raise InputError(
            f"{self._path}: this part of a ROS 2 bag is neither MCAP nor SQLite; copy it again from where it was made"
        )


def _opened_parts(known: Parts, losses: Losses, most_bytes: int) -> list[_FilePart]:
    """Return the parts that can be read, and name the others.

    Raises
    ------
    InputError
        If none can be read, with what the first one said.
    """
    parts: dict[int, _FilePart] = {}
    errors: list[InputError] = []
    unread: list[tuple[int, Loss]] = []
    for index, path in enumerate(known.paths):
        try:
            parts[index] = _FilePart(path, losses, most_bytes)
        except InputError as error:
            if isinstance(error.__cause__, OSError):
                # of the machine, not of the recording
                raise
            errors.append(error)
            unread.append((index, Loss(SkipCause.DAMAGED, path.name, str(error).removeprefix(f"{path}: "))))
    if not parts:
        raise errors[0]
    _place(parts, known.missing, unread, losses)
    return list(parts.values())


def _place(
    parts: Mapping[int, _FilePart],
    missing: Sequence[tuple[int, Loss]],
    unread: Sequence[tuple[int, Loss]],
    losses: Losses,
) -> None:
    """Say of the parts, and of what is lost between them, when it was recorded."""
    infos = ((index, part.info.start_ns, part.info.stop_ns) for index, part in parts.items())
    spans = [(index, start, stop) for index, start, stop in infos if start is not None and stop is not None]
    written = Written(
        ((index, end), time_ns) for index, start, stop in spans for end, time_ns in enumerate((start, stop))
    )
    for index, loss in missing:
        losses.add(replace(loss, lapse=written.between((index, -1), (index, 0))))
    for index, loss in unread:
        losses.add(replace(loss, lapse=written.between((index, 0), (index + 1, 0))))
    for index, part in parts.items():
        part.place(written.between((index, 0), (index + 1, 0)), written.between((index, 2), (index + 1, 0)))


def _check_that_they_belong_together(path: Path, parts: Sequence[_FilePart]) -> None:
    """Refuse files that nothing lists as parts of one recording if they have the same topic at the same times."""
    running: list[tuple[int, _FilePart]] = []
    for start_ns, stop_ns, part in sorted(
        ((part.info.start_ns, part.info.stop_ns, part) for part in parts), key=lambda item: item[0] or 0
    ):
        if start_ns is None or stop_ns is None:
            continue
        running = [(until_ns, one) for until_ns, one in running if until_ns - start_ns > _MOST_OVERLAP_NS]
        for until_ns, one in running:
            shared = sorted(each.name for each in part.info.topics if each.message_count and one.holds([each.name]))
            if shared and min(until_ns, stop_ns) - start_ns > _MOST_OVERLAP_NS:
                same = f"{one.name} and {part.name} both have {shared[0]} at the same times"
                raise InputError(
                    f"{path}: no {METADATA} lists its files, and {same}; expected parts of one recording: "
                    "give the files that you mean one by one"
                )
        running.append((stop_ns, part))


def _parts_in(path: Path) -> list[Path]:
    """Return the bag files of a folder, ``bag_2`` before ``bag_10``; a part only once if it is there compressed too."""
    names = {each.name for each in path.iterdir() if each.name.endswith(_PART_SUFFIXES) and each.is_file()}
    parts = [name for name in names if name.removesuffix(".zstd") == name or name.removesuffix(".zstd") not in names]
    return [path / name for name in sorted(parts, key=_natural)]


def _natural(name: str) -> list[tuple[int, str]]:
    return [(int(digits or 0), text) for digits, text in re.findall(r"(\d*)(\D*)", name)]
