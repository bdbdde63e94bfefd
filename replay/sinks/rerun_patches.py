"""One map in the Rerun recording: the whole of it now and then, and what changed since in a few patches upon it.

A map of a long mission changes near its robot only; logged as a whole each time it takes gigabytes in the viewer.

Tiles of a lattice, each an entity, would take as much as patches do. But the viewer draws each of the entities in a
plane a little nearer than the one before, and where it draws by OpenGL that moves them: by 0.06 % of the picture an
entity, so that seams open between many of them. Of one map there are never more than a few here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import rerun as rr

from mapmerge.config import CellConfig
from mapmerge.grid import Grid
from mapmerge.plane import NOTHING, Box
from mapmerge.resample import in_bands
from replay.sinks.rerun_entities import EntityPath, changes
from replay.sinks.rerun_grids import Pixels, grid_map, shades_of
from replay.sinks.rerun_lattice import Change, Corner
from replay.sinks.rerun_stream import RrdStream

MAX_SIDE_CELLS = 8192
"""A texture of a graphics card has at most so many pixels on a side; larger maps are shown coarser."""
MOST_PATCHES = 3
"""At most so many lie on a map: robots that drive at the same time change it in as many places."""
LEAST_CELLS = 1 << 16
"""Smaller maps are logged as a whole each time: patches, each an entity, would save little."""

_ORDER_STEP = 0.1


class PatchedMap:
    """Logs one map.

    Patches lie beside each other. When as many cells were logged in patches as the whole map has, the map is
    logged anew and they are cleared: on the whole, patches take as much as the whole maps between them do.

    Parameters
    ----------
    stream
        The recording.
    path
        The map's entity; patches are below it.
    cells
        When a cell counts as occupied.
    draw_order
        Maps with the higher one are drawn above; patches have up to half of one more.
    paint
        Returns the picture of a part of the map: of that alone, and of where it lies.
    """

    def __init__(
        self,
        stream: RrdStream,
        path: EntityPath,
        cells: CellConfig,
        draw_order: float,
        paint: Callable[[Grid], Pixels] = shades_of,
    ) -> None:
        self._stream = stream
        self._path = path
        self._cells = cells
        self._draw_order = draw_order
        self._paint = paint
        self._corner: Corner | None = None
        self._step = 1
        self._patches: dict[int, Box] = {}
        self._patched_cells = 0

    def show(self, change: Change, repainted: Box = NOTHING) -> None:
        """Log what differs from what is shown; a map without cells is cleared.

        Parameters
        ----------
        change
            What is new about the map.
        repainted
            Its cells, counted from its first one, that are painted otherwise whatever they say.
        """
        grid = change.grid
        if grid.cells.size == 0:
            self._clear_patches()
            self._corner = None
            self._stream.log(self._path, rr.Clear(recursive=False))
            return
        step = math.ceil(max(grid.cells.shape) / MAX_SIDE_CELLS)
        if change.before is None or self._corner is None or step != self._step:
            self._show_whole(change, step)
        else:
            box = change.box.union(change.on_lattice(repainted).within(change.whole))
            if not box.is_empty:
                self._show_changed(change, box, self._corner)

    def _show_whole(self, change: Change, step: int) -> None:
        self._clear_patches()
        self._corner, self._step, self._patched_cells = change.first, step, 0
        self._log(self._path, change, change.whole, self._draw_order)

    def _show_changed(self, change: Change, changed: Box, corner: Corner) -> None:
        box, taken = patch_for(_aligned(changed, corner, self._step), self._patches)
        self._patched_cells += math.prod(box.shape)
        whole_cells = change.grid.cells.size
        if whole_cells < LEAST_CELLS or self._patched_cells > whole_cells:
            self._show_whole(change, self._step)
            return
        slot = min(taken | (set(range(MOST_PATCHES)) - self._patches.keys()))
        for other in sorted(taken - {slot}):
            self._clear(other)
        self._patches[slot] = box
        self._log(changes(self._path, slot), change, box, self._draw_order + _ORDER_STEP * (slot + 1))

    def _clear_patches(self) -> None:
        for slot in sorted(self._patches):
            self._clear(slot)

    def _clear(self, slot: int) -> None:
        del self._patches[slot]
        self._stream.log(changes(self._path, slot), rr.Clear(recursive=False))

    def _log(self, path: EntityPath, change: Change, box: Box, draw_order: float) -> None:
        """Log what the map says within a box of the lattice."""
        pose = change.pose(box)
        part = Grid(change.cells(box), change.grid.resolution_m, pose, is_own=True)
        shown = part if self._step == 1 else in_bands(part, self._step, self._cells)
        self._stream.log(path, grid_map(self._paint(shown), shown.resolution_m, pose, draw_order=draw_order))


def patch_for(changed: Box, patches: Mapping[int, Box]) -> tuple[Box, set[int]]:
    """Return the least box that holds what changed and meets no other patch, and the patches that it takes in.

    It takes in at least one where there are as many patches as there may be.
    """
    starts = [changed, *(changed.union(patch) for patch in patches.values())]
    found = [_apart(start, patches) for start in starts]
    allowed = [each for each in found if len(patches) - len(each[1]) < MOST_PATCHES]
    return min(allowed, key=lambda each: math.prod(each[0].shape))


def _apart(box: Box, patches: Mapping[int, Box]) -> tuple[Box, set[int]]:
    """Return a box that has taken in the patches that it meets, and which these are."""
    taken: set[int] = set()
    while met := {key for key, patch in patches.items() if key not in taken and not patch.within(box).is_empty}:
        taken |= met
        for key in met:
            box = box.union(patches[key])
    return box, taken


def _aligned(box: Box, corner: Corner, step: int) -> Box:
    """Return the smallest box around another whose sides are whole steps from a corner."""
    row, col = corner
    top, left, bottom, right = box.shifted(-row, -col)
    aligned = Box(top // step * step, left // step * step, -(-bottom // step) * step, -(-right // step) * step)
    return aligned.shifted(row, col)
