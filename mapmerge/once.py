"""All maps at once, for whoever has no recording of how they grew."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mapmerge.checks import shown
from mapmerge.config import MergeConfig
from mapmerge.errors import ConfigError, GridError
from mapmerge.grid import MAX_PERCENT, UNKNOWN, Grid
from mapmerge.merger import Merger
from mapmerge.prior import Prior
from mapmerge.result import MergeResult

GridLike = Grid | NDArray[np.generic]


def merge(
    grids: Mapping[str, GridLike] | Sequence[GridLike],
    config: MergeConfig | None = None,
    *,
    resolution_m: float | None = None,
    priors: Mapping[str, Prior] | None = None,
) -> MergeResult:
    """Merge maps, and say of each where it lies, or why that cannot be said.

    Parameters
    ----------
    grids
        The maps; the first is the reference, whose frame is the merged frame. Those of a sequence are called ``map0``,
        ``map1`` and so on. Each is a `Grid`, or an array of shape (rows, columns) of whole numbers as
        ``nav_msgs/OccupancyGrid`` has them: −1 for unknown, 0 to 100 for the probability of being occupied, row 0 the
        one with the lowest y.
    config
        Settings.
    resolution_m
        Side of a cell of the maps that are arrays.
    priors
        Where maps are believed to lie in the reference's frame, by name.

    Returns
    -------
    result
        What a `Merger` says of these maps: `MergeResult.poses`, `MergeResult.merged`, and the reasons.

    Raises
    ------
    GridError
        If an array is no map.
    ConfigError
        If there is no map, settings do not fit together, or an argument is of another kind.

    Examples
    --------
    >>> import numpy as np
    >>> from mapmerge import merge
    >>> empty = np.zeros((60, 80), np.int8)
    >>> result = merge({"kitchen": empty, "hall": empty}, resolution_m=0.05)
    >>> print(result.robots["hall"].reason.message)
    not placed on kitchen: one of the maps shows no wall at all
    """
    is_one = isinstance(grids, np.ndarray) and grids.ndim == 2
    if is_one or isinstance(grids, (Grid, str)) or not isinstance(grids, Iterable):
        raise ConfigError(f"grids are {shown(grids)}; expected several maps, or a mapping of names to maps")
    named = grids if isinstance(grids, Mapping) else {f"map{number}": grid for number, grid in enumerate(grids)}
    if not named:
        raise ConfigError("there is no map; expected at least one, the reference first")
    maps = {name: _as_grid(name, grid, resolution_m) for name, grid in named.items()}
    return Merger(list(maps), config).step(maps, priors, is_last=True)


def _as_grid(name: str, grid: GridLike, resolution_m: float | None) -> Grid:
    if isinstance(grid, Grid):
        return grid
    try:
        cells = np.asarray(grid)
    except ValueError as error:  # rows of different lengths
        raise GridError(f"{name} is {shown(grid)}; expected a Grid, or an array [rows, columns]") from error
    if resolution_m is None:
        raise GridError(f"{name} is an array; give resolution_m, the side of its cells, or a Grid")
    if cells.dtype.kind not in "iu":
        raise GridError(f"{name} has cells of {cells.dtype}; expected whole numbers, {UNKNOWN} or 0 to {MAX_PERCENT}")
    if cells.size and (cells.min() < UNKNOWN or cells.max() > MAX_PERCENT):
        raise GridError(
            f"{name} has cells between {cells.min()} and {cells.max()}; expected {UNKNOWN} (unknown) or 0 (free) to "
            f"{MAX_PERCENT} (occupied): of an image, say which pixels are which"
        )
    return Grid(cells.astype(np.int8), resolution_m)
