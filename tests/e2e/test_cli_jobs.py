"""Several threads: the same outputs, the same errors."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from tests.bags import write_bare_db3, write_mcap, write_rosbag1
from tests.disks import files_up_to
from tests.program import Program
from tests.runs import flat_map, seen


def messages() -> list:
    """Three robots' maps, some of which change."""
    return [seen(robot, index, flat_map(robot, 5.0 + index % 4)) for index in range(6) for robot in ("r1", "r2", "r3")]


@pytest.mark.parametrize(
    ("write", "name"), [(write_mcap, "run.mcap"), (write_rosbag1, "run.bag"), (write_bare_db3, "run.db3")]
)
def test_the_outputs_are_the_same_to_the_byte(replay: Program, tmp_path: Path, write, name: str) -> None:
    path = write(tmp_path / name, messages())
    outputs = []
    for jobs in (1, 2, 5):
        ran = replay.merge(path, "--jobs", jobs, images="changed")
        assert ran.status == 0, ran.err
        outputs.append((ran.mcap.read_bytes(), ran.report_path.read_bytes()))
    assert outputs[0] == outputs[1] == outputs[2]
    assert not {each.name for each in threading.enumerate()} & {"reader", "writer"}


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_message_that_cannot_be_used_ends_a_strict_run(replay: Program, tmp_path: Path, jobs: int) -> None:
    good = messages()
    path = write_mcap(tmp_path / "run.mcap", [*good, seen("r2", 9, width=3)])
    ran = replay.merge(path, "--strict", "--jobs", jobs)
    assert ran.status == 2
    assert "without --strict it would be skipped" in ran.err.splitlines()[-1]
    assert not ran.mcap.exists()


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_full_disk(replay: Program, two: Path, tmp_path: Path, jobs: int) -> None:
    with files_up_to(1000):
        ran = replay.merge(two, "--jobs", jobs)
    assert ran.status == 3
    assert "File too large" in ran.err.splitlines()[-1]
    assert not list(tmp_path.glob("out.*"))


@pytest.mark.parametrize("jobs", ["0", "-1", "two", "1.5", "", "99999999999"])
def test_a_number_of_threads_that_is_none(replay: Program, two: Path, jobs: str) -> None:
    ran = replay.merge(two, f"--jobs={jobs}")
    assert ran.status == 2
    assert "expected a number of threads, 1 to 999" in ran.err.splitlines()[-1]
