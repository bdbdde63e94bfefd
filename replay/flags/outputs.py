"""What is written."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from replay.errors import InputError
from replay.flags.values import html_path, mcap_path, read_flag

if TYPE_CHECKING:
    from replay.options import OutputOptions, RunOptions


def add(parser: argparse.ArgumentParser) -> None:
    """Add the flags of what is written."""
    outputs = parser.add_argument_group("outputs")
    outputs.add_argument(
        "-o",
        "--output",
        metavar="OUT.mcap",
        type=Path,
        help="the new MCAP, with OUT.rrd and OUT.json beside it (default: NAME.merged.mcap in the current folder)",
    )
    outputs.add_argument(
        "--report",
        metavar="OUT.html",
        type=Path,
        help="write what came of it as one page to look at in a browser, with pictures and plots; it needs no network",
    )
    outputs.add_argument("--no-rrd", action="store_true", help="write no Rerun recording")
    outputs.add_argument(
        "--view", action="store_true", help="open Rerun's viewer, and show the recording while it is written"
    )
    outputs.add_argument("--force", action="store_true", help="replace outputs that exist")
    outputs.add_argument(
        "--every",
        metavar="SECONDS",
        default="0",
        help="least time between two merged maps in the MCAP; the last is always written (default: at each change)",
    )
    outputs.add_argument("--copy-maps", action="store_true", help="copy the robots' own maps to the MCAP")
    outputs.add_argument(
        "--images",
        choices=("none", "changed", "all"),
        default="changed",
        help="which intermediate images are written (default: %(default)s)",
    )
    outputs.add_argument(
        "--trajectories",
        choices=("none", "auto", "all"),
        default="auto",
        help="read from /tf where robots drove, to show it in the Rerun recording and on the page: of no recording, of "
        "those of up to 64 MiB and 20 000 messages of transforms that are not compressed as files, or of all, however "
        "long that takes (default: %(default)s)",
    )
    outputs.add_argument("--json", action="store_true", help="print the report instead of a table")


def output_options(options: argparse.Namespace, run: RunOptions) -> OutputOptions:
    """Return what is to be written."""
    from replay.options import OutputOptions, seconds_to_ns
    from replay.path_errors import path_errors

    first = run.runs[0].path
    with path_errors(first, InputError):
        stem = first.resolve().name if first.is_dir() else first.stem
    return OutputOptions(
        mcap=mcap_path(options.output or Path(f"{stem}.merged.mcap")),
        rrd=not options.no_rrd,
        html=None if options.report is None else html_path(options.report),
        every_ns=read_flag("--every", options.every, seconds_to_ns),
        copy_maps=options.copy_maps,
        force=options.force,
    )
