"""The formats in which the small world is recorded: one row each, written by the libraries that are their reference."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

from benchmarks.faults.messages import Message
from benchmarks.faults.real import ROOT, Real, data_folder, raw_messages
from benchmarks.faults.world import messages
from replay.codec import ros1_typestore, ros2_message_definition, ros2_typestore
from replay.sources.base import RawMessage

CHUNK_BYTES = 9000
Encoding = Literal["cdr", "ros1"]
Container = Literal["bag", "mcap", "db3"]


@dataclass(frozen=True, slots=True)
class Recording:
    """A recording as bytes.

    Parameters
    ----------
    files
        Its files by name; names have the folder in front if it is one.
    main
        What is given to the program.
    """

    files: Mapping[str, bytes]
    main: str

    def write(self, folder: Path) -> Path:
        """Write the files and return the path to give to the program."""
        (folder / self.main).parent.mkdir(parents=True, exist_ok=True)
        for name, data in self.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        return folder / self.main

    def data_names(self) -> list[str]:
        """Return the names of the files that hold messages, in order."""
        return sorted(name for name in self.files if not name.endswith((".yaml", "-wal", "-shm")))


Write = Callable[[Path, Sequence[Message]], None]


@dataclass(frozen=True, slots=True)
class Format:
    """One way to record.

    Parameters
    ----------
    write
        Writes a recording to a path at which nothing is.
    main
        Name of the file or folder.
    container
        What holds the messages.
    is_checked
        Whether checksums protect the bytes of each message, so that no changed one may be used.
    are_names_checked
        Whether they protect what names topics and types as well.
    compression
        How what it holds is compressed, "" for not at all; messages and files always with zstd.
    compressed
        What is compressed.
    is_folder, is_split
        Whether it is a folder; whether there are several parts.
    real
        The recording, where it is one that is there already rather than one of the small world.
    """

    write: Write
    main: str
    container: Container
    encoding: Encoding = "cdr"
    is_checked: bool = False
    are_names_checked: bool = False
    compression: Literal["", "bz2", "lz4", "zstd"] = ""
    compressed: Literal["chunks", "messages", "files"] = "chunks"
    is_folder: bool = False
    is_split: bool = False
    real: Real | None = None

    @property
    def is_compressed(self) -> bool:
        """Whether whole files are."""
        return bool(self.compression) and self.compressed == "files"

    def recorded(self, what: Sequence[Message]) -> Recording:
        """Return a recording of these messages."""
        with TemporaryDirectory(prefix="faults-") as folder:
            path = Path(folder) / self.main
            self.write(path, what)
            files = path.iterdir() if path.is_dir() else [path]
            return Recording({str(each.relative_to(folder)): each.read_bytes() for each in sorted(files)}, self.main)

    def raw(self, what: Sequence[Message]) -> list[RawMessage]:
        """Return these messages as a source should yield them; those of a recording that is there, whatever is said."""
        if self.real is not None:
            return list(raw_messages(self.real.path))
        ordered = sorted(what, key=lambda each: each.log_time_ns)
        return [
            RawMessage(each.topic, each.msgtype, self.encoding, each.log_time_ns, each.data(self.encoding))
            for each in ordered
        ]


@cache
def undamaged(name: str) -> Recording:
    """Return the recording of the small world in a format."""
    return FORMATS[name].recorded(messages())


def _bag(compression: Literal["none", "bz2", "lz4"], *, content_checksum: bool = False) -> Write:
    def write(path: Path, what: Sequence[Message]) -> None:
        from lz4.frame import compress
        from rosbags.rosbag1 import Writer

        writer = Writer(path)
        if compression != "none":
            writer.set_compression(Writer.CompressionFormat[compression.upper()])
        if content_checksum:
            writer.compressor = lambda data: compress(data, 0, content_checksum=True)
        writer.chunk_threshold = CHUNK_BYTES
        with writer:
            connections: dict[str, Any] = {}
            for each in what:
                if each.topic not in connections:
                    connections[each.topic] = writer.add_connection(
                        each.topic, each.msgtype, typestore=ros1_typestore()
                    )
                writer.write(connections[each.topic], each.log_time_ns, each.data("ros1"))

    return write


@dataclass(frozen=True, slots=True)
class _Mcap:
    """Writes MCAP files."""

    encoding: Encoding = "cdr"
    compression: Literal["none", "lz4", "zstd"] = "zstd"
    options: Mapping[str, Any] = field(default_factory=dict)

    def __call__(self, path: Path, what: Sequence[Message]) -> None:
        from mcap.writer import CompressionType, Writer

        is_ros1 = self.encoding == "ros1"
        compression = CompressionType[self.compression.upper()]
        with path.open("wb") as file:
            writer = Writer(file, chunk_size=CHUNK_BYTES, compression=compression, **self.options)
            writer.start(profile="ros1" if is_ros1 else "ros2", library="")
            channels: dict[str, int] = {}
            schemas: dict[str, int] = {}
            for each in what:
                if each.msgtype not in schemas:
                    kind = each.msgtype.replace("/msg/", "/") if is_ros1 else each.msgtype
                    text = _definition(each.msgtype, is_ros1=is_ros1)
                    schemas[each.msgtype] = writer.register_schema(kind, "ros1msg" if is_ros1 else "ros2msg", text)
                if each.topic not in channels:
                    channels[each.topic] = writer.register_channel(each.topic, self.encoding, schemas[each.msgtype])
                data = each.data(self.encoding)
                writer.add_message(channels[each.topic], each.log_time_ns, data, each.log_time_ns)
            writer.finish()  # type: ignore[no-untyped-call]


def _definition(msgtype: str, *, is_ros1: bool) -> bytes:
    text = ros1_typestore().generate_msgdef(msgtype)[0] if is_ros1 else ros2_message_definition(msgtype)
    return text.encode()


def _no_index() -> dict[str, Any]:
    from mcap.writer import IndexType

    return {"index_types": IndexType.NONE}


def _no_summary() -> dict[str, Any]:
    left_out = ("repeat_channels", "repeat_schemas", "use_statistics", "use_summary_offsets")
    return {**_no_index(), **dict.fromkeys(left_out, False)}


Storage = Literal["sqlite3", "mcap"]
Compression = Literal["none", "file", "message", "storage"]


def _folder(storage: Storage, compression: Compression = "none") -> Write:
    def write(path: Path, what: Sequence[Message]) -> None:
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

        writer = Writer(path, version=9, storage_plugin=StoragePlugin[storage.upper()])
        writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
        with writer:
            connections: dict[str, Any] = {}
            for each in what:
                if each.topic not in connections:
                    connections[each.topic] = writer.add_connection(
                        each.topic, each.msgtype, typestore=ros2_typestore()
                    )
                writer.write(connections[each.topic], each.log_time_ns, each.data("cdr"))

    return write


def _split(storage: Storage, compression: Compression = "none", parts: int = 3) -> Write:
    def write(path: Path, what: Sequence[Message]) -> None:
        path.mkdir()
        names = []
        size = -(-len(what) // parts)
        for index in range(parts):
            single = path.parent / f"part_{index}"
            _folder(storage, compression)(single, what[index * size : (index + 1) * size])
            (part,) = (file for file in single.iterdir() if file.suffix != ".yaml")
            names.append(part.name.replace(single.name, f"{path.name}_{index}", 1))
            part.rename(path / names[-1])
        listed = "".join(f"  - {name}\n" for name in names)
        is_compressed = compression != "none"
        (path / "metadata.yaml").write_text(
            f"rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: {storage}\n"
            f"  relative_file_paths:\n{listed}  compression_format: '{'zstd' if is_compressed else ''}'\n"
            f"  compression_mode: '{compression if is_compressed else ''}'\n",
            encoding="utf-8",
        )

    return write


def _bare_db3(path: Path, what: Sequence[Message]) -> None:
    folder = path.parent / "written"
    _folder("sqlite3")(folder, what)
    (part,) = folder.glob("*.db3")
    part.rename(path)


_CHECKED: dict[str, Any] = {"is_checked": True, "are_names_checked": True}
_WORLD: Mapping[str, Format] = {
    "bag_none": Format(_bag("none"), "run.bag", "bag", "ros1"),
    "bag_bz2": Format(_bag("bz2"), "run.bag", "bag", "ros1", is_checked=True, compression="bz2"),
    # rosbag checks what it compresses with lz4, the writer of rosbags does not
    "bag_lz4": Format(_bag("lz4", content_checksum=True), "run.bag", "bag", "ros1", is_checked=True, compression="lz4"),
    "bag_lz4_unchecked": Format(_bag("lz4"), "run.bag", "bag", "ros1", compression="lz4"),
    "mcap_zstd": Format(_Mcap(), "run.mcap", "mcap", compression="zstd", **_CHECKED),
    "mcap_lz4": Format(_Mcap(compression="lz4"), "run.mcap", "mcap", compression="lz4", **_CHECKED),
    "mcap_none": Format(_Mcap(compression="none"), "run.mcap", "mcap", **_CHECKED),
    "mcap_ros1": Format(_Mcap("ros1"), "run.mcap", "mcap", "ros1", compression="zstd", **_CHECKED),
    "mcap_no_index": Format(_Mcap(options=_no_index()), "run.mcap", "mcap", compression="zstd", **_CHECKED),
    "mcap_no_summary": Format(_Mcap(options=_no_summary()), "run.mcap", "mcap", compression="zstd", **_CHECKED),
    "mcap_no_crc": Format(_Mcap(compression="none", options={"enable_crcs": False}), "run.mcap", "mcap"),
    "mcap_unchunked": Format(_Mcap(options={"use_chunking": False}), "run.mcap", "mcap"),
    "mcap_folder": Format(_folder("mcap"), "run", "mcap", is_folder=True),
    "mcap_message_zstd": Format(
        _folder("mcap", "message"), "run", "mcap", compression="zstd", compressed="messages", is_folder=True
    ),
    "mcap_split": Format(_split("mcap"), "run", "mcap", is_folder=True, is_split=True),
    "db3": Format(_bare_db3, "run.db3", "db3"),
    "db3_folder": Format(_folder("sqlite3"), "run", "db3", is_folder=True),
    "db3_split": Format(_split("sqlite3"), "run", "db3", is_folder=True, is_split=True),
    "db3_file_zstd": Format(
        _folder("sqlite3", "file"), "run", "db3", compression="zstd", compressed="files", is_folder=True
    ),
    "db3_message_zstd": Format(
        _folder("sqlite3", "message"), "run", "db3", compression="zstd", compressed="messages", is_folder=True
    ),
}


def _copied(path: Path) -> Write:
    def write(target: Path, what: Sequence[Message]) -> None:
        del what
        if path.is_dir():
            shutil.copytree(path, target, copy_function=shutil.copyfile)
        else:
            shutil.copyfile(path, target)

    return write


def _real(path: Path, container: Container, encoding: Encoding = "cdr", **about: Any) -> Format:  # noqa: ANN401
    """Return a recording that is there as a format of its own."""
    truth = path.with_name(f"{path.stem}.truth.json")
    name = "run" if path.is_dir() else f"run{path.suffix}"
    return Format(_copied(path), name, container, encoding, is_folder=path.is_dir(), real=Real(path, truth), **about)


_REAL: Mapping[str, Format] = {
    "sample_mcap": _real(ROOT / "samples" / "two_robots.mcap", "mcap", compression="zstd", **_CHECKED),
    "sample_bag": _real(ROOT / "samples" / "three_robots.bag", "bag", "ros1", compression="lz4"),
    "real_mcap": _real(data_folder() / "intel_res.mcap", "mcap"),
    "real_bag": _real(data_folder() / "intel_three.bag", "bag", "ros1"),
    "real_db3": _real(data_folder() / "fr101_two", "db3"),
}
FORMATS: Mapping[str, Format] = {
    **_WORLD,
    **{name: each for name, each in _REAL.items() if each.real is not None and each.real.path.exists()},
}
"""Those of the small world, and recordings that are there already."""
