"""The report as a JSON file."""

from __future__ import annotations

import json
from pathlib import Path

from replay.events import Event, Finished, Report
from replay.options import OutputOptions
from replay.plain_text import plain_json
from replay.sinks.partial_file import PartialFile, output_errors


def report_text(report: Report) -> str:
    """Return a report as it is written: indented, in the report's own order, ending in a newline."""
    return plain_json(json.dumps(report, indent=2, ensure_ascii=False, allow_nan=False)) + "\n"


class JsonSink:
    """Writes the final report."""

    def __init__(self, path: Path, _options: OutputOptions) -> None:
        self._file = PartialFile(path)
        with output_errors(path):
            self._file.partial.touch()

    def take(self, event: Event) -> None:
        """Write the report when the run has ended."""
        if isinstance(event, Finished):
            with output_errors(self._file.path):
                self._file.partial.write_text(report_text(event.report), encoding="utf-8")

    def finish(self) -> None:
        """Do nothing: the report was written at once."""

    def publish(self) -> None:
        """Give the report its final name."""
        self._file.publish()

    def discard(self) -> None:
        """Remove the report."""
        self._file.discard()
