"""Threads beside the merging: order, errors, and an end in every case."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from replay.background import Courier, ReadAhead


def threads() -> set[str]:
    return {each.name for each in threading.enumerate()} & {"reader", "writer"}


class TestReadAhead:
    def test_all_items_in_their_order(self) -> None:
        with ReadAhead(iter(range(100))) as items:
            assert list(items) == list(range(100))
        assert not threads()

    def test_an_error_comes_after_the_items_before_it(self) -> None:
        def failing() -> Iterator[int]:
            yield 1
            yield 2
            raise ValueError("the third")

        seen: list[int] = []
        with pytest.raises(ValueError, match="the third"), ReadAhead(failing()) as items:
            seen.extend(items)
        assert seen == [1, 2]
        assert not threads()

    def test_no_more_than_asked_for_and_two_are_read(self) -> None:
        read = []

        def noted() -> Iterator[int]:
            for number in range(100):
                read.append(number)
                yield number

        with ReadAhead(noted()) as items:
            assert next(items) == 0
            assert next(items) == 1
        assert len(read) <= 4

    def test_is_closed_in_its_own_thread_if_it_is_left_early(self) -> None:
        closed = []

        def endless() -> Iterator[int]:
            try:
                while True:
                    yield 0
            finally:
                closed.append(threading.current_thread().name)

        def left_early() -> None:
            with ReadAhead(endless()) as items:
                next(items)
                raise KeyError

        with pytest.raises(KeyError):
            left_early()
        assert closed == ["reader"]
        assert not threads()

    def test_nothing_asked_for(self) -> None:
        with ReadAhead(iter([1])):
            pass
        assert not threads()


class TestCourier:
    def test_all_items_in_their_order_by_one_thread(self) -> None:
        given: list[tuple[int, str]] = []
        with Courier[int](lambda item: given.append((item, threading.current_thread().name))) as courier:
            for number in range(100):
                courier.send(number)
        assert given == [(number, "writer") for number in range(100)]
        assert not threads()

    def test_an_error_is_raised_where_items_come_from(self) -> None:
        given = []

        def failing(item: int) -> None:
            given.append(item)
            if item == 3:
                raise OSError("no space")

        def send_all() -> None:
            with Courier[int](failing) as courier:
                for number in range(1000):
                    courier.send(number)

        with pytest.raises(OSError, match="no space"):
            send_all()
        assert given == [0, 1, 2, 3]
        assert not threads()

    def test_an_error_at_the_last_item_is_raised_too(self) -> None:
        def failing(_item: int) -> None:
            raise OSError("no space")

        with pytest.raises(OSError, match="no space"), Courier[int](failing) as courier:
            courier.send(1)
        assert not threads()

    def test_after_an_error_outside_nothing_more_is_given(self) -> None:
        given: list[int] = []
        let_go = threading.Event()

        def slow(item: int) -> None:
            given.append(item)
            let_go.wait(10.0)

        def interrupted() -> None:
            with Courier[int](slow) as courier:
                courier.send(1)
                courier.send(2)
                let_go.set()
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            interrupted()
        assert given in ([1], [1, 2])
        assert not threads()
