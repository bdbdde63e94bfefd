"""What is left of a recording that was cut off, made readable."""

from __future__ import annotations

import itertools
import os
import random
import re
import struct
import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rerun.chunk import McapReader
from rosbags.highlevel import AnyReader

from replay.codec import ros2_message_definition
from replay.errors import InputError
from replay.recover import recover
from replay.sinks.mcap_copy import McapCopy
from replay.sinks.partial_file import PartialFile
from replay.sources import open_source
from replay.sources.base import GRID_TYPE
from replay.sources.mcap.records import MAGIC
from tests.bags import START, chunks
from tests.outputs import metadata, raw, summary, topics
from tests.program import Program, Ran

Messages = list[tuple[str, int, int, bytes]]
CHUNK, DATA_END = 6, 15


def record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def text(value: str) -> bytes:
    return struct.pack("<I", len(value.encode())) + value.encode()


def schema(key: int, name: str = "std_msgs/msg/String") -> bytes:
    return record(3, struct.pack("<H", key) + text(name) + text("") + text(""))


def channel(key: int, topic: str, schema_key: int = 1) -> bytes:
    return record(4, struct.pack("<HH", key, schema_key) + text(topic) + text("cdr") + text(""))


def message(key: int, data: bytes) -> bytes:
    return record(5, struct.pack("<HIQQ", key, 0, START, START) + data)


def chunk(inner: bytes) -> bytes:
    data = zstandard.compress(inner)
    head = struct.pack("<QQQI", 0, 0, len(inner), zlib.crc32(inner))
    return record(CHUNK, head + text("zstd") + struct.pack("<Q", len(data)) + data)


HEAD = record(1, text("ros2") + text("a recorder"))


def records_of(path: Path, opcode: int) -> list[int]:
    """Return where the records of one kind begin in a whole file."""
    content, start, found = path.read_bytes(), len(MAGIC), []
    while start < len(content) - len(MAGIC):
        kind, length = struct.unpack_from("<BQ", content, start)
        found += [start] * (kind == opcode)
        start += 9 + length
    return found


def recorded(path: Path, compression: CompressionType = CompressionType.ZSTD, messages: int = 60) -> Path:
    """Write a recording of several chunks that holds all there can be in one."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=4096, compression=compression)
        writer.start(profile="ros2", library="a recorder")
        writer.add_metadata("who", {"name": "ü"})
        schema = writer.register_schema(GRID_TYPE, "ros2msg", ros2_message_definition(GRID_TYPE).encode())
        channels = [writer.register_channel(f"/r{index}/map", "cdr", schema, {"k": "v"}) for index in range(2)]
        writer.add_attachment(1, 2, "note.txt", "text/plain", b"of all things")
        for index in range(messages):
            data = random.Random(index).randbytes(400)  # noqa: S311 - what cannot be compressed
            writer.add_message(channels[index % 2], START + index, data, START + index + 7, index)
        writer.finish()
    return path


def messages_of(path: Path) -> Messages:
    with path.open("rb") as file:
        read = make_reader(file, validate_crcs=True).iter_messages()
        return [(channel.topic, message.log_time, message.sequence, message.data) for _, channel, message in read]


def cut(path: Path, size_bytes: int) -> Path:
    damaged = path.with_name(f"{path.name}.partial")
    damaged.write_bytes(path.read_bytes()[:size_bytes])
    return damaged


class TestAFileThatIsCutOff:
    @pytest.fixture
    def whole(self, tmp_path: Path) -> Path:
        (tmp_path / "there").mkdir()
        return recorded(tmp_path / "there" / "run.mcap")

    @pytest.mark.parametrize("share", [0.3, 0.5, 0.77, 0.9, 1.0])
    def test_its_whole_chunks_are_recovered(self, replay: Program, whole: Path, share: float) -> None:
        expected = messages_of(whole)
        damaged = cut(whole, round(whole.stat().st_size * share))
        before = damaged.read_bytes()
        whole.unlink()
        ran = replay("recover", damaged)
        assert (ran.status, ran.out) == (0, "")
        found = messages_of(whole)
        assert 0 < len(found) <= len(expected)
        assert found == expected[: len(found)]
        assert (len(found) == len(expected)) == (share == 1.0)
        assert f"recovered {len(found)} messages up to 2023-11-14 22:13:20.000 UTC" in ran.err
        assert ("the file ends early" in ran.err) == (share < 1.0)
        assert damaged.read_bytes() == before
        assert sorted(each.name for each in whole.parent.iterdir()) == ["run.mcap", "run.mcap.partial"]

    def test_all_else_is_kept(self, replay: Program, whole: Path, tmp_path: Path) -> None:
        assert replay("recover", cut(whole, whole.stat().st_size * 3 // 4), "-o", "out.mcap").status == 0
        out = tmp_path / "out.mcap"
        assert topics(out) == {"/r0/map": GRID_TYPE, "/r1/map": GRID_TYPE}
        assert metadata(out) == {"who": {"name": "ü"}}
        with out.open("rb") as file:
            reader = make_reader(file, validate_crcs=True)
            (attachment,) = reader.iter_attachments()
            header = reader.get_header()
        assert (attachment.name, attachment.data, attachment.create_time) == ("note.txt", b"of all things", 1)
        assert (header.profile, header.library) == ("ros2", "a recorder")
        known = summary(out)
        assert known.statistics is not None
        assert known.statistics.message_count == len(messages_of(out))
        assert [each.metadata for each in known.channels.values()] == [{"k": "v"}] * 2

    @pytest.mark.parametrize("compression", CompressionType)
    def test_others_open_it(self, replay: Program, tmp_path: Path, compression: CompressionType) -> None:
        run = recorded(tmp_path / "run.mcap", compression)
        assert replay("recover", cut(run, run.stat().st_size * 2 // 3), "-o", "out.mcap").status == 0
        out = tmp_path / "out.mcap"
        with AnyReader([out]) as reader:
            read = [(connection.topic, log_ns, bytes(data)) for connection, log_ns, data in reader.messages()]
        assert read == [(topic, log_ns, data) for topic, log_ns, _, data in messages_of(out)]
        assert any("/r1/map" in str(chunk.entity_path) for chunk in McapReader(str(out)).stream())

    def test_every_length_is_recovered_or_refused(self, replay: Program, tmp_path: Path) -> None:
        run = recorded(tmp_path / "run.mcap", messages=25)
        expected, content = messages_of(run), run.read_bytes()
        damaged, out = tmp_path / "cut.mcap", tmp_path / "out.mcap"
        counts = []
        for size_bytes in [*range(0, len(content), 61), len(content)]:
            damaged.write_bytes(content[:size_bytes])
            ran = replay("recover", damaged, "-o", out, "--force")
            if ran.status:
                assert ran.status == 2
                assert "nothing to recover" in ran.error or "does not begin as an MCAP" in ran.error
                counts.append(0)
                continue
            assert messages_of(out) == expected[: len(messages_of(out))]
            counts.append(len(messages_of(out)))
        assert counts == sorted(counts)
        assert counts[0] == 0
        assert counts[-1] == len(expected)


def test_a_damaged_chunk_is_left_out_and_named(replay: Program, tmp_path: Path) -> None:
    run = recorded(tmp_path / "run.mcap", CompressionType.NONE)
    expected = messages_of(run)
    second = chunks(run)[1]
    content = bytearray(run.read_bytes())
    content[second.start + 500] ^= 1
    run.write_bytes(content)
    ran = replay("recover", run, "-o", "out.mcap")
    assert ran.status == 0
    found = messages_of(tmp_path / "out.mcap")
    assert set(found) < set(expected)
    assert re.search(r"left out: the chunk at byte \d+: its checksum \(CRC\) is wrong; in it are 5 of ", ran.err)


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.NONE])
@pytest.mark.parametrize("is_chunked", [True, False])
def test_what_is_larger_than_is_read_is_left_out_and_named(
    replay: Program, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compression: CompressionType, is_chunked: bool
) -> None:
    monkeypatch.setattr("replay.recover.MOST_BYTES", 20_000)
    run = tmp_path / "run.mcap"
    with run.open("wb") as file:
        writer = Writer(file, chunk_size=1, compression=compression, use_chunking=is_chunked)
        writer.start()
        channel = writer.register_channel("/a", "json", writer.register_schema("s", "jsonschema", b"{}"))
        for time_ns, size in enumerate((10, 30_000, 10)):
            writer.add_message(channel, time_ns, bytes(size), time_ns)
        writer.finish()
    ran = replay("recover", run, "-o", "out.mcap")
    assert ran.status == 0, ran.err
    assert len(messages_of(tmp_path / "out.mcap")) == 2
    pattern = r"left out: the (chunk|message) at byte \d+: it has more than 20000 bytes, the most that is read at once"
    assert re.search(pattern, ran.err)
    assert "--max-memory" not in ran.err


def test_default_names(replay: Program, tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    recorded(tmp_path / "there" / "run.mcap")
    assert replay("recover", "there/run.mcap").status == 0
    (tmp_path / "there" / "run.mcap").rename(tmp_path / "there" / "out.mcap.partial")
    assert replay("recover", "there/out.mcap.partial").status == 0
    found = sorted(str(each.relative_to(tmp_path)) for each in tmp_path.rglob("*.mcap"))
    assert found == ["run.recovered.mcap", "there/out.mcap"]


class TestWhatASourceReadsIsRecovered:
    """The first of four chunks or so is whole, and describes all channels, unless a test says otherwise."""

    @pytest.fixture
    def run(self, tmp_path: Path) -> Path:
        return recorded(tmp_path / "run.mcap")

    @pytest.mark.parametrize("at", [0, 5, 9 + 24, 9 + 40])
    def test_past_a_chunk_of_which_any_part_of_the_head_is_damaged(
        self, replay: Program, tmp_path: Path, run: Path, at: int
    ) -> None:
        """Its type, its length, the size of what is in it, the length of its compression."""
        expected = messages_of(run)
        start = records_of(run, CHUNK)[2]
        content = bytearray(run.read_bytes())
        content[start + at] ^= 0xFF
        run.write_bytes(content)
        self.check(replay("recover", run, "-o", "out.mcap"), tmp_path, expected)

    def test_past_what_seems_to_be_the_end(self, replay: Program, tmp_path: Path, run: Path) -> None:
        expected = messages_of(run)
        content = bytearray(run.read_bytes())
        content[records_of(run, CHUNK)[2]] = DATA_END
        run.write_bytes(content)
        self.check(replay("recover", run, "-o", "out.mcap"), tmp_path, expected)

    def test_past_bytes_that_are_missing(self, replay: Program, tmp_path: Path, run: Path) -> None:
        expected = messages_of(run)
        start, content = records_of(run, CHUNK)[2], run.read_bytes()
        run.write_bytes(content[: start + 300] + content[start + 310 :])
        self.check(replay("recover", run, "-o", "out.mcap"), tmp_path, expected)

    def test_of_a_chunk_that_is_cut_off(self, replay: Program, tmp_path: Path) -> None:
        run = tmp_path / "run.mcap"
        with run.open("wb") as file:
            writer = Writer(file, chunk_size=1 << 20, compression=CompressionType.NONE)
            writer.start()
            channel = writer.register_channel("/a", "json", writer.register_schema("s", "jsonschema", b"{}"))
            for time_ns in range(100):
                writer.add_message(channel, time_ns, bytes(1000), time_ns)
            writer.finish()
        whole = messages_of(run)
        ran = replay("recover", cut(run, 60_000), "-o", "out.mcap")
        assert ran.status == 0
        found = messages_of(tmp_path / "out.mcap")
        assert len(found) == 60_000 // (1000 + 31)
        assert found == whole[: len(found)]
        assert "left out: the end of the chunk at byte" in ran.err
        assert "the file ends early" in ran.err

    def test_whose_channel_is_described_before_its_schema(self, replay: Program, tmp_path: Path) -> None:
        self.write(tmp_path, channel(1, "/a"), schema(1), message(1, b"x"))
        assert replay("recover", "x.mcap", "-o", "out.mcap").status == 0
        assert [data for *_, data in messages_of(tmp_path / "out.mcap")] == [b"x"]

    def test_whose_channel_is_described_after_it(self, replay: Program, tmp_path: Path) -> None:
        self.write(tmp_path, message(1, b"x"), schema(1), channel(1, "/a"), message(1, b"y"))
        assert replay("recover", "x.mcap", "-o", "out.mcap").status == 0
        assert [data for *_, data in messages_of(tmp_path / "out.mcap")] == [b"x", b"y"]

    def test_whose_channel_is_described_in_two_ways(self, replay: Program, tmp_path: Path) -> None:
        """As in files that were put together: what is described last counts."""
        self.write(tmp_path, schema(1), channel(1, "/a"), message(1, b"x"), channel(1, "/b"), message(1, b"y"))
        assert replay("recover", "x.mcap", "-o", "out.mcap").status == 0
        assert [(topic, data) for topic, *_, data in messages_of(tmp_path / "out.mcap")] == [("/a", b"x"), ("/b", b"y")]

    def test_but_no_maps_whose_channel_is_described_in_two_ways(self, replay: Program, tmp_path: Path) -> None:
        """No source uses them either: one of the descriptions may be damaged, and they would be another robot's."""
        maps = (channel(2, "/r1/map", 2), message(2, b"x"), channel(2, "/r2/map", 2), message(2, b"y"))
        self.write(tmp_path, schema(1), channel(1, "/a"), message(1, b"z"), schema(2, GRID_TYPE), *maps)
        ran = replay("recover", "x.mcap", "-o", "out.mcap")
        assert ran.status == 0
        assert [data for *_, data in messages_of(tmp_path / "out.mcap")] == [b"z"]
        assert "left out: 2 messages of channel 2, /r1/map, which is described in two ways" in ran.err

    def test_but_nothing_that_a_checksum_contradicts(self, replay: Program, tmp_path: Path) -> None:
        parts = [schema(1), channel(1, "/a"), message(1, b"x" * 100)]
        self.write(tmp_path, *parts, crc=zlib.crc32(MAGIC + HEAD + b"".join(parts)) ^ 1)
        ran = replay("recover", "x.mcap", "-o", "out.mcap")
        assert ran.status == 2
        assert "left out is the data section: its checksum (CRC) is wrong" in ran.error

    @pytest.mark.parametrize("bad", [record(3, b"\x02\0\xff\xff"), b"\x05\xff\xff\xff\0\0\0\0\0zz", b"\x05\x01"])
    def test_past_a_chunk_whose_records_are_none(self, replay: Program, tmp_path: Path, bad: bytes) -> None:
        first = chunk(schema(1) + channel(1, "/a") + message(1, b"x"))
        self.write(tmp_path, first, chunk(message(1, b"y") + bad), chunk(message(1, b"z")))
        ran = replay("recover", "x.mcap", "-o", "out.mcap")
        assert ran.status == 0
        assert [data for *_, data in messages_of(tmp_path / "out.mcap")] == [b"x", b"z"]
        assert f"left out: the chunk at byte {len(MAGIC + HEAD + first)}: a record in it" in ran.err.replace(
            "what should be a record", "a record"
        )

    def test_without_a_head(self, replay: Program, tmp_path: Path) -> None:
        run = tmp_path / "x.mcap"
        run.write_bytes(MAGIC + record(1, b"\xff\xff\0\0") + schema(1) + channel(1, "/a") + message(1, b"x") * 5)
        ran = replay("recover", run, "-o", "out.mcap")
        assert ran.status == 0
        assert len(messages_of(tmp_path / "out.mcap")) == 5
        assert "left out: its head" in ran.err
        assert "no whole record" not in ran.err

    @staticmethod
    def write(folder: Path, *parts: bytes, crc: int = 0) -> None:
        end = record(DATA_END, struct.pack("<I", crc)) + record(2, bytes(20)) + MAGIC
        (folder / "x.mcap").write_bytes(MAGIC + HEAD + b"".join(parts) + end)

    @staticmethod
    def check(ran: Ran, folder: Path, expected: Messages) -> None:
        assert ran.status == 0, ran.err
        found = messages_of(folder / "out.mcap")
        assert set(found) < set(expected)
        assert found[-1] == expected[-1]
        assert len(found) > len(expected) * 3 // 4
        assert "left out: " in ran.err
        assert "it has its end" in ran.err


@given(data=st.data())
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_whatever_is_damaged_all_that_a_source_reads_is_recovered(data: st.DataObject) -> None:
    with TemporaryDirectory() as name:
        compression = data.draw(st.sampled_from(CompressionType))
        run, out = recorded(Path(name) / "run.mcap", compression, messages=12), Path(name) / "out.mcap"
        expected, content = set(messages_of(run)), bytearray(run.read_bytes())
        for _ in range(data.draw(st.integers(1, 3))):
            at = data.draw(st.integers(len(MAGIC), len(content) - 1))
            content[at] = data.draw(st.integers(0, 255))
        run.write_bytes(content[: data.draw(st.sampled_from([len(content), len(content) * 2 // 3]))])
        with open_source(run) as source:
            topics_there = [each.name for each in source.info.topics if each.msgtype == GRID_TYPE]
            read = {(each.topic, each.log_time_ns, bytes(each.data)) for each in source.messages(topics_there)}
        try:
            found = recover(run, out)
        except InputError as error:
            if "nothing to recover" not in str(error) or read:
                raise
            return
        recovered = messages_of(out)
        assert len(recovered) == found.messages
        assert read <= {(topic, log_ns, content) for topic, log_ns, _, content in recovered}
        # of a chunk that is cut off, nothing tells what was changed in it: a source reads that as well
        unprotected = {content for _, _, content in read}
        assert {each[3] for each in recovered} <= {each[3] for each in expected} | unprotected
        if len(recovered) < len(expected) and found.is_whole:
            assert found.left_out


def test_what_takes_more_memory_than_there_is_ends_the_run(
    replay: Program, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is no damage, and nothing is left out because of it."""
    run = recorded(tmp_path / "run.mcap")
    original, calls = zstandard.ZstdDecompressor, itertools.count()

    def scarce() -> object:
        if next(calls) == 3:
            raise zstandard.ZstdError("zstd decompress error: Allocation error : not enough memory")
        return original()

    monkeypatch.setattr("zstandard.ZstdDecompressor", scarce)
    ran = replay("recover", run, "-o", "out.mcap")
    assert ran.status == 2
    assert ran.error.startswith("there is not enough memory")
    assert [each.name for each in tmp_path.iterdir()] == ["run.mcap"]


def recovering() -> None:
    recover(Path("x.mcap"), Path("out.mcap"))


def opening() -> None:
    open_source(Path("x.mcap")).close()


@pytest.mark.parametrize("read", [recovering, opening])
def test_tiny_messages_take_no_more_memory_than_their_chunk(
    replay: Program, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, read: Callable[[], object]
) -> None:
    """A list of what is in it would take many times as much."""
    del replay  # which runs in the folder
    monkeypatch.setattr("replay.sinks.mcap_output._CHUNK_BYTES", 1 << 14)
    inner = schema(1) + channel(1, "/a") + message(1, b"") * ((2 << 20) // len(message(1, b"")))
    TestWhatASourceReadsIsRecovered.write(tmp_path, chunk(inner))
    tracemalloc.start()
    try:
        read()
        _, peak_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak_bytes < 2 * len(inner)


class TestRefused:
    @pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes there")
    def test_what_is_no_regular_file(self, replay: Program, tmp_path: Path) -> None:
        """To open a pipe that nobody writes to takes forever."""
        os.mkfifo(tmp_path / "pipe.mcap")
        ran = replay("recover", "pipe.mcap")
        assert ran.status == 2
        assert "pipe.mcap: this is no regular file" in ran.error

    def test_to_write_where_a_run_is_writing(self, replay: Program, tmp_path: Path) -> None:
        recorded(tmp_path / "run.mcap")
        file = PartialFile.claimed(tmp_path / "out.mcap")
        ran = replay("recover", "run.mcap", "-o", "out.mcap")
        assert ran.status == 3
        assert "another run is writing it now" in ran.error
        file.discard()
        assert [each.name for each in tmp_path.iterdir()] == ["run.mcap"]

    @pytest.mark.parametrize("content", [b"", b"no recording", b"\x89MCAP0\r\n", b"\x89MCAP0\r\n\x01\x05"])
    def test_what_holds_nothing(self, replay: Program, tmp_path: Path, content: bytes) -> None:
        (tmp_path / "x.mcap").write_bytes(content)
        ran = replay("recover", "x.mcap")
        assert ran.status == 2
        assert ran.error.startswith("x.mcap: ")
        assert [each.name for each in tmp_path.iterdir()] == ["x.mcap"]

    def test_what_is_not_there(self, replay: Program) -> None:
        assert "it does not exist" in replay("recover", "x.mcap").error

    @pytest.mark.parametrize("there", ["out.mcap", "out.json", "out.rrd"])
    def test_to_replace_anything_unless_asked_to(self, replay: Program, tmp_path: Path, there: str) -> None:
        recorded(tmp_path / "run.mcap")
        (tmp_path / there).write_text("dear to somebody")
        ran = replay("recover", "run.mcap", "-o", "out.mcap")
        assert ran.status == 2
        assert f"there is already {there}" in ran.error.replace(f"{tmp_path}/", "")
        assert (tmp_path / there).read_text() == "dear to somebody"
        assert replay("recover", "run.mcap", "-o", "out.mcap", "--force").status == 0
        assert sorted(each.name for each in tmp_path.iterdir()) == ["out.mcap", "run.mcap"]

    @pytest.mark.parametrize("link", [Path.symlink_to, Path.hardlink_to])
    def test_to_write_to_what_it_reads(
        self, replay: Program, tmp_path: Path, link: Callable[[Path, Path], None]
    ) -> None:
        run = recorded(tmp_path / "run.mcap")
        kept = run.read_bytes()
        for name in ("out.mcap", "out.json", "out.mcap.recovering", "out.json.partial", "out.json.replaced"):
            link(tmp_path / name, run)
            ran = replay("recover", "run.mcap", "-o", "out.mcap", "--force")
            assert ran.status == 2
            assert "is an input" in ran.error
            (tmp_path / name).unlink()
        assert run.read_bytes() == kept

    def test_to_let_a_run_write_where_it_is_writing(
        self, replay: Program, two: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        recorded(tmp_path / "run.mcap").rename(tmp_path / "out.mcap.partial")
        recorded(tmp_path / "run.mcap")
        during = []
        finish = McapCopy.finish

        def meanwhile(copy: McapCopy) -> None:
            during.append(replay("merge", two, "-o", "out.mcap", "--no-rrd", "--force"))
            finish(copy)

        monkeypatch.setattr(McapCopy, "finish", meanwhile)
        for damaged in ("out.mcap.partial", "run.mcap"):
            assert replay("recover", damaged, "-o", "out.mcap", "--force").status == 0
        assert [ran.status for ran in during] == [3, 3]
        assert all("another run is writing it now" in ran.error for ran in during)
        assert sorted(each.name for each in tmp_path.iterdir()) == ["out.mcap", "run.mcap"]

    def test_to_read_what_a_run_is_writing(self, replay: Program, tmp_path: Path) -> None:
        content = recorded(tmp_path / "run.mcap").read_bytes()
        file = PartialFile.claimed(tmp_path / "out.mcap")
        with file.stream() as stream:
            stream.write(content)
        ran = replay("recover", "out.mcap.partial")
        assert ran.status == 2
        assert "a run is still writing it" in ran.error
        file.discard()


class TestOneOutputAtATime:
    """Runs and recoveries of one name keep each other out."""

    def test_not_while_a_run_writes_it(self, replay: Program, tmp_path: Path) -> None:
        recorded(tmp_path / "run.mcap")
        file = PartialFile.claimed(tmp_path / "out.mcap")
        ran = replay("recover", "run.mcap", "-o", "out.mcap")
        file.discard()
        assert ran.status == 3
        assert "another run is writing it now" in ran.error
        assert [each.name for each in tmp_path.iterdir()] == ["run.mcap"]

    @pytest.mark.parametrize("name", ["run.mcap", "out.mcap.partial"])
    def test_no_run_while_it_is_recovered(
        self, replay: Program, two: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
    ) -> None:
        recorded(tmp_path / name)
        finish, runs = McapCopy.finish, []

        def finished(copy: McapCopy) -> None:
            runs.append(replay.merge(two))
            finish(copy)

        monkeypatch.setattr(McapCopy, "finish", finished)
        assert replay("recover", name, "-o", "out.mcap").status == 0
        assert [each.status for each in runs] == [3]
        assert "out.mcap: another run is writing it now" in runs[0].err.splitlines()[-1]
        assert sorted(each.name for each in tmp_path.iterdir()) == sorted(["out.mcap", name])

    @pytest.mark.parametrize("left", ["out.mcap.recovering", "out.mcap.partial"])
    @pytest.mark.parametrize("command", ["merge", "recover"])
    def test_what_a_killed_one_left_is_removed(self, replay: Program, two: Path, left: str, command: str) -> None:
        (replay.folder / left).write_text("of an earlier run")
        ran = replay(command, two, "-o", "out.mcap")
        assert ran.status == 0
        assert f"an earlier run was cut off and left {left}; it is removed" in ran.out + ran.err
        assert left not in {each.name for each in replay.folder.iterdir()}


class TestTheFirstChunkWhichDescribesAllChannels:
    @pytest.fixture
    def damaged(self, tmp_path: Path) -> Path:
        run = recorded(tmp_path / "run.mcap", CompressionType.NONE)
        content = bytearray(run.read_bytes())
        content[chunks(run)[0].start + 200] ^= 1
        run.write_bytes(content)
        return run

    def test_if_damaged_the_summary_describes_them(self, replay: Program, tmp_path: Path, damaged: Path) -> None:
        expected = messages_of(recorded(tmp_path / "whole.mcap"))
        assert replay("recover", damaged, "-o", "out.mcap").status == 0
        found = messages_of(tmp_path / "out.mcap")
        assert len(found) > len(expected) * 3 // 4
        assert found == expected[-len(found) :]

    def test_if_damaged_and_all_else_is_cut_off_nothing_is_left(
        self, replay: Program, tmp_path: Path, damaged: Path
    ) -> None:
        cut_off = cut(damaged, damaged.stat().st_size // 2)
        damaged.unlink()
        ran = replay("recover", cut_off, "-o", "out.mcap")
        assert ran.status == 2
        assert "no whole message" in ran.error
        assert "its checksum (CRC) is wrong" in ran.error
        assert [each.name for each in tmp_path.iterdir()] == [cut_off.name]


@pytest.mark.parametrize("name", ["out.mcap.recovering", "out.mcap.partial"])
def test_what_a_recovery_left_that_was_killed_is_removed_by_the_next_run(
    replay: Program, two: Path, tmp_path: Path, name: str
) -> None:
    for arguments in (("merge", two, "-o", "out.mcap", "--no-rrd"), ("recover", two, "-o", "out.mcap")):
        (tmp_path / name).write_bytes(b"half of it")
        ran = replay(*arguments, "--force")
        assert ran.status == 0
        assert f"an earlier run was cut off and left {name}; it is removed" in ran.err
        assert not (tmp_path / name).exists()


def test_names_cannot_steer_the_terminal(replay: Program, tmp_path: Path) -> None:
    topic = "/x\x1b[31mRED\x1b]0;title\x07\r\nreplay: all is well\u202e"
    lost = channel(2, topic, 9) + message(2, b"y")
    TestWhatASourceReadsIsRecovered.write(tmp_path, schema(1), channel(1, "/a"), message(1, b"x"), lost)
    ran = replay("recover", "x.mcap", "-o", "out.mcap")
    assert ran.status == 0
    assert "RED" in ran.err
    assert all(line.isprintable() for line in ran.err.split("\n"))
    assert not any(line.startswith("replay: all is well") for line in ran.err.splitlines())


def test_the_recovered_file_can_be_merged(replay: Program, two: Path, tmp_path: Path) -> None:
    assert replay("recover", two, "-o", "again.mcap").status == 0
    assert raw(tmp_path / "again.mcap", "/r1/map") == raw(two, "/r1/map")
    assert replay.merge("again.mcap").statuses == {"r1": "reference", "r2": "merged"}
