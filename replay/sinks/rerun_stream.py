"""The Rerun library's writer: data in at times of the recording, one file out, errors as they should be."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import timedelta
from threading import Thread
from uuid import UUID

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from replay.sinks.partial_file import PartialFile
from replay.sinks.rerun_live import LiveStream
from replay.sinks.rerun_outlet import outlet_to

APPLICATION = "replay"
TIMELINE = "log_time"
"""Time of the recording."""
ELAPSED = "elapsed"
"""The same since the first tick, which is what people ask for."""
TICKS = "tick"
"""Number of the time, from 0: to step from one to the next, and to compare two files by, since ``rerun rrd compare``
leaves out whatever is called log_time."""

_SWITCH = "RERUN"
_PATIENCE_S = 3.0
_NEVER = timedelta(days=365)
_NO_LIMIT = 1 << 40
_CHUNK_BYTES = 1 << 20
_MOST_WAITING_BYTES = 16 << 20
_ROW_BYTES = 256


class RrdStream:
    """Writes one recording and its blueprint to a file.

    Nothing that is written depends on the clock of the machine: the timelines are the recording's own.

    Parameters
    ----------
    file
        The file.
    recording_id
        The same for the same input, so that two runs can be compared.
    live
        Takes the same for a viewer that is open meanwhile; None for no viewer.

    Raises
    ------
    RuntimeError
        If the file cannot be opened.
    """

    def __init__(self, file: PartialFile, recording_id: UUID, live: LiveStream | None = None) -> None:
        self._file = file
        self._live = live
        # Rows go to chunks by their size and never by the clock, so that two runs have the same chunks. Of each chunk
        # something is kept until the end, so small rows share one.
        batching = rr.ChunkBatcherConfig(_NEVER, _CHUNK_BYTES, _NO_LIMIT)
        with _switched_on():
            self._recording = rr.RecordingStream(
                APPLICATION, recording_id=recording_id, send_properties=False, batcher_config=batching
            )
        self._recording.set_log_time_enabled(False)
        self._recording.set_log_tick_enabled(False)
        self._ticks = 0
        self._start_ns: int | None = None
        self._waiting_bytes = 0
        self._broken = False
        self._outlet = outlet_to(file)
        try:
            self._recording.save(self._outlet.path)
        except BaseException:
            self.close()
            raise
        self._outlet.opened()

    def at(self, stamp_ns: int) -> None:
        """Set the time of what is logged from now on."""
        self._start_ns = stamp_ns if self._start_ns is None else self._start_ns
        since_ns, ticks = stamp_ns - self._start_ns, self._ticks
        _set_times(self._recording, stamp_ns, since_ns, ticks)
        if self._live is not None:
            self._live.do(lambda recording: _set_times(recording, stamp_ns, since_ns, ticks))
        self._ticks += 1

    def log(self, path: Sequence[str], *content: rr.AsComponents, static: bool = False) -> None:
        """Log to an entity, whose path is given in parts that need no escaping.

        It is written by a thread of the library; when too much waits for that, all of it is waited for.

        Raises
        ------
        RuntimeError, OSError
            If what was logged before cannot be written.
        """
        self._outlet.check()
        batches = [batch for item in content for batch in item.as_component_batches()]
        size_bytes = _ROW_BYTES + sum(batch.as_arrow_array().nbytes for batch in batches)
        if self._waiting_bytes + size_bytes > _MOST_WAITING_BYTES:
            self.flush()
        self._waiting_bytes += size_bytes
        self._recording.log(list(path), batches, static=static)
        if self._live is not None:
            self._live.log(path, batches, static=static)

    @property
    def is_live(self) -> bool:
        """Whether somebody looks on."""
        return self._live is not None

    def send(self, blueprint: rrb.Blueprint, *, live_only: bool = False) -> None:
        """Add what the viewer shows when the file is opened; or only show it to who looks on."""
        if not live_only:
            self._recording.send_blueprint(blueprint, make_active=True, make_default=True)
        if self._live is not None:
            self._live.send(blueprint)

    def flush(self) -> None:
        """Wait until all that was logged is on its way to the file.

        Raises
        ------
        RuntimeError, OSError
            If it does not get there.
        """
        # Where the library writes the file itself, and fails, whatever waits for it waits for ever: so wait only while
        # it writes.
        self._waiting_bytes = 0
        written = self._outlet.written_bytes()
        while True:
            try:
                self._recording.flush(timeout_sec=_PATIENCE_S)
            except RuntimeError as error:
                more = self._outlet.written_bytes()
                if more > written:
                    written = more
                    continue
                self._abandon()
                self._outlet.check()
                raise _not_written(error) from error
            self._outlet.check()
            return

    def finish(self) -> None:
        """Make the file whole and release it.

        Raises
        ------
        RuntimeError, OSError
            If not all of it could be written.
        """
        self.flush()
        self.close()
        self._outlet.check()
        self._file.check()
        try:
            # The library tells nobody when it fails to write the end of the file; without that this raises.
            RrdReader(self._file.readable_path()).store()
        except (RuntimeError, ValueError) as error:
            raise _not_written(error) from error

    def close(self) -> None:
        """Release the file as it is; harmless at any time."""
        if self._live is not None:
            self._live.close()
            self._live = None
        if not self._broken:
            self._recording.disconnect()
            self._outlet.close()

    def _abandon(self) -> None:
        """Let go of a recording whose writer has failed: closing it and ending the process could both hang."""
        self._broken = True
        rr.unregister_shutdown()
        Thread(target=self._recording.disconnect, daemon=True).start()


def _set_times(recording: rr.RecordingStream, stamp_ns: int, since_ns: int, ticks: int) -> None:
    recording.set_time(TIMELINE, timestamp=np.datetime64(stamp_ns, "ns"))
    recording.set_time(ELAPSED, duration=np.timedelta64(since_ns, "ns"))
    recording.set_time(TICKS, sequence=ticks)


@contextmanager
def _switched_on() -> Iterator[None]:
    """Let the library record, though its own switch may say off: here a recording was asked for."""
    switch = os.environ.pop(_SWITCH, None)
    try:
        yield
    finally:
        if switch is not None:
            os.environ[_SWITCH] = switch


def _not_written(error: Exception) -> RuntimeError:
    return RuntimeError(f"{error}; is the disk full?")
