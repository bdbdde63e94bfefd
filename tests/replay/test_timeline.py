from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace

import pytest

from mapmerge.grid import Grid
from replay.errors import InputError
from replay.events import Clock, Noted, Skipped
from replay.feeds import Feed, Tally, Window
from replay.message_times import MOST_PUT_BACK
from replay.sources.base import TF_TYPE
from replay.stamps import LAST_NS
from replay.timeline import _MOST_HELD, Tick, Transforms, ticks
from tests.bags import SECOND, START, Recorded, as_cdr
from tests.fakes import FakeSource
from tests.floors import filled
from tests.runs import at, bad_messages, link, linked, seen, updated

EVERYTHING = Window(None, None, 5 * SECOND)


def numbered(value: int) -> Grid:
    """Return a small map that is told from others by its cells."""
    return filled(value, 2, 3)


def mapped(robot: str, log_s: float, value: int, stamp_s: float | None = None) -> Recorded:
    return seen(robot, log_s, numbered(value), stamp_ns=None if stamp_s is None else at(stamp_s))


def feed(*messages: Recorded, clock: Clock = "header", offset_ns: int = 0) -> Feed:
    names = sorted({each.topic for each in messages})
    robot_of = {name: name.split("/")[1] for name in names}
    return Feed(FakeSource(messages), robot_of, dict.fromkeys(names, clock), dict.fromkeys(names, offset_ns), at(0.0))


def transforms(*messages: Recorded, clock: Clock = "header", offset_ns: int = 0) -> Feed:
    names = sorted({each.topic for each in messages})
    clocks: dict[str, Clock] = {name: "none" if name == "/tf_static" else clock for name in names}
    offsets = dict.fromkeys(names, offset_ns)
    return Feed(FakeSource(messages), dict.fromkeys(names, ""), clocks, offsets, 0)


def run(
    *feeds: Feed, window: Window = EVERYTHING, strict: bool = False
) -> tuple[list[Tick | Skipped | Noted | Transforms], tuple[Tally, ...]]:
    tallies = tuple(Tally() for _ in feeds)
    return list(ticks(feeds, tallies, window, strict=strict)), tallies


def told(items: Sequence[Tick | Skipped | Noted | Transforms]) -> list[tuple[float, dict[str, int]] | str]:
    """Return what happened, with maps by their cells, transforms by their child frames, and times in seconds."""
    return [_told(item) for item in items]


def _told(item: Tick | Skipped | Noted | Transforms) -> tuple[float, dict[str, int]] | str:
    if isinstance(item, Skipped):
        return str(item.cause)
    if isinstance(item, Noted):
        return "noted"
    if isinstance(item, Transforms):
        since = "always" if item.stamp_ns is None else f"{(item.stamp_ns - START) / SECOND:g}"
        return f"{since}: {' '.join(each.child for each in item.links)}"
    return (
        (item.stamp_ns - START) / SECOND,
        {robot: int(grid.cells[0, 0]) for robot, grid in item.grids.items()},
    )


def test_all_maps_of_one_time_are_one_tick() -> None:
    a = feed(mapped("r1", 0.0, 1), mapped("r2", 0.0, 2), mapped("r1", 1.0, 3))
    b = feed(mapped("r3", 0.0, 4), mapped("r3", 2.0, 5))
    found, _ = run(a, b)
    assert told(found) == [(0.0, {"r1": 1, "r2": 2, "r3": 4}), (1.0, {"r1": 3}), (2.0, {"r3": 5})]
    assert [item.messages for item in found if isinstance(item, Tick)] == [3, 1, 1]


def test_the_last_of_one_time_counts() -> None:
    found, _ = run(feed(mapped("r1", 0.0, 1), mapped("r1", 0.0, 2)))
    assert told(found) == [(0.0, {"r1": 2})]


def test_clocks() -> None:
    messages = [mapped("r1", 10.0, 1, stamp_s=3.0), mapped("r1", 11.0, 2, stamp_s=9.0)]
    assert [item[0] for item in told(run(feed(*messages))[0])] == [3.0, 9.0]
    assert [item[0] for item in told(run(feed(*messages, clock="log"))[0])] == [10.0, 11.0]
    assert [item[0] for item in told(run(feed(*messages, clock="none"))[0])] == [0.0]
    assert [item[0] for item in told(run(feed(*messages, offset_ns=-SECOND))[0])] == [2.0, 8.0]


class TestOrder:
    def test_within_the_window(self) -> None:
        order = [5.0, 3.0, 6.0, 1.0, 8.0, 4.0]
        found, (tally,) = run(feed(*(mapped("r1", index, index, stamp) for index, stamp in enumerate(order))))
        assert [item[0] for item in told(found)] == sorted(order)
        assert (tally.late, tally.messages) == (0, 6)

    def test_later_ones_apply_on_arrival(self) -> None:
        messages = [mapped("r1", 0.0, 1), mapped("r1", 20.0, 2), mapped("r1", 21.0, 3, stamp_s=-1.0)]
        found, (tally,) = run(feed(*messages))
        assert told(found) == [(0.0, {"r1": 3}), (20.0, {"r1": 2})]
        assert tally.late == 1

    @pytest.mark.parametrize("log_s", [0.0, 11.0])
    def test_what_is_refused_is_never_late(self, log_s: float) -> None:
        """Neither where nothing tells its time, nor where it comes too late for its place."""
        bad = bad_messages("r2", log_s)["bad_resolution"]
        ahead = [mapped("r1", 1.0, 1, stamp_s=101.0), mapped("r1", 10.0, 2, stamp_s=110.0)]
        known = [] if log_s == 0.0 else [mapped("r2", 0.0, 3)]
        found, (tally,) = run(feed(*sorted([bad, *ahead, *known], key=lambda each: each.log_time_ns)))
        assert "bad_resolution" in told(found)
        assert (tally.late, tally.messages) == (0, 3 + len(known))

    def test_exactly_the_window(self) -> None:
        messages = [mapped("r1", 0.0, 1), mapped("r1", 5.0, 2), mapped("r1", 5.5, 3, stamp_s=0.0)]
        assert run(feed(*messages))[1][0].late == 0

    def test_equal_times_stay_as_written(self) -> None:
        found, _ = run(feed(*(mapped("r1", index, index, stamp_s=1.0) for index in range(9))))
        assert told(found) == [(1.0, {"r1": 8})]

    def test_one_recording_s_order_is_no_other_s(self) -> None:
        a = feed(*(mapped("r1", 10.0 * index, index) for index in range(5)))
        b = feed(*(mapped("r2", 10.0 * index, index, stamp_s=10.0 * index - 7.0) for index in range(5)))
        found, tallies = run(a, b)
        assert [item[0] for item in told(found)] == sorted([0, 10, 20, 30, 40, -7, 3, 13, 23, 33])
        assert [tally.late for tally in tallies] == [0, 0]

    def test_a_header_without_a_time_follows_the_one_before(self) -> None:
        one, two, three = (mapped("r1", 10.0 * index, index, 10.0 * index - 1.0) for index in range(3))
        odd = Recorded(two.topic, two.msgtype, two.log_time_ns, {**two.fields, "stamp_ns": 0})
        found, (tally,) = run(feed(one, odd, three))
        assert told(found) == [(-1.0, {"r1": 0}), (9.0, {"r1": 1}), (19.0, {"r1": 2})]
        assert tally.late == 0

    def test_no_time_is_before_1970(self) -> None:
        found, _ = run(feed(mapped("r1", 1.0, 1), offset_ns=-at(3.0)))
        assert [item.stamp_ns for item in found if isinstance(item, Tick)] == [0]


class TestStamps:
    """What is believed of the headers' times; see also tests/property/test_stamps.py."""

    @pytest.mark.parametrize("off_s", [-1e9, -7200.0, 7200.0, 1e6, 4e8])
    @pytest.mark.parametrize("place", [0, 3, 7])
    def test_one_that_is_far_from_those_around_it_is_taken_when_it_was_recorded(self, off_s: float, place: int) -> None:
        stamps = [10.0 * index - 1.0 + (off_s if index == place else 0.0) for index in range(8)]
        recorded = feed(*(mapped("r1", 10.0 * index, index, stamp) for index, stamp in enumerate(stamps)))
        found, (tally,) = run(replace(recorded, leads_ns={"/r1/map": -SECOND}))
        assert [item for item in told(found) if item != "noted"] == [
            (10.0 * index - 1.0, {"r1": index}) for index in range(8)
        ]
        (note,) = (item for item in found if isinstance(item, Noted))
        assert note.robot == "r1"
        assert f"fake: /r1/map at {at(10.0 * place)} ns: the header says " in note.message
        assert (tally.bad_stamps, tally.late, tally.messages) == (1, 0, 8)
        # it is used all the same, so that nothing is lost
        run(replace(recorded, leads_ns={"/r1/map": -SECOND}), strict=True)

    @pytest.mark.parametrize("log_ns", [LAST_NS + 1, 2**63 + 5, 2**64 - 1])
    @pytest.mark.parametrize("clock", ["header", "log"])
    def test_a_log_time_that_no_stamp_can_hold_is_not_believed(self, log_ns: int, clock: Clock) -> None:
        """It comes last in the recording, and would replace maps that are newer."""
        one, two, three = (mapped("r1", 10.0 * index, index) for index in range(3))
        odd = Recorded(three.topic, three.msgtype, log_ns, {**three.fields, "stamp_ns": 0})
        found, (tally,) = run(feed(one, two, odd, odd, clock=clock))
        assert sorted(map(str, told(found))) == ["(0.0, {'r1': 0})", "(10.0, {'r1': 1})", "bad_time", "bad_time"]
        assert (tally.bad_stamps, tally.late) == (0, 0)

    def test_nor_is_that_of_what_cannot_be_decoded_or_is_a_transform(self) -> None:
        one, two = (mapped("r1", 10.0 * index, index) for index in range(2))
        odd = Recorded(two.topic, two.msgtype, 2**64 - 1, two.fields, lost_bytes=9)
        found, _ = run(feed(one, two, odd))
        assert sorted(map(str, told(found))) == ["(0.0, {'r1': 0})", "(10.0, {'r1': 1})", "undecodable"]
        moved = Recorded("/tf", TF_TYPE, 2**64 - 1, {"links": [link("map", "base")]})
        found, _ = run(transforms(linked(1.0, link("map", "odom")), moved))
        assert sorted(told(found)) == ["1: odom", "bad_time"]

    def test_no_update_belongs_to_the_map_before_one_of_which_nothing_tells_the_time(self) -> None:
        one, two = (mapped("r1", 10.0 * index, index) for index in range(2))
        odd = Recorded(two.topic, two.msgtype, 2**64 - 1, {**two.fields, "stamp_ns": 0})
        part = replace(updated("r1", 20.0, 0, 0, numbered(7).cells), log_time_ns=2**64 - 1)
        assert told(run(feed(one, part))[0]) == [(0.0, {"r1": 0}), (20.0, {"r1": 7})]
        found, _ = run(feed(one, odd, part))
        assert sorted(map(str, told(found))) == ["(0.0, {'r1': 0})", "bad_time", "update_before_grid"]

    def test_a_whole_header_is_believed_whatever_the_log_time(self) -> None:
        one, two = (mapped("r1", 10.0 * index, index) for index in range(2))
        found, (tally,) = run(feed(one, Recorded(two.topic, two.msgtype, 2**64 - 1, two.fields)))
        assert told(found) == [(0.0, {"r1": 0}), (10.0, {"r1": 1})]
        assert (tally.bad_stamps, tally.late) == (0, 0)

    def test_a_clock_that_jumps_and_stays_is_followed(self) -> None:
        stamps = [10.0 * index + (1e6 if index >= 4 else 0.0) for index in range(10)]
        found, (tally,) = run(feed(*(mapped("r1", 10.0 * index, index, stamp) for index, stamp in enumerate(stamps))))
        ticks_of = [item for item in told(found) if item != "noted"]
        assert [grids["r1"] for _, grids in ticks_of] == list(range(10))
        assert [time_s for time_s, _ in ticks_of] == [
            *(10.0 * n for n in range(6)),
            *(1e6 + 10 * n for n in (6, 7, 8, 9)),
        ]
        assert tally.bad_stamps == 2

    @pytest.mark.parametrize("back_s", [100.0, 500.0, 1e6])
    def test_a_clock_that_is_put_back_is_taken_to_have_gone_on(self, back_s: float) -> None:
        """What was recorded last is newest, also once the clock says again what it said before."""
        stamps = [2e6 + 10.0 * index - (back_s if index >= 4 else 0.0) for index in range(70)]
        found, (tally,) = run(feed(*(mapped("r1", 10.0 * index, index, stamp) for index, stamp in enumerate(stamps))))
        ticks_of = [item for item in told(found) if item != "noted"]
        assert [grids["r1"] for _, grids in ticks_of] == list(range(70))
        assert [time_s for time_s, _ in ticks_of] == [2e6 + 10.0 * index for index in range(70)]
        assert (tally.bad_stamps, tally.late) == (2, 0)
        said = [item.message for item in found if isinstance(item, Noted)]
        assert len(said) == 2
        assert f"was put back by {back_s:.0f} s" in said[1]

    def test_a_clock_that_is_put_back_all_the_time_is_named_a_few_times(self) -> None:
        stamps = [10.0 * (index % 10) for index in range(400)]
        maps = [mapped("r1", 10.0 * index, index % 100, 1e6 + stamp) for index, stamp in enumerate(stamps)]
        found, _ = run(feed(*maps))
        said = [item.message for item in found if isinstance(item, Noted) and "put back" in item.message]
        assert len(said) == MOST_PUT_BACK
        assert "not said again" in said[-1]
        assert "not said again" not in said[-2]

    def test_the_first_of_each_topic_is_named_and_all_are_counted(self) -> None:
        wild = [
            mapped(robot, 10.0 * n, n, 10.0 * n + (1e6 if n % 2 else 0)) for n in range(8) for robot in ("r1", "r2")
        ]
        found, (tally,) = run(feed(*wild))
        assert [item.robot for item in found if isinstance(item, Noted)] == ["r1", "r2"]
        assert tally.bad_stamps == 8
        assert sum(item.messages for item in found if isinstance(item, Tick)) == 16

    def test_more_nanoseconds_than_a_second_are_no_time(self) -> None:
        one, odd, three = (mapped("r1", 10.0 * index, index) for index in range(3))
        times = (Recorded(odd.topic, odd.msgtype, odd.log_time_ns, {**odd.fields, "stamp": (5, 10**9)}),)
        found, _ = run(feed(one, *times, three))
        assert [item[0] for item in told(found)] == [0.0, 10.0, 20.0]


class TestWindow:
    def test_start_is_in_and_stop_is_out(self) -> None:
        messages = [mapped("r1", index, index) for index in range(6)]
        found, (tally,) = run(feed(*messages), window=Window(at(2.0), at(4.0), 5 * SECOND))
        assert [item[0] for item in told(found)] == [2.0, 3.0]
        assert tally.messages == 4  # those before the window are read for the map that it begins with

    def test_begins_with_the_last_map_before_it(self) -> None:
        part = filled(100, 1, 1).cells
        messages = [mapped("r1", 0.0, 1), mapped("r2", 1.0, 5), updated("r1", 2.0, 0, 0, part), mapped("r1", 9.0, 2)]
        found, _ = run(feed(*messages), window=Window(at(4.0), None, 5 * SECOND))
        assert told(found) == [(4.0, {"r1": 100, "r2": 5}), (9.0, {"r1": 2})]

    def test_updates_go_on_from_the_map_before_it(self) -> None:
        part = filled(100, 1, 1).cells
        found, _ = run(feed(mapped("r1", 0.0, 1), updated("r1", 6.0, 0, 0, part)), window=Window(at(4.0), None, 0))
        assert told(found) == [(4.0, {"r1": 1}), (6.0, {"r1": 100})]

    def test_saved_maps_are_always_in(self) -> None:
        found, _ = run(feed(mapped("r1", 0.0, 1), clock="none"), window=Window(at(100.0), at(200.0), 0))
        assert len(found) == 1

    def test_bad_messages_by_their_log_time(self) -> None:
        bad = list(bad_messages("r1", 10.0).values())
        recorded = feed(mapped("r1", 0.0, 1, stamp_s=-3.0), *bad, mapped("r1", 30.0, 2, stamp_s=27.0))
        assert len(run(recorded)[0]) == 2 + len(bad)
        assert told(run(recorded, window=Window(None, at(5.0), 0))[0]) == [(-3.0, {"r1": 1})]
        assert len(run(recorded, window=Window(None, at(7.5), 0))[0]) == 2


class TestParts:
    def test_are_applied_in_order_of_time(self) -> None:
        part = filled(100, 1, 1).cells
        messages = [mapped("r1", 0.0, 1), updated("r1", 1.0, 1, 0, part), updated("r1", 1.0, 2, 0, part)]
        found, _ = run(feed(*messages))
        assert isinstance(found[-1], Tick)
        assert found[-1].grids["r1"].cells.tolist() == [[1, 100, 100], [1, 1, 1]]
        assert isinstance(found[0], Tick)
        assert found[0].grids["r1"].cells.tolist() == [[1, 1, 1], [1, 1, 1]]

    def test_that_do_not_fit(self) -> None:
        part = filled(100, 1, 1).cells
        messages = [updated("r1", 0.0, 0, 0, part), mapped("r1", 1.0, 1), updated("r1", 2.0, 3, 0, part)]
        found, (tally,) = run(feed(*messages))
        assert told(found) == ["update_before_grid", (1.0, {"r1": 1}), "update_outside_grid"]
        assert tally.messages == 3


class TestTransforms:
    MAPS = (mapped("r1", 0.0, 1), mapped("r1", 2.0, 2), mapped("r1", 4.0, 3))

    def test_come_before_the_maps_of_their_time(self) -> None:
        moving = transforms(*(linked(seconds, link("w", f"at{seconds:g}")) for seconds in (1.0, 2.0, 3.0)))
        found, tallies = run(feed(*self.MAPS), moving)
        assert told(found) == [
            (0.0, {"r1": 1}),
            "1: at1",
            "2: at2",
            (2.0, {"r1": 2}),
            "3: at3",
            (4.0, {"r1": 3}),
        ]
        assert [item.messages for item in found if isinstance(item, Tick)] == [1, 1, 1]
        assert [tally.messages for tally in tallies] == [3, 3]

    def test_that_hold_always_come_first_whenever_they_were_recorded(self) -> None:
        static = transforms(linked(9.0, link("w", "late"), static=True), linked(-1.0, link("w", "early"), static=True))
        for window in (EVERYTHING, Window(at(1.0), at(3.0), 0)):
            found, _ = run(feed(*self.MAPS), static, window=window)
            assert told(found)[:2] == ["always: late", "always: early"]

    def test_change_nothing_in_the_order_of_the_maps(self) -> None:
        """Though a robot's clock is an hour ahead, and its transforms with it."""
        order = [mapped("r1", 0.0, 1), mapped("r1", 1.0, 2, stamp_s=4.0), mapped("r1", 2.0, 3, stamp_s=3.0)]
        moving = transforms(*(linked(seconds, link("w", "a"), stamp_ns=at(seconds + 3600.0)) for seconds in range(3)))
        alone, _ = run(feed(*order))
        found, (tally, _) = run(feed(*order), moving)
        assert [item for item in told(found) if not isinstance(item, str)] == told(alone)
        assert tally.late == 0

    def test_before_the_window_are_known_in_it(self) -> None:
        moving = transforms(*(linked(seconds, link("w", f"at{seconds:g}")) for seconds in (0.5, 3.0, 5.0)))
        found, _ = run(feed(*self.MAPS), moving, window=Window(at(1.0), at(4.5), 0))
        assert told(found) == ["0.5: at0.5", (1.0, {"r1": 1}), (2.0, {"r1": 2}), "3: at3", (4.0, {"r1": 3})]

    def test_are_on_the_clock_of_the_maps(self) -> None:
        message = linked(1.0, link("w", "a"), stamp_ns=at(100.0))
        assert told(run(transforms(message))[0]) == ["100: a"]
        assert told(run(transforms(message, clock="log"))[0]) == ["1: a"]
        assert told(run(transforms(message, offset_ns=-99 * SECOND))[0]) == ["1: a"]

    def test_without_a_stamp_take_the_log_s(self) -> None:
        message = linked(1.0, link("w", "a"), stamp_ns=0)
        assert told(run(transforms(message))[0]) == ["1: a"]

    def test_a_message_takes_effect_with_the_newest_of_its_transforms(self) -> None:
        message = linked(1.0, link("w", "a", stamp_ns=at(2.0)), link("w", "b", stamp_ns=at(3.0)))
        assert told(run(transforms(message))[0]) == ["3: a b"]

    def test_that_are_none_are_told_and_the_others_used(self) -> None:
        none = link("w", "b", turn=(0.0, 0.0, 0.0, 0.0))
        found, _ = run(transforms(linked(1.0, link("w", "a"), none)))
        assert told(found) == ["bad_transform", "1: a"]
        (skipped,) = (item for item in found if isinstance(item, Skipped))
        assert (skipped.robot, skipped.topic, skipped.input) == ("", "/tf", "fake")
        assert "from 'b' to 'w' is none" in skipped.detail
        with pytest.raises(InputError, match=r"^fake: /tf at 2023-11-14 22:13:\d\d\.\d{3} UTC: .* --strict"):
            run(transforms(linked(1.0, none)), strict=True)

    def test_bytes_that_are_none_are_told(self) -> None:
        whole = linked(1.0, link("w", "a"))
        cut = Recorded(whole.topic, whole.msgtype, whole.log_time_ns, whole.fields, lost_bytes=9)
        found, _ = run(feed(*self.MAPS), transforms(cut, whole))
        assert "undecodable" in told(found)
        assert sum(item.messages for item in found if isinstance(item, Tick)) == 3


class TestBadMessages:
    def test_are_told_and_counted(self) -> None:
        bad = bad_messages("r1", 1.0)
        found, (tally,) = run(feed(mapped("r1", 0.0, 1), *bad.values(), mapped("r1", 9.0, 2)))
        causes = [item for item in told(found) if isinstance(item, str)]
        assert causes == list(bad)
        assert [item for item in told(found) if not isinstance(item, str)] == [(0.0, {"r1": 1}), (9.0, {"r1": 2})]
        assert tally.messages == 2 + len(bad)

    def test_say_where_they_were(self) -> None:
        found, _ = run(feed(mapped("r1", 0.0, 1), bad_messages("r1", 1.0)["size_mismatch"]))
        (skipped,) = (item for item in found if isinstance(item, Skipped))
        assert (skipped.robot, skipped.topic, skipped.log_time_ns) == ("r1", "/r1/map", at(1.0))

    def test_are_fatal_if_strict(self) -> None:
        for message in bad_messages("r1", 1.0).values():
            with pytest.raises(InputError, match=r"^fake: /r1/map at 2023-11-14 22:13:\d\d\.\d{3} UTC: .* --strict"):
                run(feed(mapped("r1", 0.0, 1), message), strict=True)

    def test_are_no_tick(self) -> None:
        found, _ = run(feed(*bad_messages("r1", 1.0).values()))
        assert all(isinstance(item, Skipped) for item in found)


class TestLast:
    MAPS = (mapped("r1", 0.0, 1), mapped("r1", 2.0, 2))

    @staticmethod
    def are_last(found: Sequence[Tick | Skipped | Noted | Transforms]) -> list[bool]:
        return [item.is_last for item in found if isinstance(item, Tick)]

    @pytest.mark.parametrize("count", [1, 2, 5])
    def test_only_the_last_tick_says_that_it_is(self, count: int) -> None:
        found, _ = run(feed(*(mapped("r1", index, index) for index in range(count))))
        assert self.are_last(found) == [False] * (count - 1) + [True]
        assert told(found)[-1] == (count - 1.0, {"r1": count - 1})

    def test_of_several_recordings(self) -> None:
        found, _ = run(feed(*self.MAPS), feed(mapped("r2", 1.0, 5), mapped("r2", 2.0, 6)))
        assert told(found)[-1] == (2.0, {"r1": 2, "r2": 6})
        assert self.are_last(found) == [False, False, True]

    def test_whatever_else_comes_after_it(self) -> None:
        bad = bad_messages("r1", 3.0).values()
        moving = transforms(*(linked(seconds, link("w", "a")) for seconds in (1.0, 4.0)))
        found, _ = run(feed(*self.MAPS, *bad), moving)
        assert self.are_last(found) == [False, True]
        assert told(found)[:3] == [(0.0, {"r1": 1}), "1: a", (2.0, {"r1": 2})]
        assert len(found) == 4 + len(bad)

    @pytest.mark.parametrize("count", [_MOST_HELD - 1, _MOST_HELD, 3 * _MOST_HELD])
    def test_if_too_much_comes_after_it_a_tick_without_maps_ends_the_run(self, count: int) -> None:
        moving = transforms(*(linked(3.0 + index, link("w", f"{index}")) for index in range(count)))
        found, _ = run(feed(*self.MAPS), moving)
        assert [item.split()[-1] for item in told(found) if isinstance(item, str)] == [str(i) for i in range(count)]
        ticks_found = [item for item in found if isinstance(item, Tick)]
        assert sum(item.messages for item in ticks_found) == 2
        assert [item.stamp_ns for item in ticks_found] == [at(0.0), at(2.0), at(2.0)][: len(ticks_found)]
        if count < _MOST_HELD:
            assert self.are_last(found) == [False, True]
        else:
            assert self.are_last(found) == [False, False, True]
            assert found[-1] is ticks_found[-1]
            assert ticks_found[-1].grids == {}

    def test_however_much_comes_before_it(self) -> None:
        moving = transforms(*(linked(0.001 * index, link("w", "a")) for index in range(1, 2 * _MOST_HELD)))
        found, _ = run(feed(mapped("r1", 0.0, 1), mapped("r1", 9.0, 2)), moving)
        assert self.are_last(found) == [False, True]
        assert told(found)[-1] == (9.0, {"r1": 2})

    def test_without_any_map_there_is_none(self) -> None:
        for count in (1, 2 * _MOST_HELD):
            found, _ = run(transforms(*(linked(float(index), link("w", "a")) for index in range(count))))
            assert len(found) == count
            assert self.are_last(found) == []


def test_every_message_is_counted_once() -> None:
    messages = [mapped("r1", 0.0, 1), *bad_messages("r1", 1.0).values(), mapped("r1", 9.0, 2), mapped("r1", 9.0, 3)]
    found, (tally,) = run(feed(*messages))
    assert sum(item.messages for item in found if isinstance(item, Tick)) == tally.messages == len(messages)


def test_the_digest_is_over_topic_time_and_bytes() -> None:
    messages = [mapped("r1", 0.0, 1), mapped("r2", 1.0, 2)]
    _, (tally,) = run(feed(*messages))
    expected = hashlib.sha256()
    for each in messages:
        data = as_cdr(each)
        expected.update(f"{each.topic} {each.log_time_ns} {len(data)}\n".encode() + data)
    assert tally.digest.hexdigest() == expected.hexdigest()


def test_memory_is_that_of_the_window() -> None:
    """Messages are decoded as they are needed, not all at once."""
    read: list[int] = []

    class Watched(FakeSource):
        def messages(self, topics):
            for raw in super().messages(topics):
                read.append(raw.log_time_ns)
                yield raw

    recorded = feed(*(mapped("r1", index, index) for index in range(100)))
    watched = Feed(
        Watched([mapped("r1", index, index) for index in range(100)]),
        recorded.robot_of,
        recorded.clocks,
        recorded.offsets_ns,
        recorded.untimed_ns,
    )
    next(iter(ticks([watched], [Tally()], EVERYTHING, strict=False)))
    assert len(read) <= 8
