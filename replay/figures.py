"""Figures in words: so rounded that they never say more than is so, and never what a reason contradicts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from decimal import Decimal
from typing import Any

from mapmerge import rounding
from mapmerge.rounding import rounded_down

NO_FIGURE = "–"


def share(value: float | None, digits: int = 3) -> str:
    """Return a share rounded down, so that what is less than a limit, or than 1, reads like that."""
    return NO_FIGURE if value is None else f"{rounded_down(value, digits):.{digits}f}"


def area(value_m2: float | None) -> str:
    """Return an area rounded down, as reasons name it."""
    return NO_FIGURE if value_m2 is None else f"{rounded_down(value_m2, 1):,.1f} m²"


def percent(value: float | None) -> str:
    """Return a probability in percent, rounded down, with as many digits as tell it from 1."""
    if value is None:
        return NO_FIGURE
    return f"{rounded_down(value * 100.0, 2 if value > 0.9 or value < 0.01 else 0):g}%"


def degrees(yaw_rad: float, digits: int = 1) -> str:
    """Return an angle in degrees."""
    return fixed(math.degrees(yaw_rad), digits)


def fixed(value: float, digits: int) -> str:
    """Return a number with so many digits behind the point; no zero has a sign."""
    return rounding.fixed(value, digits)


def init_pose(robot: str, pose: Mapping[str, Any]) -> str:
    """Return a placement as the value of ``--init-pose``: to a millimetre and a thousandth of a degree."""
    x_m, y_m = fixed(pose["x_m"], 3), fixed(pose["y_m"], 3)
    return f"{robot}={x_m},{y_m},{degrees(pose['yaw_rad'], 3)}deg"


def seconds(since_ns: int) -> str:
    """Return how long after the first maps something was."""
    return f"+{since_ns / 1e9:.1f} s"


def size(count_bytes: int) -> str:
    """Return a number of bytes in the largest unit of which it is at least one."""
    value = float(count_bytes)
    for unit in ("bytes", "kB", "MB"):
        if value < 1000.0:
            return f"{value:.0f} {unit}" if unit == "bytes" else f"{value:.1f} {unit}"
        value /= 1000.0
    return f"{value:.1f} GB"


def exact(value: float) -> str:
    """Return a number that is read back as the same one, with a point and without an exponent: any YAML has it so."""
    text = f"{Decimal(repr(value)):f}"
    return text if "." in text else f"{text}.0"
