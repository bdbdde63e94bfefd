"""Flags: what there is, and the options that they stand for."""

from __future__ import annotations

import argparse
import math
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from replay import __version__
from replay.errors import InputError, UsageError

if TYPE_CHECKING:
    from replay.options import OutputOptions, RunOptions

_Value = TypeVar("_Value")

_EXAMPLES = """\
examples:
  replay info run.mcap
  replay merge run.mcap --robots r1,r2
  replay merge alpha=alpha_bag/ bravo=bravo_bag/ -o out/floor.mcap
  replay merge today.mcap old=map.yaml --robots r1,old --require-all
  replay recover out/floor.mcap.partial
"""

_MERGE_EXAMPLES = """\
examples:
  replay merge run.mcap --robots r1,r2       r1 is the reference: its map frame becomes the merged frame
  replay merge a=alpha.bag b=bravo/          one recording a robot, whatever its map topic is called
  replay merge run.mcap --topic '/{robot}/slam/map'
  replay merge run.mcap --start 60 --stop 300 --no-rrd --json
  replay merge run.mcap --init-pose r2=4.5,-1.2,90deg+-0.5,+-0.5,+-5deg

exit status: 0 done; 1 a robot was not merged and --require-all was given; 2 bad usage or input;
3 an output could not be written, or a bug; 130 interrupted
"""

_INFO_STATUS = """\
exit status: 0 listed, also where nothing would be merged or something is lost; 2 bad usage, or an input that cannot be
read at all; 3 the list could not be written, or a bug; 130 interrupted
"""

_RECOVER_STATUS = """\
An MCAP, bag or .db3 that was cut off or is damaged can be given to `replay merge` as it is: it uses all whole messages.
What is recovered is for other programs.

exit status: 0 written, also where something is left out; 2 bad usage, or nothing can be recovered; 3 the new MCAP could
not be written, or a bug; 130 interrupted
"""


class _Help(argparse.RawDescriptionHelpFormatter):
    """Help that reads the same in every version of Python: docs/cli.md is checked against it."""

    def _format_action_invocation(self, action: argparse.Action) -> str:
        if not action.option_strings or action.nargs == 0:
            return super()._format_action_invocation(action)
        value = self._format_args(action, self._get_default_metavar_for_optional(action))
        return f"{', '.join(action.option_strings)} {value}"


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line; it imports nothing heavy."""
    program = argparse.ArgumentParser(
        prog="replay",
        usage="replay COMMAND ...",
        description="Merge the occupancy grid maps that several robots recorded, offline, at each timestamp.",
        epilog=_EXAMPLES,
        formatter_class=_Help,
        allow_abbrev=False,
    )
    program.add_argument("--version", action="version", version=f"replay {__version__}")
    commands = program.add_subparsers(prog="replay", dest="command", metavar="COMMAND", required=True)
    merge = commands.add_parser(
        "merge",
        help="merge the maps of a recording and write what came of it",
        usage="replay merge RUN [RUN ...] [options]",
        description="Merge the maps of one or more recordings at each timestamp, and write the outcome to a new MCAP,\n"
        "a Rerun recording and a JSON report.",
        epilog=_MERGE_EXAMPLES,
        formatter_class=_Help,
        allow_abbrev=False,
    )
    _input_arguments(merge)
    _placing_arguments(merge)
    _output_arguments(merge)
    info = commands.add_parser(
        "info",
        help="list what recordings hold and what would be merged",
        usage="replay info RUN [RUN ...] [options]",
        description="List format, duration, map topics, messages, sizes and resolutions of recordings,\n"
        "and what would be merged.",
        epilog=_INFO_STATUS,
        formatter_class=_Help,
        allow_abbrev=False,
    )
    _input_arguments(info)
    info.add_argument(
        "--max-memory",
        metavar="SIZE",
        help="leave out what of a recording is larger to read at once, such as 500MB (default: 1 GiB)",
    )
    _recover_command(commands)
    return program


def _recover_command(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    recover = commands.add_parser(
        "recover",
        help="make a readable MCAP of one that was cut off, such as OUT.mcap.partial",
        usage="replay recover FILE [options]",
        description="Write what is whole of an MCAP that was cut off to a new one: of OUT.mcap.partial, which a "
        "run\nthat was killed left, or of any other recorder's. FILE is only read.",
        epilog=_RECOVER_STATUS,
        formatter_class=_Help,
        allow_abbrev=False,
    )
    recover.add_argument("file", metavar="FILE", type=Path, help="the MCAP that was cut off")
    recover.add_argument(
        "-o",
        "--output",
        metavar="OUT.mcap",
        type=Path,
        help="the new MCAP (default: FILE without .partial, or NAME.recovered.mcap in the current folder)",
    )
    recover.add_argument("--force", action="store_true", help="replace outputs that exist")


def _input_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "runs",
        nargs="+",
        metavar="RUN",
        help="a recording, as PATH or ROBOT=PATH: .bag, ROS 2 bag folder, .db3, .mcap, any of these "
        "files compressed with zstd, or a saved map's .yaml",
    )
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
        "with ns, or ISO 8601, UTC unless it names a zone",
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


def _placing_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("how maps are placed")
    group.add_argument(
        "--method",
        metavar="NAME",
        default="correlation",
        help="how two maps are matched: correlation, existing or paper (default: %(default)s)",
    )
    group.add_argument(
        "--scale",
        choices=("metadata", "free"),
        default="metadata",
        help="believe the maps' resolutions, or estimate how far their ratio is off, 0.4 to 2.5 times "
        "(default: %(default)s)",
    )
    group.add_argument(
        "--min-confidence",
        metavar="P",
        default="0.92",
        help="least probability that a placement is right (default: %(default)s; how many are wrong at each: "
        "docs/benchmarks.md); the methods existing and paper state none and ignore it",
    )
    group.add_argument(
        "--init-pose",
        action="append",
        default=[],
        metavar="R=X,Y,YAW[±SX,±SY,±SYAW]",
        help="where R's map frame lies in the reference's, metres and radians, or degrees with deg or °; the spread is "
        "a standard deviation, placements within 3 are searched; +- does for ± (default spread: 1 m, 1 m, 10°); "
        "may be repeated",
    )
    group.add_argument(
        "--use-tf",
        action="store_true",
        help="take such poses from transforms between map frames in /tf and /tf_static (spread: 0.5 m, 0.5 m, 5°)",
    )


def _output_arguments(parser: argparse.ArgumentParser) -> None:
    outputs = parser.add_argument_group("outputs")
    outputs.add_argument(
        "-o",
        "--output",
        metavar="OUT.mcap",
        type=Path,
        help="the new MCAP, with OUT.rrd and OUT.json beside it (default: NAME.merged.mcap in the current folder)",
    )
    outputs.add_argument("--no-rrd", action="store_true", help="write no Rerun recording")
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
    outputs.add_argument("--json", action="store_true", help="print the report instead of a table")
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
    rules.add_argument(
        "--require-all", action="store_true", help="exit with 1 unless two robots or more were merged, all"
    )


def run_options(options: argparse.Namespace) -> RunOptions:
    """Return what is to be read and how it is to be merged."""
    from replay.footprint import size_to_bytes
    from replay.options import RunOptions, TimeBound, seconds_to_ns
    from replay.runs import RunPath, TopicChoice

    placing = _placing_options(options) if options.command == "merge" else {}
    return RunOptions(
        runs=tuple(RunPath.parse(text) for text in options.runs),
        robots=_robots(options.robots),
        topics=tuple(TopicChoice.parse(text) for text in options.topic),
        clock=options.clock,
        start=_read("--start", options.start, TimeBound.parse) if options.start is not None else None,
        stop=_read("--stop", options.stop, TimeBound.parse) if options.stop is not None else None,
        reorder_window_ns=_read("--reorder-window", options.reorder_window, seconds_to_ns),
        align_starts=options.align_starts,
        strict=getattr(options, "strict", False),
        images=getattr(options, "images", "none"),
        max_memory_bytes=(
            _read("--max-memory", options.max_memory, size_to_bytes) if options.max_memory is not None else None
        ),
        **placing,
    )


def _read(flag: str, text: str, parse: Callable[[str], _Value]) -> _Value:
    """Return what a flag says; of what it cannot say, tell which flag it was."""
    try:
        return parse(text)
    except UsageError as error:
        raise UsageError(f"{flag}: {error}") from error


def _placing_options(options: argparse.Namespace) -> dict[str, Any]:
    """Return how maps are placed, as keywords of `RunOptions`."""
    from mapmerge.config import MergeConfig, VerifyConfig
    from mapmerge.errors import ConfigError
    from mapmerge.match import MATCHERS
    from replay.init_pose import InitPose

    if options.method not in MATCHERS:
        raise UsageError(f"--method {options.method}: there is no such method; expected {', '.join(MATCHERS)}")
    verify = VerifyConfig(min_confidence=_probability(options.min_confidence))
    try:
        merge = MergeConfig(method=options.method, scale=options.scale, verify=verify)
    except ConfigError as error:
        raise UsageError(f"--min-confidence {options.min_confidence}: {error}") from error
    return {
        "init_poses": tuple(InitPose.parse(text) for text in options.init_pose),
        "use_tf": options.use_tf,
        "merge": merge,
        "jobs": _jobs(options.jobs),
    }


def _jobs(text: str | None) -> int:
    """Return how many threads are to work at once; those that there are processors for, if nothing is said."""
    if text is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if not re.fullmatch(r"[0-9]{1,3}", text) or not int(text):
        raise UsageError(f"--jobs {text}: expected a number of threads, 1 to 999")
    return int(text)


def _probability(text: str) -> float:
    try:
        probability = float(text)
    except ValueError:
        probability = math.nan
    if not 0.0 < probability < 1.0:
        raise UsageError(f"--min-confidence {text}: expected a probability above 0 and below 1, such as 0.99")
    return probability


def _robots(text: str | None) -> tuple[str, ...] | None:
    if text is None:
        return None
    names = tuple(name.strip() for name in text.split(","))
    if not all(names) or len(set(names)) != len(names):
        raise UsageError(f"--robots {text}: expected names with commas between them, each once, such as r1,r2")
    return names


def recovery_paths(options: argparse.Namespace) -> tuple[Path, Path]:
    """Return the file to recover, and the new one."""
    damaged: Path = options.file
    whole = damaged.with_suffix("") if damaged.suffix == ".partial" else None
    default = whole if whole and whole.suffix == ".mcap" else Path(f"{damaged.stem}.recovered.mcap")
    return damaged, _mcap(options.output or default)


def _mcap(path: Path) -> Path:
    if path.suffix != ".mcap":
        raise UsageError(f"--output {path}: expected a name that ends in .mcap")
    return path


def output_options(options: argparse.Namespace, run: RunOptions) -> OutputOptions:
    """Return what is to be written."""
    from replay.options import OutputOptions, seconds_to_ns
    from replay.path_errors import path_errors

    first = run.runs[0].path
    with path_errors(first, InputError):
        stem = first.resolve().name if first.is_dir() else first.stem
    return OutputOptions(
        mcap=_mcap(options.output or Path(f"{stem}.merged.mcap")),
        rrd=not options.no_rrd,
        every_ns=_read("--every", options.every, seconds_to_ns),
        copy_maps=options.copy_maps,
        force=options.force,
    )
