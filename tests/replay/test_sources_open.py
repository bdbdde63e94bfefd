"""Which source opens what, and the one clear line for all that none can open."""

from __future__ import annotations

import errno
import gzip
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import apsw
import cv2
import mcap.exceptions
import mcap.stream_reader
import pytest
import rosbags.rosbag1
import zstandard
from ruamel.yaml.error import YAMLError

from replay.errors import BadMessage, InputError
from replay.sources import SOURCES, open_source
from replay.sources.boundary import COMMON, translated
from replay.sources.zstd import ZstdError
from tests import bags
from tests.data_paths import ROOT, shared_data


def refused(path: Path, *words: str) -> str:
    """Open a path, or read its maps; return the error, which must be one line that names the path."""
    with pytest.raises(InputError) as caught, open_source(path) as source:
        list(source.messages([topic.name for topic in source.info.topics]))
    text = str(caught.value)
    assert type(caught.value) is InputError
    assert str(path) in text
    assert "\n" not in text
    for word in words:
        assert word in text
    return text


def _written(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def test_missing(tmp_path: Path) -> None:
    refused(tmp_path / "none.bag", "does not exist", "ROS 1 bag")


def test_empty_file(tmp_path: Path) -> None:
    refused(_written(tmp_path / "a.bag", b""), "is empty")


@pytest.mark.parametrize(
    ("beginning", "kind"),
    [
        (b"\x89MCAP0\r\n", "an MCAP file"),
        (b"#ROSBAG V", "a ROS 1 bag"),
        (b"SQLite format 3\0", "a .db3 file"),
        (b"\x28\xb5\x2f\xfd", "zstd"),
    ],
)
def test_files_that_are_cut_off_at_once(tmp_path: Path, beginning: bytes, kind: str) -> None:
    for length in range(1, len(beginning)):
        shown = f"cut off after {length} byte{'s' if length > 1 else ''}, "
        refused(_written(tmp_path / "a", beginning[:length]), shown, kind, "copy it again")


@pytest.mark.parametrize("length", [1, 100, 10_000])
def test_files_that_were_never_written(tmp_path: Path, length: int) -> None:
    refused(_written(tmp_path / "a", bytes(length)), f"begins with {min(length, 4096)} byte", "zero", "full disk")
    refused(_written(tmp_path / "b", zstandard.compress(bytes(length))), "zero", "full disk")


def test_folder_that_is_no_bag(tmp_path: Path) -> None:
    refused(tmp_path, "no ROS 2 bag", "metadata.yaml")


def test_folder_of_single_recordings_names_one(tmp_path: Path) -> None:
    bags.write_rosbag1(tmp_path / "one.bag")
    refused(tmp_path, str(tmp_path / "one.bag"))


def test_file_that_is_no_recording(tmp_path: Path) -> None:
    refused(_written(tmp_path / "a.mcap", b"hello, world"), "no recording", "hello")


@pytest.mark.parametrize(
    ("content", "hint"),
    [
        (gzip.compress(b"x", mtime=0), "unpack it"),
        (zstandard.compress(b"x"), "zstd -d"),
        (zstandard.compress(zstandard.compress(b"x")), "zstd -d"),
        (b"\x28\xb5\x2f\xfd....", "copy it again"),
        (b"RRF2\0\0", "the .mcap beside it"),
        (zstandard.compress(bytes(1000))[:8], "ends early at byte 8"),
        (b"P5\n2 2\n255\n....", ".yaml"),
    ],
)
def test_file_that_can_be_made_one_says_how(tmp_path: Path, content: bytes, hint: str) -> None:
    refused(_written(tmp_path / "a.bag", content), hint)


def test_a_compressed_file_that_ends_early_is_read_as_far_as_it_goes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    plain = bags.write_mcap(tmp_path / "a.mcap", compression="none").read_bytes()
    for share in (0.5, 0.9):
        # in several blocks, because of one that is cut off there is nothing
        pieces = [zstandard.compress(plain[start : start + 2000]) for start in range(0, len(plain), 2000)]
        whole = b"".join(pieces)
        path = _written(tmp_path / "a.mcap.zst", whole[: int(share * len(whole))])
        with open_source(path) as source:
            found = len(list(source.messages(["/r1/map", "/r2/map"])))
            assert len(list(temporary.iterdir())) == 1
            assert [each.cause for each in source.losses.all] == ["ends_early"]
        assert found > 0
        assert not list(temporary.iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such file")
def test_what_is_no_file() -> None:
    refused(Path("/dev/null"), "no regular file")


@pytest.mark.parametrize("name", ["a.bag", "folder"])
def test_permission_denied(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    # By hand, because the owner of a container may read everything.
    path = tmp_path / name
    if name == "folder":
        bags.write_rosbag2(path)
    else:
        bags.write_rosbag1(path)

    def denied(self: Path, *_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(Path, "open", denied)
    refused(path, "permission denied")


def test_the_folder_that_may_not_be_entered_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By hand, as above; it is not the file in it that has to be made readable."""
    path = bags.write_rosbag2(tmp_path / "bag")

    def denied(self: Path, *_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(Path, "open", denied)
    monkeypatch.setattr(os, "access", lambda asked, _: Path(asked) != path)
    assert refused(path).startswith(f"{path}: permission to enter this folder denied; ")


@pytest.mark.parametrize("head", [b"\x89MCAP0\n", b"\x89MCAP0\r\r\n", b"\xef\xbf\xbdMCAP0\r\n", b"#ROSBAG V2.0\r\n"])
def test_converted_line_endings_in_the_first_line(tmp_path: Path, head: bytes) -> None:
    refused(_written(tmp_path / "a", head + bytes(200)), "text mode", "binary mode")


def test_shared_bag_with_converted_line_endings() -> None:
    """Two of its 360 messages lost a byte each; all others are found, and the cause is named."""
    with open_source(shared_data("faulty/line_endings_damaged.bag")) as source:
        assert [(each.name, each.message_count) for each in source.info.topics] == [("/scan", 358)]
        messages = list(source.messages(["/scan"]))
        assert len(messages) == 358
        assert len({len(each.data) for each in messages}) == 1
        assert {str(each.cause) for each in source.losses.all} == {"damaged"}
        assert "text mode" in " ".join(each.detail for each in source.losses.all)


def test_shared_bag_of_before_2_0() -> None:
    refused(shared_data("faulty/rosrecord_v1_2.bag"), "#ROSRECORD V1.2", "rosbag fix")


@pytest.mark.parametrize("name", ["faulty/no_grid_topic.mcap", "faulty/no_grid_topic_db3"])
def test_shared_recordings_without_maps_list_their_topics(name: str) -> None:
    with open_source(shared_data(name)) as source:
        types = {topic.name: topic.msgtype for topic in source.info.topics}
        assert types["/tf"] == "tf2_msgs/msg/TFMessage"
        assert sum(topic.message_count for topic in source.info.topics) > 500


# --- the boundary


FOREIGN: tuple[Callable[[], Exception], ...] = (
    lambda: rosbags.rosbag1.ReaderError("File magic is invalid."),
    lambda: zstandard.ZstdError("bad frame"),
    lambda: ZstdError("bad frame"),
    lambda: RuntimeError("LZ4F_decompress failed"),
    lambda: EOFError("ended"),
    mcap.exceptions.EndOfFile,
    lambda: mcap.exceptions.RecordLengthLimitExceeded(5, 1 << 60, 1),
    lambda: YAMLError("two\nlines"),
    lambda: cv2.error("too large"),
    lambda: KeyError("nav_msgs/msg/Odd"),
    AssertionError,
    lambda: OSError(5, "Input/output error"),
    MemoryError,
    lambda: UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid start byte"),
)


@pytest.mark.parametrize("make", FOREIGN)
def test_errors_of_libraries_become_one_line(make: Callable[[], Exception]) -> None:
    error = make()
    with pytest.raises(InputError) as caught, translated(Path("some/recording"), (*COMMON, type(error))):
        raise error
    assert "some/recording" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert caught.value.__cause__ is error


def test_too_little_memory_is_not_blamed_on_the_recording() -> None:
    with pytest.raises(InputError) as caught, translated(Path("some/recording"), part="the chunk at byte 7"):
        raise MemoryError
    assert str(caught.value).startswith("some/recording: the chunk at byte 7 takes more memory than there is; ")


@pytest.mark.parametrize(
    ("number", "remedy"),
    [
        (errno.EMFILE, "`ulimit -n`"),
        (errno.ENFILE, "raise the limit"),
        (errno.ENOSPC, "TMPDIR"),
        (errno.EDQUOT, "TMPDIR"),
    ],
)
def test_limits_of_the_machine_are_not_blamed_on_the_recording(number: int, remedy: str) -> None:
    with pytest.raises(InputError) as caught, translated(Path("some/recording")):
        raise OSError(number, os.strerror(number), "another/file")
    text = str(caught.value)
    assert text.startswith(f"some/recording: it cannot be read: {os.strerror(number)}; ")
    assert remedy in text
    assert "expected a recording" not in text
    assert "copy it again" not in text


@pytest.mark.parametrize("error", [KeyboardInterrupt(), SystemExit(2), GeneratorExit(), apsw.Error("not ours")])
def test_other_errors_pass(error: BaseException) -> None:
    with pytest.raises(type(error)), translated(Path("recording")):
        raise error


def test_errors_of_this_program_pass_unchanged() -> None:
    error = BadMessage("empty", "the map has no cells")
    with pytest.raises(BadMessage) as caught, translated(Path("recording")):
        raise error
    assert caught.value is error


# --- the table


def test_sources_import_no_library_before_it_is_needed() -> None:
    code = (
        "import sys, importlib, replay.sources as s\n"
        "for target in s.SOURCES.values(): importlib.import_module(target.partition(':')[0])\n"
        "print(sorted({'rosbags', 'mcap', 'ruamel', 'lz4', 'zstandard', 'apsw'} & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_a_new_format_is_one_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = _written(tmp_path / "a.new", b"NEWFORMAT")
    (tmp_path / "new_format.py").write_text(
        "class NewFile:\n"
        "    def __init__(self, path, *, most_bytes): self.path = path\n"
        "    @classmethod\n"
        "    def recognises(cls, path, head): return head.startswith(b'NEWFORMAT')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(SOURCES, "new", "new_format:NewFile")
    assert open_source(path).path == path
