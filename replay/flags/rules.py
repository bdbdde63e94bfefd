"""What a run may use, and when it ends with an error."""

from __future__ import annotations

import argparse
import os
import re

from replay.errors import UsageError


def add(parser: argparse.ArgumentParser) -> argparse._ArgumentGroup:
    """Add the flags of what a run may use, and of when it fails; return their group, for those of one command."""
    rules = parser.add_argument_group("rules")
    rules.add_argument(
        "--jobs",
        metavar="N",
        help="threads that work at once, for reading, matching and writing; outputs are the same (default: one for "
        "each processor)",
    )
    rules.add_argument(
        "--max-memory",
        metavar="SIZE",
        help="skip maps, and refuse placements, for which a robot's map or the merged map would by itself need more "
        "memory than this, such as 2GiB or 500MB, and what of a recording is larger to read at once (default: any map, "
        "merged maps of up to 10⁹ cells, and chunks and messages of up to 1 GiB)",
    )
    rules.add_argument(
        "--strict",
        action="store_true",
        help="end with an error at the first message that is unusable, and at damage of a recording, even if that "
        "costs no message",
    )
    return rules


def add_all(parser: argparse.ArgumentParser) -> None:
    """Add these flags, and that of a run which must merge all."""
    add(parser).add_argument(
        "--require-all", action="store_true", help="exit with 1 unless two robots or more were merged, all"
    )


def jobs(text: str | None) -> int:
    """Return how many threads are to work at once; those that there are processors for, if nothing is said."""
    if text is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if not re.fullmatch(r"[0-9]{1,3}", text) or not int(text):
        raise UsageError(f"--jobs {text}: expected a number of threads, 1 to 999")
    return int(text)
