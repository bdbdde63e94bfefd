"""Maps in the Rerun recording: the merged one, and each robot's own under its frame. Only what changed is logged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr

from mapmerge.config import CellConfig
from mapmerge.grid import Grid
from mapmerge.outcome import RobotOutcome, Status
from mapmerge.result import MergeResult
from mapmerge.sim2 import Points, Sim2
from replay.sinks.rerun_entities import CONTRADICTIONS, MERGED, MERGED_MAP, RobotEntities
from replay.sinks.rerun_grids import quaternion
from replay.sinks.rerun_labels import PointM, known_places_m
from replay.sinks.rerun_lattice import Lattice
from replay.sinks.rerun_layout import Box as Extent
from replay.sinks.rerun_layout import Layout, in_view, lay_out
from replay.sinks.rerun_overlap import RED, Tint
from replay.sinks.rerun_patches import PatchedMap
from replay.sinks.rerun_stream import RrdStream
from replay.sinks.rerun_walls import WallScene

# Above each robot's own map: of those, the first robot's is uppermost.
_MERGED_ORDER = 1.0

_LABEL_Z_M = 1.0
_MARK_Z_M = 0.3
_MARK_RADIUS = rr.Radius.ui_points(1.6)
# In points of the screen, which the library tells from metres by their sign.
_DOT_RADIUS = rr.Radius.ui_points(0.75)


@dataclass(slots=True)
class _Shown:
    """What the recording shows of one robot now."""

    corners_m: Points | None = None
    places_m: Points | None = None
    pose: Sim2 | None = None
    label: tuple[str, PointM] | None = None


class MapScene:
    """Logs the maps of a run.

    Parameters
    ----------
    stream
        The recording.
    robots
        The robots, the reference first.
    cells
        When a cell counts as occupied.
    tolerance_m
        How far a wall may lie from the same wall in another map.
    """

    def __init__(
        self, stream: RrdStream, robots: Sequence[RobotEntities], cells: CellConfig, tolerance_m: float
    ) -> None:
        self._stream = stream
        self._robots = robots
        self._merged: Grid | None = None
        self._is_marked = False
        self._merged_lattice = Lattice()
        self._tint = Tint(cells, tolerance_m)
        self._merged_map = PatchedMap(stream, MERGED_MAP, cells, _MERGED_ORDER, self._tint.paint)
        self._laid_out: Mapping[str, RobotOutcome] | None = None
        self._shown = {entities.robot: _Shown() for entities in robots}
        self._lattices = {entities.robot: Lattice() for entities in robots}
        self._maps = {
            entities.robot: PatchedMap(stream, entities.map, cells, draw_order=0.0 - entities.index)
            for entities in robots
        }
        self._walls = {entities.robot: WallScene(stream, entities, cells) for entities in robots}
        self._now: Extent | None = None
        self._ever: Extent | None = None
        stream.log(MERGED, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)

    @property
    def extent(self) -> Extent | None:
        """What to look at, for all maps to be in view now and, if possible, at all times; None without maps."""
        return None if self._now is None else in_view(self._now, self._now.joined(self._ever))

    @property
    def shown(self) -> set[str]:
        """Robots whose map frame lies somewhere."""
        return {robot for robot, shown in self._shown.items() if shown.pose is not None}

    def show(self, result: MergeResult) -> None:
        """Log what differs from what was logged before."""
        self._show_merged(result)
        for entities in self._robots:
            if entities.robot in result.updated:
                self._show_map(entities, result.grids[entities.robot])
        # the merger keeps what became of the robots where nothing new came
        if result.robots is self._laid_out:
            return
        self._laid_out = result.robots
        corners_m = {robot: shown.corners_m for robot, shown in self._shown.items() if shown.corners_m is not None}
        places_m = {robot: shown.places_m for robot, shown in self._shown.items() if shown.places_m is not None}
        layout = lay_out(result, corners_m, places_m)
        self._now = layout.extent
        self._ever = self._ever if self._now is None else self._now.joined(self._ever)
        for entities in self._robots:
            self._show_pose(entities, layout)
            self._show_label(entities, result.robots[entities.robot], layout)

    def _show_merged(self, result: MergeResult) -> None:
        merged, repainted = result.merged, self._tint.update(result)
        if merged is not None and (merged is not self._merged or not repainted.is_empty):
            self._merged_map.show(self._merged_lattice.take(merged), repainted)
            self._merged = merged
        if not repainted.is_empty:
            self._show_contradictions()

    def _show_contradictions(self) -> None:
        """Mark them above the walls, which have the colours of their robots."""
        at_m = self._tint.contradictions_m
        if len(at_m) == 0:
            if self._is_marked:
                self._stream.log(CONTRADICTIONS, rr.Clear(recursive=False))
        else:
            places = np.column_stack([at_m, np.full(len(at_m), _MARK_Z_M)]).astype(np.float32)
            self._stream.log(CONTRADICTIONS, rr.Points3D(places, colors=[RED], radii=_MARK_RADIUS))
        self._is_marked = len(at_m) > 0

    def _show_map(self, entities: RobotEntities, grid: Grid) -> None:
        """Log a robot's own map, cropped to what it knows, so that it lies within the merged map once it is placed."""
        known = grid.cropped_to_known()
        shown = self._shown[entities.robot]
        change = self._lattices[entities.robot].take(known)
        self._maps[entities.robot].show(change)
        self._walls[entities.robot].show(change)
        is_blank = known.cells.size == 0
        shown.corners_m = None if is_blank else _corners_m(known)
        shown.places_m = None if is_blank else known_places_m(known)

    def _show_pose(self, entities: RobotEntities, layout: Layout) -> None:
        pose, shown = layout.merged_from_map.get(entities.robot), self._shown[entities.robot]
        if pose is None or pose == shown.pose:
            return
        shown.pose = pose
        self._stream.log(
            entities.frame,
            rr.Transform3D(
                translation=[pose.x_m, pose.y_m, 0.0], quaternion=quaternion(pose.yaw_rad), scale=[pose.scale] * 3
            ),
        )

    def _show_label(self, entities: RobotEntities, outcome: RobotOutcome, layout: Layout) -> None:
        at_m, shown = layout.labels_m.get(entities.robot), self._shown[entities.robot]
        if at_m is None:
            if shown.label is not None:
                shown.label = None
                self._stream.log(entities.label, rr.Clear(recursive=False))
            return
        text = _label(entities.label_text, outcome)
        if shown.label == (text, at_m):
            return
        shown.label = (text, at_m)
        self._stream.log(
            entities.label,
            rr.Points3D(
                [[*at_m, _LABEL_Z_M]],
                labels=[text],
                show_labels=True,
                colors=[entities.colour],
                radii=_DOT_RADIUS,
            ),
        )


def _label(robot: str, outcome: RobotOutcome) -> str:
    if outcome.merged_from_map is not None:
        return f"{robot} (reference)" if outcome.status is Status.REFERENCE else robot
    return f"{robot}: not merged,\n{outcome.reason.code.replace('_', ' ')}"


def _corners_m(grid: Grid) -> Points:
    """Return the corners of a grid in the map frame, counter-clockwise from that of cell (0, 0)."""
    width_m, height_m = grid.cols * grid.resolution_m, grid.rows * grid.resolution_m
    return grid.map_from_grid.apply(np.array([[0.0, 0.0], [width_m, 0.0], [width_m, height_m], [0.0, height_m]]))
