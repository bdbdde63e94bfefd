"""Outputs that are refused before anything is read: those that are there, that are inputs, or that have no folder."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from replay.errors import OutputError, UsageError
from replay.options import OutputOptions
from replay.sinks import all_output_paths, output_paths, refuse_existing
from replay.sinks.partial_file import partial_name, recovering_name

_Identity = tuple[int, int]


def refuse_outputs(outputs: OutputOptions, inputs: Sequence[Path]) -> None:
    """Refuse outputs that could not be written at the end, or would cost an input.

    Raises
    ------
    ReplayError
        With the reason.
    """
    finals = all_output_paths(outputs).values()
    names = [name for path in finals for name in (path, partial_name(path))]
    refuse_inputs([*names, recovering_name(outputs.mcap)], inputs)
    refuse_existing(outputs)
    for path in output_paths(outputs).values():
        refuse_unwritable(path)


def refuse_inputs(paths: Iterable[Path], inputs: Sequence[Path]) -> None:
    """Refuse names that are those of inputs, by whatever link, or that lie in one."""
    folders = {path.resolve() for path in inputs}
    files = {identity for path in inputs for identity in _identities(path)}
    for path in paths:
        resolved = path.resolve()
        if {resolved, *resolved.parents} & folders or _identity(path) in files:
            raise UsageError(f"{path} is an input, or would be written into one; give another name with --output")


def refuse_unwritable(path: Path) -> None:
    """Refuse a name that no file can have."""
    if path.is_dir():
        raise OutputError(f"{path}: a folder has this name; remove it, or give another --output")
    folder = path.absolute().parent
    if not folder.is_dir():
        raise OutputError(f"{folder}: there is no such folder; make it, or choose another")


def _identities(path: Path) -> set[_Identity]:
    """Return which files an input is of; two names that are the same file have the same one."""
    parts = [path]
    with suppress(OSError):  # what cannot be listed is refused where it is read
        parts += path.iterdir()
    return {found for part in parts if (found := _identity(part)) is not None}


def _identity(path: Path) -> _Identity | None:
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino
