"""Misfortunes of whole runs: killed, no space left, the folder gone, two at once, the recording cut while it is read.

Each run is the program in a process of its own, on a sample recording, as kills in `kills` are.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from benchmarks.faults.kills import FINALS, SAMPLE, killed_runs
from benchmarks.faults.oracle import Judged, Verdict

_MOST_S = 120.0
_ENDS = {0: Verdict.RIGHT, 2: Verdict.ERROR, 3: Verdict.ERROR}
_LIMITED = (
    "import resource, sys; size = int(sys.argv.pop(1));"
    "resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)); import replay.cli; sys.exit(replay.cli.main())"
)


@dataclass(frozen=True, slots=True)
class Ended:
    """How a run ended: its status, None if it had to be stopped, and what it said."""

    status: int | None
    said: str


Misfortune = Callable[[Random, Path], Judged]


def killed(random: Random, folder: Path) -> Judged:
    """Kill a run at any moment."""
    (outcome,) = killed_runs(1, random.randrange(2**32), folder)
    if outcome.broken:
        return Judged(Verdict.WRONG, "; ".join(outcome.broken))
    return Judged(Verdict.RIGHT if outcome.recovered is None else Verdict.NAMED)


def no_space(random: Random, folder: Path) -> Judged:
    """Let no file grow beyond a size that is somewhere within that of the outputs."""
    limit_bytes = int(2.0 ** random.uniform(6, 21))
    run = _started(folder, "-c", _LIMITED, str(limit_bytes))
    return judged(_ended(run), folder)


def folder_gone(random: Random, folder: Path) -> Judged:
    """Remove the folder of the outputs at any moment."""
    run = _started(folder, "-m", "replay.cli")
    _wait_for(folder / "out" / "out.mcap.partial", run)
    time.sleep(random.random() * 0.5)
    shutil.rmtree(folder / "out", ignore_errors=True)
    ended = _ended(run)
    if ended.status == 0 and not (folder / "out").exists():
        return Judged(Verdict.RIGHT)  # it was done before
    return judged(ended, folder)


def two_at_once(random: Random, folder: Path) -> Judged:
    """Start two runs into the same outputs."""
    runs = [_started(folder, "-m", "replay.cli")]
    time.sleep(random.random())
    runs.append(_started(folder, "-m", "replay.cli"))
    ended = [_ended(run) for run in runs]
    if not any(each.status == 0 for each in ended):
        return Judged(Verdict.WRONG, f"neither run was done: {ended}")
    return max((judged(each, folder) for each in ended), key=lambda found: list(Verdict).index(found.verdict))


def cut_while_read(random: Random, folder: Path) -> Judged:
    """Cut the recording off at any moment while it is read."""
    run = _started(folder, "-m", "replay.cli", flags=("--jobs", "1"))
    _wait_for(folder / "out" / "out.mcap.partial", run)
    time.sleep(random.random() * 0.3)
    recording = folder / "in" / "run.mcap"
    with recording.open("r+b") as file:
        file.truncate(random.randrange(recording.stat().st_size))
    ended = _ended(run)
    if ended.status in {0, 1} and "skipped" in ended.said:
        return Judged(Verdict.NAMED, ended.said)
    return judged(ended, folder, changed=True)


MISFORTUNES: Mapping[str, Misfortune] = {
    "run_killed": killed,
    "run_without_space": no_space,
    "run_without_folder": folder_gone,
    "runs_at_once": two_at_once,
    "run_with_recording_cut": cut_while_read,
}


def tried(count: int, seed: int) -> Iterator[tuple[str, Judged]]:
    """Yield how runs ended, each misfortune so many times."""
    for name, misfortune in MISFORTUNES.items():
        for number in range(count):
            with TemporaryDirectory(prefix="faults-") as folder:
                yield name, misfortune(Random(f"{seed} {name} {number}"), Path(folder))  # noqa: S311


def judged(ended: Ended, folder: Path, *, changed: bool = False) -> Judged:
    """Judge how a run ended that was not killed."""
    lines = ended.said.splitlines()
    if ended.status is None:
        return Judged(Verdict.HUNG, f"it was stopped after {_MOST_S:.0f} s")
    if ended.status not in _ENDS or "Traceback" in ended.said:
        return Judged(Verdict.CRASHED, f"it ended with {ended.status}: {ended.said}")
    if ended.status and not lines[-1].startswith("replay: error: "):
        return Judged(Verdict.WRONG, f"it ended with {ended.status} and without an error: {ended.said}")
    if not changed and (folder / "in" / "run.mcap").read_bytes() != SAMPLE.read_bytes():
        return Judged(Verdict.WRONG, "the recording was changed")
    out = folder / "out"
    left = sorted(each.name for each in out.iterdir()) if out.exists() else []
    if left not in ([], sorted(FINALS)):
        return Judged(Verdict.WRONG, f"it left {', '.join(left)}")
    if ended.status == 0 and not left:
        return Judged(Verdict.WRONG, "it says that it is done, and nothing is there")
    return Judged(_ENDS[ended.status], ended.said)


def _started(folder: Path, *python: str, flags: Sequence[str] = ()) -> subprocess.Popen[str]:
    """Start a run on a copy of the sample; ``python`` is what makes Python the program."""
    recording, out = folder / "in" / "run.mcap", folder / "out"
    if not recording.exists():
        recording.parent.mkdir()
        out.mkdir()
        shutil.copyfile(SAMPLE, recording)
    command = [sys.executable, *python, "merge", str(recording), "-o", str(out / "out.mcap"), "--force", *flags]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def _wait_for(path: Path, run: subprocess.Popen[str]) -> None:
    """Wait until a run writes, or has ended."""
    while not path.exists() and run.poll() is None:
        time.sleep(0.005)


def _ended(run: subprocess.Popen[str]) -> Ended:
    try:
        _, said = run.communicate(timeout=_MOST_S)
    except subprocess.TimeoutExpired:
        run.kill()
        run.communicate()
        return Ended(None, "")
    return Ended(run.returncode, said)
