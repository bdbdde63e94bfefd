"""What a user may do about a map that was not merged: for each reason a hint, for reports and documents alike."""

from __future__ import annotations

from collections.abc import Mapping

from mapmerge.reasons import ReasonCode

NOTHING_TO_DO = ""

ADVICE: Mapping[ReasonCode, str] = {
    ReasonCode.REFERENCE: NOTHING_TO_DO,
    ReasonCode.ACCEPTED: NOTHING_TO_DO,
    ReasonCode.NO_MAP: (
        "See whether its map topic is the right one (`replay info`, `--topic`) and whether its messages were "
        "skipped; a recording that begins later than the map was sent may lack it."
    ),
    ReasonCode.NO_REFERENCE_MAP: (
        "Choose another reference: the first name of `--robots` is the reference, and only a robot with a map serves."
    ),
    ReasonCode.TOO_LITTLE_STRUCTURE: (
        "Let the robot see more walls before its map is merged: one corner of a room fits everywhere. If you know "
        "where it started, `--init-pose` helps only once there are walls that can be compared."
    ),
    ReasonCode.NO_CANDIDATE: (
        "See whether the maps are of the same place and show walls (`replay info` says what is there); if you know "
        "about where the robot started, say so with `--init-pose`."
    ),
    ReasonCode.TOO_LITTLE_OVERLAP: (
        "The robots have hardly been to the same places: let them share a room or a corner that both see from close "
        "by, or record longer. If it is another building or floor, the refusal is right."
    ),
    ReasonCode.WALLS_DISAGREE: (
        "Most often the robots have not been to the same places yet, or it is another building: then the refusal is "
        "right. If they have, look at the overlay, where it is red: where a wall is bent or doubled, mend that robot's "
        "SLAM, or leave out what came after with `--stop`; if cells have another size than the map says, try "
        "`--scale free`."
    ),
    ReasonCode.LOW_ACCEPTANCE: (
        "Look at the overlay, and try the default method, `--method correlation`, which weighs more than this index."
    ),
    ReasonCode.AMBIGUOUS: (
        "The place looks alike in several ways: say about where the robot started with `--init-pose`, for which a "
        "spread of some metres is enough, take recorded transforms with `--use-tf`, or let the robots share "
        "something that is there only once."
    ),
    ReasonCode.LOW_CONFIDENCE: (
        "The robots may not have been to the same places yet: let the maps share more. If they do share a place, and "
        "you know about where the robot started, say so with `--init-pose` or `--use-tf`. If it is another building, "
        "the refusal is right."
    ),
    ReasonCode.PRIOR_CONTRADICTED: (
        "The pose that was given is wrong, or the map is: the reason may say where the maps do fit. See whether the "
        "pose is that of the map frame, not of the robot, and its yaw in radians (`90deg` says degrees); correct "
        "`--init-pose`, or leave it or `--use-tf` out."
    ),
    ReasonCode.INCONSISTENT: (
        "This pair contradicts the others: look whether one of its maps is bent, and fix a robot that is surely "
        "placed with `--init-pose`."
    ),
    ReasonCode.TOO_LARGE: (
        "Nearly always one map claims a wrong resolution or origin: see which with `replay info`. If all are right, "
        "and `--max-memory` is the limit, allow more."
    ),
    ReasonCode.MAP_JUMPED: (
        "The robot's SLAM closed a loop, or moved or restarted its map: use the part before or after with `--start` "
        "and `--stop`, if one of them is bad."
    ),
    ReasonCode.OTHER_COMPONENT: (
        "These maps fit each other, but none of them the reference's: make one of them the reference with "
        "`--robots`, or record where they meet the reference's map."
    ),
}
"""Text with commands in backquotes; empty where there is nothing to do. docs/tuning.md says the same, and more."""
