"""The command: prints the sections, line by line as they are measured."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.data import data_folder
from benchmarks.flags import count, folder, share
from benchmarks.speed import cold, growth, memory, pairs, replays, startup, warm
from benchmarks.speed.options import Options
from benchmarks.speed.timing import one_thread

SECTIONS: Mapping[str, tuple[str, Callable[[Options], Iterator[str]]]] = {
    "cold": ("Two large maps matched from nothing", cold.lines),
    "pairs": ("The simulated pairs of benchmarks.truth matched from nothing", pairs.lines),
    "warm": ("One more map, once the maps are merged", warm.lines),
    "replay": ("Whole recordings, against reading and writing alone", replays.lines),
    "memory": ("Most memory at once", memory.lines),
    "startup": ("How soon the program says something", startup.lines),
    "growth": ("Cost of an update, with cells and with robots", growth.lines),
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the sections that were asked for."""
    given = vars(_parser().parse_args(arguments))
    sections, work = given.pop("sections"), given.pop("work")
    data = data_folder()
    recordings = None if data is None else data / "real"
    if recordings is None and "replay" in sections:
        print("recordings: not measured, for they are absent; set REPLAY_DATA to their folder", file=sys.stderr)
    with one_thread(), TemporaryDirectory() as temporary:
        kept = Path(temporary) if work is None else work
        kept.mkdir(parents=True, exist_ok=True)
        show(sections, Options(work=kept, recordings=recordings, **given))


def show(sections: Sequence[str], options: Options) -> None:
    """Print sections."""
    for name in sections:
        title, lines = SECTIONS[name]
        print(f"\n{title}\n", flush=True)
        for line in lines(options):
            print(line, flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="How long things take, against simpler work on the same data.")
    parser.add_argument("--sections", nargs="+", choices=tuple(SECTIONS), default=tuple(SECTIONS))
    parser.add_argument("--work", type=folder, help="folder that keeps the recordings that are made; none by default")
    parser.add_argument("--huge", action="store_true", help="memory: also maps of 10 000 × 10 000 cells")
    told = {
        "sides": "cold: cells a side",
        "rounds": "how often things take turns",
        "share": "pairs: share of them, for a quick look",
        "warm_sides": "warm: cells a side",
        "side": "replay: cells a side of the mission",
        "updates": "replay: maps a robot of the mission",
        "memory_side": "memory: cells a side",
        "memory_updates": "memory: maps a robot",
        "growth_sides": "growth: cells a side, of two robots",
        "growth_robots": "growth: how many robots",
        "growth_side": "growth: cells a side, of several robots",
        "growth_updates": "growth: maps a robot",
    }
    defaults = {field.name: field.default for field in fields(Options)}
    for name, text in told.items():
        _add(parser, name, defaults[name], text)
    return parser


def _add(parser: argparse.ArgumentParser, name: str, default: object, text: str) -> None:
    """Add a flag for a number or for several, as the default is."""
    several = isinstance(default, tuple)
    kind = share if isinstance(default, float) else count
    flag = f"--{name.replace('_', '-')}"
    if several:
        parser.add_argument(flag, type=kind, nargs="+", default=default, help=text)
    else:
        parser.add_argument(flag, type=kind, default=default, help=text)


if __name__ == "__main__":
    main()
