"""What is believed of robots' places before their maps are looked at: given poses, recorded transforms."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from mapmerge.prior import Prior
from replay.events import Noted
from replay.init_pose import InitPose
from replay.pose3 import MAX_TILT_RAD
from replay.sources.base import Source
from replay.timeline import Transforms
from replay.transforms import Chain, TransformBuffer

TF_SIGMA_M = 0.5
TF_SIGMA_YAW_RAD = math.radians(5.0)

_WITHOUT = "no prior is used for it"


class Beliefs:
    """Folds transforms into priors; each recording has frames of its own.

    Parameters
    ----------
    frames
        Each robot's map frame as recorded, the reference first; None without a usable map.
    given
        Poses that were given; they are believed rather than transforms.
    recordings
        Those with transforms; None if none are to be used.
    """

    def __init__(
        self, frames: Mapping[str, str | None], given: Sequence[InitPose], recordings: Sequence[Source] | None
    ) -> None:
        self._reference = next(iter(frames))
        self._frames = {robot: frame for robot, frame in frames.items() if frame is not None}
        self._given = {item.robot: item.prior() for item in given}
        self._buffers = {recording: TransformBuffer() for recording in recordings or ()}
        others = [robot for robot in self._frames if robot != self._reference and robot not in self._given]
        asked = others if recordings is not None and self._reference in self._frames else []
        self._hopeless = {robot: why for robot in asked if (why := self._why_hopeless(robot))}
        self._open = [robot for robot in asked if robot not in self._hopeless]
        self._linked: set[str] = set()
        self._tilted: set[str] = set()

    def take(self, item: Transforms) -> None:
        """Take in transforms that hold from their time on."""
        for link in item.links:
            self._buffers[item.recording].hold(link, item.stamp_ns)

    def now(self) -> tuple[dict[str, Prior], tuple[Noted, ...]]:
        """Return what is believed of each robot now, and what must be said of it for the first time."""
        priors, notes = dict(self._given), []
        for robot in self._open:
            chain = self._chain(robot)
            if chain is None:
                continue
            self._linked.add(robot)
            tilt_rad = chain.target_from_source.tilt_rad
            if tilt_rad <= MAX_TILT_RAD:
                pose = chain.target_from_source.flat()
                priors[robot] = Prior(pose, TF_SIGMA_M, TF_SIGMA_M, TF_SIGMA_YAW_RAD, "recorded in /tf")
            elif robot not in self._tilted:
                self._tilted.add(robot)
                notes.append(Noted(robot, self._tilt(robot, tilt_rad)))
        return priors, tuple(notes)

    def foreseen(self) -> Iterator[Noted]:
        """Say for which robots no transform can be found, whatever is recorded."""
        for robot, why in self._hopeless.items():
            yield Noted(robot, f"{why}; {_WITHOUT}")

    def missed(self) -> Iterator[Noted]:
        """Say, once all was read, for which robots no transform was found."""
        for robot in self._open:
            if robot in self._linked:
                continue
            ends = f"its map frame {self._frames[robot]!r} with {self._frames[self._reference]!r}"
            if self._chain(robot) is not None:
                yield Noted(
                    robot, f"transforms link {ends} only after the last map; {_WITHOUT}: are the clocks the same?"
                )
            else:
                yield Noted(robot, f"no chain of transforms in /tf and /tf_static links {ends}; {_WITHOUT}")

    def _chain(self, robot: str) -> Chain | None:
        """Return the newest chain from a robot's map frame to the reference's; of equals, of the first recording."""
        ends = self._frames[self._reference], self._frames[robot]
        found = [chain for buffer in self._buffers.values() if (chain := buffer.chain(*ends)) is not None]
        return max(found, key=lambda chain: -1 if chain.stamp_ns is None else chain.stamp_ns, default=None)

    def _why_hopeless(self, robot: str) -> str | None:
        frame, reference_frame = self._frames[robot], self._frames[self._reference]
        if not self._buffers:
            return "there is no /tf and no /tf_static in the recordings"
        if not frame or not reference_frame:
            return f"the maps of {robot if not frame else self._reference} name no frame for a transform to lead to"
        if frame == reference_frame:
            return (
                f"its maps and those of {self._reference} have the same frame, {frame!r}, so that no transform "
                "tells where they lie to each other"
            )
        return None

    def _tilt(self, robot: str, tilt_rad: float) -> str:
        return (
            f"the transform from its map frame {self._frames[robot]!r} to {self._frames[self._reference]!r} is tilted "
            f"by {math.degrees(tilt_rad):.0f}°, no pose in the plane; {_WITHOUT} while it is"
        )
