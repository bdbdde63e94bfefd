"""What is left of a recording that was cut off, made readable."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rerun.chunk import McapReader
from rosbags.highlevel import AnyReader

from replay.codec import ros2_message_definition
from replay.sinks.mcap_copy import McapCopy
from replay.sinks.partial_file import PartialFile
from replay.sources.base import GRID_TYPE
from tests.bags import START, chunks
from tests.outputs import metadata, raw, summary, topics
from tests.program import Program

Messages = list[tuple[str, int, int, bytes]]


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
    assert re.search(r"left out: .*run\.mcap: the chunk at byte \d+ is damaged: its checksum \(CRC\) is wrong", ran.err)


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
    assert re.search(r"left out: .*run\.mcap: the (chunk|record) at byte \d+ has more than 20000 bytes", ran.err)


def test_default_names(replay: Program, tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    recorded(tmp_path / "there" / "run.mcap")
    assert replay("recover", "there/run.mcap").status == 0
    (tmp_path / "there" / "run.mcap").rename(tmp_path / "there" / "out.mcap.partial")
    assert replay("recover", "there/out.mcap.partial").status == 0
    found = sorted(str(each.relative_to(tmp_path)) for each in tmp_path.rglob("*.mcap"))
    assert found == ["run.recovered.mcap", "there/out.mcap"]


class TestRefused:
    @pytest.mark.parametrize("content", [b"", b"no recording", b"\x89MCAP0\r\n", b"\x89MCAP0\r\n\x01\x05"])
    def test_what_holds_nothing(self, replay: Program, tmp_path: Path, content: bytes) -> None:
        (tmp_path / "x.mcap").write_bytes(content)
        ran = replay("recover", "x.mcap")
        assert ran.status == 2
        assert ran.error.startswith("x.mcap: ")
        assert [each.name for each in tmp_path.iterdir()] == ["x.mcap"]

    def test_what_is_not_there(self, replay: Program) -> None:
        assert "No such file" in replay("recover", "x.mcap").error

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


def test_a_message_whose_channel_is_lost_is_counted(replay: Program, tmp_path: Path) -> None:
    """The first chunk holds the descriptions of all channels."""
    run = recorded(tmp_path / "run.mcap", CompressionType.NONE)
    content = bytearray(run.read_bytes())
    content[chunks(run)[0].start + 200] ^= 1
    run.write_bytes(content)
    ran = replay("recover", run, "-o", "out.mcap")
    assert ran.status == 2
    assert "no whole message" in ran.error
    assert not raw_files(tmp_path)


def raw_files(folder: Path) -> list[str]:
    return [each.name for each in folder.iterdir() if each.name != "run.mcap"]


def test_the_recovered_file_can_be_merged(replay: Program, two: Path, tmp_path: Path) -> None:
    assert replay("recover", two, "-o", "again.mcap").status == 0
    assert raw(tmp_path / "again.mcap", "/r1/map") == raw(two, "/r1/map")
    assert replay.merge("again.mcap").statuses == {"r1": "reference", "r2": "merged"}
