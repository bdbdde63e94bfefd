"""The report as a JSON file."""

from __future__ import annotations

import json

from replay.events import Event, Finished, Report
from replay.options import OutputOptions
from replay.plain_text import plain_json
from replay.sinks.partial_file import PartialFile, output_errors


def report_text(report: Report) -> str:
    """Return a report as it is written: indented, in the report's own order, ending in a newline."""
    return plain_json(json.dumps(report, indent=2, ensure_ascii=False, allow_nan=False)) + "\n"


class JsonSink:
    """Writes the final report."""

    def __init__(self, file: PartialFile, _options: OutputOptions) -> None:
        self._file = file

    def take(self, event: Event) -> None:
        """Write the report when the run has ended."""
        if isinstance(event, Finished):
            with output_errors(self._file.path), self._file.stream() as stream:
                stream.write(report_text(event.report).encode())

    def finish(self) -> None:
        """Wait until the report is on the disk; it was written at once."""
        self._file.sync()

    def publish(self) -> None:
        """Give the report its final name."""
        self._file.publish()

    def discard(self) -> None:
        """Remove the report."""
        self._file.discard()
