"""Names in a recording that are made to do harm: they are shown escaped, and lead to no path but the outputs'."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer
from rerun.chunk import RrdReader

from tests.bags import Recorded, write_mcap
from tests.outputs import topics
from tests.program import Program
from tests.runs import bare_room, seen

HOSTILE = {
    "an escape sequence": "r\x1b[2J\x1b[31m",
    "a line end": "r\nreplay: error: all is lost",
    "a return": "r\rgone",
    "a bell and a backspace": "r\x07\x08\x08",
    "a second set of controls": "r\x9b31m\x7f",
    "a mark of direction": "r\u202edellac si ti tahw",
    "a line separator": "r\u2028next",
    "nothing wide": "r\u200b\ufeff",
    "a zero": "r\x00s",
    "the folder above": "..",
    "quotes": "'\"`$(reboot)\\",
    "markup": "[bold red]r[/]",
    "percent": "%s{0}%n",
    "very long": "r" * 5000,
    "other scripts": "робот机器人🤖",
}


def harmless(text: str) -> bool:
    """Tell whether nothing in a text steers the terminal that it is shown on."""
    return all(line.isprintable() for line in text.split("\n")) and len(max(text.split("\n"), key=len)) < 6000


def texts(value: Any) -> Iterator[str]:
    """Yield all texts within a value, however deep."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        yield from texts(list(value.values()))
    elif isinstance(value, list):
        for each in value:
            yield from texts(each)


@pytest.mark.parametrize("name", HOSTILE.values(), ids=HOSTILE)
class TestNames:
    def test_of_robots(self, replay: Program, tmp_path: Path, name: str) -> None:
        messages = [seen("r1", 0.0), seen("r2", 1.0, topic=f"/{name}/map")]
        inside = tmp_path / "in"
        inside.mkdir()
        run = write_mcap(inside / "run.mcap", messages)
        before = set(tmp_path.rglob("*"))
        ran = replay("merge", run, "-o", tmp_path / "out.mcap", "--robots", f"r1,{name}", "--copy-maps")
        assert ran.status == 0, ran.err
        assert harmless(ran.out), ran.out
        assert harmless(ran.err), ran.err
        assert {path.name for path in set(tmp_path.rglob("*")) - before} == {"out.mcap", "out.rrd", "out.json"}
        written = (tmp_path / "out.json").read_text("utf-8")
        assert harmless(written)
        assert json.loads(written)["robots"][name]["status"] == "merged"
        assert all(topic.isascii() and topic.isprintable() and ".." not in topic for topic in topics(ran.mcap))
        paths = {chunk.entity_path for chunk in RrdReader(tmp_path / "out.rrd").stream()}
        assert all(path.isprintable() for path in paths)

    def test_in_the_rerun_recording(self, replay: Program, tmp_path: Path, name: str) -> None:
        """Also of the reference, whose name is in the reasons of the others, and of what is skipped or not placed."""
        reference, placed, alone = f"{name}0", f"{name}2", f"{name}3"
        messages = [
            seen("r1", 0.0, topic=f"/{reference}/map"),
            seen("r1", 1.0, topic=f"/{reference}/map", resolution=0.0),
            seen("r2", 2.0, topic=f"/{placed}/map"),
            seen("r3", 3.0, bare_room(), topic=f"/{alone}/map"),
        ]
        run = write_mcap(tmp_path / "run.mcap", messages)
        ran = replay("merge", run, "-o", "out.mcap", "--robots", f"{reference},{placed},{alone}", "--images", "none")
        assert ran.status == 0, ran.err
        found = [
            text
            for chunk in RrdReader(tmp_path / "out.rrd").stream()
            if not str(chunk.entity_path).startswith("/__")
            for row in chunk.to_record_batch().to_pylist()
            for text in texts(row)
        ]
        assert any("is not merged" in text for text in found)
        assert any("was skipped" in text for text in found)
        assert not [text for text in found if not harmless(text)]

    def test_of_topics_that_are_recovered(self, replay: Program, tmp_path: Path, name: str) -> None:
        """Of a channel without its schema, and of one whose name is lost."""
        run = tmp_path / "run.mcap"
        with run.open("wb") as file:
            writer = Writer(file, use_chunking=False, repeat_channels=False, repeat_schemas=False)
            writer.start()
            schema = writer.register_schema("a", "ros2msg", b"")
            channels = [writer.register_channel(topic, "cdr", schema) for topic in ("/a", f"/{name}/map")]
            for channel in channels:
                writer.add_message(channel, 1, b"", 1)
            writer.finish()
        content = run.read_bytes()
        at = content.index(f"/{name}/map".encode())
        # the channel's record is its id, its schema's, and the length of its name
        run.write_bytes(content[: at - 6] + b"\x63\x00" + content[at - 4 :])
        ran = replay("recover", run, "-o", "out.mcap")
        assert ran.status == 0, ran.err
        assert harmless(ran.err), ran.err
        assert all(line.startswith("replay: ") for line in ran.err.splitlines())
        assert "replay: left out" in ran.err

    def test_of_frames(self, replay: Program, tmp_path: Path, name: str) -> None:
        messages = [seen("r1", 0.0, frame=name), seen("r2", 1.0, frame=f"{name}2")]
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), "--use-tf", "--json")
        assert ran.status == 0, ran.err
        assert harmless(ran.out)
        assert harmless(ran.err)
        shown = replay("info", tmp_path / "run.mcap")
        assert shown.status == 0
        assert harmless(shown.out)

    def test_of_topics_in_errors(self, replay: Program, tmp_path: Path, name: str) -> None:
        run = write_mcap(
            tmp_path / "run.mcap", [seen("r1", 0.0, topic=f"/{name}/a"), seen("r1", 0.0, topic=f"/{name}/b")]
        )
        ran = replay.merge(run)
        assert ran.status == 2
        assert harmless(ran.err)
        assert ran.err.count("\n") == 1


def test_very_many_robots_are_merged_only_if_they_are_named(replay: Program, tmp_path: Path) -> None:
    run = write_mcap(
        tmp_path / "run.mcap", [seen("r1", 0.0, topic=f"/r{n}/map") for n in range(101)], chunk_bytes=1 << 20
    )
    ran = replay.merge(run)
    assert ran.status == 2
    assert ran.error.startswith("there are maps of 101 robots; more than 100 are merged only if they are named")
    assert len(ran.err) < 1500
    assert replay.merge(run, "--robots", "r1").status == 0


def test_many_topics_are_not_all_listed(replay: Program, tmp_path: Path) -> None:
    bad = seen("r1", 0.0, width=0, height=0, data=seen("r1", 0.0).fields["data"][:0])
    many = [Recorded(f"/r{number}/local_costmap", bad.msgtype, bad.log_time_ns, bad.fields) for number in range(2000)]
    run = write_mcap(tmp_path / "run.mcap", [seen("r1", 0.0), *many], chunk_bytes=1 << 20)
    ran = replay.merge(run)
    assert ran.status == 0, ran.err
    assert "and 1980 more" in ran.err
    assert len(ran.err) < 5000
