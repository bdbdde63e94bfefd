"""What a merger can be given, and what of another kind is refused."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from mapmerge.checks import shown
from mapmerge.errors import ConfigError, GridError
from mapmerge.grid import Grid
from mapmerge.prior import Prior


def refuse_no_names(robots: Sequence[str]) -> None:
    """Refuse what is no list of names of robots.

    Raises
    ------
    ConfigError
        If it is none.
    """
    names = list(robots) if isinstance(robots, Iterable) and not isinstance(robots, (str, bytes)) else None
    if names is None or not all(isinstance(name, str) for name in names):
        raise ConfigError(f"robots are {shown(robots)}; expected a list of names, such as ['r1', 'r2']")
    if not names or len(set(names)) != len(names):
        raise ConfigError(f"robots are {names}; expected at least one, each once")


def refuse_others(updates: Mapping[str, Grid], priors: Mapping[str, Prior] | None, robots: Sequence[str]) -> None:
    """Refuse what are no maps of these robots, or no beliefs.

    Raises
    ------
    ConfigError
        If there are maps of others, or beliefs are of another kind.
    GridError
        If one is no map.
    """
    if not isinstance(updates, Mapping):
        raise ConfigError(f"maps are {shown(updates)}; expected a mapping of robots to grids")
    strangers = sorted(str(robot) for robot in updates if robot not in robots)
    if strangers:
        raise ConfigError(f"there are maps of {', '.join(strangers)}; expected only maps of {', '.join(robots)}")
    for robot, grid in updates.items():
        if not isinstance(grid, Grid):
            raise GridError(f"the map of {robot} is {shown(grid)}; expected a Grid, such as Grid(cells, resolution_m)")
    if priors is not None and not isinstance(priors, Mapping):
        raise ConfigError(f"priors are {shown(priors)}; expected a mapping of robots to Prior values")
    for robot, prior in (priors or {}).items():
        if not isinstance(prior, Prior):
            raise ConfigError(f"the prior of {robot} is {shown(prior)}; expected a Prior")
