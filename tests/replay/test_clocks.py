from __future__ import annotations

import pytest

from replay.clocks import Probe, agreed, frames, offsets_ns, probe
from replay.errors import UsageError
from replay.events import Clock
from tests.bags import SECOND, START, Recorded
from tests.fakes import FakeSource
from tests.runs import at, bad_messages, seen

DAY_S = 86_400


def probed(messages: list[Recorded], **options) -> Probe | None:
    choice = options.pop("choice", "header")
    return probe(FakeSource(messages, **options), 3, "r1", "/r1/map", choice)


def known(
    robot: str,
    first_s: float,
    last_s: float | None = None,
    *,
    index: int = 0,
    clock: Clock = "header",
    topic: str | None = None,
) -> Probe:
    first_ns = round(first_s * SECOND)
    last_ns = round((first_s + 10.0 if last_s is None else last_s) * SECOND)
    log_ns = (first_ns + SECOND, last_ns + SECOND)
    return Probe(robot, index, topic or f"/{robot}/map", clock, first_ns, last_ns, *log_ns, "map")


SAVED = Probe("old", 1, "/map", "none", None, None, 0, 0, "map")


class TestProbe:
    def test_header(self) -> None:
        messages = [seen("r1", 5.0, stamp_ns=7 * SECOND, frame="/odom"), seen("r1", 25.0, stamp_ns=27 * SECOND)]
        lead_ns = 7 * SECOND - at(5.0)
        expected = Probe("r1", 3, "/r1/map", "header", 7 * SECOND, 27 * SECOND, at(5.0), at(25.0), "/odom", lead_ns)
        assert probed(messages) == expected

    @pytest.mark.parametrize("off_s", [-4 * 365 * DAY_S, -7200, 7200, 10 * 365 * DAY_S])
    @pytest.mark.parametrize("later", [1, 2, 5])
    def test_a_first_stamp_that_is_far_from_the_next_is_not_believed(self, off_s: int, later: int) -> None:
        wild = seen("r1", 5.0, stamp_ns=at(5.0) + off_s * SECOND)
        found = probed([wild, *(seen("r1", 5.0 + 10.0 * number) for number in range(1, later + 1))])
        assert found is not None
        assert (found.clock, found.lead_ns, found.first_ns) == ("header", 0, at(5.0))

    @pytest.mark.parametrize("rate", [0.1, 0.5, 1.0, 9.0])
    def test_simulated_time_is_believed(self, rate: float) -> None:
        messages = [seen("r1", 5.0 + 10.0 * n, stamp_ns=SECOND + round(10 * rate * n * SECOND)) for n in range(4)]
        found = probed(messages)
        assert found is not None
        assert (found.clock, found.first_ns) == ("header", SECOND)

    @pytest.mark.parametrize("stamp_ns", [0, -SECOND])
    def test_log_where_the_header_has_no_time(self, stamp_ns: int) -> None:
        found = probed([seen("r1", 5.0, stamp_ns=stamp_ns), seen("r1", 25.0)])
        assert found is not None
        assert (found.clock, found.first_ns, found.last_ns) == ("log", at(5.0), at(25.0))

    def test_log_if_told(self) -> None:
        found = probed([seen("r1", 5.0, stamp_ns=7)], choice="log")
        assert found is not None
        assert (found.clock, found.first_ns) == ("log", at(5.0))

    def test_no_clock(self) -> None:
        assert probed([seen("r1", 0.0)], has_clock=False) == Probe(
            "r1", 3, "/r1/map", "none", None, None, at(0.0), at(0.0), "map"
        )

    def test_the_first_message_that_can_be_used(self) -> None:
        found = probed([*bad_messages("r1", 0.0).values(), seen("r1", 30.0)])
        assert found is not None
        assert found.first_ns == at(30.0)

    def test_nothing_that_can_be_used(self) -> None:
        assert probed(list(bad_messages("r1", 0.0).values())) is None


class TestAgreed:
    def test_the_header_only_where_all_inputs_have_it(self) -> None:
        probes = [known("r1", 5.0), known("r1", 6.0, index=1, clock="log"), known("r2", 7.0)]
        assert [item.clock for item in agreed(probes)] == ["log", "log", "header"]
        assert agreed(probes)[0].first_ns == probes[0].first_log_ns

    def test_each_topic_has_its_own(self) -> None:
        probes = [known("r1", 5.0), known("r1", 6.0, clock="log", topic="/r1/map_updates")]
        assert [item.clock for item in agreed(probes)] == ["header", "log"]

    def test_saved_maps_have_none_and_do_not_matter(self) -> None:
        probes = [
            SAVED,
            known("old", 5.0, index=2, topic="/map"),
            known("old", 6.0, index=3, clock="log", topic="/map"),
        ]
        assert [item.clock for item in agreed(probes)] == ["none", "log", "log"]


@pytest.mark.parametrize(
    ("recorded", "expected"),
    [
        ({"a": "map", "b": "map"}, ["a/map", "b/map"]),
        ({"a": "map", "b": "odom"}, ["map", "odom"]),
        ({"a": "/map", "b": "odom"}, ["map", "odom"]),
        ({"a": "//x/y", "b": "x"}, ["x/y", "x"]),
        ({"a": "", "b": "map"}, ["a/map", "map"]),
        ({"a": "merged", "b": "map"}, ["a/merged", "map"]),
        ({"a": "map", "b": "map", "c": "a/map"}, ["a/map", "b/map", "c/a/map"]),
    ],
)
def test_frames(recorded: dict[str, str], expected: list[str]) -> None:
    assert list(frames(list(recorded), recorded, "merged").values()) == expected


def test_frame_of_a_robot_without_a_map() -> None:
    assert frames(["a", "b"], {"a": "map"}, "merged") == {"a": "map", "b": "b/map"}


class TestOffsets:
    def test_none_where_clocks_may_be_the_same(self) -> None:
        probes = [known("r1", START / SECOND), known("r2", START / SECOND + DAY_S - 1.0, index=1)]
        assert offsets_ns("r1", probes, align_starts=False) == {(0, "/r1/map"): 0, (1, "/r2/map"): 0}

    @pytest.mark.parametrize("gap_s", [DAY_S + 1.0, -DAY_S - 1.0, 1.7e9])
    def test_refused_where_they_cannot(self, gap_s: float) -> None:
        first_s = 2 * DAY_S + 100.0
        other_s = first_s + 10.0 + gap_s if gap_s > 0 else first_s - 10.0 + gap_s
        probes = [known("r1", first_s), known("r2", other_s, index=1)]
        for reference in ("r1", "r2"):
            with pytest.raises(UsageError, match=r"r[12] .* days? apart .* --align-starts"):
                offsets_ns(reference, probes, align_starts=False)

    def test_a_long_recording_may_reach_the_other(self) -> None:
        probes = [known("r1", 0.0, 3 * DAY_S), known("r2", 3.5 * DAY_S, index=1)]
        assert set(offsets_ns("r1", probes, align_starts=False).values()) == {0}

    def test_aligned(self) -> None:
        probes = [known("r1", 1e9), known("r2", 5.0, index=1), known("r3", 7.0, index=1), known("r4", 2e9, index=2)]
        assert offsets_ns("r1", probes, align_starts=True) == {
            (0, "/r1/map"): 0,
            (1, "/r2/map"): (10**9 - 5) * SECOND,
            (1, "/r3/map"): (10**9 - 5) * SECOND,
            (2, "/r4/map"): -(10**9) * SECOND,
        }

    def test_saved_maps_have_none(self) -> None:
        saved = SAVED
        assert offsets_ns("r1", [known("r1", 1e9), saved], align_starts=False) == {(0, "/r1/map"): 0}
        assert offsets_ns("old", [saved], align_starts=True) == {}

    def test_a_reference_without_a_time_follows_the_first_that_has(self) -> None:
        probes = [SAVED, known("r1", 1e9), known("r2", 5.0, index=1)]
        assert offsets_ns("old", probes, align_starts=True)[1, "/r2/map"] == (10**9 - 5) * SECOND

    def test_parts_of_one_recording_keep_their_distance(self) -> None:
        probes = [known("a", 1e9), known("b", 5.0, index=1), known("b", 105.0, index=2)]
        shifts = offsets_ns("a", probes, align_starts=True)
        assert shifts[1, "/b/map"] == shifts[2, "/b/map"] == (10**9 - 5) * SECOND
