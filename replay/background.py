"""Work that goes on beside the merging: reading ahead, and giving events to sinks.

Each is one thread, with room for one item between it and the merger, so that order, outcome and memory are what they
are without it but for that item. Most of what they do, decompressing, digests, compressing, runs outside of Python's
lock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from queue import Empty, Full, Queue
from threading import Event as Flag
from threading import Thread
from types import TracebackType
from typing import Generic, Self, TypeVar

_Item = TypeVar("_Item")

_POLL_S = 0.1


class _Failed:
    """What a thread ends with: the error that it ended by, or None."""

    def __init__(self, error: BaseException | None) -> None:
        self.error = error


class ReadAhead(Generic[_Item]):
    """Yields what an iterator yields, which runs in a thread of its own, one item ahead.

    Leave it as a context manager: the thread ends with it, and the iterator is closed there.
    """

    def __init__(self, items: Iterator[_Item]) -> None:
        self._items = items
        self._queue: Queue[_Item | _Failed] = Queue(maxsize=1)
        self._unwanted = Flag()
        self._thread = Thread(target=self._run, name="reader", daemon=True)

    def __enter__(self) -> Iterator[_Item]:
        self._thread.start()
        return self._read()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._unwanted.set()
        self._thread.join()

    def _read(self) -> Iterator[_Item]:
        while True:
            item = self._queue.get()
            if not isinstance(item, _Failed):
                yield item
            elif item.error is None:
                return
            else:
                raise item.error

    def _run(self) -> None:
        error: BaseException | None = None
        try:
            for item in self._items:
                if not self._offer(item):
                    break
            getattr(self._items, "close", lambda: None)()
        except BaseException as found:  # noqa: BLE001 - it is raised again where the items are wanted
            error = found
        self._offer(_Failed(error))

    def _offer(self, item: _Item | _Failed) -> bool:
        """Wait until there is room for an item; tell whether it is wanted still."""
        while not self._unwanted.is_set():
            try:
                self._queue.put(item, timeout=_POLL_S)
            except Full:
                continue
            return True
        return False


class Courier(Generic[_Item]):
    """Gives items to a function in a thread of its own, in order.

    An error of the function is raised by the next `send`, or at the end. Leave it as a context manager: all items are
    given by then or, if an error leads out of it, none any more.
    """

    def __init__(self, give: Callable[[_Item], None]) -> None:
        self._give = give
        self._queue: Queue[_Item | None] = Queue(maxsize=1)
        self._error: BaseException | None = None
        self._ended, self._unwanted = Flag(), Flag()
        self._thread = Thread(target=self._run, name="writer", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self._put(None)
        else:
            self._unwanted.set()
        self._thread.join()
        if error is None and self._error is not None:
            raise self._error

    def send(self, item: _Item) -> None:
        """Have an item given; waits while another one waits already."""
        self._put(item)
        if self._error is not None:
            raise self._error

    def _put(self, item: _Item | None) -> None:
        while not self._ended.is_set():
            try:
                self._queue.put(item, timeout=_POLL_S)
            except Full:
                continue
            return

    def _run(self) -> None:
        try:
            while not self._unwanted.is_set():
                try:
                    item = self._queue.get(timeout=_POLL_S)
                except Empty:
                    continue
                if item is None:
                    return
                self._give(item)
        except BaseException as error:  # noqa: BLE001 - it is raised again where the items come from
            self._error = error
        finally:
            self._ended.set()
