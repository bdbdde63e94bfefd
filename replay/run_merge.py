"""A run as the command line makes one: merged, written if that is asked for, and told about."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

from replay.console import Talk, open_notes
from replay.errors import UsageError
from replay.events import Report
from replay.options import OutputOptions, RunOptions
from replay.sinks.base import Sink
from replay.sinks.terminal import Narrator, ProgressSink

if TYPE_CHECKING:
    from replay.plan import Plan


class Run:
    """A run of the merger that shows its progress on standard error.

    Parameters
    ----------
    options
        What is read, and how it is merged.
    written
        What is written; None for nothing.
    talk, colour
        How much is said, and when in colours: ``auto``, ``always`` or ``never``.
    is_shown
        Whether Rerun's viewer is opened, and shows what is written while the run goes on.
    """

    def __init__(
        self,
        options: RunOptions,
        written: OutputOptions | None,
        talk: Talk = Talk.USUAL,
        colour: str = "auto",
        *,
        is_shown: bool = False,
    ) -> None:
        if is_shown and written is None:
            raise UsageError("--view shows the Rerun recording, which is not written; give --output OUT.mcap as well")
        if is_shown and written is not None and not written.rrd:
            raise UsageError("--view shows the Rerun recording, which is not written; leave out --no-rrd, or --view")
        self._options = options
        self._written = written
        self._talk = talk
        self._is_shown = is_shown
        self._notes = open_notes(colour)
        self.narrator = Narrator(self._notes, announce=options.robots is None, talk=talk)

    def merge(self) -> Report:
        """Merge, and return the report.

        Raises
        ------
        ReplayError
            If an input cannot be read, or an output not be written.
        """
        from replay.execute import merge_into

        if self._is_shown:
            from replay import viewer

            viewer.refuse_without_screen(viewer.INSTEAD_OF_LIVE)
        return merge_into(self._sinks, self._options, self._written, self._planned)

    def _planned(self, plan: Plan) -> None:
        self.narrator.unused_topics = plan.unused_topics()

    @contextmanager
    def _sinks(self) -> Iterator[Sequence[Sink]]:
        from replay.sinks import open_sinks

        shown = (ProgressSink(self._notes, self._talk), self.narrator)
        written = self._written
        if written is not None and self._is_shown:
            from replay import viewer

            written = replace(written, live_url=viewer.open_live())
            viewer.import_silently()
        if written is not None:
            with open_sinks(written, shown, say=self.narrator.say) as sinks:
                yield sinks
            return
        try:
            yield shown
        finally:
            for sink in shown:
                sink.finish()
