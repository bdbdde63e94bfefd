"""What the program ends with."""

from __future__ import annotations

from replay.standard_streams import say

EXIT_DONE = 0
EXIT_DIFFERS = 1
"""What was asked for does not hold: not all maps were merged, or something is not as expected."""
EXIT_BAD_INPUT = 2
EXIT_FAILED = 3
EXIT_INTERRUPTED = 130


def interrupted_late() -> int:
    """Say that an interrupt came when all was written, and return the status for it."""
    say("replay: interrupted; the outputs are written")
    return EXIT_INTERRUPTED
