"""The latest transforms between the frames of one recording, and chains of them."""

from __future__ import annotations

from dataclasses import dataclass

from replay.messages import FrameLink
from replay.pose3 import Pose3


@dataclass(frozen=True, slots=True)
class Chain:
    """Where one frame lies in another, through all the frames between them.

    Parameters
    ----------
    target_from_source
        The links of the chain, composed.
    stamp_ns
        Time of its newest link; None if all of them hold always.
    """

    target_from_source: Pose3
    stamp_ns: int | None


@dataclass(frozen=True, slots=True)
class _Held:
    """A link, and from when on it holds; None for always."""

    link: FrameLink
    stamp_ns: int | None


class TransformBuffer:
    """Frames as a forest, as tf has it: each frame has one parent, the one it was given last.

    What holds always is not replaced by what holds from some time on.
    """

    def __init__(self) -> None:
        self._held: dict[str, _Held] = {}

    def hold(self, link: FrameLink, stamp_ns: int | None) -> None:
        """Take a link that holds from this time on, or always; links come in order of time."""
        known = self._held.get(link.child)
        if stamp_ns is None or known is None or known.stamp_ns is not None:
            self._held[link.child] = _Held(link, stamp_ns)

    def chain(self, target: str, source: str) -> Chain | None:
        """Return where the source frame lies in the target frame; None if no chain of links leads there."""
        ancestors = self._ancestors(target)
        for frame, frame_from_source in self._ancestors(source).items():
            if frame in ancestors:
                frame_from_target = ancestors[frame]
                pose = frame_from_target.target_from_source.inverse() @ frame_from_source.target_from_source
                return Chain(pose, _newer(frame_from_target.stamp_ns, frame_from_source.stamp_ns))
        return None

    def _ancestors(self, frame: str) -> dict[str, Chain]:
        """Return where a frame lies in itself and in each of its ancestors, nearest first.

        Nothing if they go round in a loop: there are two ways between its frames, and no telling which is right.
        """
        found: dict[str, Chain] = {}
        chain = Chain(Pose3(), None)
        while frame not in found:
            found[frame] = chain
            held = self._held.get(frame)
            if held is None:
                return found
            frame = held.link.parent
            pose = held.link.parent_from_child @ chain.target_from_source
            chain = Chain(pose, _newer(chain.stamp_ns, held.stamp_ns))
        return {}


def _newer(one_ns: int | None, other_ns: int | None) -> int | None:
    return max((stamp_ns for stamp_ns in (one_ns, other_ns) if stamp_ns is not None), default=None)
