"""From matches of pairs to one consistent placement of all robots.

The accepted matches are the edges of a graph. Its maximum spanning forest, by score, places the robots; an edge that
closes a loop and misses contradicts it. An edge of the forest that several others contradict, which together weigh more
than it, gives way: loops of many robots say which match is the wrong one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mapmerge.sim2 import IDENTITY, Sim2


@dataclass(frozen=True, slots=True)
class Edge:
    """An accepted match of two robots.

    Parameters
    ----------
    target_from_source
        Between the two map frames.
    weight
        The larger, the more it is trusted.
    at_m
        A point of the source's map frame, amid what it knows, at which placements are compared.
    """

    target: str
    source: str
    target_from_source: Sim2
    weight: float
    at_m: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Placement:
    """Where a robot's map lies in its component.

    Parameters
    ----------
    component
        The first robot, in the given order, of all those that are linked with this one; its map frame is the
        component's frame.
    component_from_map
        Pose of this robot's map in that frame.
    via
        The robot whose match places this one; None for the first robot.
    """

    component: str
    component_from_map: Sim2
    via: str | None


@dataclass(frozen=True, slots=True)
class Forest:
    """All robots' placements, and the edges that contradict them."""

    placements: dict[str, Placement]
    contradicted: tuple[Edge, ...]


def place(robots: Sequence[str], edges: Sequence[Edge], *, distance_m: float, angle_rad: float) -> Forest:
    """Place robots by their matches.

    Parameters
    ----------
    robots
        In the order that decides which robot a component is named after.
    edges
        Accepted matches.
    distance_m, angle_rad
        An edge that closes a loop contradicts it if it misses by more than one of these.
    """
    ordered = sorted(edges, key=lambda edge: (-edge.weight, robots.index(edge.target), robots.index(edge.source)))

    def without(refused: Sequence[Edge]) -> Forest:
        """Place by all edges but these; return the forest with all that contradict it, these among them."""
        tree, loops = _spanning(robots, [edge for edge in ordered if edge not in refused])
        placements = _walk(robots, tree)
        missing = [
            edge
            for edge in (*refused, *loops)
            if not _agrees(edge, placements, distance_m=distance_m, angle_rad=angle_rad)
        ]
        return Forest(placements, tuple(edge for edge in ordered if edge in missing))

    refused: list[Edge] = []
    forest = without(refused)
    while forest.contradicted:
        suspects = [edge for edge in ordered if edge not in forest.contradicted]
        others = [(without([*refused, edge]), edge) for edge in suspects]
        better, suspect = min(others, key=lambda other: _cost(other[0], robots), default=(forest, None))
        if suspect is None or _cost(better, robots) >= _cost(forest, robots):
            break
        refused, forest = [*refused, suspect], better
    return forest


def _cost(forest: Forest, robots: Sequence[str]) -> tuple[int, float]:
    """Return what a forest does without: links first, then the weight of the edges that contradict it."""
    parts = len({forest.placements[robot].component for robot in robots})
    return parts, sum(edge.weight for edge in forest.contradicted)


def _spanning(robots: Sequence[str], ordered: Sequence[Edge]) -> tuple[list[Edge], list[Edge]]:
    """Return the edges of the maximum spanning forest, and those that close loops."""
    group = {robot: robot for robot in robots}
    tree: list[Edge] = []
    loops: list[Edge] = []
    for edge in ordered:
        old, new = group[edge.source], group[edge.target]
        (loops if old == new else tree).append(edge)
        group = {robot: new if name == old else name for robot, name in group.items()}
    return tree, loops


def _walk(robots: Sequence[str], tree: Sequence[Edge]) -> dict[str, Placement]:
    """Compose the transforms along the tree, from the first robot of each component outwards."""
    neighbours: dict[str, list[tuple[str, Sim2]]] = {robot: [] for robot in robots}
    for edge in tree:
        neighbours[edge.target].append((edge.source, edge.target_from_source))
        neighbours[edge.source].append((edge.target, edge.target_from_source.inverse()))
    placements: dict[str, Placement] = {}
    for root in robots:
        if root in placements:
            continue
        placements[root] = Placement(root, IDENTITY, None)
        queue = [root]
        for robot in queue:
            for other, robot_from_other in neighbours[robot]:
                if other not in placements:
                    pose = placements[robot].component_from_map @ robot_from_other
                    placements[other] = Placement(root, pose, robot)
                    queue.append(other)
    return placements


def _agrees(edge: Edge, placements: dict[str, Placement], *, distance_m: float, angle_rad: float) -> bool:
    if placements[edge.target].component != placements[edge.source].component:
        return False
    target = placements[edge.target].component_from_map
    placed = target.inverse() @ placements[edge.source].component_from_map
    return placed.is_close(edge.target_from_source, distance_m=distance_m, angle_rad=angle_rad, at_m=edge.at_m)
