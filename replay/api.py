"""A run from Python: told by keywords that are called as the settings of a file are, with values as Python has them."""

from __future__ import annotations

import os
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mapmerge.config import MergeConfig, ScaleChoice
from mapmerge.errors import ConfigError
from replay.errors import UsageError
from replay.events import Event, Finished, Report
from replay.footprint import size_to_bytes
from replay.init_pose import InitPose
from replay.options import (
    ClockChoice,
    ImageChoice,
    OutputOptions,
    RunOptions,
    TimeBound,
    TrajectoryChoice,
    seconds_to_ns,
)
from replay.runs import RunPath, TopicChoice

if TYPE_CHECKING:
    from typing import Self

PathLike = str | os.PathLike[str]


def merge(
    runs: PathLike | Sequence[PathLike] | Mapping[str, PathLike],
    *,
    robots: Sequence[str] | None = None,
    topics: str | Sequence[str] | Mapping[str, str] = (),
    clock: ClockChoice = "header",
    start: float | str | datetime | None = None,
    stop: float | str | datetime | None = None,
    reorder_window_s: float = 5.0,
    align_starts: bool = False,
    init_poses: Mapping[str, Sequence[float]] | Iterable[InitPose] = (),
    use_tf: bool = False,
    config: MergeConfig | None = None,
    method: str | None = None,
    scale: ScaleChoice | None = None,
    min_confidence: float | None = None,
    max_memory: int | str | None = None,
    images: ImageChoice | None = None,
    trajectories: TrajectoryChoice | None = None,
    strict: bool = False,
    jobs: int = 1,
) -> MergeRun:
    """Merge the maps of recordings, and return what happens, one event after the other.

    Nothing is read before the first event is asked for, and nothing is written, unless `MergeRun.write` is called.

    Parameters
    ----------
    runs
        A recording, several, or one for each robot by its name.
    robots
        Robots to merge, the reference first; None for all, in order of name.
    topics
        Map topics: one with ``{robot}`` in it for all, or one for each robot by its name.
    clock
        What times are taken from: ``header`` or ``log``.
    start, stop
        Which maps are used: seconds after the first map, a time (UTC unless it has a zone), or text as ``--start``
        takes it.
    reorder_window_s
        Messages are put in order of time within this window.
    align_starts
        Whether all recordings are taken to begin together.
    init_poses
        Where robots' map frames lie in the reference's, by their names: x and y in metres and yaw in radians, then,
        unless the usual spread will do, the standard deviations of all three; or `InitPose` values.
    use_tf
        Whether recorded transforms between map frames say so.
    config
        Settings of the merger.
    method, scale, min_confidence
        The same as ``config.method``, ``config.scale`` and ``config.verify.min_confidence``, in place of these.
    max_memory
        The most memory that one map may need: bytes, or text such as ``2GiB``.
    images
        Which intermediate images are rendered: ``none``, ``changed`` or ``all``. None: ``changed`` where they are
        written, else ``none``.
    trajectories
        Of which recordings it is read from ``/tf`` where robots drove: ``none``, ``auto`` (not of large ones) or
        ``all``. None: ``auto`` where the Rerun recording is written, else ``none``.
    strict
        Whether a message that cannot be used ends the run.
    jobs
        How many threads work at once; the outcome is the same.

    Returns
    -------
    run
        An iterator over `Started`, `Skipped`, `Noted`, `Merged` and, at the end, `Finished`.

    Raises
    ------
    UsageError
        If these do not fit together. What is wrong with a recording is raised as `ReplayError` where it is read.

    Examples
    --------
    >>> import replay
    >>> report = replay.merge("samples/two_robots.mcap", robots=["r1", "r2"]).finish()
    >>> report["robots"]["r2"]["status"]
    'merged'
    """
    paths = _run_paths(runs)
    if not paths:
        raise UsageError("no recording was given; expected a path, several, or one for each robot")
    options = RunOptions(
        runs=paths,
        robots=None if robots is None else _names(robots),
        topics=_topics(topics),
        clock=_one_of("clock", clock, ("header", "log")),
        start=_bound(start),
        stop=_bound(stop),
        reorder_window_ns=_nanoseconds(reorder_window_s),
        align_starts=align_starts,
        strict=strict,
        images=_one_of("images", images or "none", ("none", "changed", "all")),
        init_poses=_init_poses(init_poses),
        use_tf=use_tf,
        merge=_merge_config(config or MergeConfig(), method, scale, min_confidence),
        max_memory_bytes=size_to_bytes(max_memory) if isinstance(max_memory, str) else max_memory,
        trajectories=_one_of("trajectories", trajectories or "none", ("none", "auto", "all")),
        jobs=jobs,
    )
    return MergeRun(options, written_images=images or "changed", written_trajectories=trajectories or "auto")


class MergeRun(Iterator[Event]):
    """A run: an iterator over what happens in it.

    Parameters
    ----------
    options
        What it was told.
    written_images, written_trajectories
        Which intermediate images are rendered, and of which recordings it is read where robots drove, where that is
        written.
    """

    def __init__(
        self,
        options: RunOptions,
        *,
        written_images: ImageChoice = "changed",
        written_trajectories: TrajectoryChoice = "auto",
    ) -> None:
        self.options = options
        """What it was told, as a value."""
        self._written_images = written_images
        self._written_trajectories = written_trajectories
        self._events: Generator[Event, None, None] | None = None

    def __next__(self) -> Event:
        if self._events is None:
            from replay.pipeline import merge as events

            self._events = events(self.options)
        return next(self._events)

    def finish(self) -> Report:
        """Go on to the end, and return the final report, as ``docs/report.schema.json`` describes it.

        Raises
        ------
        ReplayError
            If a recording cannot be read, no map can be used, or the end was seen already.
        """
        for event in self:
            if isinstance(event, Finished):
                return event.report
        raise UsageError("this run is over; call replay.merge anew")

    def write(
        self,
        output: PathLike,
        *,
        report: PathLike | None = None,
        rrd: bool = True,
        every_s: float = 0.0,
        copy_maps: bool = False,
        force: bool = False,
    ) -> Report:
        """Run it, write what `replay merge` would, and return the final report.

        Parameters
        ----------
        output
            The new MCAP; the Rerun recording and the report as JSON stand beside it.
        report
            The report as a page to look at in a browser, a name that ends in ``.html``.
        rrd
            Whether the Rerun recording is written.
        every_s
            Least time between two merged maps in the MCAP.
        copy_maps
            Whether the robots' own maps are copied to the MCAP.
        force
            Whether files that exist are replaced.

        Raises
        ------
        UsageError
            If events of the run were taken already, or files exist.
        InputError
            If a recording cannot be read, or no map can be used.
        OutputError
            If a file cannot be written; then none is.
        """
        if self._events is not None:
            raise UsageError("events of this run were taken already; call replay.merge anew and write that")
        from replay.flags.values import html_path, mcap_path
        from replay.outputs import refuse_outputs
        from replay.pipeline import drain, events
        from replay.plan import open_plan
        from replay.sinks import open_sinks

        written = OutputOptions(
            mcap_path(Path(output)),
            rrd=rrd,
            html=None if report is None else html_path(Path(report)),
            every_ns=_nanoseconds(every_s),
            copy_maps=copy_maps,
            force=force,
        )
        trajectories: TrajectoryChoice = self._written_trajectories if rrd else "none"
        options = replace(self.options, images=self._written_images, trajectories=trajectories)
        self._events = _nothing()
        refuse_outputs(written, [item.path for item in options.runs])
        with open_plan(options) as plan:
            refuse_outputs(written, plan.files())
            with open_sinks(written) as sinks:
                return drain(events(plan, options, written), sinks, options.jobs).report

    def close(self) -> None:
        """End it, and close the recordings; harmless at any time."""
        if self._events is not None:
            self._events.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _nothing() -> Generator[Event, None, None]:
    yield from ()


def _run_paths(runs: PathLike | Sequence[PathLike] | Mapping[str, PathLike]) -> tuple[RunPath, ...]:
    if isinstance(runs, Mapping):
        return tuple(RunPath(robot, Path(path)) for robot, path in runs.items())
    several = [runs] if isinstance(runs, (str, os.PathLike)) else runs
    # a path is one, whatever equals signs are in it
    return tuple(RunPath(None, Path(path)) for path in several)


def _names(robots: Sequence[str]) -> tuple[str, ...]:
    if isinstance(robots, str) or not robots or len(set(robots)) != len(robots):
        raise UsageError(f"robots is {robots!r}; expected a list of names, each once, the reference first")
    return tuple(robots)


def _topics(topics: str | Sequence[str] | Mapping[str, str]) -> tuple[TopicChoice, ...]:
    if isinstance(topics, Mapping):
        return tuple(TopicChoice(robot, topic) for robot, topic in topics.items())
    return tuple(TopicChoice.parse(text) for text in ([topics] if isinstance(topics, str) else topics))


def _bound(time: float | str | datetime | None) -> TimeBound | None:
    if time is None:
        return None
    if isinstance(time, (int, float)):
        return TimeBound(_nanoseconds(time), relative=True)
    return TimeBound.parse(time if isinstance(time, str) else time.isoformat())


def _nanoseconds(seconds: float) -> int:
    number = Decimal(str(seconds))
    return seconds_to_ns(f"{number:f}" if number.is_finite() else str(seconds))


def _init_poses(poses: Mapping[str, Sequence[float]] | Iterable[InitPose]) -> tuple[InitPose, ...]:
    if not isinstance(poses, Mapping):
        return tuple(poses)
    for robot, values in poses.items():
        if len(values) not in (3, 6):
            raise UsageError(
                f"init_poses of {robot} has {len(values)} numbers; expected x_m, y_m and yaw_rad, and the standard "
                "deviation of each, if any"
            )
    return tuple(InitPose(robot, *map(float, values)) for robot, values in poses.items())


def _merge_config(
    config: MergeConfig, method: str | None, scale: ScaleChoice | None, min_confidence: float | None
) -> MergeConfig:
    """Return the settings of the merger with those in place that have keywords of their own."""
    from mapmerge.match import MATCHERS

    changes: dict[str, Any] = {}
    if method is not None:
        changes["method"] = _one_of("method", method, tuple(MATCHERS))
    if scale is not None:
        changes["scale"] = _one_of("scale", scale, ("metadata", "free"))
    try:
        if min_confidence is not None:
            changes["verify"] = replace(config.verify, min_confidence=min_confidence)
        return replace(config, **changes)
    except ConfigError as error:
        raise UsageError(str(error)) from error


def _one_of(name: str, value: Any, choices: tuple[str, ...]) -> Any:  # noqa: ANN401 - one of the choices
    if value not in choices:
        raise UsageError(f"{name} is {value!r}; expected one of {', '.join(choices)}")
    return value
