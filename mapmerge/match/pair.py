"""Two maps that are matched, and which placements are allowed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmerge.align import Poses, composed, inverses, poses_of
from mapmerge.match.spectrum import Spectra
from mapmerge.prepare import PreparedMap
from mapmerge.prior import Prior
from mapmerge.sim2 import Sim2
from mapmerge.verify import known_area_m2


@dataclass(frozen=True, slots=True, eq=False)
class DescribedMap:
    """A map with its orientation spectra."""

    map: PreparedMap
    spectra: Spectra

    @property
    def wall_m(self) -> float:
        """Length of its walls."""
        return len(self.map.walls_m) * self.map.wall_spacing_m

    def comes_before(self, other: DescribedMap) -> bool:
        """Tell which of two maps is the source whatever order they are given in, so that the outcome is symmetric.

        It is the smaller one, which costs less. Of copies, the frames decide.
        """
        mine, others = self.map.grid, other.map.grid
        key = (known_area_m2(self.map), *mine.cells.shape)
        other_key = (known_area_m2(other.map), *others.cells.shape)
        if key != other_key:
            return key < other_key
        if not np.array_equal(mine.cells, others.cells):
            return mine.cells.tobytes() < others.cells.tobytes()
        one, two = mine.map_from_grid, others.map_from_grid
        return (one.x_m, one.y_m, one.yaw_rad) < (two.x_m, two.y_m, two.yaw_rad)


@dataclass(frozen=True, slots=True, eq=False)
class PairOfMaps:
    """Two maps in the order in which they are matched.

    Parameters
    ----------
    target, source
        The map that stays, and the one that is placed.
    prior
        What is believed of their placement; None if nothing is.
    swapped
        Whether these are not the maps as they were given, but the other way round: the prior is of the source from
        the target, and so are limits of the scale.
    """

    target: DescribedMap
    source: DescribedMap
    prior: Prior | None = None
    swapped: bool = False

    @property
    def reach_m(self) -> float:
        """How far what the maps show lies from the origins of their frames: by so much a turn moves it."""
        grids = self.target.map.grid, self.source.map.grid
        return max(math.hypot(grid.map_from_grid.x_m, grid.map_from_grid.y_m) for grid in grids) + max(
            math.hypot(*self.target.map.extent_m), math.hypot(*self.source.map.extent_m)
        )

    def between_maps(self, target_from_source: Sim2) -> Sim2:
        """Return a placement between grid frames as one between map frames."""
        target, source = self.target.map.grid, self.source.map.grid
        return target.map_from_grid @ target_from_source @ source.map_from_grid.inverse()

    def between_grids(self, target_from_source: Sim2) -> Sim2:
        """Return a placement between map frames as one between grid frames."""
        target, source = self.target.map.grid, self.source.map.grid
        return target.map_from_grid.inverse() @ target_from_source @ source.map_from_grid

    @property
    def believed(self) -> Sim2 | None:
        """The prior's placement between the grid frames."""
        if self.prior is None:
            return None
        pose = self.prior.target_from_source
        return self.between_grids(pose.inverse() if self.swapped else pose)

    def allowed(self, poses: Poses, slack_m: float = 0.0, slack_rad: float = 0.0) -> NDArray[np.bool_]:
        """Tell which placements between grid frames, shape (C, 4), lie within the prior, or so near to it."""
        if self.prior is None:
            return np.ones(len(poses), np.bool_)
        target, source = self.target.map.grid.map_from_grid, self.source.map.grid.map_from_grid.inverse()
        moved = composed(composed(poses_of([target]), poses), poses_of([source]))
        if self.swapped:
            moved = inverses(moved)
        return self.prior.allows_each(moved[:, :3], slack_m, slack_rad)
