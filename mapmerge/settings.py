"""What all settings have in common."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from mapmerge.errors import ConfigError

_DIVISORS = {
    "scale_range",
    "wall_spacing_m",
    "angle_step_rad",
    "cell_m",
    "reject_m",
    "rough_reject_m",
    "sweep_step_rad",
    "sweep_cell_m",
    "scale_step",
    "distinct_scale",
    "length_m",
    "stiffness_m",
    "blur_cells",
    "radon_bin_m",
    "inlier_m",
    "icp_reject_m",
    "many_side_cells",
    "max_side_cells",
}


@dataclass(frozen=True, slots=True)
class Settings:
    """Base of all settings: numbers must be finite and not negative."""

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            for number in value if isinstance(value, tuple) else (value,):
                if isinstance(number, (int, float)) and not (math.isfinite(number) and number >= 0):
                    raise ConfigError(f"{item.name} is {value}; expected finite numbers that are not negative")
            if item.name in _DIVISORS and not (min(value, default=1.0) if isinstance(value, tuple) else value) > 0:
                raise ConfigError(f"{item.name} is {value}; expected more than 0")
