"""Why a map was merged or not: a closed list, so that programs can rely on it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class ReasonCode(StrEnum):
    """What decided over a robot's map or over a pair of maps."""

    REFERENCE = "reference"
    """This robot's map frame is the merged frame."""
    ACCEPTED = "accepted"
    """The placement passed every test."""
    NO_MAP = "no_map"
    """The robot has no usable map yet."""
    NO_REFERENCE_MAP = "no_reference_map"
    """The reference robot has no usable map yet, so that there is nothing to merge with."""
    TOO_LITTLE_STRUCTURE = "too_little_structure"
    """One of the maps shows too few walls to tell one place from another."""
    NO_CANDIDATE = "no_candidate"
    """No placement of the maps on each other was found at all."""
    TOO_LITTLE_OVERLAP = "too_little_overlap"
    """At the best placement, the maps share too little ground or too few walls."""
    WALLS_DISAGREE = "walls_disagree"
    """At the best placement, walls of one map stand in free space of the other."""
    LOW_ACCEPTANCE = "low_acceptance"
    """At the best placement, the acceptance index is too low."""
    AMBIGUOUS = "ambiguous"
    """Another placement is nearly as good as the best one."""
    LOW_CONFIDENCE = "low_confidence"
    """The best placement is the only good one, but too little speaks for it."""
    PRIOR_CONTRADICTED = "prior_contradicted"
    """The maps do not fit where the placement was said to be, but elsewhere."""
    INCONSISTENT = "inconsistent"
    """The pair fits by itself, but contradicts better placements of the same robots."""
    TOO_LARGE = "too_large"
    """Placed there, the merged map would be larger than it may be."""
    MAP_JUMPED = "map_jumped"
    """The map contradicts what it was before, or forgot it: of a map, not of its placement."""
    OTHER_COMPONENT = "other_component"
    """The map fits other robots' maps, but none of them is linked to the reference."""


@dataclass(frozen=True, slots=True)
class Reason:
    """A code to act upon and a sentence to read."""

    code: ReasonCode
    message: str
