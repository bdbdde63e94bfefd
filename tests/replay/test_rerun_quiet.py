"""What the Rerun recording costs: nothing is laid out or written anew while nothing happens, and little with many."""

from __future__ import annotations

import tracemalloc
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from mapmerge.sim2 import Sim2
from replay.events import Event, Merged
from replay.sinks import rerun_maps
from replay.sinks.rerun_labels import label_places_m
from replay.sinks.rerun_layout import lay_out
from tests.replay.test_sink_rerun import events_of, written
from tests.rrd import rows_of
from tests.runs import flat_map

SECOND = 1_000_000_000
QUIET_TICKS = 20


@pytest.fixture
def quiet() -> list[Event]:
    """A run of two robots whose maps stay as they are after the first of each."""
    ticks = {SECOND * (1 + index): {f"r{1 + index}": flat_map(f"r{1 + index}")} for index in range(2)}
    ticks |= {SECOND * (10 + index): {"r2": flat_map("r2")} for index in range(QUIET_TICKS)}
    return events_of(("r1", "r2"), ticks)


def test_where_nothing_changes_nothing_is_laid_out(
    quiet: list[Event], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    times = []
    monkeypatch.setattr(rerun_maps, "lay_out", lambda *known: times.append(known) or lay_out(*known))
    written(tmp_path / "run.rrd", quiet)
    assert sum(isinstance(event, Merged) for event in quiet) == 2 + QUIET_TICKS
    assert len(times) == 2


def test_where_nothing_changes_only_plots_go_on(quiet: list[Event], tmp_path: Path) -> None:
    later: dict[str, int] = {}
    for chunk in RrdReader(written(tmp_path / "run.rrd", quiet)).stream():
        for row in rows_of(chunk.to_record_batch()):
            if 10 * SECOND <= row.get("log_time", 0) < (9 + QUIET_TICKS) * SECOND:
                later[chunk.entity_path] = later.get(chunk.entity_path, 0) + 1
    assert set(later.values()) == {QUIET_TICKS - 1}
    assert all(path.startswith("/plots/") for path in later)


def test_names_of_many_maps_are_placed_in_little_memory() -> None:
    """Fifty maps of which most overlap: their places against each other would be half a gigabyte."""
    places_m = np.stack(np.meshgrid(np.arange(32.0), np.arange(32.0)), axis=-1).reshape(-1, 2)
    poses = {f"r{index}": Sim2(7.0 * (index % 10), 9.0 * (index // 10), 0.1 * index) for index in range(50)}
    tracemalloc.start()
    try:
        found = label_places_m(poses, dict.fromkeys(poses, places_m))
        _, most_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert list(found) == list(poses)
    assert most_bytes < 8 << 20
    for robot, at_m in found.items():
        own_m = poses[robot].apply(places_m)
        assert np.hypot(*(own_m - at_m).T).min() < 1e-9
    pairs = combinations(found.values(), 2)
    assert min(np.hypot(*np.subtract(one, other)) for one, other in pairs) > 2.0
