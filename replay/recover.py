"""A new MCAP of what is whole of one that was cut off: by a run of ours that was killed, or by anyone's recorder."""

from __future__ import annotations

import stat
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from replay.errors import InputError
from replay.file_lock import try_lock
from replay.interrupts import held_off
from replay.mcap_salvage import Salvage
from replay.options import OutputOptions
from replay.outputs import refuse_inputs, refuse_irreplaceable, refuse_unwritable
from replay.sinks import all_output_paths, claim, refuse_existing, remove_left_over, reserved_paths
from replay.sinks.mcap_copy import McapCopy
from replay.sinks.partial_file import PartialFile, partial_name, recovering_name
from replay.sinks.publication import publish
from replay.sources.boundary import translated
from replay.sources.mcap.record_file import RecordFile, written_bytes
from replay.sources.mcap.records import MAGIC
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
    removed
        What is to be said of files that an earlier run left.
    """

    damaged: Path
    output: Path
    messages: int
    until_ns: int
    is_whole: bool
    left_out: tuple[str, ...]
    removed: tuple[str, ...] = ()

    def lines(self) -> Iterator[str]:
        """Yield what is said at the terminal."""
        yield from self.removed
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
    with translated(damaged):
        try:
            damaged.stat()
        except FileNotFoundError as error:
            raise InputError(f"{damaged}: it does not exist; expected an MCAP that was cut off or damaged") from error
    options = OutputOptions(output, force=force)
    is_partial = _recovers_partial(output, damaged)
    own = {partial_name(output)} if is_partial else set[Path]()
    refuse_inputs([path for path in reserved_paths(options) if path not in own], [damaged])
    refuse_irreplaceable(reserved_paths(options))
    refuse_existing(options)
    refuse_unwritable(output)
    removed: list[str] = []
    with ExitStack() as stack:
        salvage = Salvage(stack.enter_context(_opened(damaged)))
        # under the name of runs, so that none writes the same output
        file = PartialFile(output, recovering_name(output) if is_partial else None)
        copy = stack.enter_context(_copied(file, removed.append))
        if not is_partial:
            remove_left_over([PartialFile(output, recovering_name(output))], removed.append)
        with translated(damaged, (OSError,)):
            salvage.to(copy)
        copy.finish()
        with held_off():
            refuse_existing(options)
            publish([copy], [file], all_output_paths(options))
    return Recovery(
        damaged, output, salvage.messages, salvage.until_ns, salvage.is_whole, salvage.left_out, tuple(removed)
    )


def _recovers_partial(output: Path, damaged: Path) -> bool:
    """Tell whether it is what a run left of this output: then its own lock keeps other runs out meanwhile."""
    with suppress(OSError):
        return damaged.samefile(partial_name(output))
    return False


@contextmanager
def _copied(file: PartialFile, say: Callable[[str], object]) -> Iterator[McapCopy]:
    """Open a new MCAP; it is removed unless it has its final name at the end."""
    try:
        claim(file, say)
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
            # before it is opened: that would wait for whoever writes to a pipe
            mode = path.stat().st_mode
            if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
                raise InputError(f"{path}: this is no regular file; expected an MCAP that was cut off or damaged")
            file = stack.enter_context(path.open("rb"))
            size = path.stat().st_size
            is_free = try_lock(file.fileno(), shared=True)
            magic = file.read(len(MAGIC))
        if not is_free:
            raise InputError(f"{path}: a run is still writing it; wait until that has ended")
        if not size:
            raise InputError(f"{path}: it is empty, so there is nothing to recover")
        if magic != MAGIC:
            raise InputError(
                f"{path}: it does not begin as an MCAP does; expected one that was cut off; "
                "`replay merge` reads bags and .db3 files that were, as they are"
            )
        yield RecordFile(path, file, size, written_bytes(file, size), MOST_BYTES)
