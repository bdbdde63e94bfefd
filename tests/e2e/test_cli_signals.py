"""Ends that come from outside: interrupted, terminated, nobody listening."""

from __future__ import annotations

import signal
import subprocess
from pathlib import Path

import pytest

from tests.bags import write_mcap
from tests.program import PROGRAM, quiet, started, wait_for
from tests.runs import flat_map, seen

# A shell shows 130 for both. Python ends itself with the signal, whatever the program returns, if it was running code
# that is made at run time, such as a dataclass.
INTERRUPTED = (130, -signal.SIGINT)


@pytest.fixture(scope="module")
def long_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording that takes long to merge: each map says something new."""
    messages = [
        seen(robot, index, flat_map(robot, 7.0 + 2.0 * (index % 2))) for index in range(150) for robot in ("r1", "r2")
    ]
    return write_mcap(tmp_path_factory.mktemp("long") / "long.mcap", messages)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted(long_run: Path, tmp_path: Path, number: signal.Signals) -> None:
    process = started("merge", long_run, "-o", "out.mcap", "--no-rrd", cwd=tmp_path)
    wait_for(tmp_path / "out.mcap.partial", process)
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert process.returncode in INTERRUPTED
    assert out == ""
    assert err.splitlines()[-1] == "replay: interrupted; nothing was written"
    assert "Traceback" not in err
    assert not list(tmp_path.iterdir())


def test_interrupted_leaves_what_was_there(long_run: Path, tmp_path: Path) -> None:
    for name in ("out.mcap", "out.json"):
        (tmp_path / name).write_text("of an earlier run")
    process = started("merge", long_run, "-o", "out.mcap", "--no-rrd", "--force", cwd=tmp_path)
    wait_for(tmp_path / "out.mcap.partial", process)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=30)
    assert process.returncode in INTERRUPTED
    assert {each.name: each.read_text() for each in tmp_path.iterdir()} == {
        "out.mcap": "of an earlier run",
        "out.json": "of an earlier run",
    }


@pytest.mark.parametrize("command", ["merge", "info"])
def test_nobody_reads_the_output(two: Path, tmp_path: Path, command: str) -> None:
    arguments = ["--no-rrd", "--images", "none", "--json"] if command == "merge" else []
    with subprocess.Popen(
        [*PROGRAM, command, two, *arguments],
        cwd=tmp_path,
        env=quiet(),
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        err = process.stderr.read()
        assert process.wait(timeout=30) == 0
    assert "Traceback" not in err
    assert "BrokenPipe" not in err
