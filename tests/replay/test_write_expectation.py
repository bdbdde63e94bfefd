"""Expectations that are written are read as they were meant, whatever robots are called."""

from pathlib import Path

import pytest

from mapmerge.sim2 import Sim2
from replay.checks.expectation import load_expectation
from replay.checks.findings import findings
from replay.checks.write_expectation import expectation_text
from replay.run_result import RobotResult, RunResult


def result(name: str) -> RunResult:
    reference = RobotResult("r1", "reference", "reference", "", Sim2(), 0.9, None, 10.0, None, "r1/map")
    pose = Sim2(-1.0004996, 2.5, 3.1, 1.0203)
    robot = RobotResult(name, "merged", "accepted", "", pose, 0.987, 0.01, 10.4, 0.0, "map")
    return RunResult(Path("out.json"), "r1", {"r1": reference, name: robot}, {"damaged": 3}, "1", {}, ())


@pytest.mark.parametrize(
    "name", ["r2", "no", "1e3", "~", 'a"b', "a\\b", "a: {b}", "# c", "\x07\n\t", "\u202e", "\U000e0001", "😀", " "]
)
def test_it_holds_of_the_run_that_it_is_written_from(tmp_path: Path, name: str) -> None:
    path = tmp_path / "expect.yaml"
    path.write_text(expectation_text(result(name)), encoding="utf-8")
    found = findings(load_expectation(path), result(name))
    assert [item for item in found if not item.holds] == []
    assert {item.subject for item in found} == {"run", "r1", name}
    assert len(found) == 10
