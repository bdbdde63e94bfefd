"""Where maps agree and contradict each other in the Rerun recording: a tint over the merged map."""

from __future__ import annotations

import numpy as np
import rerun as rr

from mapmerge.config import CellConfig
from mapmerge.overlap import AGREE, CONTRADICT, overlap
from mapmerge.result import MergeResult
from mapmerge.warp import Layer
from replay.sinks.rerun_entities import OVERLAP
from replay.sinks.rerun_grids import grid_map
from replay.sinks.rerun_stream import RrdStream

MAX_SIDE_CELLS = 1024
"""Larger maps are compared in larger cells: it is a tint."""

_HEIGHT_M = 0.3
_TINT = {AGREE: (40, 190, 95, 54), CONTRADICT: (255, 40, 40, 255)}


class OverlapScene:
    """Logs the tint, when a map that is placed or a placement changed.

    Parameters
    ----------
    stream
        The recording.
    cells
        When a cell counts as occupied.
    tolerance_m
        How far a wall may lie from the same wall in another map.
    """

    def __init__(self, stream: RrdStream, cells: CellConfig, tolerance_m: float) -> None:
        self._stream = stream
        self._cells = cells
        self._tolerance_m = tolerance_m
        self._layers: list[Layer] = []
        self._is_shown = False
        colours = np.zeros((256, 4), np.uint8)
        for kind, colour in _TINT.items():
            colours[kind] = colour
        # four bytes as one number are looked up four times as fast
        self._colours = colours.view(np.uint32).ravel()

    def show(self, result: MergeResult) -> None:
        """Log the tint if it can differ from the one before."""
        layers = [
            Layer(result.grids[robot], outcome.merged_from_map)
            for robot, outcome in result.robots.items()
            if outcome.merged_from_map is not None and robot in result.grids
        ]
        before, self._layers = self._layers, layers
        if len(before) == len(layers) and all(map(Layer.is_same, before, layers)):
            return
        found = None
        if result.merged is not None and len(layers) > 1:
            found = overlap(
                layers, result.merged, self._cells, tolerance_m=self._tolerance_m, max_side_cells=MAX_SIDE_CELLS
            )
        if found is None:
            if self._is_shown:
                self._stream.log(OVERLAP, rr.Clear(recursive=False))
            self._is_shown = False
            return
        self._is_shown = True
        self._stream.log(
            OVERLAP,
            grid_map(
                self._colours[found.kinds].view(np.uint8).reshape(*found.kinds.shape, 4),
                found.resolution_m,
                found.merged_from_grid,
                draw_order=2.0,
                height_m=_HEIGHT_M,
            ),
        )
