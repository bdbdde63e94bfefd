"""Merging of occupancy grid maps: arrays in, values out.

Nothing here reads a file, looks at a clock, prints, or keeps state between calls.
"""

from mapmerge.config import MergeConfig
from mapmerge.errors import ConfigError, GridError, MapMergeError
from mapmerge.grid import Grid
from mapmerge.match import Match
from mapmerge.merger import MergeResult, MergeState, step
from mapmerge.outcome import RobotOutcome, Status
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.sim2 import Sim2

__all__ = [
    "ConfigError",
    "Grid",
    "GridError",
    "MapMergeError",
    "Match",
    "MergeConfig",
    "MergeResult",
    "MergeState",
    "Reason",
    "ReasonCode",
    "RobotOutcome",
    "Sim2",
    "Status",
    "step",
]
