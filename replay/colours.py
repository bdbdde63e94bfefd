"""Where colours are: on terminals that have them, unless it is said otherwise."""

from __future__ import annotations

import os
from typing import IO


def are_on(stream: IO[str], choice: str = "auto") -> bool:
    """Tell whether a stream is to have colours.

    Parameters
    ----------
    choice
        ``auto``, ``always`` or ``never``: the first follows ``NO_COLOR``, ``FORCE_COLOR`` and ``TERM``.
    """
    if choice != "auto":
        return choice == "always"
    if os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR"):
        return True
    return stream.isatty() and os.environ.get("TERM") != "dumb"
