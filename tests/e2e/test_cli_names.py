"""Names in a recording that are made to do harm: they are shown escaped, and lead to no path but the outputs'."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from rerun.chunk import RrdReader

from tests.bags import Recorded, write_mcap
from tests.outputs import topics
from tests.program import Program
from tests.runs import seen

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
