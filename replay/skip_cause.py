"""Why something of a recording was not used."""

from __future__ import annotations

from enum import StrEnum


class SkipCause(StrEnum):
    """Why a message was not used: a closed list."""

    UNDECODABLE = "undecodable"
    """Its bytes are not those of its type."""
    SIZE_MISMATCH = "size_mismatch"
    """Its data does not have width × height cells."""
    BAD_RESOLUTION = "bad_resolution"
    """Its resolution is not a number of metres that a cell of a map can have."""
    BAD_ORIGIN = "bad_origin"
    """Its origin is not finite, not a pose in the plane, or farther away than anything is."""
    TOO_LARGE = "too_large"
    """A side has more than 100 000 cells."""
    EMPTY = "empty"
    """It has no cells."""
    UPDATE_BEFORE_GRID = "update_before_grid"
    """An update of a part, before any full map, or after one that is lost."""
    UPDATE_OUTSIDE_GRID = "update_outside_grid"
    """An update of a part that is not within the last full map."""
    BAD_TIME = "bad_time"
    """Nothing tells when it was: neither its header nor its log time is one that a ROS stamp can hold."""
    BAD_TRANSFORM = "bad_transform"
    """A transform in it has no finite shift, no rotation, or not two frames; the others in it are used."""
    OVER_MEMORY = "over_memory"
    """It would need more memory than --max-memory allows, or is a part of a file that would."""
    ENDS_EARLY = "ends_early"
    """The file ends before the recording does."""
    DAMAGED = "damaged"
    """A part of the file cannot be read."""
    WRONG_CHECKSUM = "wrong_checksum"
    """A part of the file is not what was written: its checksum (CRC) is wrong."""
    MISSING_PART = "missing_part"
    """A file of the recording is not there."""
    UNKNOWN_TYPE = "unknown_type"
    """Its topic has no schema, or one that says something else than the standard, or an encoding that is not read."""
