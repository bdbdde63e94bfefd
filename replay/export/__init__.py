"""`replay export`: maps and transforms of a recording in other programs' forms. A new one is a file and a row here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from mapmerge.grid import Grid

__all__ = ["MODES", "TARGETS", "TRANSFORMS", "Target", "writer"]

WriteMap = Callable[["Grid", Path, str], Mapping[Path, bytes]]
"""From a map, a path without suffix and a mode to the files that hold it, the one that leads to the others last."""


@dataclass(frozen=True, slots=True)
class Target:
    """A row of the table: what writes maps in a form, and which endings its files have.

    Parameters
    ----------
    writer
        ``module:attribute`` of a `WriteMap`, imported when it is used.
    suffixes
        What a name that was given may end in; what is written has the endings that it should have.
    """

    writer: str
    suffixes: tuple[str, ...]


TARGETS: dict[str, Target] = {
    "map_server": Target("replay.export.map_server:files", (".yaml", ".yml", ".pgm", ".png")),
    "png": Target("replay.export.picture:files", (".png",)),
}

TRANSFORMS = "tf"
"""What is no form of maps: transforms between their frames."""

MODES = ("trinary", "scale", "raw")
"""How ``map_server`` maps hold cells."""


def writer(target: str) -> WriteMap:
    """Return what writes maps in a form."""
    module, _, attribute = TARGETS[target].writer.partition(":")
    return cast("WriteMap", getattr(import_module(module), attribute))
