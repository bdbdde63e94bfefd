"""Processes that run cases. One that dies, or takes too long, is the outcome of its case; another takes its place."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from queue import SimpleQueue
from select import select
from threading import Lock
from time import perf_counter
from typing import IO

from benchmarks.faults.cases import Task
from benchmarks.faults.oracle import Judged, Verdict
from benchmarks.faults.worker import READY

MOST_S = 30.0
_START_S = 120.0
_ONE_THREAD = {"OPENCV_FOR_THREADS_NUM": "1", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
_COMMAND = (sys.executable, "-m", "benchmarks.faults.worker")


@dataclass(frozen=True, slots=True)
class Done:
    """A case that was run; ``judged`` is None if it cannot be made."""

    task: Task
    judged: Judged | None
    took_s: float = 0.0


class Worker:
    """One process, started when it is needed.

    Parameters
    ----------
    command
        What it runs.
    most_s
        How long a case may take.
    """

    def __init__(self, command: tuple[str, ...] = _COMMAND, most_s: float = MOST_S) -> None:
        self._command = command
        self._most_s = most_s
        self._process: subprocess.Popen[bytes] | None = None

    def run(self, task: Task) -> Judged | None:
        """Run a case, whatever becomes of the process."""
        process = self._started()
        try:
            pickle.dump(task, _pipe(process.stdin))
            _pipe(process.stdin).flush()
            answer = _within(_pipe(process.stdout), self._most_s)
        except TimeoutError:
            self.close()
            return Judged(Verdict.HUNG, f"it was stopped after {self._most_s:.0f} s")
        except (EOFError, OSError):
            status = process.wait()
            self.close()
            return Judged(Verdict.CRASHED, f"the process ended with {status}")
        if not isinstance(answer, Judged | None):
            raise TypeError(f"{answer!r} is no answer")
        return answer

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            for pipe in (self._process.stdin, self._process.stdout):
                _close(pipe)
            self._process.wait()
        self._process = None

    def _started(self) -> subprocess.Popen[bytes]:
        if self._process is None:
            environment = {**os.environ, **_ONE_THREAD}
            self._process = subprocess.Popen(
                self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment
            )
            try:
                ready = _within(_pipe(self._process.stdout), _START_S) == READY
            except (EOFError, TimeoutError):
                ready = False
            if not ready:
                self.close()
                raise RuntimeError(f"{' '.join(self._command)} does not start")
        return self._process


def _close(pipe: IO[bytes] | None) -> None:
    """Close a pipe whose other end may be gone."""
    if pipe is not None:
        try:
            pipe.close()
        except BrokenPipeError:
            return


def _pipe(pipe: IO[bytes] | None) -> IO[bytes]:
    if pipe is None:
        raise AssertionError("the process has no pipe")
    return pipe


def _within(stream: IO[bytes], limit_s: float) -> object:
    """Read an answer; a process that is stuck in the middle of one is not foreseen."""
    ready, _, _ = select([stream], [], [], limit_s)
    if not ready:
        raise TimeoutError
    return pickle.load(stream)  # noqa: S301 - from the process that was started here


def run_all(tasks: Iterable[Task], jobs: int, new_worker: Callable[[], Worker] = Worker) -> Iterator[Done]:
    """Yield what became of tasks, as they are done; tasks are taken as workers become free."""
    source, lock = iter(tasks), Lock()
    done: SimpleQueue[Done | None] = SimpleQueue()

    def work() -> None:
        worker = new_worker()
        try:
            while True:
                with lock:
                    task = next(source, None)
                if task is None:
                    return
                begin_s = perf_counter()
                done.put(Done(task, worker.run(task), perf_counter() - begin_s))
        finally:
            worker.close()
            done.put(None)

    with ThreadPoolExecutor(jobs) as threads:
        futures = [threads.submit(work) for _ in range(jobs)]
        left = jobs
        while left:
            item = done.get()
            if item is None:
                left -= 1
            else:
                yield item
        for future in futures:
            future.result()
