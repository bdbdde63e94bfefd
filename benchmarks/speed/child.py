"""A process of its own: how long it takes, and how much memory at most.

``python -m benchmarks.speed.child ARGUMENTS`` is the program ``replay`` with these arguments, which writes to stderr,
as its last line, how much memory it had at most.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

_STATUS = Path("/proc/self/status")


@dataclass(frozen=True, slots=True)
class Ended:
    """What a process took.

    Parameters
    ----------
    wall_s, processor_s
        From its start to its end; processor time of all its threads.
    peak_bytes
        Most memory that was resident at once.
    """

    wall_s: float
    processor_s: float
    peak_bytes: int


def python(arguments: Sequence[str]) -> tuple[float, float, str]:
    """Run this Python with one thread of each library; return wall and processor time in seconds, and its stderr.

    Raises
    ------
    RuntimeError
        If it fails.
    """
    before_s, begin = _children_s(), perf_counter()
    environment = {**os.environ, "OPENCV_FOR_THREADS_NUM": "1", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, *arguments], env=environment, capture_output=True, text=True, check=False)
    wall_s, processor_s = perf_counter() - begin, _children_s() - before_s
    if done.returncode:
        raise RuntimeError(f"python {' '.join(arguments)} ended with {done.returncode}: {done.stderr.strip()}")
    return wall_s, processor_s, done.stderr


def _children_s() -> float:
    """Return the processor time of all processes that were started here and have ended."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def replay(arguments: Sequence[str]) -> Ended:
    """Run the program ``replay``."""
    wall_s, processor_s, said = python(["-m", __name__, *arguments])
    return Ended(wall_s, processor_s, int(said.split()[-1]))


def peak_bytes() -> int:
    """Return the most memory that this process had resident at once.

    What the system says of ended children is no use on Linux, where it includes what their parent had.
    """
    if _STATUS.exists():
        lines = _STATUS.read_text(encoding="ascii").splitlines()
        return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM"))
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else most * 1024


def main() -> int:
    """Run the program and say how much memory it had."""
    from replay.cli import main as run

    status = run(sys.argv[1:])
    print(f"\n{peak_bytes()}", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
