"""What every sink offers."""

from __future__ import annotations

from typing import Protocol

from replay.events import Event


class Sink(Protocol):
    """Something that shows or writes what happens in a run.

    A sink writes to a `replay.sinks.partial_file.PartialFile` that is claimed for it. All sinks finish before any is
    published, so that a run that fails leaves nothing under a final name. Errors of the libraries below leave as
    `replay.errors.OutputError`.
    """

    def take(self, event: Event) -> None:
        """Take in an event; the same object is given to all sinks and must not be changed."""

    def finish(self) -> None:
        """Write all that is left; what was written is whole after this, and on the disk."""

    def publish(self) -> None:
        """Give what was written its final name."""

    def discard(self) -> None:
        """Remove what was written, because the run failed; harmless at any time."""
