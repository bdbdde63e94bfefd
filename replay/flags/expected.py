"""What is expected of a run, and where it is said whether that holds."""

from __future__ import annotations

import argparse
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from replay.errors import InputError, ReplayError, UsageError
from replay.flags.values import refuse_no_name

if TYPE_CHECKING:
    from collections.abc import Iterator

    from replay.checks.told import ToldFiles

_SAVED_MAPS = (".yaml", ".yml")
_OF_NO_MERGE = ("positional arguments", "what is expected", "what is said")
"""The groups of flags that say something of a run that was made before."""
_ANYWHERE = ("config", "set")
"""Flags that say others, which count instead."""


def add(parser: argparse.ArgumentParser) -> None:
    """Add the flags of what is expected."""
    group = parser.add_argument_group("what is expected")
    group.add_argument("--expect", metavar="EXPECT.yaml", type=Path, help="hold the outcome against this")
    group.add_argument(
        "--write-expect", metavar="EXPECT.yaml", type=Path, help="write what this run meets, with some leeway"
    )
    group.add_argument("--junit", metavar="OUT.xml", type=Path, help="write the findings as JUnit XML; replaces it")
    group.add_argument("--summary", metavar="FILE", help="append the findings to this file as Markdown")


def refuse_unfit(options: argparse.Namespace) -> None:
    """Refuse flags that do not fit together, or what is said of a merge where nothing is merged.

    Raises
    ------
    UsageError
        With those.
    """
    if (options.expect is None) == (options.write_expect is None):
        raise UsageError("give either --expect EXPECT.yaml or --write-expect EXPECT.yaml")
    if options.write_expect is not None and (options.junit or options.summary or options.json):
        raise UsageError("--junit, --summary and --json tell what was found: give them with --expect")
    useless = list(_useless(options)) if is_made_before(options) else []
    if useless:
        raise UsageError(f"{', '.join(useless)}: {options.runs[0]} is a run that was made before: nothing is merged")
    if options.report is not None and options.output is None:
        raise UsageError("--report stands beside what else a run writes: give --output OUT.mcap as well")


def is_made_before(options: argparse.Namespace) -> bool:
    """Tell whether it is a run that was made before; what cannot be read is refused where it is read."""
    from replay.report_file import holds_report

    with suppress(InputError):
        return len(options.runs) == 1 and holds_report(Path(options.runs[0]))
    return False


def told_files(options: argparse.Namespace) -> ToldFiles:
    """Return where findings are written.

    Raises
    ------
    ReplayError
        If a name is none, or one that could not be written in the end, or would replace what is read or what else is
        written.
    """
    from replay.checks.told import ToldFiles, refuse_unappendable
    from replay.outputs import refuse_alike, refuse_inputs, refuse_unwritable
    from replay.written_files import refuse_files, reserved_names

    if options.summary == "":
        raise UsageError('--summary: the name is empty; is the variable set, as "$GITHUB_STEP_SUMMARY" is in a job?')
    summary = Path(options.summary) if options.summary else None
    replaced = [path for path in (options.write_expect, options.junit) if path is not None]
    for flag, path in (("--write-expect", options.write_expect), ("--junit", options.junit), ("--summary", summary)):
        if path is not None:
            refuse_no_name(flag, path)
    appended = [summary] if summary is not None else []
    refuse_files(replaced, _inputs(options), force=options.force or options.write_expect is None)
    for path in appended:
        refuse_inputs([path], _inputs(options))
        refuse_unappendable(path)
        if not path.exists():
            refuse_unwritable(path.resolve())
    run = _reserved(options)
    if options.expect is not None:
        refuse_inputs(run, [options.expect])
    refuse_alike([run, *map(reserved_names, replaced), appended])
    return ToldFiles(options.junit, summary, ", ".join(Path(text).name for text in options.runs))


def _reserved(options: argparse.Namespace) -> tuple[Path, ...]:
    """Return all names that the outputs of the run take, if they are fit for any; what is not is refused later."""
    from replay.options import OutputOptions
    from replay.sinks import reserved_paths

    if options.output is None or options.output.suffix != ".mcap":
        return ()
    return reserved_paths(OutputOptions(options.output, html=options.report, force=options.force))


def _inputs(options: argparse.Namespace) -> list[Path]:
    """Return what is read, with the images of saved maps."""
    from replay.runs import RunPath
    from replay.sources import open_source

    paths = [RunPath.parse(text).path for text in options.runs]
    for path in [each for each in paths if each.suffix in _SAVED_MAPS]:
        with suppress(ReplayError), open_source(path) as source:  # what cannot be read is refused when it is merged
            paths += source.files
    return [*paths, *(path for path in (options.expect, options.config) if path is not None)]


def _useless(options: argparse.Namespace) -> Iterator[str]:
    """Yield what was said of how to merge, or what to write of that: flags, and settings by where they were said."""
    from replay.arguments import command_parser

    served = "json" if options.write_expect is None else "force"
    origins = getattr(options, "origins", {})
    for title, action in command_parser("check").grouped():
        if title in _OF_NO_MERGE or action.dest in (served, *_ANYWHERE):
            continue
        flag = action.option_strings[-1]
        if action.dest in options.given:
            yield flag
        elif flag in origins:
            yield origins[flag]
    for _, origin in getattr(options, "merge_fields", {}).values():
        yield origin
