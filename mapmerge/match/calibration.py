"""What `mapmerge.match.confidence` is made of; written by ``python -m benchmarks.calibrate``."""

from __future__ import annotations

INTERCEPT = 0.0

CURVES: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {}
"""Knots of each cue, and what is added to the log odds from each to the next."""
