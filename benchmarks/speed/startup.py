"""How soon the program says something: ``replay --help`` against a Python that does nothing."""

from __future__ import annotations

from collections.abc import Iterator
from statistics import median

from benchmarks.speed.child import python
from benchmarks.speed.options import Options
from benchmarks.speed.printed import Table, at_most, ratio, seconds

MOST = 4.0
_RUNS_A_ROUND = 4
_SCRIPT = "import sys; from replay.cli import main; sys.exit(main())"
_PROGRAMS = {
    "python -c pass": ("-c", "pass"),
    "replay --help": ("-c", _SCRIPT, "--help"),
    "replay merge --help": ("-c", _SCRIPT, "merge", "--help"),
}
TABLE = Table(24, ("program", "wall", "processor", "ratio"))


def lines(options: Options) -> Iterator[str]:
    """Yield the lines of the section: the programs take turns; the first round does not count."""
    spent: dict[str, list[tuple[float, float]]] = {name: [] for name in _PROGRAMS}
    for number in range(_RUNS_A_ROUND * options.rounds + 1):
        for name, arguments in _PROGRAMS.items():
            wall_s, processor_s, _ = python(arguments)
            if number:
                spent[name].append((wall_s, processor_s))
    yield TABLE.header
    medians = {name: [median(column) for column in zip(*runs, strict=True)] for name, runs in spent.items()}
    empty_s = medians["python -c pass"][0]
    for name, (wall_s, processor_s) in medians.items():
        yield TABLE.row(name, seconds(wall_s), seconds(processor_s), ratio(wall_s / empty_s))
    yield at_most("replay --help, to an empty Python", medians["replay --help"][0] / empty_s, MOST)
