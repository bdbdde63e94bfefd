"""Small files that are written at once: whole under their final names, or not there; several together, or none."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from replay.interrupts import held_off
from replay.outputs import refuse_alike, refuse_inputs, refuse_irreplaceable, refuse_unwritable
from replay.sinks import OutputsExistError
from replay.sinks.partial_file import PartialFile, output_errors, partial_name
from replay.sinks.publication import aside_name, publish


def reserved_names(path: Path) -> tuple[Path, ...]:
    """Return all names that may be written or removed for one file: also the temporary one, and that of the old one."""
    return path, partial_name(path), aside_name(path)


def refuse_files(paths: Sequence[Path], inputs: Sequence[Path], *, force: bool) -> None:
    """Refuse names of files that could not be written at the end, or would cost an input.

    Raises
    ------
    ReplayError
        With the reason.
    """
    reserved = [reserved_names(path) for path in paths]
    every = [name for names in reserved for name in names]
    refuse_inputs(every, inputs)
    refuse_alike(reserved)
    refuse_irreplaceable(every)
    existing = [str(path) for path in paths if os.path.lexists(path)]
    if existing and not force:
        raise OutputsExistError(existing)
    for path in every:
        refuse_unwritable(path)


def write_files(contents: Mapping[Path, bytes], *, force: bool) -> None:
    """Write files that belong together, all or none; the last one last.

    Raises
    ------
    ReplayError
        If one cannot be written; then all are as they were.
    """
    files = [PartialFile(path) for path in contents]
    try:
        for file, content in zip(files, contents.values(), strict=True):
            file.claim()
            with output_errors(file.path), file.stream() as stream:
                stream.write(content)
            file.sync()
        with held_off():
            refuse_files(list(contents), (), force=force)
            publish(files, files, list(contents))
    finally:
        for file in files:
            file.discard()
