"""Errors that a user meets, each one clear line: what, where, what was expected, what to do.

::

    ReplayError                 base; `exit_code` is what the program ends with
    ├── UsageError        (2)   flags or paths that do not fit together
    ├── InputError        (2)   a recording that cannot be read
    │   └── BadMessage          one message that cannot be used: skipped and counted, fatal with --strict
    └── OutputError       (3)   an output that cannot be written

Exceptions of the libraries that read and write are translated into these at the boundary: each source and each
sink translates its own, and nothing else catches them.
"""

from __future__ import annotations

from typing import ClassVar


class ReplayError(Exception):
    """Base of the errors that end the program with one line."""

    exit_code: ClassVar[int] = 2


class UsageError(ReplayError):
    """Flags or paths that do not fit together or do not fit the recording."""


class InputError(ReplayError):
    """A recording that cannot be read."""


class BadMessage(InputError):
    """One message that cannot be used.

    Parameters
    ----------
    cause
        A key of the documented list in `replay.skip_cause.SkipCause`.
    detail
        What was found and what was expected.
    """

    def __init__(self, cause: str, detail: str) -> None:
        super().__init__(detail)
        self.cause = cause
        self.detail = detail


class OutputError(ReplayError):
    """An output that cannot be written."""

    exit_code: ClassVar[int] = 3
