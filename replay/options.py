"""What a run can be told, as values; the command line and Python build the same ones."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from decimal import Decimal
from pathlib import Path
from typing import Any, Literal

from mapmerge.config import MergeConfig
from replay.errors import UsageError
from replay.init_pose import InitPose
from replay.runs import RunPath, TopicChoice

NS_PER_S = 1_000_000_000
DEFAULT_REORDER_WINDOW_NS = 5 * NS_PER_S

ImageChoice = Literal["none", "changed", "all"]
ClockChoice = Literal["header", "log"]
TrajectoryChoice = Literal["none", "auto", "all"]


def seconds_to_ns(text: str) -> int:
    """Read a number of seconds, not negative, as whole nanoseconds.

    Raises
    ------
    UsageError
        If it is none.
    """
    if not re.fullmatch(r"\d+(\.\d*)?|\.\d+", text):
        raise UsageError(f"{text!r} is no number of seconds; expected one such as 12.5")
    return int(Decimal(text) * NS_PER_S)


@dataclass(frozen=True, slots=True)
class TimeBound:
    """``--start`` or ``--stop``: after the run's first map, or absolute."""

    ns: int
    relative: bool

    @staticmethod
    def parse(text: str) -> TimeBound:
        """Read ``12.5`` (seconds after the first map), ``1700000000000000000ns`` or an ISO 8601 time."""
        if re.fullmatch(r"\d+ns", text):
            return TimeBound(int(text[:-2]), relative=False)
        if re.fullmatch(r"[\d.]+", text):
            return TimeBound(seconds_to_ns(text), relative=True)
        try:
            moment = datetime.fromisoformat(text)
        except ValueError:
            raise UsageError(
                f"{text!r} is no time; expected seconds after the first map such as 12.5, nanoseconds since 1970 "
                "such as 1700000000000000000ns, or ISO 8601 such as 2026-05-01T12:00:00Z"
            ) from None
        since = (moment if moment.tzinfo else moment.replace(tzinfo=UTC)) - datetime(1970, 1, 1, tzinfo=UTC)
        beyond_us = re.search(r"[.,]\d{6}(\d{1,3})", text)  # which datetime leaves out
        whole_ns = (since.days * 86_400 + since.seconds) * NS_PER_S + since.microseconds * 1_000
        return TimeBound(whole_ns + (int(beyond_us[1].ljust(3, "0")) if beyond_us else 0), relative=False)

    def absolute_ns(self, start_ns: int) -> int:
        """Return the time on the run's clock, whose first map is at ``start_ns``."""
        return start_ns + self.ns if self.relative else self.ns


@dataclass(frozen=True, slots=True)
class RunOptions:
    """What is read, how it is merged, and what is drawn of it.

    Parameters
    ----------
    runs
        The recordings.
    robots
        Robots to merge, the reference first; None for all.
    topics
        Map topics said outright.
    clock
        What times are taken from, where the messages have it.
    start, stop
        Only maps from ``start`` on and before ``stop`` are used, and of each robot the last one before ``start``.
    reorder_window_ns
        Messages are put in order of time within this window.
    align_starts
        Shift the clocks of all recordings so that the robots start together: for clocks that cannot be the same.
    strict
        Whether a message that cannot be used ends the run.
    images
        Which intermediate images are rendered.
    init_poses
        Where robots' maps are said to lie in the reference's map frame.
    use_tf
        Whether recorded transforms between map frames say so, for robots without such a pose.
    merge
        Settings of the merger.
    max_memory_bytes
        The most memory that one robot's map, the merged map, or a message or chunk that is read may need; None for
        what `MergeConfig` and `replay.sources.memory` allow. What needs more is not used. It affects results, but is no
        setting of a machine: the same limit gives the same outcome everywhere.
    trajectories
        Of which recordings it is read where robots drove: ``auto`` leaves out large ones. It changes no outcome, and
        is shown only, in the Rerun recording and on the page.
    jobs
        How many threads work at once: more than one read ahead, match pairs and write beside the merging. The outcome
        is the same.
    """

    runs: tuple[RunPath, ...]
    robots: tuple[str, ...] | None = None
    topics: tuple[TopicChoice, ...] = ()
    clock: ClockChoice = "header"
    start: TimeBound | None = None
    stop: TimeBound | None = None
    reorder_window_ns: int = DEFAULT_REORDER_WINDOW_NS
    align_starts: bool = False
    strict: bool = False
    images: ImageChoice = "changed"
    init_poses: tuple[InitPose, ...] = ()
    use_tf: bool = False
    merge: MergeConfig = field(default_factory=MergeConfig)
    max_memory_bytes: int | None = None
    trajectories: TrajectoryChoice = "none"
    jobs: int = 1

    def settings(self) -> Mapping[str, Any]:
        """Return the settings that affect results, as written to reports."""
        return {
            "robots": list(self.robots) if self.robots is not None else None,
            "clock": self.clock,
            "start": asdict(self.start) if self.start else None,
            "stop": asdict(self.stop) if self.stop else None,
            "reorder_window_ns": self.reorder_window_ns,
            "align_starts": self.align_starts,
            "topics": [asdict(choice) for choice in self.topics],
            "init_poses": [asdict(item) for item in self.init_poses],
            "use_tf": self.use_tf,
            "max_memory_bytes": self.max_memory_bytes,
            "merge": _plain(asdict(self.merge)),
        }


@dataclass(frozen=True, slots=True)
class OutputOptions:
    """What is written.

    Parameters
    ----------
    mcap
        The new MCAP; the recording and the report stand beside it.
    rrd
        Whether the Rerun recording is written.
    html
        The report to look at; None: none is written.
    every_ns
        Least time between two merged maps in the MCAP.
    copy_maps
        Whether the robots' own maps are copied to the MCAP.
    force
        Whether files that exist are replaced.
    live_url
        Address of a viewer to which the Rerun recording goes as well; None for none.
    """

    mcap: Path
    rrd: bool = True
    html: Path | None = None
    every_ns: int = 0
    copy_maps: bool = False
    force: bool = False
    live_url: str | None = None

    def settings(self, images: ImageChoice) -> Mapping[str, Any]:
        """Return the settings that decide what an MCAP holds, as written to reports."""
        return {"images": images, "every_ns": self.every_ns, "copy_maps": self.copy_maps}


def _plain(value: Any) -> Any:  # noqa: ANN401 - any JSON value
    """Return the value with tuples as lists, as JSON has them."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, (list, tuple)) else value
