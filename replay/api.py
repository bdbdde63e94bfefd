"""A run from Python: told by keywords that are called as the settings of a file are, with values as Python has them."""

from __future__ import annotations

import os
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import datetime
from inspect import GEN_CLOSED, getgeneratorstate
from typing import TYPE_CHECKING

from mapmerge.config import MergeConfig, ScaleChoice
from replay import keywords
from replay.errors import UsageError
from replay.events import Event, Finished, Report
from replay.init_pose import InitPose
from replay.options import ClockChoice, ImageChoice, OutputOptions, RunOptions, TrajectoryChoice

if TYPE_CHECKING:
    from typing import Self

PathLike = str | os.PathLike[str]


@keywords.known_only
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
        ``all``. None: ``auto`` where the Rerun recording or the page is written, else ``none``.
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
        If these do not fit together, or a keyword is none of them. What is wrong with a recording is raised as
        `ReplayError` where it is read.

    Examples
    --------
    >>> import replay
    >>> report = replay.merge("samples/two_robots.mcap", robots=["r1", "r2"]).finish()
    >>> report["robots"]["r2"]["status"]
    'merged'
    """
    paths = keywords.run_paths(runs)
    if not paths:
        raise UsageError("no recording was given; expected a path, several, or one for each robot")
    drawn = None if images is None else keywords.one_of("images", images, ("none", "changed", "all"))
    driven = None if trajectories is None else keywords.one_of("trajectories", trajectories, ("none", "auto", "all"))
    options = RunOptions(
        runs=paths,
        robots=keywords.robot_names(robots),
        topics=keywords.topic_choices(topics),
        clock=keywords.one_of("clock", clock, ("header", "log")),
        start=keywords.time_bound("start", start),
        stop=keywords.time_bound("stop", stop),
        reorder_window_ns=keywords.nanoseconds("reorder_window_s", reorder_window_s),
        align_starts=keywords.truth("align_starts", align_starts),
        strict=keywords.truth("strict", strict),
        images=drawn or "none",
        init_poses=keywords.init_poses(init_poses),
        use_tf=keywords.truth("use_tf", use_tf),
        merge=keywords.merge_config(config, method, scale, min_confidence),
        max_memory_bytes=keywords.max_memory_bytes(max_memory),
        trajectories=driven or "none",
        jobs=keywords.job_count(jobs),
    )
    return MergeRun(options, written_images=drawn or "changed", written_trajectories=driven or "auto")


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

    def __repr__(self) -> str:
        runs = ", ".join(run.path.name for run in self.options.runs)
        robots = ", ".join(self.options.robots or ()) or "all robots"
        if self._events is None:
            state = "not begun"
        else:
            state = "over" if getgeneratorstate(self._events) == GEN_CLOSED else "going on"
        return f"<replay.MergeRun of {robots} in {runs}: {state}>"

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

    @keywords.known_only
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
        from replay.execute import merge_into
        from replay.flags.values import html_path, mcap_path
        from replay.sinks import OutputsExistError, Sink, open_sinks

        written = OutputOptions(
            mcap_path(keywords.path("output", output), "output"),
            rrd=keywords.truth("rrd", rrd),
            html=None if report is None else html_path(keywords.path("report", report), "report"),
            every_ns=keywords.nanoseconds("every_s", every_s),
            copy_maps=keywords.truth("copy_maps", copy_maps),
            force=keywords.truth("force", force),
        )
        trajectories: TrajectoryChoice = self._written_trajectories if rrd or report is not None else "none"
        options = replace(self.options, images=self._written_images, trajectories=trajectories)

        @contextmanager
        def sinks() -> Iterator[Sequence[Sink]]:
            with open_sinks(written) as opened:
                self._events = _nothing()  # until here nothing was taken, and it can be written anew
                self._events.close()
                yield opened

        try:
            return merge_into(sinks, options, written)
        except OutputsExistError as error:
            raise OutputsExistError(error.existing, "force=True") from error

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
