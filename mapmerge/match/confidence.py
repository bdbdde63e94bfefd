"""Placeholder until fitted."""

from __future__ import annotations

import math

from mapmerge.match.cues import Cues


def confidence(cues: Cues) -> float:
    """Return a placeholder."""
    return 1.0 / (1.0 + math.exp(-20 * (cues.wall_agreement - 0.8)))
