"""The report to look at: one page, drawn once, when the run has ended."""

from __future__ import annotations

from replay.events import Event
from replay.html.story import StoryTeller
from replay.options import OutputOptions
from replay.sinks.partial_file import PartialFile, output_errors


class HtmlSink:
    """Folds a run, and writes its page at the end."""

    def __init__(self, file: PartialFile, _options: OutputOptions) -> None:
        self._file = file
        self._teller = StoryTeller()

    def take(self, event: Event) -> None:
        """Take in what happened; write the page when the run has ended."""
        story = self._teller.take(event)
        if story is not None:
            from replay.html.page import page

            text = page(story)
            with output_errors(self._file.path), self._file.stream() as stream:
                stream.write(text.encode())

    def finish(self) -> None:
        """Wait until the page is on the disk; it was written at once."""
        self._file.sync()

    def publish(self) -> None:
        """Give the page its final name."""
        self._file.publish()

    def discard(self) -> None:
        """Remove the page."""
        self._file.discard()
