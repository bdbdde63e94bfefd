"""Maps in the Rerun recording: the merged one, and each robot's own under its frame. Only what changed is logged."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import rerun as rr

from mapmerge.config import CellConfig
from mapmerge.grid import Grid
from mapmerge.outcome import RobotOutcome, Status
from mapmerge.resample import in_bands
from mapmerge.result import MergeResult
from mapmerge.sim2 import Points, Sim2
from mapmerge.warp import Bytes
from replay.sinks.rerun_entities import GROUND, MERGED, MERGED_MAP, EntityPath, RobotEntities
from replay.sinks.rerun_labels import PointM, known_places_m
from replay.sinks.rerun_layout import Box as Extent
from replay.sinks.rerun_layout import Layout, lay_out
from replay.sinks.rerun_stream import RrdStream
from replay.sinks.rerun_walls import WallScene

# A texture of a graphics card has at most so many pixels on a side; larger maps are shown coarser.
MAX_SIDE_CELLS = 8192

# Of cells that are free, as likely free as occupied, and occupied.
_FLOOR, _UNSURE, _WALL = 84, 50, 170

_LABEL_Z_M = 1.0
# In points of the screen, which the library tells from metres by their sign.
_DOT_RADIUS = rr.Radius.ui_points(0.75)


def _shades() -> Bytes:
    """Return the shade of each cell's byte: floors dim, walls light, what is not known as the ground behind the map."""
    percent = np.arange(101)
    shades = np.full(256, GROUND[0], np.uint8)
    shades[:101] = np.interp(percent, (0, 50, 100), (_FLOOR, _UNSURE, _WALL)).astype(np.uint8)
    return shades


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
    """

    def __init__(self, stream: RrdStream, robots: Sequence[RobotEntities], cells: CellConfig) -> None:
        self._stream = stream
        self._robots = robots
        self._cells = cells
        self._shades = _shades()
        self._merged: Grid | None = None
        self._laid_out: Mapping[str, RobotOutcome] | None = None
        self._shown = {entities.robot: _Shown() for entities in robots}
        self._walls = {entities.robot: WallScene(stream, entities, cells) for entities in robots}
        self._extent: Extent | None = None
        stream.log(MERGED, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)

    @property
    def extent(self) -> Extent | None:
        """What all maps cover now; None without maps."""
        return self._extent

    @property
    def shown(self) -> set[str]:
        """Robots whose map frame lies somewhere."""
        return {robot for robot, shown in self._shown.items() if shown.pose is not None}

    def show(self, result: MergeResult) -> None:
        """Log what differs from what was logged before."""
        self._show_merged(result.merged)
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
        self._extent = layout.extent
        for entities in self._robots:
            self._show_pose(entities, layout)
            self._show_label(entities, result.robots[entities.robot], layout)

    def _show_merged(self, merged: Grid | None) -> None:
        if merged is not None and merged is not self._merged:
            self._log_grid(MERGED_MAP, merged, draw_order=1.0)
            self._merged = merged

    def _show_map(self, entities: RobotEntities, grid: Grid) -> None:
        """Log a robot's own map, cropped to what it knows, so that it lies within the merged map once it is placed."""
        known = grid.cropped_to_known()
        shown = self._shown[entities.robot]
        self._log_grid(entities.map, known, draw_order=0.0)
        self._walls[entities.robot].show(known)
        is_blank = known.cells.size == 0
        shown.corners_m = None if is_blank else _corners_m(known)
        shown.places_m = None if is_blank else known_places_m(known)

    def _log_grid(self, path: EntityPath, grid: Grid, *, draw_order: float) -> None:
        if grid.cells.size == 0:
            self._stream.log(path, rr.Clear(recursive=False))
            return
        shown = _shrunk(grid, self._cells)
        pose = shown.map_from_grid
        self._stream.log(
            path,
            rr.GridMap(
                # Row 0 has the lowest y in a map, and is the top one in a picture.
                data=cv2.LUT(shown.cells.view(np.uint8), self._shades)[::-1].tobytes(),
                format=rr.components.ImageFormat(
                    width=shown.cols, height=shown.rows, color_model="L", channel_datatype="U8"
                ),
                cell_size=shown.resolution_m,
                translation=[pose.x_m, pose.y_m, 0.0],
                quaternion=_quaternion(pose.yaw_rad),
                draw_order=draw_order,
                colormap=rr.components.Colormap.Grayscale,
            ),
        )

    def _show_pose(self, entities: RobotEntities, layout: Layout) -> None:
        pose, shown = layout.merged_from_map.get(entities.robot), self._shown[entities.robot]
        if pose is None or pose == shown.pose:
            return
        shown.pose = pose
        self._stream.log(
            entities.frame,
            rr.Transform3D(
                translation=[pose.x_m, pose.y_m, 0.0], quaternion=_quaternion(pose.yaw_rad), scale=[pose.scale] * 3
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


def _shrunk(grid: Grid, cells: CellConfig) -> Grid:
    """Return a map so coarse that it can be shown."""
    factor = math.ceil(max(grid.cells.shape) / MAX_SIDE_CELLS)
    return grid if factor == 1 else in_bands(grid, factor, cells)


def _corners_m(grid: Grid) -> Points:
    """Return the corners of a grid in the map frame, counter-clockwise from that of cell (0, 0)."""
    width_m, height_m = grid.cols * grid.resolution_m, grid.rows * grid.resolution_m
    return grid.map_from_grid.apply(np.array([[0.0, 0.0], [width_m, 0.0], [width_m, height_m], [0.0, height_m]]))


def _quaternion(yaw_rad: float) -> rr.Quaternion:
    return rr.Quaternion(xyzw=[0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2)])
