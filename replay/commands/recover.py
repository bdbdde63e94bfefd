"""`replay recover`: a readable MCAP of one that was cut off."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.exit_status import EXIT_DONE, interrupted_late
from replay.flags import talk
from replay.flags.values import mcap_path
from replay.plain_text import plain
from replay.standard_streams import say

USAGE = "FILE [options]"
DESCRIPTION = """\
Write what is whole of an MCAP that was cut off to a new one: of OUT.mcap.partial, which a run
that was killed left, or of any other recorder's. FILE is only read.
"""
EPILOG = """\
An MCAP, bag or .db3 that was cut off or is damaged can be given to `replay merge` as it is: it uses all whole messages.
What is recovered is for other programs.

examples:
  replay recover out/floor.mcap.partial              writes out/floor.mcap
  replay recover cut_off.mcap -o whole.mcap

exit status: 0 written, also where something is left out; 2 bad usage, or nothing can be recovered; 3 the new MCAP could
not be written, or a bug; 130 interrupted
"""


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add the file, and the flags of the new one."""
    parser.add_argument("file", metavar="FILE", type=Path, help="the MCAP that was cut off")
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT.mcap",
        type=Path,
        help="the new MCAP (default: FILE without .partial, or NAME.recovered.mcap in the current folder)",
    )
    parser.add_argument("--force", action="store_true", help="replace outputs that exist")
    talk.add_quiet(parser)


def run(options: argparse.Namespace) -> int:
    """Recover, and say what was found and what is left out."""
    from replay.recover import recover

    damaged, output = _paths(options)
    found = recover(damaged, output, force=options.force)
    try:
        for line in found.lines() if not options.quiet else ():
            say(f"replay: {plain(line)}")
    except KeyboardInterrupt:
        return interrupted_late()
    return EXIT_DONE


def _paths(options: argparse.Namespace) -> tuple[Path, Path]:
    """Return the file to recover, and the new one."""
    damaged: Path = options.file
    whole = damaged.with_suffix("") if damaged.suffix == ".partial" else None
    default = whole if whole and whole.suffix == ".mcap" else Path(f"{damaged.stem}.recovered.mcap")
    return damaged, mcap_path(options.output or default)
