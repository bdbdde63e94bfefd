"""Runs that are killed at any moment: what they leave is whole, or has no final name, and can be recovered.

Every other run replaces what an earlier one wrote, so that old and new files could be mixed.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random

from mcap.reader import make_reader

from replay.errors import InputError
from replay.recover import recover
from replay.sinks.partial_file import partial_name
from replay.sinks.publication import aside_name

SAMPLE = Path(__file__).resolve().parents[2] / "samples" / "two_robots.mcap"
FINALS = ("out.mcap", "out.rrd", "out.html", "out.json")

_POLL_S = 0.005
_PATIENCE_S = 300.0
_Message = tuple[str, int, bytes]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a killed run left.

    Parameters
    ----------
    replaces
        Whether there were outputs of an earlier run.
    killed
        Whether it was killed; False if it had ended before.
    left
        The names that it left.
    recovered
        How many messages could be recovered of its MCAP under the temporary name; None if there is none.
    broken
        The promises that are broken: none, if all is well.
    """

    replaces: bool
    killed: bool
    left: tuple[str, ...]
    recovered: int | None
    broken: tuple[str, ...]


def killed_runs(count: int, seed: int, folder: Path) -> list[Outcome]:
    """Start as many runs, kill each at a random moment, and look at what it left.

    Parameters
    ----------
    folder
        Where inputs and outputs are written; it may be there.
    """
    random = Random(seed)  # noqa: S311 - moments to choose, not secrets
    trial = _Trial.prepared(folder)
    return [trial.killed(random, replaces=index % 2 == 1) for index in range(count)]


@dataclass(frozen=True, slots=True)
class _Trial:
    """The recording, and what runs write that nobody disturbs: the one that is killed, and an earlier one."""

    folder: Path
    run: Path
    digest: str
    whole: Path
    older: Path
    messages: tuple[_Message, ...]
    writing_s: float

    @staticmethod
    def prepared(folder: Path) -> _Trial:
        run, whole, older = folder / "input" / "run.mcap", folder / "whole", folder / "older"
        for each in (run.parent, whole, older):
            each.mkdir(parents=True)
        shutil.copy(SAMPLE, run)
        if _started(run, older, "--images", "none", "--min-confidence", "0.9").wait(_PATIENCE_S):
            raise RuntimeError("the earlier run failed")
        process = _started(run, whole)
        _wait_for(whole / "out.mcap.partial", process)
        begin_s = time.perf_counter()
        if process.wait(_PATIENCE_S):
            raise RuntimeError("the run that nobody disturbs failed")
        writing_s = time.perf_counter() - begin_s
        return _Trial(folder, run, _digest(run), whole, older, tuple(_messages(whole / "out.mcap")), writing_s)

    def killed(self, random: Random, *, replaces: bool) -> Outcome:
        """Run, kill, and look."""
        out = self.folder / "out"
        shutil.rmtree(out, ignore_errors=True)
        if replaces:
            shutil.copytree(self.older, out)
        else:
            out.mkdir()
        process = _started(self.run, out, "--force")
        _wait_for(out / "out.mcap.partial", process)
        time.sleep(random.random() * self.writing_s)
        killed = process.poll() is None
        process.kill()
        process.wait(_PATIENCE_S)
        left = tuple(sorted(each.name for each in out.iterdir()))
        broken = list(self._broken(out, left))
        recovered = self._recovered(out, broken)
        broken += self._broken_later(out, with_page=not replaces)
        return Outcome(replaces, killed, left, recovered, tuple(broken))

    def _broken(self, out: Path, left: tuple[str, ...]) -> Iterator[str]:
        """Yield what is wrong with the final names."""
        temporary = {of(Path(name)).name for name in FINALS for of in (partial_name, aside_name)}
        if strange := set(left) - {*FINALS, *temporary}:
            yield f"there is {', '.join(sorted(strange))}"
        ages = {name: self._age(out / name) for name in FINALS if name in left}
        for name, age in ages.items():
            if age is None:
                yield f"{name} is neither of the earlier run nor whole"
        if len({*ages.values()}) > 1:
            yield f"new and old are mixed: {ages}"
        if "out.json" in ages and len(ages) < len(FINALS):
            yield "the report is there and the others are not"
        if _digest(self.run) != self.digest or [*self.run.parent.iterdir()] != [self.run]:
            yield "the input was changed"

    def _age(self, path: Path) -> str | None:
        """Return which run a file is of; None if it is no whole file of any."""
        content, name = path.read_bytes(), path.name
        older = self.older / name
        if older.exists() and content == older.read_bytes():
            return "old"
        if path.suffix == ".rrd":  # which is not the same to the byte in two runs
            return "new" if _is_whole_rrd(path) else None
        return "new" if content == (self.whole / name).read_bytes() else None

    def _recovered(self, out: Path, broken: list[str]) -> int | None:
        """Recover what has the temporary name; return how many messages that are."""
        partial, target = out / "out.mcap.partial", self.folder / "recovered.mcap"
        if not partial.exists():
            return None
        try:
            count = recover(partial, target, force=True).messages
        except InputError as error:
            if "nothing to recover" not in str(error):
                broken.append(str(error))
            return 0
        found = tuple(_messages(target))
        if len(found) != count or found != self.messages[:count]:
            broken.append("what was recovered is not what was written")
        return count

    def _broken_later(self, out: Path, *, with_page: bool) -> Iterator[str]:
        """Yield what is wrong with a run that follows."""
        if _started(self.run, out, "--force", "--no-rrd", with_page=with_page).wait(_PATIENCE_S):
            yield "a run that follows fails"
            return
        names = [*(["out.html"] if with_page else []), "out.json", "out.mcap"]
        if (left := sorted(each.name for each in out.iterdir())) != names:
            yield f"a run that follows leaves {', '.join(left)}"
        for name in set(names) & set(left):
            if (out / name).read_bytes() != (self.whole / name).read_bytes():
                yield f"a run that follows writes another {name}"


def _started(run: Path, out: Path, *flags: str, with_page: bool = True) -> subprocess.Popen[bytes]:
    page = ["--report", str(out / "out.html")] if with_page else []
    command = [sys.executable, "-m", "replay.cli", "merge", str(run), "-o", str(out / "out.mcap"), *page, *flags]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _wait_for(path: Path, process: subprocess.Popen[bytes]) -> None:
    """Wait until a run writes, or has ended."""
    while not path.exists() and process.poll() is None:
        time.sleep(_POLL_S)


def _messages(path: Path) -> Iterator[_Message]:
    with path.open("rb") as file:
        for _, channel, message in make_reader(file, validate_crcs=True).iter_messages(log_time_order=False):
            yield channel.topic, message.log_time, message.data


def _is_whole_rrd(path: Path) -> bool:
    from rerun.chunk import RrdReader

    try:
        RrdReader(path).store()
    except (RuntimeError, ValueError):
        return False
    return True


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
