"""Killed at any moment: what has its final name is whole and of one run, and what has not is no obstacle."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from benchmarks.faults.kills import killed_runs
from replay.sinks.partial_file import PartialFile
from tests.bags import write_mcap
from tests.outputs import raw, summary
from tests.program import PROGRAM, Program, quiet, started, wait_for
from tests.runs import flat_map, seen

if sys.platform == "win32":
    pytest.skip("nobody is killed by a signal there", allow_module_level=True)

FINALS = {"out.mcap", "out.rrd", "out.json"}

# Ends the process before the n-th time that it renames, removes or waits for the disk.
_KILLER = textwrap.dedent("""
    import os, pathlib, signal, sys

    left = int(sys.argv.pop(1))

    def counted(function):
        def call(*arguments, **options):
            global left
            if not left:
                os.kill(os.getpid(), signal.SIGKILL)
            left -= 1
            return function(*arguments, **options)
        return call

    for name in ("replace", "rename", "link", "unlink", "remove", "fsync"):
        setattr(os, name, counted(getattr(os, name)))
    from replay.cli import main
    sys.exit(main(sys.argv[1:]))
""")


def killed_before(call: int, *arguments: object) -> int:
    command = [sys.executable, "-c", _KILLER, str(call), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, env=quiet(), timeout=120).returncode


@pytest.fixture(scope="module")
def long_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording that takes long to merge: each map says something new."""
    messages = [
        seen(robot, index, flat_map(robot, 7.0 + 2.0 * (index % 2))) for index in range(150) for robot in ("r1", "r2")
    ]
    return write_mcap(tmp_path_factory.mktemp("long") / "long.mcap", messages)


def test_at_random_moments(tmp_path: Path) -> None:
    outcomes = killed_runs(12, seed=4, folder=tmp_path)
    assert [outcome for outcome in outcomes if outcome.broken] == []
    assert any(outcome.killed for outcome in outcomes)
    assert any("out.mcap.partial" in outcome.left for outcome in outcomes)
    assert any("out.html" in outcome.left for outcome in outcomes)


@pytest.mark.parametrize("rrd", [True, False])
def test_between_any_two_steps_of_publishing(replay: Program, two: Path, tmp_path: Path, rrd: bool) -> None:
    """Where the report is there, all are there and of one run; nothing of two runs is ever side by side."""
    new, old, out = (tmp_path / name for name in ("new", "old", "out"))
    flags = [] if rrd else ["--no-rrd"]
    for folder, more in ((new, flags), (old, ["--min-confidence", "0.9"])):
        folder.mkdir()
        assert replay("merge", two, "-o", folder / "out.mcap", *more).status == 0
    wanted = {"out.mcap", "out.json", *(["out.rrd"] if rrd else [])}
    seen_names, call, status = set(), 0, -1
    while status:
        out.mkdir(exist_ok=True)
        for name in FINALS:
            (out / name).write_bytes((old / name).read_bytes())
        status = killed_before(call, "merge", two, "-o", out / "out.mcap", "--force", *flags)
        assert status in (0, -signal.SIGKILL)
        there = FINALS & {each.name for each in out.iterdir()}
        is_old = {(out / name).read_bytes() == (old / name).read_bytes() for name in there}
        assert len(is_old) == 1
        if "out.json" in there:
            assert there == (FINALS if is_old == {True} else wanted)
            assert json.loads((out / "out.json").read_bytes())["schema"] == "replay.report/1"
        elif is_old == {False}:
            assert (out / "out.mcap").read_bytes() == (new / "out.mcap").read_bytes()
        summary(out / "out.mcap")
        seen_names.add((frozenset(there), *is_old))
        call += 1
        assert call < 50
    assert {path.name for path in out.iterdir()} == wanted
    assert (frozenset({"out.mcap"}), True) in seen_names
    assert (frozenset({"out.mcap"}), False) in seen_names


class TestWhatIsLeft:
    @pytest.fixture
    def left(self, two: Path, tmp_path: Path) -> Path:
        """A folder in which a run was killed when all was written and nothing had its final name."""
        status = killed_before(2, "merge", two, "-o", tmp_path / "out.mcap", "--no-rrd", "--images", "none")
        assert status == -signal.SIGKILL
        assert {each.name for each in tmp_path.iterdir()} == {"out.mcap.partial", "out.json.partial"}
        return tmp_path

    def test_is_recovered(self, replay: Program, two: Path, left: Path) -> None:
        ran = replay("recover", left / "out.mcap.partial")
        assert ran.status == 0
        found = raw(left / "out.mcap", "/merged/report")
        assert replay("merge", two, "-o", left / "again.mcap", "--no-rrd", "--images", "none").status == 0
        assert found == raw(left / "again.mcap", "/merged/report")

    def test_is_replaced_by_the_next_run_which_says_so(self, replay: Program, two: Path, left: Path) -> None:
        ran = replay("merge", two, "-o", left / "out.mcap", "--no-rrd", "--images", "none")
        assert ran.status == 0
        for name in ("out.mcap", "out.json"):
            assert f"an earlier run was cut off and left {left / name}.partial; it is removed" in ran.err
        assert {each.name for each in left.iterdir()} == {"out.mcap", "out.json"}

    def test_of_a_page_is_removed_by_a_run_that_writes_none(self, replay: Program, two: Path, tmp_path: Path) -> None:
        page = tmp_path / "out.html.partial"
        assert replay("merge", two, "-o", "a.mcap", "--no-rrd", "--images", "none", "--report", page.stem).status == 0
        (tmp_path / "out.html").rename(page)
        ran = replay("merge", two, "-o", "out.mcap", "--no-rrd", "--images", "none")
        assert ran.status == 0
        assert f"an earlier run was cut off and left {page.name}; it is removed" in ran.err
        page.touch()
        ran = replay("merge", two, "-o", "out.mcap", "--no-rrd", "--images", "none", "--force")
        assert ran.status == 0
        assert "earlier run" not in ran.err
        assert not page.exists()

    def test_of_a_page_stays_if_it_is_somebody_elses(self, replay: Program, two: Path, tmp_path: Path) -> None:
        page = tmp_path / "out.html.partial"
        page.write_text("dear to somebody")
        assert replay.merge(two).status == 0
        assert page.read_text() == "dear to somebody"
        page.unlink()
        with PartialFile.claimed(tmp_path / "out.html").stream():  # another run writes it now
            assert replay("merge", two, "-o", "out.mcap", "--no-rrd", "--images", "none", "--force").status == 0
            assert page.exists()

    def test_goes_unmentioned_where_it_is_empty(self, replay: Program, two: Path, tmp_path: Path) -> None:
        (tmp_path / "out.mcap.partial").touch()
        ran = replay.merge(two)
        assert ran.status == 0
        assert "earlier run" not in ran.err


class TestTwoAtOnce:
    def test_the_second_is_refused(self, replay: Program, two: Path, long_run: Path, tmp_path: Path) -> None:
        first = started("merge", long_run, "-o", "out.mcap", "--no-rrd", "--images", "none", cwd=tmp_path)
        try:
            wait_for(tmp_path / "out.json.partial", first)
            ran = replay("merge", two, "-o", "out.mcap", "--no-rrd", "--images", "none", "--force")
            assert first.poll() is None
        finally:
            first.kill()
            first.communicate()
        assert ran.status == 3
        assert "out.mcap: another run is writing it now" in ran.err.splitlines()[-1]
        assert {each.name for each in tmp_path.iterdir()} == {"out.mcap.partial", "out.json.partial"}

    def test_a_lock_ends_with_its_run(self, replay: Program, two: Path, long_run: Path, tmp_path: Path) -> None:
        first = started("merge", long_run, "-o", "out.mcap", "--no-rrd", "--images", "none", cwd=tmp_path)
        wait_for(tmp_path / "out.json.partial", first)
        first.kill()
        first.communicate()
        assert replay.merge(two).status == 0
        assert {each.name for each in tmp_path.iterdir()} == {"out.mcap", "out.json"}

    def test_many_at_once(self, replay: Program, two: Path, tmp_path: Path) -> None:
        """Each is refused in one line or done; and what there is at the end is that of a run alone."""
        command = [*PROGRAM, "merge", two, "-o", "out.mcap", "--no-rrd", "--images", "none", "--force"]
        runs = [
            subprocess.Popen(
                command, cwd=tmp_path, env=quiet(), text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
            )
            for _ in range(4)
        ]
        ends = [(run.communicate(timeout=120)[1], run.returncode) for run in runs]
        assert 0 in {status for _, status in ends}
        assert {status for _, status in ends} <= {0, 3}
        assert all("another run is writing it now" in err for err, status in ends if status)
        assert {each.name for each in tmp_path.iterdir()} == {"out.mcap", "out.json"}
        assert replay("merge", two, "-o", "alone.mcap", "--no-rrd", "--images", "none").status == 0
        for suffix in (".mcap", ".json"):
            assert (tmp_path / f"out{suffix}").read_bytes() == (tmp_path / f"alone{suffix}").read_bytes()
