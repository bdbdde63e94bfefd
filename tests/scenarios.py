"""What happens in runs of every kind, as events for sinks to take."""

from __future__ import annotations

import functools
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2
from replay.events import Event, Merged
from replay.init_pose import InitPose
from replay.options import RunOptions
from replay.pipeline import merge
from replay.runs import RunPath
from tests.bags import Recorded, write_mcap
from tests.runs import (
    bare_room,
    begun_anew,
    growing,
    in_log_order,
    link,
    linked,
    reference_from,
    seen,
    two_robots,
)


@dataclass(frozen=True)
class Scenario:
    """A recording, how it is read, and what must come of it for the scenario to be what its name says."""

    record: Callable[[], Sequence[Recorded]]
    is_so: Callable[[Merged | None], bool]
    images: str = "none"
    init_poses: tuple[InitPose, ...] = ()
    use_tf: bool = False
    trajectories: str = "none"


def _nothing() -> Grid:
    return Grid(np.full((20, 30), -1, np.int8), 0.1)


def _pose_of(robot: str) -> tuple[float, float, float]:
    pose = reference_from(robot)
    return pose.x_m, pose.y_m, pose.yaw_rad


def _statuses(event: Merged | None) -> list[str]:
    return [str(robot.status) for robot in event.result.robots.values()] if event else []


SCENARIOS: dict[str, Scenario] = {
    "merged": Scenario(
        two_robots, lambda last: _statuses(last) == ["reference", "merged"] and last.pictures != (), images="changed"
    ),
    "three_robots_one_unplaced": Scenario(
        lambda: in_log_order(two_robots(), [seen("r3", 30.0, bare_room())]),
        lambda last: _statuses(last) == ["reference", "merged", "unmerged"],
        images="all",
    ),
    "nobody_merged": Scenario(
        lambda: [seen(robot, index, bare_room()) for index, robot in enumerate(("r1", "r2", "r3"))],
        lambda last: _statuses(last) == ["reference", "unmerged", "unmerged"],
        images="changed",
    ),
    "restarted": Scenario(
        lambda: [seen("r1", 0.0), seen("r2", 1.0), seen("r2", 2.0, begun_anew(bare_room()))],
        lambda last: [str(change.kind) for change in last.result.changes] == ["jumped", "withdrawn"],
    ),
    "no_reference": Scenario(
        lambda: in_log_order([seen("r1", 0.0, resolution=0.0)], growing("r2")),
        lambda last: _statuses(last) == ["no_map", "unmerged"] and last.result.merged is None,
    ),
    "nothing_known": Scenario(
        lambda: [seen("r1", 0.0, _nothing()), seen("r2", 1.0)],
        lambda last: last.result.merged is None and _statuses(last) == ["no_map", "unmerged"],
        images="all",
    ),
    "no_map_at_all": Scenario(
        lambda: [seen("r1", 0.0, _nothing()), seen("r2", 1.0, _nothing())],
        lambda last: _statuses(last) == ["no_map", "no_map"],
    ),
    "believed": Scenario(
        lambda: in_log_order([linked(0.0, link("", "r3/map"))], two_robots(), growing("r3", 1.0)),
        lambda last: last.report["robots"]["r2"]["prior"] is not None and len(last.report["notes"]) == 1,
        init_poses=(InitPose("r2", *_pose_of("r2")),),
        use_tf=True,
    ),
    "driven": Scenario(
        lambda: in_log_order(
            two_robots(),
            [linked(0.5 * index, link("map", "r1/base_link", Sim2(0.2 * index, 1.0))) for index in range(50)],
        ),
        lambda last: [item.robot for item in last.moved] == ["r1"],
        images="changed",
        trajectories="all",
    ),
    "one_robot": Scenario(lambda: growing("r1"), lambda last: _statuses(last) == ["reference"], images="changed"),
}


@functools.cache
def events_of(name: str) -> tuple[Event, ...]:
    """Return all that happens in a scenario."""
    scenario = SCENARIOS[name]
    with tempfile.TemporaryDirectory() as folder:
        path = write_mcap(Path(folder) / "run.mcap", scenario.record())
        options = RunOptions(
            (RunPath(None, path),),
            images=scenario.images,  # type: ignore[arg-type]
            init_poses=scenario.init_poses,
            use_tf=scenario.use_tf,
            trajectories=scenario.trajectories,  # type: ignore[arg-type]
        )
        events = tuple(merge(options))
    last = next((event for event in reversed(events) if isinstance(event, Merged)), None)
    assert scenario.is_so(last), (name, last)
    return events
