"""A new MCAP of what is whole of one that was cut off: by a run of ours that was killed, or by anyone's recorder."""

from __future__ import annotations

import stat
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from replay.errors import InputError
from replay.interrupts import held_off
from replay.mcap_walk import Walk
from replay.options import OutputOptions
from replay.outputs import refuse_inputs, refuse_unwritable
from replay.sinks import all_output_paths, refuse_existing
from replay.sinks.file_lock import try_lock
from replay.sinks.mcap_copy import McapCopy
from replay.sinks.partial_file import PartialFile
from replay.sinks.publication import publish
from replay.sources.boundary import translated
from replay.sources.mcap_records import MAGIC, RecordFile, written_bytes
from replay.sources.memory import MOST_BYTES
from replay.words import counted, moment, recovered

_LEFT_OUT_NAMED = 5


@dataclass(frozen=True, slots=True)
class Recovery:
    """What came of it.

    Parameters
    ----------
    messages
        How many were recovered.
    until_ns
        Log time of the last one.
    is_whole
        Whether the file was not cut off.
    left_out
        What is not in the new file, and why.
    """

    damaged: Path
    output: Path
    messages: int
    until_ns: int
    is_whole: bool
    left_out: tuple[str, ...]

    def lines(self) -> Iterator[str]:
        """Yield what is said at the terminal."""
        for what in self.left_out[:_LEFT_OUT_NAMED]:
            yield f"left out: {what}"
        if len(self.left_out) > _LEFT_OUT_NAMED:
            yield f"left out: {len(self.left_out) - _LEFT_OUT_NAMED} more"
        if self.is_whole:
            until = moment(self.until_ns)
            yield f"{self.damaged}: recovered {counted(self.messages, 'message')} up to {until}; it has its end"
        else:
            yield recovered(str(self.damaged), self.messages, self.until_ns)
        yield f"wrote {self.output}"


def recover(damaged: Path, output: Path, *, force: bool = False) -> Recovery:
    """Write what is whole of an MCAP to a new one, with an index; schemas, channels, metadata, attachments too.

    Parameters
    ----------
    damaged
        The file, such as ``out.mcap.partial``; it is only read.
    output
        The new file; it has this name once it is whole.
    force
        Whether files that exist are replaced, also those beside it that belong to what is replaced.

    Raises
    ------
    ReplayError
        If nothing can be recovered, or the new file cannot be written.
    """
    options = OutputOptions(output, force=force)
    refuse_inputs([*all_output_paths(options).values(), _temporary(output)], [damaged])
    refuse_existing(options)
    refuse_unwritable(output)
    with ExitStack() as stack:
        walk = Walk(stack.enter_context(_opened(damaged)))
        copy = stack.enter_context(_copied(PartialFile(output, _temporary(output))))
        walk.to(copy)
        copy.finish()
        with held_off():
            refuse_existing(options)
            publish([copy], list(all_output_paths(options).values()))
    return Recovery(damaged, output, walk.messages, walk.until_ns, walk.is_whole, tuple(walk.left_out))


def _temporary(output: Path) -> Path:
    """Return a temporary name that is not the one of runs, which is what is recovered."""
    return output.with_name(f"{output.name}.recovering")


@contextmanager
def _copied(file: PartialFile) -> Iterator[McapCopy]:
    """Open a new MCAP; it is removed unless it has its final name at the end."""
    try:
        file.claim()
        copy = McapCopy(file)
        try:
            yield copy
        finally:
            copy.discard()
    finally:
        file.discard()


@contextmanager
def _opened(path: Path) -> Iterator[RecordFile]:
    with ExitStack() as stack:
        with translated(path):
            if not stat.S_ISREG(path.stat().st_mode):  # to open one may wait for ever
                raise InputError(f"{path}: this is no regular file; expected an MCAP that was cut off")
            file = stack.enter_context(path.open("rb"))
            size = path.stat().st_size
            is_free = try_lock(file.fileno(), shared=True)
            magic = file.read(len(MAGIC))
        if not is_free:
            raise InputError(f"{path}: a run is still writing it; wait until that has ended")
        if not size:
            raise InputError(f"{path}: it is empty, so there is nothing to recover")
        if magic != MAGIC:
            raise InputError(f"{path}: it does not begin as an MCAP does; expected one that was cut off")
        yield RecordFile(path, file, size, written_bytes(file, size), MOST_BYTES)
