"""Matchers: each finds where one map lies on another. A new one is a file here and a row in `MATCHERS`."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from mapmerge.errors import ConfigError
from mapmerge.match.base import Match, Matcher, Rival

__all__ = ["CALIBRATED", "MATCHERS", "Match", "Matcher", "Rival", "load_matcher"]

MATCHERS: dict[str, str] = {
    "correlation": "mapmerge.match.correlation:CorrelationMatcher",
    "existing": "mapmerge.match.existing:ExistingMatcher",
    "paper": "mapmerge.match.paper:PaperMatcher",
}

CALIBRATED = frozenset({"correlation"})
"""Methods that state a confidence, and accept by it; the others accept by the acceptance index."""


def load_matcher(name: str) -> Matcher[Any]:
    """Return the matcher of this name.

    Raises
    ------
    ConfigError
        If there is none.
    """
    if name not in MATCHERS:
        raise ConfigError(f"there is no method {name!r}; expected one of {', '.join(sorted(MATCHERS))}")
    module, _, attribute = MATCHERS[name].partition(":")
    matcher: Matcher[Any] = getattr(import_module(module), attribute)()
    return matcher
