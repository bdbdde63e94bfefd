"""Times: clocks, their order, windows, robots that begin late."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from tests.bags import SECOND, START, Recorded, write_mcap, write_rosbag1
from tests.outputs import maps, raw, reports, transforms
from tests.program import Program, Ran
from tests.runs import at, flat_map, growing, in_log_order, is_right, reference_from, seen, two_robots


def ticks_s(ran: Ran) -> list[float]:
    """Return the times of a run's ticks, in seconds after the recordings begin."""
    return [(time_ns - START) / SECOND for time_ns, _ in reports(ran.mcap)]


def lagging(robot: str, lag_s: float, **options: Any) -> list[Recorded]:
    """Return a robot's maps, whose headers are older than the log."""
    return [
        seen(robot, seconds, flat_map(robot, east_m), stamp_ns=at(seconds - lag_s), **options)
        for seconds, east_m in ((0.0, 1.0), (10.0, 7.0), (20.0, 9.0))
    ]


class TestClock:
    def test_the_header_s_unless_told(self, replay: Program, tmp_path: Path) -> None:
        run = write_mcap(tmp_path / "run.mcap", in_log_order(lagging("r1", 1.0), lagging("r2", 2.5)))
        by_header = replay.merge(run)
        assert ticks_s(by_header) == [-2.5, -1.0, 7.5, 9.0, 17.5, 19.0]
        assert by_header.report["inputs"][0]["clocks"] == {"/r1/map": "header", "/r2/map": "header"}
        by_log = replay.merge(run, "--clock", "log")
        assert ticks_s(by_log) == [0.0, 10.0, 20.0]
        assert by_log.report["inputs"][0]["clocks"] == {"/r1/map": "log", "/r2/map": "log"}

    def test_the_log_s_where_headers_have_none(self, replay: Program, tmp_path: Path) -> None:
        messages = in_log_order(growing("r1", stamp_ns=0), lagging("r2", 2.5))
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages))
        assert ran.report["inputs"][0]["clocks"] == {"/r1/map": "log", "/r2/map": "header"}
        assert ticks_s(ran) == [-2.5, 0.0, 7.5, 10.0, 17.5, 20.0]

    def test_it_is_chosen_by_the_first_message(self, replay: Program, tmp_path: Path) -> None:
        first, *rest = lagging("r1", 1.0)
        messages = in_log_order([seen("r1", 0.0, flat_map("r1", 1.0), stamp_ns=0), *rest], growing("r2", 2.0))
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages))
        assert ran.report["inputs"][0]["clocks"]["/r1/map"] == "log"
        assert first.log_time_ns == at(ticks_s(ran)[0])

    def test_nanoseconds_are_kept(self, replay: Program, tmp_path: Path) -> None:
        messages = [
            seen("r1", 0.0, flat_map("r1", 5.0 + index), stamp_ns=START + 123_456_789 + index) for index in range(3)
        ]
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages))
        expected = [START + 123_456_789 + index for index in range(3)]
        assert [time_ns for time_ns, _ in reports(ran.mcap)] == expected
        assert [each.stamp_ns for each in maps(ran.mcap)] == expected

    @pytest.mark.parametrize("stamp_ns", [0, -5 * SECOND])
    def test_a_later_header_without_a_time_does_no_harm(self, replay: Program, tmp_path: Path, stamp_ns: int) -> None:
        one, two, three = growing("r1")
        odd = Recorded(two.topic, two.msgtype, two.log_time_ns, {**two.fields, "stamp_ns": stamp_ns})
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", [one, odd, three]))
        assert ticks_s(ran) == [0.0, 10.0, 20.0]
        assert ran.report["inputs"][0]["late"] == 0


class TestOrder:
    """The header's order may differ from the log's."""

    @staticmethod
    def swapped(second_s: float) -> list[Recorded]:
        """Return r1's maps logged in order, the second with an older stamp than the first."""
        stamps_s = (10.0, second_s, 20.0)
        return [
            seen("r1", 10.0 + index, flat_map("r1", 5.0 + index), stamp_ns=at(stamp_s))
            for index, stamp_s in enumerate(stamps_s)
        ]

    def test_within_the_window(self, replay: Program, tmp_path: Path) -> None:
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", self.swapped(6.0)))
        assert ticks_s(ran) == [6.0, 10.0, 20.0]
        assert [each.grid.cropped_to_known().cols for each in maps(ran.mcap)] == [61, 51, 71]
        assert ran.report["inputs"][0]["late"] == 0

    def test_beyond_the_window(self, replay: Program, tmp_path: Path) -> None:
        messages = [*self.swapped(6.0), seen("r1", 30.0, flat_map("r1", 8.0), stamp_ns=at(8.0))]
        run = write_mcap(tmp_path / "run.mcap", messages)
        ran = replay.merge(run, "--reorder-window", "12.5")
        assert ticks_s(ran) == [6.0, 8.0, 10.0, 20.0]
        assert ran.report["inputs"][0]["late"] == 0
        ran = replay.merge(run)
        assert ticks_s(ran) == [6.0, 10.0, 20.0]
        assert [each.grid.cropped_to_known().cols for each in maps(ran.mcap)] == [61, 81, 71]
        assert ran.report["inputs"][0]["late"] == 1
        assert "1 message too late" in ran.err

    def test_no_window(self, replay: Program, tmp_path: Path) -> None:
        run = write_mcap(tmp_path / "run.mcap", self.swapped(6.0))
        ran = replay.merge(run, "--reorder-window", "0")
        assert ticks_s(ran) == [10.0, 20.0]
        assert ran.report["inputs"][0]["late"] == 1

    def test_stamps_never_decrease(self, replay: Program, tmp_path: Path) -> None:
        messages = in_log_order(self.swapped(3.0), lagging("r2", 2.5), lagging("r3", -1.5))
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), "--reorder-window", "1")
        for topic in ("/merged/map", "/merged/report", "/tf"):
            times = [time_ns for time_ns, _ in raw(ran.mcap, topic)]
            assert times == sorted(times)
        history = [change["stamp_ns"] for change in ran.report["history"]]
        assert history == sorted(history)


class TestStartAndStop:
    @pytest.mark.parametrize(
        ("arguments", "expected"),
        [
            ((), [0.0, 2.0, 10.0, 12.0, 20.0, 22.0]),
            (("--start", "2"), [2.0, 10.0, 12.0, 20.0, 22.0]),
            (("--start", "2.000000001"), [2.000000001, 10.0, 12.0, 20.0, 22.0]),
            (("--stop", "12"), [0.0, 2.0, 10.0]),
            (("--start", "2.", "--stop", "12.5"), [2.0, 10.0, 12.0]),
            (("--start", f"{at(10.0)}ns", "--stop", f"{at(20.0)}ns"), [10.0, 12.0]),
            (("--start", f"{at(10.0) + 1}ns"), [10.000000001, 12.0, 20.0, 22.0]),
        ],
    )
    def test_forms(self, replay: Program, two: Path, arguments: tuple[str, ...], expected: list[float]) -> None:
        ran = replay.merge(two, *arguments)
        assert ticks_s(ran) == expected

    def test_iso_8601(self, replay: Program, two: Path) -> None:
        moment = datetime.fromtimestamp(at(10.0) // SECOND, UTC)
        zoned = moment.astimezone().isoformat()
        for text in (moment.isoformat(), moment.strftime("%Y-%m-%dT%H:%M:%SZ"), f"{moment:%Y-%m-%d %H:%M:%S}", zoned):
            assert ticks_s(replay.merge(two, "--start", text)) == [10.0, 12.0, 20.0, 22.0]

    def test_it_is_counted_from_the_first_map_of_all(self, replay: Program, tmp_path: Path) -> None:
        messages = in_log_order(growing("r1", 5.0), growing("r2", 2.0))
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), "--start", "3")
        assert ticks_s(ran)[0] == 5.0

    def test_a_window_without_maps(self, replay: Program, two: Path) -> None:
        ran = replay.merge(two, "--start", "1000")
        assert ran.status == 2
        assert "--start is after all maps, which end 22.0 s after the first one" in ran.error
        assert not ran.mcap.exists()

    def test_what_is_beyond_it_is_not_judged(self, replay: Program, tmp_path: Path) -> None:
        """A message that cannot be read has a log time at least."""
        messages = [*two_robots(), seen("r1", 60.0, height=7)]
        run = write_mcap(tmp_path / "run.mcap", messages)
        assert replay.merge(run, "--strict").status == 2
        ran = replay.merge(run, "--strict", "--stop", "30")
        assert ran.status == 0
        assert ran.report["skipped"] == {}


class TestOtherClocks:
    """Robots whose clocks cannot be the same: simulated time against wall time, recordings of other days."""

    @staticmethod
    def simulated(robot: str, first_s: float = 3.0, **options: Any) -> list[Recorded]:
        return [
            seen(robot, seconds, flat_map(robot, east_m), stamp_ns=round((first_s + seconds) * SECOND), **options)
            for seconds, east_m in ((0.0, 1.0), (10.0, 7.0), (20.0, 9.0))
        ]

    @pytest.fixture
    def bags(self, tmp_path: Path) -> tuple[str, str]:
        a = write_mcap(tmp_path / "a.mcap", growing("r1", 1.0, topic="/map"))
        b = write_rosbag1(tmp_path / "b.bag", self.simulated("r2", topic="/map"))
        return f"a={a}", f"b={b}"

    def test_are_refused_with_the_hint(self, replay: Program, bags: tuple[str, str]) -> None:
        for order in (bags, bags[::-1]):
            ran = replay.merge(*order)
            assert ran.status == 2
            assert "days apart" in ran.error
            assert "--align-starts" in ran.error

    def test_are_aligned_to_the_reference(self, replay: Program, bags: tuple[str, str]) -> None:
        ran = replay.merge(*bags, "--align-starts")
        assert ran.statuses == {"a": "reference", "b": "merged"}
        assert ticks_s(ran) == [1.0, 11.0, 21.0]
        assert {time_ns for time_ns, _ in transforms(ran.mcap)} == {at(1.0), at(11.0), at(21.0)}
        offsets = [item["offsets_ns"] for item in ran.report["inputs"]]
        assert offsets == [{"/map": 0}, {"/map": at(1.0) - 3 * SECOND}]
        assert ran.report["settings"]["align_starts"] is True

    def test_simulated_time_of_the_reference(self, replay: Program, bags: tuple[str, str]) -> None:
        ran = replay.merge(*bags[::-1], "--align-starts")
        assert [time_ns for time_ns, _ in reports(ran.mcap)] == [3 * SECOND, 13 * SECOND, 23 * SECOND]
        assert ran.robots["a"]["first_merged_stamp_ns"] == 13 * SECOND

    def test_start_and_stop_are_on_the_reference_s_clock(self, replay: Program, bags: tuple[str, str]) -> None:
        ran = replay.merge(*bags, "--align-starts", "--start", f"{at(5.0)}ns", "--stop", "15")
        assert ticks_s(ran) == [5.0, 11.0]  # it begins with what was known then

    def test_robots_of_one_recording_stay_together(self, replay: Program, tmp_path: Path) -> None:
        a = write_mcap(tmp_path / "a.mcap", growing("r1", topic="/map"))
        messages = in_log_order(self.simulated("r2"), self.simulated("r3", 5.0))
        ran = replay.merge(f"a={a}", write_mcap(tmp_path / "b.mcap", messages), "--align-starts")
        assert ticks_s(ran) == [0.0, 2.0, 10.0, 12.0, 20.0, 22.0]

    def test_of_one_recording(self, replay: Program, tmp_path: Path) -> None:
        """One robot's headers are simulated time, the other's wall time."""
        run = write_mcap(tmp_path / "run.mcap", in_log_order(growing("r1", 1.0), self.simulated("r2")))
        assert "--align-starts" in replay.merge(run).error
        ran = replay.merge(run, "--clock", "log")
        assert ran.statuses == {"r1": "reference", "r2": "merged"}

    def test_hours_apart_may_be_the_same_clock(self, replay: Program, tmp_path: Path) -> None:
        messages = in_log_order(growing("r1"), growing("r2", 20 * 3600.0))
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages))
        assert ran.statuses == {"r1": "reference", "r2": "merged"}

    def test_aligned_starts_change_nothing_where_clocks_agree(self, replay: Program, two: Path) -> None:
        assert ticks_s(replay.merge(two, "--align-starts")) == ticks_s(replay.merge(two))


class TestLateAndEarly:
    def test_a_robot_that_starts_late(self, replay: Program, tmp_path: Path) -> None:
        messages = in_log_order(growing("r1"), growing("r2", 15.0))
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages))
        statuses = [report["robots"]["r2"]["status"] for _, report in reports(ran.mcap)]
        assert statuses[:2] == ["no_map", "no_map"]
        assert statuses[-1] == "merged"

    def test_a_robot_that_stops_early_keeps_its_place(self, replay: Program, tmp_path: Path) -> None:
        grown = [seen("r1", 50.0 + east_m, flat_map("r1", east_m)) for east_m in (8.0, 8.5, 9.0)]
        messages = [seen("r1", 0.0, flat_map("r1", 7.5)), seen("r2", 1.0), *grown]
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages))
        statuses = [report["robots"]["r2"]["status"] for _, report in reports(ran.mcap)]
        assert statuses == ["no_map", "merged", "merged", "merged", "merged"]

    def test_a_reference_that_starts_late(self, replay: Program, tmp_path: Path) -> None:
        messages = in_log_order(growing("r1", 15.0), growing("r2"), growing("r3", 1.0))
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), "--copy-maps")
        early = [report for time_ns, report in reports(ran.mcap) if time_ns < at(15.0)]
        assert len(early) == 4
        for report in early:
            assert report["robots"]["r1"]["status"] == "no_map"
            for robot in ("r2", "r3"):
                assert report["robots"][robot]["status"] in ("unmerged", "no_map")
                assert report["robots"][robot]["merged_from_map"] is None
                assert report["robots"][robot]["reason"]["code"] in ("no_reference_map", "no_map")
        assert early[-1]["robots"]["r3"]["component"] == "r2"
        assert early[-1]["robots"]["r3"]["component_from_map"] is not None
        assert maps(ran.mcap)[0].stamp_ns == at(15.0)
        assert next(transforms(ran.mcap))[0] == at(15.0)
        assert maps(ran.mcap, "/r2/map")[0].stamp_ns == at(0.0)
        assert set(ran.statuses.values()) == {"reference", "merged"}

    def test_a_reference_that_never_starts(self, replay: Program, tmp_path: Path) -> None:
        messages = in_log_order([seen("r1", 3.0, resolution=0.0)], growing("r2"), growing("r3", 1.0))
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), images="changed")
        assert ran.statuses == {"r1": "no_map", "r2": "unmerged", "r3": "unmerged"}
        assert ran.robots["r2"]["reason"]["code"] == "no_reference_map"
        assert not raw(ran.mcap, "/merged/map")
        assert not raw(ran.mcap, "/tf")
        assert is_right(ran.robots["r3"]["component_from_map"], reference_from("r3", "r2"))


@pytest.mark.parametrize("log_ns", [4_200_000_000 * SECOND, 2**64 - 1])
@pytest.mark.parametrize("clock", ["header", "log"])
def test_one_message_of_no_time_ends_no_run(replay: Program, tmp_path: Path, log_ns: int, clock: str) -> None:
    *messages, last = two_robots()
    odd = replace(last, log_time_ns=log_ns, fields={**last.fields, "stamp_ns": 0})
    ran = replay.merge(write_mcap(tmp_path / "run.mcap", [*messages, last, odd]), "--clock", clock)
    assert ran.status == 0, ran.err
    assert ran.report["skipped"] == {"bad_time": 1}
    assert ran.statuses == {"r1": "reference", "r2": "merged"}
