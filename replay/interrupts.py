"""Signals that end the program: interrupted, terminated, its terminal closed."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

# Windows has no SIGHUP; there, closing the console is SIGBREAK.
NUMBERS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name))

_Handler = Callable[[int, FrameType | None], object] | signal.Handlers


def listen() -> None:
    """Let all of them end the program as Ctrl-C does; those that are ignored, as under nohup, stay so."""
    if threading.current_thread() is not threading.main_thread():
        return
    for number in NUMBERS:
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, _interrupt)


@contextmanager
def held_off() -> Iterator[None]:
    """Let them do nothing within this: for what takes no time, must not be left half done, and is the end of a run."""
    with _handled_by(signal.SIG_IGN):
        yield


@contextmanager
def put_off() -> Iterator[None]:
    """Let them wait until the end of this: for what takes no time and must not be left half done."""
    met: list[int] = []
    with _handled_by(lambda number, _: met.append(number)):
        yield
    for number in met:
        signal.raise_signal(number)


@contextmanager
def _handled_by(handler: _Handler) -> Iterator[None]:
    """Give them another handler within this, but for those that are ignored; only the main thread can."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: known for number in NUMBERS if (known := signal.getsignal(number)) not in {None, signal.SIG_IGN}}
    try:
        for number in before:
            signal.signal(number, handler)
        yield
    finally:
        for number, known in before.items():
            signal.signal(number, known)


def _interrupt(_number: int, _frame: object) -> NoReturn:
    raise KeyboardInterrupt
