"""`replay view`: look at what came of a run."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.exit_status import EXIT_DONE

USAGE = "OUT.rrd [OUT.rrd ...]"
DESCRIPTION = """\
Open Rerun recordings that `replay merge` wrote in Rerun's viewer, and wait until its window is closed.
The viewer comes with this program, and is kept off the network. It opens MCAP files as well.
"""
EPILOG = """\
examples:
  replay view out/floor.rrd
  replay view monday.rrd tuesday.rrd         both, to compare

exit status: 0 the window was closed; 2 bad usage, a file that cannot be opened, or no screen; 3 the viewer failed;
130 interrupted
"""


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add the recordings."""
    parser.add_argument("recordings", nargs="+", metavar="OUT.rrd", type=Path, help="a Rerun recording")


def run(options: argparse.Namespace) -> int:
    """Open the viewer, and wait for it."""
    from replay.viewer import view

    view(options.recordings)
    return EXIT_DONE
