"""The command of a report page is one that can be typed, or it is said why there is none."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from tests.bags import write_mcap, write_rosbag1
from tests.pages import Page
from tests.program import in_process_of_its_own
from tests.runs import growing, two_robots


def page(folder: Path, *runs: str) -> Page:
    ran = in_process_of_its_own("merge", "-o", "o.mcap", "--no-rrd", "--report", "o.html", "--", *runs, cwd=folder)
    assert ran.returncode == 0, ran.stderr
    return Page((folder / "o.html").read_text(encoding="utf-8"))


def test_recordings_of_one_name_cannot_be_told_from_each_other(tmp_path: Path) -> None:
    for folder, robot in (("pa", "r1"), ("pb", "r2")):
        (tmp_path / folder).mkdir()
        write_mcap(tmp_path / folder / "run.mcap", growing(robot, topic="/map"))
    told = page(tmp_path, "r1=pa/run.mcap", "r2=pb/run.mcap").words("provenance")
    assert "Several recordings have the same name" in told
    assert "replay merge" not in told


def test_robots_that_are_called_after_folders_cannot_be_in_one(tmp_path: Path) -> None:
    for folder, write in (("alpha", write_mcap), ("bravo", write_rosbag1)):
        (tmp_path / folder).mkdir()
        write(tmp_path / folder / ("run.mcap" if write is write_mcap else "run.bag"), growing("r1", topic="/map"))
    told = page(tmp_path, "alpha/run.mcap", "bravo/run.bag")
    assert [row[0] for row in told.rows("robots")] == ["alpha_run", "bravo_run"]
    assert "Robots are called after the folders" in told.words("provenance")
    assert "replay merge" not in told.words("provenance")


@pytest.mark.parametrize("name", ["-d.mcap", "--force", "a b.mcap"])
def test_a_name_like_a_flag_is_a_path(tmp_path: Path, name: str) -> None:
    write_mcap(tmp_path / name, two_robots())
    told = page(tmp_path, f"./{name}").words("provenance")
    line = told[told.index("replay merge") :]
    assert shlex.split(line)[2] == (f"./{name}" if name.startswith("-") else name)
