"""A run from beginning to end: what the command line and Python have in common."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from typing import TYPE_CHECKING

from replay.events import Report
from replay.options import OutputOptions, RunOptions

if TYPE_CHECKING:
    from replay.plan import Plan
    from replay.sinks.base import Sink

OpenSinks = Callable[[], "AbstractContextManager[Sequence[Sink]]"]


def merge_into(
    opened: OpenSinks,
    options: RunOptions,
    written: OutputOptions | None,
    planned: Callable[[Plan], object] = lambda _: None,
) -> Report:
    """Merge, give what happens to sinks, and return the report.

    Parameters
    ----------
    opened
        Opens the sinks; called once it is known that the run can begin.
    options
        What is read, and how it is merged.
    written
        What is written; None for nothing.
    planned
        Is told what is to be merged before the sinks are opened.

    Raises
    ------
    ReplayError
        If an input cannot be read, or an output not be written.
    """
    from replay.open_plan import open_plan
    from replay.outputs import refuse_outputs
    from replay.pipeline import drain, events

    with _own_threads(), open_plan(options) as plan:
        if written is not None:
            # what is wrong with the inputs is said first: an output that is there already hides nothing
            refuse_outputs(written, [*(item.path for item in options.runs), *plan.files()])
        planned(plan)
        with opened() as sinks:
            return drain(events(plan, options, written), sinks, options.jobs).report


@contextmanager
def _own_threads() -> Iterator[None]:
    """Keep OpenCV from starting threads of its own meanwhile: those of a run are as many as were asked for."""
    import cv2

    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)
