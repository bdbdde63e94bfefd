"""What is truly so of the robots of a run: ``NAME.truth.json``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from mapmerge.sim2 import IDENTITY, Sim2
from replay.documents import Node
from replay.errors import InputError
from replay.read_document import read_json

_POSE = ("x_m", "y_m", "yaw_rad", "yaw_deg")


@dataclass(frozen=True, slots=True)
class RobotTruth:
    """What is known of one robot's map.

    Parameters
    ----------
    reference_from_map
        Where its map frame truly lies in the reference's; None if its map is of another place.
    at_m
        The point of its map frame at which positions are compared: the middle of what it shares with others.
    """

    reference_from_map: Sim2 | None
    at_m: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Truth:
    """What is known of a run.

    Parameters
    ----------
    reference
        The robot in whose map frame poses are.
    robots
        The others, by name.
    reference_from_true_map
        Where the true map's frame lies in the reference's; None if nothing is said.
    """

    reference: str
    robots: Mapping[str, RobotTruth]
    reference_from_true_map: Sim2 | None

    def everybody(self) -> dict[str, RobotTruth]:
        """Return what is known of all robots, the reference first, which is compared at what another shares with it."""
        others = [(item.reference_from_map, item.at_m) for item in self.robots.values()]
        at_m = next((pose.apply_point(*shared_m) for pose, shared_m in others if pose is not None), (0.0, 0.0))
        return {self.reference: RobotTruth(IDENTITY, at_m), **self.robots}

    def seen_from(self, robot: str, file: Path) -> Truth:
        """Return the same with another robot as the reference.

        If its map is of another place, all that are of the old reference's place are none of its own; of others of
        other places nothing is known then.

        Raises
        ------
        InputError
            If nothing is known of it.
        """
        if robot == self.reference:
            return self
        known = self.robots.get(robot)
        if known is not None and known.reference_from_map is None:
            there = {name: item for name, item in self.everybody().items() if item.reference_from_map is not None}
            return Truth(robot, {name: replace(item, reference_from_map=None) for name, item in there.items()}, None)
        if known is None or known.reference_from_map is None:
            raise InputError(
                f"{file}: it says nothing of how {robot}, the run's reference, lies to {self.reference}; merge with "
                f"--robots {self.reference},… or give a truth that does"
            )
        own_from_reference = known.reference_from_map.inverse()
        return Truth(
            robot,
            {
                name: RobotTruth(item.reference_from_map and own_from_reference @ item.reference_from_map, item.at_m)
                for name, item in self.everybody().items()
                if name != robot
            },
            self.reference_from_true_map and own_from_reference @ self.reference_from_true_map,
        )


def load_truth(path: Path) -> Truth:
    """Read a truth file; keys that are not used are left alone, unless they are nearly like one that is.

    Raises
    ------
    InputError
        If it is none.
    """
    return truth_of(read_json(path, "TRUTH.json, as `replay evaluate --help` shows it"))


def truth_of(node: Node) -> Truth:
    """Read what is truly so."""
    node.no_slips(("reference", "robots", "reference_from_true_map"))
    return Truth(
        node.need("reference").text(),
        {name: _robot(item) for name, item in node.need("robots").items()},
        node.maybe("reference_from_true_map", _pose),
    )


def _robot(node: Node) -> RobotTruth:
    node.no_slips(("same_place", "overlap_centre_m", *_POSE))
    same_place = node.maybe("same_place", Node.truth)
    return RobotTruth(
        None if same_place is False else _pose(node),
        node.maybe("overlap_centre_m", Node.place_m) or (0.0, 0.0),
    )


def _pose(node: Node) -> Sim2:
    node.no_slips(_POSE)
    degrees = node.maybe("yaw_deg", Node.number)
    if degrees is not None and node.get("yaw_rad") is not None:
        node.refuse("either yaw_deg or yaw_rad")
    yaw_rad = node.need("yaw_rad").number() if degrees is None else math.radians(degrees)
    return Sim2(node.need("x_m").number(), node.need("y_m").number(), yaw_rad)
