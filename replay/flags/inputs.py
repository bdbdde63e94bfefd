"""Which recordings are read, whose maps, and of which times; and all that a run is told."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from replay.errors import UsageError
from replay.flags import placing, rules
from replay.flags.values import read_flag

if TYPE_CHECKING:
    from replay.options import RunOptions, TrajectoryChoice


def add(parser: argparse.ArgumentParser, *config_names: str) -> None:
    """Add recordings, the flags of what is read of them, and files of settings, which all commands that do so take."""
    parser.add_argument(
        "runs",
        nargs="*",
        default=[],
        metavar="RUN",
        help="a recording, as PATH or ROBOT=PATH: .bag, ROS 2 bag folder, .db3, .mcap, any of these "
        "files compressed with zstd, or a saved map's .yaml",
    )
    add_settings(parser, *config_names)
    group = parser.add_argument_group("which maps")
    group.add_argument(
        "--robots", metavar="R1,R2,…", help="robots to merge, the reference first (default: all, by name)"
    )
    group.add_argument(
        "--topic",
        action="append",
        default=[],
        metavar="[ROBOT=]TOPIC",
        help="map topic, for one robot or with {robot} for all; may be repeated",
    )
    times = parser.add_argument_group("time")
    times.add_argument(
        "--clock",
        choices=("header", "log"),
        default="header",
        help="what times are taken from; log is used where headers have none (default: %(default)s)",
    )
    times.add_argument(
        "--start",
        metavar="TIME",
        help="begin at this time, with the last map before it: seconds after the first map, nanoseconds since 1970 "
        "with ns, or ISO 8601, UTC unless it names a zone; what is said of times, as +2.0 s, counts from there",
    )
    times.add_argument("--stop", metavar="TIME", help="use maps before this time")
    times.add_argument(
        "--reorder-window",
        metavar="SECONDS",
        default="5",
        help="put messages in order of time within this window (default: %(default)s)",
    )
    times.add_argument(
        "--align-starts",
        action="store_true",
        help="let all recordings begin together, on the reference's clock: for clocks that cannot be the same",
    )


def add_settings(parser: argparse.ArgumentParser, *names: str) -> None:
    """Add the flags that say settings, the file by these other names, too."""
    parser.add_argument(
        "-c",
        "--config",
        *names,
        metavar="FILE",
        type=Path,
        help="take settings from this file: TOML, as `replay config` prints it, or a run's .json or .mcap; flags win",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="set one of them, also those without a flag, such as merge.verify.min_overlap_m2=4; may be repeated",
    )


def run_options(options: argparse.Namespace, *, needs_runs: bool = True) -> RunOptions:
    """Return what is to be read and how it is to be merged; of flags that a command lacks, the defaults.

    Raises
    ------
    UsageError
        If something of that cannot be understood, or no recording is given.
    """
    if needs_runs:
        refuse_no_runs(options)
    from replay.footprint import size_to_bytes
    from replay.options import RunOptions, TimeBound, seconds_to_ns
    from replay.runs import RunPath, TopicChoice

    placed = placing.placing_options(options) if hasattr(options, "method") else {}
    return RunOptions(
        runs=tuple(RunPath.parse(text) for text in options.runs),
        robots=robot_names(options.robots),
        topics=tuple(TopicChoice.parse(text) for text in options.topic),
        clock=options.clock,
        start=read_flag("--start", options.start, TimeBound.parse) if options.start is not None else None,
        stop=read_flag("--stop", options.stop, TimeBound.parse) if options.stop is not None else None,
        reorder_window_ns=read_flag("--reorder-window", options.reorder_window, seconds_to_ns),
        align_starts=options.align_starts,
        strict=getattr(options, "strict", False),
        images=getattr(options, "images", "none"),
        max_memory_bytes=(
            read_flag("--max-memory", options.max_memory, size_to_bytes) if options.max_memory is not None else None
        ),
        trajectories=_trajectories(options),
        jobs=rules.jobs(options.jobs) if hasattr(options, "jobs") else 1,
        **placed,
    )


def _trajectories(options: argparse.Namespace) -> TrajectoryChoice:
    """Return of which recordings it is read where robots drove: of none where no output shows it."""
    is_shown = not getattr(options, "no_rrd", True) or getattr(options, "report", None) is not None
    return getattr(options, "trajectories", "none") if is_shown else "none"


def refuse_no_runs(options: argparse.Namespace) -> None:
    """Refuse a command line that names no recording, if no file of settings does."""
    if not options.runs:
        example = f"replay {options.command} run.mcap"
        raise UsageError(f"RUN is missing; expected one recording or more, PATH or ROBOT=PATH, such as `{example}`")


def robot_names(text: str | None) -> tuple[str, ...] | None:
    """Return the names that ``--robots`` says; None for all."""
    if text is None:
        return None
    names = tuple(name.strip() for name in text.split(","))
    if not all(names) or len(set(names)) != len(names):
        raise UsageError(f"--robots {text}: expected names with commas between them, each once, such as r1,r2")
    return names
