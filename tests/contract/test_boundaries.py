"""What the libraries below raise leaves as an error of ours, in one line; whatever else is raised is a bug."""

from __future__ import annotations

import inspect
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np
import pytest

from replay.codec import decode
from replay.errors import InputError, OutputError, ReplayError
from replay.options import OutputOptions
from replay.recover import recover
from replay.sinks import open_sinks
from replay.sources import open_source, zstd
from replay.sources.base import GRID_TYPE
from replay.sources.losses import Loss
from tests import bags
from tests.scenarios import events_of

MODULES = {
    "mcap": ("mcap.exceptions",),
    "mcap checksums": ("mcap.stream_reader",),
    "zstandard": ("zstandard",),
    "zstd": (zstd.zstd.__name__,),
    "rosbags": ("rosbags.rosbag1",),
    "rosbags messages": ("rosbags.serde",),
    "sqlite3": ("sqlite3",),
    "opencv": ("cv2",),
    "yaml": tuple(
        f"ruamel.yaml.{name}" for name in ("error", "scanner", "parser", "reader", "composer", "constructor")
    ),
    "arrow": ("pyarrow",),
}

# Of sides that are not used, of misuse that would be a bug of ours, or no errors.
NOT_OURS = {"Warning", "WriterError", "DecoderNotFoundError", "YAMLStreamError", "ArrowCancelled"}

SYSTEM: tuple[Exception, ...] = (OSError(28, "No space left on device"), OSError("it broke"), MemoryError())
# lz4 has no class of its own.
LZ4: tuple[Exception, ...] = (RuntimeError("LZ4F_decompress failed with code: ERROR"),)


class PanicException(BaseException):
    """What Rust raises in Python: it cannot be imported, and is no `Exception`."""


PanicException.__module__ = "pyo3_runtime"


def raised_by(library: str) -> list[BaseException]:
    """Return one error of each class that a library has."""
    classes = {
        found
        for name in MODULES[library]
        for found in vars(import_module(name)).values()
        if inspect.isclass(found)
        and issubclass(found, Exception)
        and not issubclass(found, Warning)
        and found.__module__ != "builtins"
        and found.__name__ not in NOT_OURS
    }
    assert classes
    return [_instance(each) for each in sorted(classes, key=lambda each: each.__qualname__)]


def _instance(kind: type[Exception]) -> Exception:
    """Return an error of a class, whatever it is made of."""
    for arguments in ((), ("it broke\nin two lines",), (1, 2, 3), (1, 2, 3, 4), ("a", 1, 2, "b", "c")):
        try:
            error = kind(*arguments)
            str(error)
        except (TypeError, AttributeError):
            continue
        return error
    raise AssertionError(f"{kind} is made of something else")


Prepare = Callable[[Path], Callable[[], object]]


@dataclass(frozen=True)
class Boundary:
    """Where a library is called.

    Parameters
    ----------
    entry
        What is replaced by something that raises.
    prepare
        Writes what is to be read, and returns what then calls the entry.
    """

    entry: str
    prepare: Prepare
    libraries: tuple[str, ...]
    more: tuple[BaseException, ...] = SYSTEM
    expected: type[ReplayError] | Literal["a loss", "all is read", "all is read, with a loss"] = InputError


def _reading(write: Callable[..., Path], name: str, *arguments: Any, **options: Any) -> Prepare:
    def prepare(folder: Path) -> Callable[[], object]:
        return partial(_read, write(folder / name, *arguments, **options))

    return prepare


def _compressed(path: Path) -> Path:
    bags.write_mcap(path)
    path.write_bytes(zstd.zstd.compress(path.read_bytes()))
    return path


def _read(path: Path) -> tuple[int, tuple[Loss, ...]]:
    """Return how many maps there are, and what is lost."""
    with open_source(path) as source:
        raws = source.messages([each.name for each in source.info.topics if each.msgtype == GRID_TYPE])
        count = len([decode(raw) for raw in raws])
        return count, source.losses.all


def _writing(folder: Path) -> Callable[[], object]:
    events = events_of("merged")

    def write() -> None:
        with open_sinks(OutputOptions(folder / "out.mcap")) as sinks:
            for event in events:
                for sink in sinks:
                    sink.take(event)

    return write


def _recovering(folder: Path) -> Callable[[], object]:
    return partial(recover, bags.write_mcap(folder / "run.mcap"), folder / "out.mcap")


ZSTD = zstd.zstd.__name__
TYPESTORE = "rosbags.typesys.store.Typestore"
RERUN = (*SYSTEM, RuntimeError(), PanicException("!"))
OPEN_BAG, OPEN_FOLDER = (bags.write_rosbag1, "run.bag"), (bags.write_rosbag2, "run")
OPEN_SAVED_MAP = (bags.write_saved_map, "map.yaml", np.zeros((4, 5), np.uint8))
BOUNDARIES = {
    "bag, opened": Boundary("rosbags.rosbag1.Reader.open", _reading(*OPEN_BAG), (), SYSTEM[:2]),
    "bag, its index": Boundary(
        "rosbags.rosbag1.reader.Header.get_uint32",
        _reading(*OPEN_BAG),
        ("rosbags",),
        (AssertionError(), KeyError("conn")),
        "all is read, with a loss",
    ),
    "mcap, its index": Boundary(
        "mcap.records.ChunkIndex.read", _reading(bags.write_mcap, "run.mcap"), ("mcap",), (), "all is read"
    ),
    "mcap, a zstd chunk": Boundary(
        "zstandard.ZstdDecompressor", _reading(bags.write_mcap, "run.mcap"), ("zstandard",), (), "a loss"
    ),
    "mcap, an lz4 chunk": Boundary(
        "lz4.frame.LZ4FrameDecompressor",
        _reading(bags.write_mcap, "run.mcap", compression="lz4"),
        (),
        LZ4,
        "a loss",
    ),
    "db3, opened": Boundary("sqlite3.connect", _reading(bags.write_bare_db3, "run.db3"), ("sqlite3",)),
    "db3, a message": Boundary(
        f"{ZSTD}.ZstdDecompressor",
        _reading(bags.write_bare_db3, "run.db3", compression="message"),
        ("zstd",),
        (),
        "a loss",
    ),
    "folder, its metadata": Boundary(
        "ruamel.yaml.YAML.load",
        _reading(*OPEN_FOLDER),
        ("yaml",),
        (IndexError(), KeyError("x")),
        "all is read, with a loss",
    ),
    "folder, a part": Boundary(
        f"{ZSTD}.ZstdDecompressor", _reading(*OPEN_FOLDER, compression="file"), ("zstd",), SYSTEM, InputError
    ),
    "compressed alone": Boundary(
        f"{ZSTD}.ZstdDecompressor", _reading(_compressed, "run.mcap"), ("zstd",), SYSTEM, InputError
    ),
    "saved map, its description": Boundary("ruamel.yaml.YAML.load", _reading(*OPEN_SAVED_MAP), ("yaml",)),
    "saved map, its image": Boundary("cv2.imdecode", _reading(*OPEN_SAVED_MAP), ("opencv",)),
    "a message": Boundary(
        f"{TYPESTORE}.deserialize_cdr", _reading(bags.write_mcap, "run.mcap"), ("rosbags messages",), ()
    ),
    "out.mcap, a message": Boundary(
        "mcap.writer.Writer.add_message", _writing, ("mcap", "zstandard"), expected=OutputError
    ),
    "out.mcap, its end": Boundary("mcap.writer.Writer.finish", _writing, ("mcap", "zstandard"), expected=OutputError),
    "out.rrd, opened": Boundary("rerun.RecordingStream.save", _writing, ("arrow",), RERUN, OutputError),
    "out.rrd, a row": Boundary("rerun.RecordingStream.log", _writing, ("arrow",), RERUN, OutputError),
    "out.rrd, its end": Boundary("rerun.chunk.RrdReader.store", _writing, ("arrow",), RERUN, OutputError),
    "recovered, a message": Boundary(
        "mcap.writer.Writer.add_message", _recovering, ("mcap", "zstandard"), expected=OutputError
    ),
    "recovered, its end": Boundary(
        "mcap.writer.Writer.finish", _recovering, ("mcap", "zstandard"), expected=OutputError
    ),
}

CASES = [
    pytest.param(boundary, error, id=f"{name}-{type(error).__name__}-{index}")
    for name, boundary in BOUNDARIES.items()
    for index, error in enumerate([*boundary.more, *(each for name in boundary.libraries for each in raised_by(name))])
]


def raising(error: BaseException) -> Callable[..., object]:
    def fail(*_: object, **__: object) -> object:
        raise error

    return fail


@pytest.mark.parametrize(("boundary", "error"), CASES)
def test_is_an_error_of_ours_in_one_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, boundary: Boundary, error: BaseException
) -> None:
    call = boundary.prepare(tmp_path)
    monkeypatch.setattr(boundary.entry, raising(error))
    if isinstance(boundary.expected, str):
        count, losses = cast("tuple[int, tuple[Loss, ...]]", call())
        assert bool(losses) == boundary.expected.endswith("a loss")
        assert bool(count) == boundary.expected.startswith("all is read")
        assert not [each for each in losses if "\n" in each.detail or not each.detail]
        return
    with pytest.raises(boundary.expected) as caught:
        call()
    assert str(caught.value)
    assert "\n" not in str(caught.value)
    assert caught.value.__cause__ is not None
    assert not [each.name for each in threading.enumerate() if each.name == "rrd"]
    assert not [each.name for each in tmp_path.iterdir() if each.name.startswith("out.")]


# One function of ours for each source, met when it is opened or read.
OURS = {
    "bag": ("replay.sources.rosbag1.file.topic_table", _reading(*OPEN_BAG)),
    "bag, its index": ("replay.sources.rosbag1.index._check_chunk_counts", _reading(*OPEN_BAG)),
    "bag, a message": ("replay.sources.rosbag1.file._message_at", _reading(*OPEN_BAG)),
    "mcap": ("replay.sources.mcap.file.topic_table", _reading(bags.write_mcap, "run.mcap")),
    "mcap, its summary": ("replay.sources.mcap.summary._is_complete", _reading(bags.write_mcap, "run.mcap")),
    "mcap, a message": ("replay.sources.mcap.chunk_reader.message_header_at", _reading(bags.write_mcap, "run.mcap")),
    "db3": ("replay.sources.sqlite3.file._topic", _reading(bags.write_bare_db3, "run.db3")),
    "db3, a message": ("replay.sources.sqlite3.file.decompressed_cdr", _reading(bags.write_bare_db3, "run.db3")),
    "folder": ("replay.sources.rosbag2.folder.listed_parts", _reading(*OPEN_FOLDER)),
    "folder, a part": ("replay.sources.rosbag2.folder.plain_copy", _reading(*OPEN_FOLDER)),
    "compressed": ("replay.sources.compressed_file.plain_copy", _reading(_compressed, "run.mcap")),
    "saved map": ("replay.sources.map_server.saved_map._resolution_m", _reading(*OPEN_SAVED_MAP)),
    "saved map, its image": ("replay.sources.map_server.image_file.header_of", _reading(*OPEN_SAVED_MAP)),
}
BUGS = (TypeError(), AttributeError(), KeyError(), IndexError(), AssertionError(), ZeroDivisionError(), RuntimeError())


@pytest.mark.parametrize("bug", BUGS, ids=lambda bug: type(bug).__name__)
@pytest.mark.parametrize("name", OURS)
def test_a_bug_of_ours_is_no_damage(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str, bug: Exception) -> None:
    entry, prepare = OURS[name]
    call = prepare(tmp_path)
    monkeypatch.setattr(entry, raising(bug))
    with pytest.raises(type(bug)) as caught:
        call()
    assert caught.value is bug


@pytest.mark.parametrize("name", BOUNDARIES)
def test_each_entry_is_what_is_called(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str) -> None:
    """Else the test above would pass by whatever else goes wrong: here what is raised is nobody's."""

    class Unheard(BaseException):
        pass

    call = BOUNDARIES[name].prepare(tmp_path)
    monkeypatch.setattr(BOUNDARIES[name].entry, raising(Unheard()))
    with pytest.raises(Unheard):
        call()
