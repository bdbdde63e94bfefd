"""From the transforms of one recording to where its robots were in their map frames."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mapmerge.sim2 import wrap_angle
from replay.messages import FrameLink
from replay.transforms import TransformBuffer

STEP_M = 0.1
STEP_RAD = 0.1
MOST_POSES = 10_000
"""After so many poses of a robot the steps are twice as long, and so on."""

JUMP_M = 3.0
"""Nobody drives so far from one pose to the next: there a line is parted."""

INTERVAL_NS = 80_000_000
"""Least time between two looks at a robot: ten transforms a second are all seen, and not many more."""

_BASES = ("base_footprint", "base_link")

Pose = tuple[float, float, float]
"""x and y in metres, yaw in radians."""


@dataclass(slots=True)
class _Track:
    """What is known of one robot's way."""

    base: str | None = None
    links: int = 0
    last: Pose | None = None
    seen_ns: int | None = None
    count: int = 0


class Tracker:
    """Folds the transforms of one recording into poses of the robots in their map frames.

    A robot is where its base is: the frame ``base_footprint`` or ``base_link``, by itself or behind a prefix, that
    hangs on its map frame. Where several do, it is the one whose prefix is the robot's name; else nobody can tell.

    Parameters
    ----------
    frames
        Map frame of each robot of the recording.
    """

    def __init__(self, frames: Mapping[str, str]) -> None:
        self._frames = frames
        self._buffer = TransformBuffer()
        self._bases: list[str] = []
        self._known: set[str] = set()
        self._tracks = {robot: _Track() for robot in frames}
        self._new: dict[str, list[Pose]] = {}

    def take(self, stamp_ns: int | None, links: Sequence[FrameLink]) -> None:
        """Take in transforms that hold from a time on, or always."""
        for link in links:
            self._buffer.hold(link, stamp_ns)
            if link.child not in self._known:
                self._known.add(link.child)
                if _base_prefix(link.child) is not None:
                    self._bases.append(link.child)
        if stamp_ns is None:
            return
        for robot, track in self._tracks.items():
            if track.seen_ns is None or stamp_ns - track.seen_ns >= INTERVAL_NS:
                self._look(robot, track, stamp_ns)

    def new_poses(self) -> dict[str, list[Pose]]:
        """Return where robots were since this was asked last."""
        new, self._new = self._new, {}
        return new

    def _look(self, robot: str, track: _Track, stamp_ns: int) -> None:
        track.seen_ns = stamp_ns
        chain = None if track.base is None else self._buffer.chain(self._frames[robot], track.base)
        if chain is None or track.links != len(self._known):
            # which base it is depends on which frames there are
            track.base, track.links = self._base(robot), len(self._known)
            chain = None if track.base is None else self._buffer.chain(self._frames[robot], track.base)
        if chain is None:
            return
        flat = chain.target_from_source.flat()
        pose = flat.x_m, flat.y_m, flat.yaw_rad
        if track.last is None or _is_step(track.last, pose, 2.0 ** (track.count // MOST_POSES)):
            track.last = pose
            track.count += 1
            self._new.setdefault(robot, []).append(pose)

    def _base(self, robot: str) -> str | None:
        """Return the robot's base frame; of several of one robot the first kind, None where they may be others'."""
        frame = self._frames[robot]
        linked = [base for base in self._bases if self._buffer.chain(frame, base) is not None]
        own = [base for base in linked if _base_prefix(base) == robot]
        prefixes = {_base_prefix(base) for base in linked}
        is_shared = list(self._frames.values()).count(frame) > 1
        if not own and (len(prefixes) != 1 or is_shared):
            return None
        return min(own or linked, key=_rank)


def _base_prefix(frame: str) -> str | None:
    """Return what stands before ``base_link`` in the name of a frame, without what parts them; None if it is none."""
    for kind in _BASES:
        prefix = frame.removesuffix(kind)
        if prefix != frame and (not prefix or prefix[-1] in "/_."):
            return prefix.rstrip("/_.")
    return None


def _rank(base: str) -> int:
    """Return which kind of base a frame is, the one to be preferred first."""
    return next(rank for rank, kind in enumerate(_BASES) if base.endswith(kind))


def _is_step(one: Pose, other: Pose, times: float) -> bool:
    far_m = math.hypot(one[0] - other[0], one[1] - other[1])
    return far_m >= STEP_M * times or abs(wrap_angle(one[2] - other[2])) >= STEP_RAD * times
