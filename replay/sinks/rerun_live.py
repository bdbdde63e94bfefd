"""What goes on in a run, to a viewer that is open meanwhile. Nothing that becomes of the viewer matters to the run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import timedelta
from queue import Full, Queue
from threading import Thread
from uuid import UUID

import rerun as rr
import rerun.blueprint as rrb

_MOST_WAITING = 512
_PATIENCE_S = 10.0
_OFTEN = timedelta(milliseconds=100)
_CHUNK_BYTES = 1 << 20
_CHUNK_ROWS = 1 << 12

_Job = Callable[[rr.RecordingStream], object]


class LiveStream:
    """Sends what is logged to a viewer, in a thread of its own.

    A viewer that is closed is left alone; one that takes nothing for ten seconds, too.

    Parameters
    ----------
    url
        Where the viewer listens.
    application, recording_id
        Those of the file.
    """

    def __init__(self, url: str, application: str, recording_id: UUID) -> None:
        self._queue: Queue[_Job | None] = Queue(maxsize=_MOST_WAITING)
        self._is_lost = False
        self._thread = Thread(target=self._run, args=(url, application, recording_id), name="live", daemon=True)
        self._thread.start()

    def do(self, job: _Job) -> None:
        """Have something done with the recording, in order."""
        if not self._is_lost:
            try:
                self._queue.put(job, timeout=_PATIENCE_S)
            except Full:
                self._lose()

    def log(self, path: Sequence[str], batches: Sequence[rr.DescribedComponentBatch], *, static: bool) -> None:
        """Log to an entity."""
        parts: list[object] = list(path)
        content = list(batches)
        self.do(lambda recording: recording.log(parts, content, static=static))

    def send(self, blueprint: rrb.Blueprint) -> None:
        """Lay the viewer out."""
        self.do(lambda recording: recording.send_blueprint(blueprint, make_active=True, make_default=True))

    def close(self) -> None:
        """Let all be sent, if the viewer takes it."""
        if self._is_lost:
            return
        try:
            self._queue.put(None, timeout=_PATIENCE_S)
        except Full:
            self._lose()
        self._thread.join(_PATIENCE_S)
        if self._thread.is_alive():
            self._lose()

    def _lose(self) -> None:
        self._is_lost = True
        rr.unregister_shutdown()  # it would wait for the viewer when the program ends

    def _run(self, url: str, application: str, recording_id: UUID) -> None:
        try:
            batching = rr.ChunkBatcherConfig(_OFTEN, _CHUNK_BYTES, _CHUNK_ROWS)
            recording = rr.RecordingStream(
                application, recording_id=recording_id, send_properties=False, batcher_config=batching
            )
            recording.set_log_time_enabled(False)
            recording.set_log_tick_enabled(False)
            recording.connect_grpc(url)
            while (job := self._queue.get()) is not None and not self._is_lost:
                job(recording)
            recording.flush(timeout_sec=_PATIENCE_S / 2)
            recording.disconnect()
        except Exception:  # noqa: BLE001 - the viewer was closed: whatever the library says of it
            self._is_lost = True
