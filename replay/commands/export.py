"""`replay export`: maps for map_server, pictures, and transforms."""

from __future__ import annotations

import argparse
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING

from replay.errors import UsageError
from replay.exit_status import EXIT_DONE
from replay.export import MODES, TARGETS, TRANSFORMS
from replay.flags.inputs import robot_names
from replay.flags.values import read_flag, refuse_no_name
from replay.plain_text import escaped, plain
from replay.standard_streams import printing, say

if TYPE_CHECKING:
    from collections.abc import Sequence

    from replay.events import Noted, Skipped
    from replay.export.maps import Maps
    from replay.options import TimeBound
    from replay.run_result import RunResult

USAGE = "FILE [options]"
DESCRIPTION = """\
Write a map in a form that other programs take: the merged map of OUT.mcap, a robot's map at its place in the merged
frame, or any map of any recording; or print where the robots' maps lie, as static transforms. FILE is only read.
"""
EPILOG = """\
map_server is the .yaml and .pgm that nav2's map_saver writes, and map_server, also that of ROS 1, loads; png is a
picture in the colours of RViz; tf is a line for the shell for each robot, printed unless --output says where to.

examples:
  replay export out/floor.mcap                               writes floor.yaml and floor.pgm
  replay export out/floor.mcap --at 120 --to png -o early.png
  replay export out/floor.mcap --robots r2 --maps run.mcap   r2's own map at its place
  replay export out/floor.mcap --to tf
  replay export run.bag --topic /r1/map -o r1

exit status: 0 written; 2 bad usage, or an input that cannot be read; 3 an output could not be written, or a bug;
130 interrupted
"""

_NO_TURN_DEG = 1e-6
_ROS = ("1", "2")


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add what is read, what is chosen of it, and what is written."""
    parser.add_argument(
        "file", metavar="FILE", type=Path, help="OUT.mcap, or any recording with maps; for tf, OUT.json as well"
    )
    parser.add_argument(
        "--to",
        choices=(*TARGETS, TRANSFORMS),
        default="map_server",
        help="in which form (default: %(default)s)",
    )
    which = parser.add_argument_group("which maps")
    which.add_argument("--topic", metavar="TOPIC", help="the map's topic (default: /merged/map, or the only one)")
    which.add_argument(
        "--at",
        metavar="TIME",
        help="the map as of this time, instead of the last: seconds after the first map, nanoseconds since 1970 with "
        "ns, or ISO 8601, UTC unless it names a zone",
    )
    which.add_argument(
        "--robots", metavar="R1,R2,…", help="these robots' own maps, each at its place on the cells of the merged map"
    )
    which.add_argument(
        "--maps",
        metavar="RUN",
        action="append",
        default=[],
        help="a recording that was merged, as PATH or ROBOT=PATH, to take the robots' maps from if FILE has none (it "
        "has with `replay merge --copy-maps`); give all that were merged",
    )
    outputs = parser.add_argument_group("outputs")
    outputs.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        type=Path,
        help="name of what is written, with or without its ending; of several robots, each one's name is put behind it "
        "(default: FILE's name in the current folder)",
    )
    outputs.add_argument("--force", action="store_true", help="replace outputs that exist")
    outputs.add_argument(
        "--mode",
        choices=MODES,
        help="of map_server: occupied, free and unknown alone; percentages as shades of a PNG; or as they are "
        f"(default: {MODES[0]})",
    )
    outputs.add_argument("--ros", choices=_ROS, help=f"of tf: for which ROS the lines are (default: {_ROS[-1]})")


def run(options: argparse.Namespace) -> int:
    """Export, and say what was written."""
    from replay.options import TimeBound

    at = read_flag("--at", options.at, TimeBound.parse) if options.at is not None else None
    _refuse_useless(options)
    if options.output is not None:
        endings = () if options.to == TRANSFORMS else TARGETS[options.to].suffixes
        refuse_no_name("--output", options.output, endings, "floor")
    return _transforms(options, at) if options.to == TRANSFORMS else _maps(options, at)


def _refuse_useless(options: argparse.Namespace) -> None:
    """Refuse flags that the others leave nothing to say."""
    robot_names(options.robots)
    is_tf = options.to == TRANSFORMS
    if options.maps and (options.robots is None or is_tf):
        raise UsageError("--maps is where robots' maps are taken from; say whose, as --robots r2, and not with --to tf")
    if options.topic is not None and (options.robots is not None or is_tf):
        raise UsageError("--topic names one map as it is recorded; leave it out with --robots and with --to tf")
    if options.mode is not None and options.to != "map_server":
        raise UsageError(f"--mode is how map_server maps hold cells; leave it out with --to {options.to}")
    if options.ros is not None and not is_tf:
        raise UsageError("--ros is for which ROS transforms are; leave it out, or give --to tf")


def _transforms(options: argparse.Namespace, at: TimeBound | None) -> int:
    from replay.export.transforms import lines
    from replay.written_files import refuse_files, write_files

    if options.output is not None:
        refuse_files([options.output], [options.file], force=options.force)
    result = _run_result(options.file, _within(options, at))
    found = list(lines(result, _robots(options, result) or tuple(result.robots), int(options.ros or _ROS[-1])))
    if options.output is not None:
        content = "".join(f"{line}\n" for line in found)
        write_files({options.output: content.encode()}, force=options.force)
        say(f"replay: wrote {escaped(str(options.output))}")
        return EXIT_DONE
    with printing():
        for line in found:
            print(line)
    return EXIT_DONE


def _maps(options: argparse.Namespace, at: TimeBound | None) -> int:
    from replay.export import writer
    from replay.written_files import refuse_files, write_files

    found = _chosen(options, at)
    write = writer(options.to)
    contents: dict[Path, bytes] = {}
    stems = _stems(options, list(found.grids))
    for name, grid in found.grids.items():
        contents |= write(grid, stems[name], options.mode or MODES[0])
    refuse_files(list(contents), [options.file, *found.files], force=options.force)
    write_files(contents, force=options.force)
    _tell(found, [str(path) for path in contents], options)
    return EXIT_DONE


def _chosen(options: argparse.Namespace, at: TimeBound | None) -> Maps:
    from replay.export.maps import one_map
    from replay.export.merged import merged_map
    from replay.export.placed import placed_maps
    from replay.report_file import holds_report
    from replay.runs import RunPath

    is_run = holds_report(options.file)
    at = _within(options, at) if is_run else at
    if options.robots is not None:
        result = _run_result(options.file, at)
        recordings = [RunPath.parse(text) for text in options.maps]
        return placed_maps(result, _robots(options, result), recordings, at, _say)
    if options.file.suffix == ".json" and is_run:
        raise UsageError(f"{options.file}: a report holds no map; give OUT.mcap, or --robots and --maps")
    if is_run and options.topic is None:
        found, missing = merged_map(options.file, at, _say)
        if missing:
            say(f"replay: {missing}")
        return found
    return one_map(options.file, options.topic, at, _say)


def _within(options: argparse.Namespace, at: TimeBound | None) -> TimeBound | None:
    """Return a time of a run as one since 1970; say so if the run ended before it."""
    from replay.report_file import holds_mcap, read_report, since_1970

    if at is None or not holds_mcap(options.file):
        return at
    report = read_report(options.file)
    absolute = since_1970(options.file, report, at)
    if report["stamp_ns"] is not None and absolute.ns > report["stamp_ns"]:
        from replay.words import moment

        say(f"replay: --at {options.at} is after the run, which ends at {moment(report['stamp_ns'])}: as of its end")
    return absolute


def _run_result(path: Path, at: TimeBound | None) -> RunResult:
    from replay.report_file import read_report
    from replay.run_result import RunResult

    return RunResult.of(read_report(path, at), path)


def _robots(options: argparse.Namespace, result: RunResult) -> tuple[str, ...]:
    """Return the robots that were named."""
    names = robot_names(options.robots) or ()
    unknown = [name for name in names if name not in result.robots]
    if unknown:
        raise UsageError(
            f"--robots {options.robots}: there is no robot {unknown[0]!r}; there are {', '.join(result.robots)}"
        )
    return names


def _stems(options: argparse.Namespace, robots: Sequence[str]) -> dict[str, Path]:
    """Return the paths of the files of each map, without their endings, no two alike."""
    file: Path = options.file
    path = options.output or Path(file.name if file.is_file() else file.resolve().name)
    known = TARGETS[options.to].suffixes if options.output is not None else (path.suffix,)
    name = path.name.removesuffix(path.suffix) if path.suffix and path.suffix in known else path.name
    if len(robots) == 1:
        return {robots[0]: path.with_name(name)}
    parts: dict[str, str] = {}
    for robot in robots:
        part = re.sub(r"[^\w.-]", "_", robot)
        while part in parts.values():
            part += "_"
        parts[robot] = part
    return {robot: path.with_name(f"{name}.{part}") for robot, part in parts.items()}


def _say(event: Skipped | Noted) -> None:
    from replay.export.maps import told

    say(f"replay: {told(event)}")


def _tell(found: Maps, paths: Sequence[str], options: argparse.Namespace) -> None:
    from replay.words import moment

    when = f", as of {moment(found.stamp_ns)}" if found.stamp_ns else ""
    for name, grid in found.grids.items():
        turn_deg = math.degrees(grid.map_from_grid.yaw_rad)
        whose = f"{plain(name)}: " if options.robots is not None else ""
        say(f"replay: {whose}{grid.cols} × {grid.rows} cells of {grid.resolution_m:g} m{when}")
        if not grid.known.any():
            say("replay: nothing is known in it: it is the map of a time when there was none")
        if options.to == "map_server" and abs(turn_deg) > _NO_TURN_DEG:
            say(f"replay: its origin is turned by {turn_deg:.2f}°; nav2's costmaps and AMCL take no notice of that")
    say(f"replay: wrote {', '.join(plain(path) for path in paths)}")
