"""Outputs that are refused before anything is written: those that are there, are inputs, or have no folder."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from replay.errors import InputError, OutputError, ReplayError, UsageError
from replay.options import OutputOptions
from replay.path_errors import path_errors
from replay.sinks import refuse_existing, reserved_paths
from replay.sinks.publication import why_irreplaceable

_Identity = tuple[int, int]


def refuse_outputs(outputs: OutputOptions, inputs: Sequence[Path]) -> None:
    """Refuse outputs that could not be written at the end, or would cost an input.

    Raises
    ------
    ReplayError
        With the reason.
    """
    reserved = reserved_paths(outputs)
    refuse_inputs(reserved, inputs)
    refuse_irreplaceable(reserved)
    refuse_existing(outputs)
    for path in reserved:
        refuse_unwritable(path)


def refuse_inputs(paths: Iterable[Path], inputs: Sequence[Path]) -> None:
    """Refuse names that are those of inputs, by whatever link, or that lie in one."""
    folders = {_resolved(path, InputError) for path in inputs}
    files = {identity for path in inputs for identity in _identities(path)}
    for path in paths:
        resolved = _resolved(path, OutputError)
        if {resolved, *resolved.parents} & folders or _identity(path) in files:
            raise UsageError(f"{path} is an input, or would be written into one; give another name")


def refuse_alike(outputs: Sequence[Sequence[Path]]) -> None:
    """Refuse outputs that would replace each other, by whatever link.

    Parameters
    ----------
    outputs
        Of each output, or of each set of them that goes together, all names that it takes.
    """
    taken: dict[Path | _Identity, Path] = {}
    for paths in outputs:
        for path in paths:
            for key in (_resolved(path, OutputError), _identity(path)):
                if key is not None and key in taken:
                    raise UsageError(f"{path} is taken by another output, {taken[key]}; give another name")
        for path in paths:
            taken |= {key: path for key in (_resolved(path, OutputError), _identity(path)) if key is not None}


def refuse_irreplaceable(paths: Iterable[Path]) -> None:
    """Refuse names that links, pipes and devices have: they are neither written to nor replaced, whatever is said."""
    for path in paths:
        with path_errors(path, OutputError):
            why = None if _is_folder(path) else why_irreplaceable(path)
        if why:
            raise UsageError(f"{path}: {why}")


def refuse_unwritable(path: Path) -> None:
    """Refuse a name that no file can have."""
    with path_errors(path, OutputError):
        if why := why_irreplaceable(path):
            raise OutputError(f"{path}: {why}")
        folder = path.absolute().parent
        if not folder.is_dir():
            raise OutputError(f"{folder}: there is no such folder; make it, or choose another")


def _is_folder(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()


def _resolved(path: Path, kind: type[ReplayError]) -> Path:
    with path_errors(path, kind):
        return path.resolve()


def _identities(path: Path) -> set[_Identity]:
    """Return which files an input is of; two names that are the same file have the same one."""
    parts = [path]
    with suppress(OSError):  # what cannot be listed is refused where it is read
        parts += path.iterdir()
    return {found for part in parts if (found := _identity(part)) is not None}


def _identity(path: Path) -> _Identity | None:
    try:
        status = path.stat()
    except (OSError, ValueError):
        return None
    return status.st_dev, status.st_ino
