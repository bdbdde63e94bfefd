"""Misfortunes of whole runs: killed, interrupted, no space left, the folder gone, two at once, and the like.

Each run is the program in a process of its own, on a sample recording, as kills in `kills` are.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from benchmarks.faults.kills import SAMPLE, killed_runs
from benchmarks.faults.oracle import Judged, Verdict

FINALS = ("out.mcap", "out.rrd", "out.json")
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


Misfortune = Callable[[Random, Path], Judged | None]


def interrupted(random: Random, folder: Path) -> Judged:
    """Interrupt or terminate a run at any moment."""
    run = _started(folder, "-m", "replay.cli")
    _wait_for(folder / "out" / "out.mcap.partial", run)
    time.sleep(random.random() * 1.5)
    run.send_signal(random.choice([signal.SIGINT, signal.SIGTERM]))
    ended = _ended(run)
    if ended.said.splitlines()[-1:] != ["replay: interrupted; nothing was written"]:
        return judged(ended, folder)  # it was done before
    left = sorted(each.name for each in (folder / "out").iterdir())
    if left or ended.status not in {128 + signal.SIGINT, -signal.SIGINT}:
        return Judged(Verdict.WRONG, f"it ended with {ended.status} and left {', '.join(left)}")
    return Judged(Verdict.ERROR, ended.said)


def no_space(random: Random, folder: Path) -> Judged:
    """Let no file grow beyond a size that is somewhere within that of the outputs."""
    limit_bytes = int(2.0 ** random.uniform(6, 21))
    run = _started(folder, "-c", _LIMITED, str(limit_bytes))
    return judged(_ended(run), folder)


def small_disk(random: Random, folder: Path) -> Judged | None:
    """Let the disk of the outputs be too small, by some bytes or by much."""
    return _on_disk(folder, f"size={int(2.0 ** random.uniform(12, 21))}")


def read_only(random: Random, folder: Path) -> Judged | None:
    """Let the disk of the outputs take nothing."""
    del random
    return _on_disk(folder, "ro")


def into_its_input(random: Random, folder: Path) -> Judged:
    """Let an output be the recording, by its name or by a link."""
    recording = _recording(folder)
    output = folder / "out" / "out.mcap"
    if (kind := random.randrange(4)) == 0:
        output = recording
    elif kind == 1:
        output.symlink_to(recording)
    elif kind == 2:
        output.hardlink_to(recording)
    else:
        output = recording.parent / ".." / "in" / recording.name
    ended = _ended(_started(folder, "-m", "replay.cli", output=output))
    if kind in {1, 2}:
        output.unlink()
    if ended.status == 0 or [*recording.parent.iterdir()] != [recording]:
        return Judged(Verdict.WRONG, f"it wrote over its input: {ended}")
    return judged(ended, folder)


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
    "run_interrupted": interrupted,
    "run_without_space": no_space,
    "run_on_small_disk": small_disk,
    "run_on_read_only_disk": read_only,
    "run_into_its_input": into_its_input,
    "run_without_folder": folder_gone,
    "runs_at_once": two_at_once,
    "run_with_recording_cut": cut_while_read,
}


def tried(count: int, seed: int) -> Iterator[tuple[str, Judged]]:
    """Yield how runs ended, each misfortune so many times; none that cannot be had here."""
    for each in _killed(count, seed) if count else ():
        yield "run_killed", each
    for name, misfortune in MISFORTUNES.items():
        for number in range(count):
            with TemporaryDirectory(prefix="faults-") as folder:
                found = misfortune(Random(f"{seed} {name} {number}"), Path(folder))  # noqa: S311
            if found is not None:
                yield name, found


def _killed(count: int, seed: int) -> Iterator[Judged]:
    """Kill runs at any moment, and run and recover what they left."""
    with TemporaryDirectory(prefix="faults-") as folder:
        for outcome in killed_runs(count, seed, Path(folder)):
            fine = Verdict.RIGHT if outcome.recovered is None else Verdict.NAMED
            yield Judged(Verdict.WRONG if outcome.broken else fine, "; ".join(outcome.broken))


def judged(ended: Ended, folder: Path, *, changed: bool = False, left: Sequence[str] | None = None) -> Judged:
    """Judge how a run ended that was not killed.

    Parameters
    ----------
    changed
        Whether something else may have changed the recording.
    left
        The names in the folder of the outputs, if that cannot be looked at any more.
    """
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
    if left is None:
        left = [each.name for each in out.iterdir()] if out.exists() else []
    if sorted(left) not in ([], sorted(FINALS)):
        return Judged(Verdict.WRONG, f"it left {', '.join(left)}")
    if ended.status == 0 and not left:
        return Judged(Verdict.WRONG, "it says that it is done, and nothing is there")
    return Judged(_ENDS[ended.status], ended.said)


def _on_disk(folder: Path, option: str) -> Judged | None:
    """Run where the outputs are on a disk of their own; None where nobody may have one."""
    _recording(folder)
    script = f'mount -t tmpfs -o {option} tmpfs out || exit 99; "$@"; status=$?; ls -A out > left; exit $status'
    apart = ("unshare", "--user", "--map-root-user", "--mount", "sh", "-c", script, "sh")
    try:
        ended = _ended(_started(folder, "-m", "replay.cli", before=apart))
    except FileNotFoundError:
        return None
    if not (folder / "left").exists():
        return None
    return judged(ended, folder, left=(folder / "left").read_text().split())


def _recording(folder: Path) -> Path:
    """Return the copy of the sample, made with the folder of the outputs if it is not there."""
    recording = folder / "in" / "run.mcap"
    if not recording.exists():
        recording.parent.mkdir(parents=True)
        (folder / "out").mkdir()
        shutil.copyfile(SAMPLE, recording)
    return recording


def _started(
    folder: Path, *python: str, flags: Sequence[str] = (), before: Sequence[str] = (), output: Path | None = None
) -> subprocess.Popen[str]:
    """Start a run on a copy of the sample; ``python`` is what makes Python the program, ``before`` runs that."""
    output = folder / "out" / "out.mcap" if output is None else output
    arguments = ["merge", str(_recording(folder)), "-o", str(output), "--force", *flags]
    # The packages are found from another folder as well.
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.Popen(
        [*before, sys.executable, *python, *arguments],
        cwd=folder,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


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
