"""What a user may do about a map that was not merged: for each reason a hint, for reports and documents alike."""

from __future__ import annotations

from collections.abc import Mapping

from mapmerge.reasons import ReasonCode

NOTHING_TO_DO = ""

ADVICE: Mapping[ReasonCode, str] = {
    ReasonCode.REFERENCE: NOTHING_TO_DO,
    ReasonCode.ACCEPTED: NOTHING_TO_DO,
    ReasonCode.NO_MAP: (
        "See whether its map topic is the right one (`replay info`, `--topic`) and whether its messages were skipped; "
        "a recording that begins later than the map was sent may lack it."
    ),
    ReasonCode.NO_REFERENCE_MAP: (
        "Choose another reference: the first name of `--robots` is the reference, and only a robot with a map serves."
    ),
    ReasonCode.TOO_LITTLE_STRUCTURE: (
        "Let the robot see more walls before its map is merged; if you know where it started, `--init-pose` helps "
        "only once there are walls that can be compared."
    ),
    ReasonCode.NO_CANDIDATE: (
        "See whether the maps are of the same place and show walls; if you know about where the robot started, "
        "say so with `--init-pose`."
    ),
    ReasonCode.TOO_LITTLE_OVERLAP: (
        "The robots have hardly been to the same places: let them share a room or a corridor, or record longer. "
        "If it is another building or floor, the refusal is right."
    ),
    ReasonCode.WALLS_DISAGREE: (
        "Look at the overlay: if a wall is bent or doubled, mend that robot's SLAM; if cells have another size than "
        "the map says, try `--scale free`. If it is another place, the refusal is right."
    ),
    ReasonCode.LOW_ACCEPTANCE: (
        "Look at the overlay, and try the default method, `--method correlation`, which weighs more than this index."
    ),
    ReasonCode.AMBIGUOUS: (
        "The place looks alike in several ways: say about where the robot started with `--init-pose`, take recorded "
        "transforms with `--use-tf`, or let the robots share something that is there only once."
    ),
    ReasonCode.LOW_CONFIDENCE: (
        "If you know about where the robot started, say so with `--init-pose` or `--use-tf`; else let the maps share "
        "more. If it is another place, the refusal is right."
    ),
    ReasonCode.PRIOR_CONTRADICTED: (
        "The pose that was given is wrong, or the map is: compare both places below, correct `--init-pose`, or leave "
        "it out."
    ),
    ReasonCode.INCONSISTENT: (
        "This pair contradicts the others: look whether one of its maps is bent, and fix a robot that is surely "
        "placed with `--init-pose`."
    ),
    ReasonCode.TOO_LARGE: (
        "See whether a map claims a huge extent or tiny cells (`replay info`); else allow more with `--max-memory`."
    ),
    ReasonCode.MAP_JUMPED: (
        "The robot's SLAM moved or restarted its map: use the part before or after with `--start` and `--stop`."
    ),
    ReasonCode.OTHER_COMPONENT: (
        "These maps fit each other: make one of them the reference with `--robots`, or record where they meet the "
        "reference's map."
    ),
}
"""Text with commands in backquotes; empty where there is nothing to do."""
