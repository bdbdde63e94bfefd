from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Collection, Generator, Iterable
from pathlib import Path
from typing import Any, Literal

import pytest

from replay.errors import InputError
from replay.skip_cause import SkipCause
from replay.sources import open_source
from replay.sources.base import RawMessage, SourceInfo
from replay.sources.mcap import file as mcap_file
from replay.sources.rosbag2.folder import merged_by_time
from replay.sources.zstd import MAGIC, zstd
from tests import bags
from tests.bags import SECOND, START
from tests.data_paths import ROOT
from tests.disks import files_up_to
from tests.replay.test_sources_open import refused

TOPICS = {each.topic for each in bags.SAMPLE}


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def _read(path: Path) -> tuple[list[tuple[str, int, bytes]], list[tuple[str, str, int | None]]]:
    """Return all messages of a bag, and cause, place and number of messages of what is lost, each time it is read."""
    with open_source(path) as source:
        topics = [each.name for each in source.info.topics]
        found = [(each.topic, each.log_time_ns, bytes(each.data)) for each in source.messages(topics)]
        losses = source.losses.all
        assert len(list(source.messages(topics))) == len(found)
        assert source.losses.all == losses
    return found, [(str(each.cause), each.place, each.messages) for each in losses]


def _recorded(messages: Iterable[bags.Recorded]) -> list[tuple[str, int, bytes]]:
    ordered = sorted(messages, key=lambda each: each.log_time_ns)
    return [(each.topic, each.log_time_ns, bags.as_cdr(each)) for each in ordered]


def _without(index: int) -> list[bags.Recorded]:
    return [each for at, each in enumerate(bags.SAMPLE) if at != index]


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_a_missing_part_is_named_and_the_others_are_read(tmp_path: Path, storage: Literal["sqlite3", "mcap"]) -> None:
    path = bags.write_split_rosbag2(tmp_path / "bag", storage=storage)
    (missing,) = path.glob("bag_7.*")
    missing.unlink()
    assert _read(path) == (_recorded(_without(2)), [("missing_part", missing.name, None)])


def test_the_metadata_says_how_many_messages_are_missing(tmp_path: Path) -> None:
    path = bags.write_split_rosbag2(tmp_path / "bag")
    (path / "bag_7.db3").unlink()
    with (path / "metadata.yaml").open("a") as file:
        file.write("  files:\n  - path: bag_7.db3\n    message_count: 41\n")
    assert _read(path)[1] == [("missing_part", "bag_7.db3", 41)]


def test_all_parts_are_missing(tmp_path: Path) -> None:
    path = bags.write_split_rosbag2(tmp_path / "bag", bags.SAMPLE[:4])
    for part in path.glob("*.db3"):
        part.unlink()
    refused(path, "all 4 parts", "bag_5.db3", "metadata.yaml")


def test_a_part_that_is_listed_twice_is_read_once(tmp_path: Path) -> None:
    path = bags.write_split_rosbag2(tmp_path / "bag")
    metadata = path / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("  - bag/bag_7.db3\n", "  - bag/bag_7.db3\n" * 2))
    assert _read(path) == (_recorded(bags.SAMPLE), [])


def test_a_gap_in_the_numbers_of_parts_that_nothing_lists_is_named(tmp_path: Path) -> None:
    path = bags.write_split_rosbag2(tmp_path / "bag")
    (path / "metadata.yaml").unlink()
    (path / "bag_7.db3").unlink()
    assert _read(path) == (_recorded(_without(2)), [("missing_part", "bag_7.db3", None)])


@pytest.mark.parametrize(
    "names", [("day_1.mcap", "day_900.mcap"), ("day_01.mcap", "day_03.mcap"), ("a.mcap", "c.mcap")]
)
def test_other_numbers_are_no_numbers_of_parts(tmp_path: Path, names: tuple[str, str]) -> None:
    (tmp_path / "run").mkdir()
    for index, name in enumerate(names):
        _part(tmp_path / "run" / name, index)
    assert _read(tmp_path / "run")[1] == []


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_what_is_lost_of_a_part_is_named_with_the_part(tmp_path: Path, storage: Literal["sqlite3", "mcap"]) -> None:
    path = bags.write_split_rosbag2(tmp_path / "bag", storage=storage)
    (part,) = path.glob("bag_6.*")
    length = part.stat().st_size - 4096
    part.write_bytes(part.read_bytes()[:length])
    found, losses = _read(path)
    assert found == _recorded(_without(1)) or found == _recorded(bags.SAMPLE)
    assert {cause for cause, _, _ in losses} == {"ends_early"}
    assert all(place.startswith(f"{part.name}: ") for _, place, _ in losses)


def test_a_part_that_is_not_compressed_yet(tmp_path: Path, temporary: Path) -> None:
    path = bags.write_split_rosbag2(tmp_path / "bag", compression="file")
    plain = bags.write_split_rosbag2(tmp_path / "plain")
    (path / "bag_14.db3.zstd").unlink()
    (plain / "plain_14.db3").rename(path / "bag_14.db3")
    with open_source(path) as source:
        assert len(list(source.messages(TOPICS))) == len(bags.SAMPLE)
    assert list(temporary.iterdir()) == []


def test_without_metadata_a_part_and_its_compressed_copy_count_once(tmp_path: Path, temporary: Path) -> None:
    path = bags.write_rosbag2(tmp_path / "bag", compression="file")
    (path / "metadata.yaml").unlink()
    plain = bags.write_rosbag2(tmp_path / "plain")
    (plain / "plain.db3").rename(path / "bag.db3")
    with open_source(path) as source:
        assert len(list(source.messages(TOPICS))) == len(bags.SAMPLE)
        assert list(temporary.iterdir()) == []


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_of_a_truncated_compressed_part_is_read_what_it_yields(
    tmp_path: Path, temporary: Path, storage: Literal["sqlite3", "mcap"]
) -> None:
    messages = [bags.recorded_map("/r1/map", START + each * SECOND, seed=each, rows=4000) for each in range(4)]
    path = bags.write_rosbag2(tmp_path / "bag", messages, storage, "file")
    (part,) = path.glob("*.zstd")
    part.write_bytes(part.read_bytes()[: part.stat().st_size * 7 // 10])
    found, losses = _read(path)
    assert found == _recorded(messages[:2])
    assert [cause for cause, _, _ in losses] == ["ends_early"]
    assert losses[0][1].startswith(f"{part.name}: ")
    assert list(temporary.iterdir()) == []


def test_a_compressed_part_that_lost_only_its_last_bytes(tmp_path: Path, temporary: Path) -> None:
    path = bags.write_rosbag2(tmp_path / "bag", compression="file")
    (part,) = path.glob("*.zstd")
    plain = zstd.decompress(part.read_bytes())
    part.write_bytes(zstd.compress(plain, options={zstd.CompressionParameter.checksum_flag: 1})[:-2])
    assert _read(path) == (_recorded(bags.SAMPLE), [("ends_early", f"{part.name}: its compression", None)])
    assert list(temporary.iterdir()) == []


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_a_compressed_part_that_yields_nothing(tmp_path: Path, temporary: Path, storage: str) -> None:
    path = bags.write_rosbag2(tmp_path / "bag", storage=storage, compression="file")
    (part,) = path.glob("*.zstd")
    part.write_bytes(part.read_bytes()[:-20])
    refused(path, str(part), "ends early", "decompress")
    assert list(temporary.iterdir()) == []


def test_a_compressed_part_that_is_damaged_is_left_out(tmp_path: Path, temporary: Path) -> None:
    path = bags.write_split_rosbag2(tmp_path / "bag", compression="file")
    part = path / "bag_7.db3.zstd"
    plain = zstd.decompress(part.read_bytes())
    data = bytearray(zstd.compress(plain, options={zstd.CompressionParameter.checksum_flag: 1}))
    data[-1] ^= 1
    part.write_bytes(data)
    assert _read(path) == (_recorded(_without(2)), [("damaged", part.name, None)])
    assert list(temporary.iterdir()) == []


def test_a_compressed_part_that_is_no_recording_is_not_decompressed_to_its_end(tmp_path: Path) -> None:
    """Some kilobytes may grow to more than any disk takes."""
    path = bags.write_rosbag2(tmp_path / "bag", compression="file")
    (part,) = path.glob("*.zstd")
    part.write_bytes(zstd.compress(bytes(1 << 26)))
    with files_up_to(1 << 22):
        refused(path, part.name, "begins with 4096 bytes that are all zero")


def test_a_compressed_part_that_grows_beyond_what_a_file_may_have(tmp_path: Path) -> None:
    path = bags.write_rosbag2(tmp_path / "bag", compression="file")
    (part,) = path.glob("*.zstd")
    part.write_bytes(part.read_bytes() + zstd.compress(bytes(1 << 26)))
    with files_up_to(1 << 22):
        refused(path, part.name, "`ulimit -f`", "TMPDIR")


@pytest.mark.parametrize("free_bytes", [1 << 24, 10_000_000])
def test_a_compressed_part_leaves_some_of_what_is_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, free_bytes: int
) -> None:
    """It begins like a recording, so that nothing tells what it becomes before it is that."""
    path = bags.write_rosbag2(tmp_path / "bag", storage="mcap", compression="file")
    (part,) = path.glob("*.zstd")
    part.write_bytes(zstd.compress(b"\x89MCAP0\r\n" + b"\xff" * (1 << 25)))
    before = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: before._replace(free=free_bytes))
    with files_up_to(free_bytes * 4 // 5):
        refused(path, part.name, "more than 75% of what is free", "TMPDIR")


def test_damage_in_a_compressed_part_names_the_part_not_its_copy(tmp_path: Path) -> None:
    path = bags.write_rosbag2(tmp_path / "bag", storage="mcap", compression="file")
    (part,) = path.glob("*.zstd")
    part.write_bytes(zstd.compress(bags.write_mcap(tmp_path / "inner.mcap").read_bytes()[:5000]))
    with open_source(path) as source:
        found = len(list(source.messages(TOPICS)))
        assert 0 < found < len(bags.SAMPLE)
        (loss,) = source.losses.all
    assert loss.cause == SkipCause.ENDS_EARLY
    assert loss.place.startswith(f"{part.name}: ")


def test_damage_that_shows_only_when_a_part_is_read_is_named_once(tmp_path: Path) -> None:
    path = bags.write_rosbag2(tmp_path / "bag", storage="mcap")
    (part,) = path.glob("*.mcap")
    bags.write_mcap(part)
    bags.damage(part, next(chunk for chunk in bags.chunks(part) if "/r1/map" in chunk.topics))
    with open_source(path) as source:
        assert source.losses.all == ()
        for _ in range(2):
            assert 0 < len(list(source.messages(["/r1/map"]))) < 3
        (loss,) = source.losses.all
    assert loss.place.startswith(f"{part.name}: the chunk at byte ")


def test_a_damaged_compressed_message_is_named_and_the_others_are_read(tmp_path: Path) -> None:
    path = bags.write_rosbag2(tmp_path / "bag", bags.SAMPLE[1:4], compression="message")
    (part,) = path.glob("*.db3")
    data = bytearray(part.read_bytes())
    start = data.index(MAGIC) + len(MAGIC)
    data[start : start + 20] = b"\xff" * 20
    part.write_bytes(data)
    found, losses = _read(path)
    lost = set(_recorded(bags.SAMPLE[1:4])) - set(found)
    assert len(lost) == 1
    assert found == [each for each in _recorded(bags.SAMPLE[1:4]) if each not in lost]
    assert [(cause, count) for cause, _, count in losses] == [("damaged", 1)]
    assert losses[0][1].startswith(f"{part.name}: message ")


def test_another_compression(tmp_path: Path) -> None:
    path = bags.write_rosbag2(tmp_path / "bag", compression="message")
    metadata = path / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("compression_format: zstd", "compression_format: lz4"))
    refused(path, "'lz4'", "zstd", "ros2 bag convert")


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("", "it has no 'rosbag2_bagfile_information'"),
        ("a: [", "it cannot be read (ParserError: "),
        ("- 1", "it has no 'rosbag2_bagfile_information'"),
        ("rosbag2_bagfile_information: 3", "it has no 'rosbag2_bagfile_information'"),
        ("rosbag2_bagfile_information:\n  version: 9", "it lists no files"),
        ("rosbag2_bagfile_information:\n  relative_file_paths: a.db3", "it lists no files"),
        ("\x00", "it cannot be read (ReaderError: "),
        ("\xff\xfe", "it cannot be read (UnicodeDecodeError: "),
    ],
)
def test_metadata_that_is_none_says_no_more_than_the_files_and_is_named(tmp_path: Path, text: str, found: str) -> None:
    path = bags.write_split_rosbag2(tmp_path / "bag")
    (path / "metadata.yaml").write_bytes(text.encode("latin-1"))
    assert _read(path) == (_recorded(bags.SAMPLE), [("damaged", "metadata.yaml", 0)])
    with open_source(path) as source:
        (loss,) = source.losses.all
    assert loss.detail.startswith(found)
    assert loss.detail.endswith("; all bag files of the folder are taken for parts of the recording")


def test_metadata_without_any_file(tmp_path: Path) -> None:
    path = tmp_path / "bag"
    path.mkdir()
    (path / "metadata.yaml").touch()
    refused(path, "no file with messages")


def test_a_part_that_is_no_recording_is_left_out(tmp_path: Path) -> None:
    path = bags.write_split_rosbag2(tmp_path / "bag")
    (path / "bag_7.db3").write_bytes(b"something else")
    assert _read(path) == (_recorded(_without(2)), [("damaged", "bag_7.db3", None)])


@pytest.mark.parametrize(("content", "words"), [(b"", "is empty"), (bytes(9999), "zero"), (b"SQL", "after 3 bytes")])
@pytest.mark.parametrize("compression", ["none", "file"])
def test_a_part_with_nothing_in_it_is_called_that(tmp_path: Path, content: bytes, words: str, compression) -> None:
    """As a full disk leaves the last part: to call it no recording says nothing of why."""
    path = bags.write_split_rosbag2(tmp_path / "bag", compression=compression)
    (part,) = path.glob("bag_7.*")
    part.write_bytes(zstd.compress(content) if compression == "file" else content)
    assert _read(path) == (_recorded(_without(2)), [("damaged", part.name, None)])
    with open_source(path) as source:
        assert words in source.losses.all[0].detail
        assert "neither" not in source.losses.all[0].detail


def test_the_only_part_is_no_recording(tmp_path: Path) -> None:
    path = bags.write_rosbag2(tmp_path / "bag")
    (path / "bag.db3").write_bytes(b"something else")
    refused(path, str(path / "bag.db3"), "neither MCAP nor SQLite")


def test_a_wal_beside_a_part(tmp_path: Path) -> None:
    path = bags.write_rosbag2(tmp_path / "bag")
    (path / "bag.db3-wal").write_bytes(b"rows")
    assert _read(path) == (_recorded(bags.SAMPLE), [("damaged", "bag.db3: bag.db3-wal", None)])


def test_the_metadata_itself_points_to_its_folder(tmp_path: Path) -> None:
    path = bags.write_rosbag2(tmp_path / "bag")
    refused(path / "metadata.yaml", "give its folder", str(path))


# --- files that nothing says belong together


def test_recordings_of_the_same_times_are_no_parts_of_one(tmp_path: Path) -> None:
    """As in a folder of recordings: their maps would be mixed."""
    (tmp_path / "runs").mkdir()
    for name in ("monday", "tuesday"):
        _part(tmp_path / "runs" / f"{name}.mcap", 0, 9)
    both = "monday.mcap and tuesday.mcap both have /r1/map"
    refused(tmp_path / "runs", "no metadata.yaml lists its files", both, "one by one")


def test_nor_are_recordings_of_which_a_short_one_lies_within_a_long_one(tmp_path: Path) -> None:
    (tmp_path / "runs").mkdir()
    for name, seconds in (("a_long", (0, 20)), ("b_early", (0, 1)), ("c_within", (9, 12))):
        _part(tmp_path / "runs" / f"{name}.mcap", *seconds)
    refused(tmp_path / "runs", "a_long.mcap and c_within.mcap", "one by one")


@pytest.mark.parametrize("second", [(4, 9), (3, 9)])
def test_files_that_follow_each_other_are(tmp_path: Path, second: tuple[int, int]) -> None:
    """Or overlap by a second at most, as a recorder may let them."""
    (tmp_path / "run").mkdir()
    _part(tmp_path / "run" / "run_0.mcap", 0, 4)
    _part(tmp_path / "run" / "run_1.mcap", *second)
    with open_source(tmp_path / "run") as source:
        assert len(list(source.messages(["/r1/map"]))) == 4


# --- what is open at a time


def _bag(path: Path, *parts: Path) -> Path:
    """Make a bag of single files, in this order."""
    path.mkdir()
    names = [f"part_{index}{''.join(part.suffixes)}" for index, part in enumerate(parts)]
    for name, part in zip(names, parts, strict=True):
        part.rename(path / name)
    listed = "".join(f"    - {name}\n" for name in names)
    (path / "metadata.yaml").write_text(f"rosbag2_bagfile_information:\n  relative_file_paths:\n{listed}")
    return path


def _part(path: Path, *seconds: int, **options: Any) -> Path:
    messages = [bags.recorded_map("/r1/map", START + each * SECOND, seed=1, rows=1) for each in seconds]
    return bags.write_mcap(path, messages, **options)


def _compressed_part(path: Path, *seconds: int) -> Path:
    part = _part(path, *seconds)
    compressed = path.with_name(f"{path.name}.zstd")
    compressed.write_bytes(zstd.compress(part.read_bytes()))
    return compressed


READ_WITH_FEW_HANDLES = """
import resource, sys
from pathlib import Path
from replay.sources import open_source

resource.setrlimit(resource.RLIMIT_NOFILE, (40, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
with open_source(Path(sys.argv[1])) as source:
    times = [each.log_time_ns for each in source.messages(["/r1/map"])]
print(len(times), times == sorted(times))
"""


@pytest.mark.parametrize(("storage", "compression"), [("sqlite3", "none"), ("mcap", "file")])
def test_more_parts_than_files_may_be_open(
    tmp_path: Path, storage: Literal["sqlite3", "mcap"], compression: Literal["none", "file"]
) -> None:
    pytest.importorskip("resource", reason="Windows has no such limit")
    # more than may be open: what is open must not grow with the parts
    messages = [bags.recorded_map("/r1/map", START + each, seed=1, rows=1) for each in range(60)]
    path = bags.write_split_rosbag2(tmp_path / "bag", messages, storage, compression)
    command = [sys.executable, "-c", READ_WITH_FEW_HANDLES, str(path)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert (run.stdout.strip(), run.stderr) == ("60 True", "")


def test_copies_of_compressed_parts_are_there_only_while_they_are_read(tmp_path: Path, temporary: Path) -> None:
    seconds = ((0, 1), (2, 5), (4, 6), (7, 8))
    parts = [_compressed_part(tmp_path / f"{index}.mcap", *each) for index, each in enumerate(seconds)]
    counts = []
    with open_source(_bag(tmp_path / "bag", *parts)) as source:
        assert list(temporary.iterdir()) == []
        for message in source.messages(["/r1/map"]):
            copies = sorted(file.name for file in temporary.glob("*/copies/*"))
            counts.append(((message.log_time_ns - START) // SECOND, [name[5] for name in copies]))
            assert len(list(temporary.iterdir())) == len(copies)
        assert list(temporary.iterdir()) == []
    assert counts == [
        (0, ["0"]), (1, ["0"]), (2, ["1"]), (4, ["1", "2"]), (5, ["1", "2"]), (6, ["2"]), (7, ["3"]), (8, ["3"])
    ]  # fmt: skip


def test_no_copy_stays_when_reading_ends_early(tmp_path: Path, temporary: Path) -> None:
    parts = [_compressed_part(tmp_path / f"{index}.mcap", 0, 9) for index in range(3)]
    with open_source(_bag(tmp_path / "bag", *parts)) as source:
        for _ in source.messages(["/r1/map"]):
            break
        assert list(temporary.iterdir()) == []


def test_no_copy_stays_when_a_part_is_damaged(tmp_path: Path, temporary: Path) -> None:
    parts = [_compressed_part(tmp_path / f"{index}.mcap", 0, 9) for index in range(3)]
    path = _bag(tmp_path / "bag", *parts)
    with open_source(path) as source:
        part = path / "part_2.mcap.zstd"
        part.write_bytes(part.read_bytes()[:-20])
        with pytest.raises(InputError, match="ends early") as caught:
            list(source.messages(["/r1/map"]))
        assert str(caught.value).startswith(str(part))
        assert list(temporary.iterdir()) == []


def test_to_close_removes_the_copies_that_are_being_read(tmp_path: Path, temporary: Path) -> None:
    parts = [_compressed_part(tmp_path / f"{index}.mcap", index, 9) for index in range(3)]
    source = open_source(_bag(tmp_path / "bag", *parts))
    messages = source.messages(["/r1/map"])
    next(messages)
    assert len(list(temporary.iterdir())) == 1
    source.close()
    assert list(temporary.iterdir()) == []
    with pytest.raises(ValueError, match="closed"):
        list(messages)
    assert list(temporary.iterdir()) == []


def test_parts_without_the_topics_are_not_opened_again(tmp_path: Path) -> None:
    path = bags.write_split_rosbag2(tmp_path / "bag", bags.SAMPLE[:3])
    with open_source(path) as source:
        (path / "bag_5.db3").unlink()
        assert [each.topic for each in source.messages(["/r1/map", "/r2/map"])] == ["/r1/map", "/r2/map"]
        with pytest.raises(InputError, match=r"bag_5\.db3"):
            list(source.messages(["/chatter"]))


@pytest.mark.parametrize("options", [bags.NO_SUMMARY, bags.NO_INDEX])
def test_parts_without_an_index_are_passed_through_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: dict[str, Any]
) -> None:
    passed: list[str] = []
    original = mcap_file.scan
    monkeypatch.setattr(
        mcap_file, "scan", lambda file, *rest: (passed.append(file.path.name), original(file, *rest))[1]
    )
    parts = [_part(tmp_path / f"{index}.mcap", index, index + 3, **options) for index in range(2)]
    with open_source(_bag(tmp_path / "bag", *parts)) as source:
        next(source.messages(["/r1/map"]))
        assert len(list(source.messages(["/r1/map"]))) == 4
        assert len(list(source.messages(["/r1/map"]))) == 4
    assert sorted(passed) == ["part_0.mcap", "part_1.mcap"]


# --- merging


class _Part:
    """A recording of one topic; tells whether it has been read from."""

    def __init__(self, name: str, *seconds: int) -> None:
        self.path = Path(name)
        self.seconds = seconds
        self.is_read = False

    @property
    def info(self) -> SourceInfo:
        times = [START + each for each in self.seconds]
        return SourceInfo("mcap", min(times, default=None), max(times, default=None), ())

    def messages(self, topics: Collection[str]) -> Generator[RawMessage, None, None]:
        del topics
        self.is_read = True
        for each in self.seconds:
            yield RawMessage(str(self.path), "t", "cdr", START + each, b"")


def test_parts_are_merged_by_time_and_ties_keep_the_order_of_the_parts() -> None:
    parts = [_Part("a", 2, 3, 5), _Part("b"), _Part("c", 1, 3, 3), _Part("d", 3, 9)]
    found = [(each.topic, each.log_time_ns - START) for each in merged_by_time(parts, ["t"])]
    assert found == [("c", 1), ("a", 2), ("a", 3), ("c", 3), ("c", 3), ("d", 3), ("a", 5), ("d", 9)]


def test_a_part_is_read_only_when_it_is_due() -> None:
    parts = [_Part("a", 1, 2), _Part("b", 3, 4), _Part("c", 5, 6)]
    messages = merged_by_time(parts, ["t"])
    next(messages)
    assert [part.is_read for part in parts] == [True, False, False]
    next(messages)
    next(messages)
    assert [part.is_read for part in parts] == [True, True, False]
