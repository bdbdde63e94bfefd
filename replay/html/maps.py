"""The merged map, each robot's walls and way on it, and the maps that are not merged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapmerge.raster import compared_on, pixels_around, seen, shrunk, values_on
from mapmerge.sim2 import IDENTITY
from mapmerge.warp import Layer
from replay.html.pictures import Picture, grey_picture, mask_picture, single_picture, tint_picture, visible
from replay.html.roster import Member
from replay.html.story import MAX_SIDE_PX, Story
from replay.html.ways import Ways, ways

_OWN_SIDE_PX = 800


@dataclass(frozen=True, slots=True)
class MapLayer:
    """A layer of the merged map that can be shown or not."""

    name: str
    picture: Picture
    colour: str | None
    shown: bool
    kind: str


@dataclass(frozen=True, slots=True)
class Stack:
    """Pictures of the same place on each other, and where robots drove there, if that is known."""

    layers: tuple[MapLayer, ...]
    ways: Ways | None
    resolution_m: float

    @property
    def picture(self) -> Picture:
        """The lowest one."""
        return self.layers[0].picture


@dataclass(frozen=True, slots=True)
class Apart:
    """A robot that is not merged: its own map, if it has one, and why."""

    member: Member
    picture: Picture | None
    reason: str
    code: str


def merged_stack(story: Story) -> Stack | None:
    """Return the merged map and its layers; None without one."""
    result = story.result
    if result is None or result.merged is None:
        return None
    placed = [
        (story.member(robot), layer)
        for robot, outcome in result.robots.items()
        if outcome.merged_from_map is not None and (layer := story.layer(robot, outcome.merged_from_map)) is not None
    ]
    merged = Layer(shrunk(result.merged, MAX_SIDE_PX, story.cells), IDENTITY)
    pixels = pixels_around([merged, *(layer for _, layer in placed)], MAX_SIDE_PX)
    if pixels is None:
        return None
    grey = grey_picture(values_on(merged, pixels, story.cells), pixels)
    layers = [MapLayer("merged map", grey, None, shown=True, kind="map")]
    maps = [seen(values_on(layer, pixels, story.cells), story.cells) for _, layer in placed]
    for (member, _), shown in zip(placed, maps, strict=True):
        walls = mask_picture([(visible(shown.walls), member.rgb)], pixels)
        layers.append(MapLayer(member.name, walls, member.colour, shown=True, kind="walls"))
    if len(maps) > 1:
        found = compared_on([layer for _, layer in placed], pixels, story.cells, story.tolerance_m)
        tint = tint_picture(found, np.logical_or.reduce([shown.walls for shown in maps]), pixels)
        layers.append(MapLayer("where maps overlap", tint, None, shown=True, kind="tint"))
    driven = ways(story, [(member, layer.merged_from_map) for member, layer in placed], pixels)
    return Stack(tuple(layers), driven, result.merged.resolution_m)


def apart(story: Story) -> list[Apart]:
    """Return the robots that are not in the merged map."""
    found = []
    for robot, values in story.report["robots"].items():
        if values["merged_from_map"] is not None:
            continue
        member = story.member(robot)
        layer = story.layer(robot, IDENTITY)
        picture = single_picture(layer, member.rgb, story.cells, _OWN_SIDE_PX) if layer else None
        found.append(Apart(member, picture, values["reason"]["message"], values["reason"]["code"]))
    return found
