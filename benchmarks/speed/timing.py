"""Processor time of what takes turns in one process."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from statistics import median
from time import process_time

import cv2

Contestant = Callable[[], object]


def timed(taking_turns: Mapping[str, Contestant], rounds: int) -> dict[str, float]:
    """Return the median processor time of each, in seconds; a first round does not count."""
    seconds: dict[str, list[float]] = {name: [] for name in taking_turns}
    for number in range(rounds + 1):
        for name, run in taking_turns.items():
            taken = once(run)
            if number:
                seconds[name].append(taken)
    return {name: median(values) for name, values in seconds.items()}


def once(run: Contestant) -> float:
    """Return the processor time of one run, in seconds."""
    begin = process_time()
    run()
    return process_time() - begin


@contextmanager
def one_thread() -> Iterator[None]:
    """Let OpenCV use one thread, as all else does here."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(threads)
