"""Maps that tell nothing, or the wrong thing: without walls, of one cell, of one wall, symmetric, identical, mirrored.

Recordings are whole. Maps that do not tell where they lie must not be placed, or only where they lie.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from benchmarks.faults.messages import MapContent, Message
from benchmarks.faults.world import (
    BARE_ROOM,
    CORRIDOR,
    ONE_WALL,
    PARTS_M,
    SQUARE_ROOM,
    STRANGER,
    Box,
    drawn_map,
    indices_of_maps,
    robot_of,
)
from mapmerge.grid import Grid
from samples.world import Rng

Messages = Sequence[Message]

_LARGE_CELLS = 1500


def all_free(recorded: Messages, rng: Rng) -> Messages:
    """Let what is known be free, in all maps of one robot or of all."""
    return _redrawn(recorded, rng, lambda _, content: replace(content, cells=content.cells.replace(b"\x64", b"\x00")))


def one_cell(recorded: Messages, rng: Rng) -> Messages:
    """Let maps have one cell."""
    cell = (b"\xff", b"\x00", b"\x64")[int(rng.integers(3))]
    return _redrawn(recorded, rng, lambda _, content: replace(content, width=1, height=1, cells=cell))


def one_row(recorded: Messages, rng: Rng) -> Messages:
    """Let maps have one row, or one column."""
    is_row = rng.uniform() < 0.5

    def cut(_: Message, content: MapContent) -> MapContent:
        row = content.cells[content.height // 2 * content.width :][: content.width]
        return replace(content, width=len(row) if is_row else 1, height=1 if is_row else len(row), cells=row)

    return _redrawn(recorded, rng, cut)


def one_wall(recorded: Messages, rng: Rng) -> Messages:
    """Let maps show one wall, or a corridor without ends: nothing tells where along it a map lies."""
    return _in_building(recorded, rng, (ONE_WALL, CORRIDOR))


def symmetric(recorded: Messages, rng: Rng) -> Messages:
    """Let maps show a bare room that looks the same from two sides or from four."""
    return _in_building(recorded, rng, (BARE_ROOM, SQUARE_ROOM))


def identical(recorded: Messages, rng: Rng) -> Messages:
    """Let two robots have the same maps."""
    one, other = rng.permutation(["r1", "r2", "r3"])[:2]
    maps = [each for each in recorded if isinstance(each.content, MapContent)]
    own = [each for each in maps if robot_of(each.topic) == one]
    others = {id(each): index for index, each in enumerate(each for each in maps if robot_of(each.topic) == other)}
    result = []
    for each in recorded:
        # the last ones are the same, however many there are
        at = others[id(each)] - len(others) if id(each) in others else 0
        content = own[max(at, -len(own))].content if at else each.content
        if isinstance(content, MapContent) and isinstance(each.content, MapContent):
            content = replace(content, stamp_ns=each.content.stamp_ns)
        result.append(replace(each, content=content))
    return result


def mirrored(recorded: Messages, rng: Rng) -> Messages:
    """Let the maps of one robot be mirrored, as when rows are written from the other end: they fit nowhere."""
    return _redrawn(recorded, rng, lambda _, content: _with(content, _grid(content)[::-1]), most=1)


def over_memory(recorded: Messages, rng: Rng) -> Messages:
    """Let a map be larger than the memory that it may take."""
    index = indices_of_maps(recorded)[int(rng.integers(len(indices_of_maps(recorded))))]
    content = recorded[index].content
    if not isinstance(content, MapContent):
        raise TypeError(content)
    cells = np.zeros((_LARGE_CELLS, _LARGE_CELLS), np.int8)
    cells[:: int(rng.integers(20, 60))] = 100
    large = replace(recorded[index], content=_with(content, cells))
    return [*recorded[:index], large, *recorded[index + 1 :]]


def _in_building(recorded: Messages, rng: Rng, buildings: Sequence[tuple[Box, ...]]) -> Messages:
    walls = buildings[int(rng.integers(len(buildings)))]
    whole = [
        _with(content, drawn_map(robot_of(each.topic), len(PARTS_M) - 1, walls).cells)
        if isinstance(content := each.content, MapContent) and robot_of(each.topic) != STRANGER
        else content
        for each in recorded
    ]
    return [replace(each, content=content) for each, content in zip(recorded, whole, strict=True)]


def _redrawn(
    recorded: Messages, rng: Rng, change: Callable[[Message, MapContent], MapContent], most: int = 3
) -> Messages:
    """Change all maps of some robots."""
    robots = set(rng.permutation(["r1", "r2", "r3"])[: int(rng.integers(1, most + 1))])
    return [
        replace(each, content=change(each, each.content))
        if isinstance(each.content, MapContent) and robot_of(each.topic) in robots
        else each
        for each in recorded
    ]


def _grid(content: MapContent) -> np.ndarray:
    return np.frombuffer(content.cells, np.int8).reshape(content.height, content.width)


def _with(content: MapContent, cells: np.ndarray) -> MapContent:
    grid = Grid(cells, content.resolution_m)
    return replace(content, width=grid.cols, height=grid.rows, cells=np.ascontiguousarray(cells).tobytes())
