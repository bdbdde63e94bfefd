"""Whether a recording's own message definitions say what the standard says.

Messages are decoded by the definitions that are built in, not by those that a recording carries. Where the two differ,
the standard one would read bytes as something that they are not, so that such messages are not to be decoded at all.

Fields are compared by name, order and type, also those of the types that are used within. What has no part in the bytes
does not matter: comments, constants, defaults, upper bounds, the order in which the types within are defined. An empty
definition is taken as the standard one, because many writers leave it out; so is a type within that is not defined.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Literal

from replay.sources.base import TF_TYPE, TF_TYPES
from replay.sources.definitions.fields import Fields, NoDefinitionError
from replay.sources.definitions.text import stated_fields

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rosbags.interfaces.typing import FieldDesc

LARGEST_CHARS = 1 << 18
"""A longer definition is not looked at: that of a map has a few thousand characters."""


def differing_field(msgtype: str, definition: str, ros: Literal[1, 2]) -> str | None:
    """Tell where a definition differs from the standard one.

    Parameters
    ----------
    msgtype
        In the form ``nav_msgs/msg/OccupancyGrid``.
    definition
        Text of the definition with those of the types within, as ROS 1 bags, ``ros1msg``, ``ros2msg`` and ``ros2idl``
        have it.
    ros
        By which version's standard the messages would be decoded.

    Returns
    -------
    str or None
        The first difference, as in "width of nav_msgs/msg/MapMetaData is uint64 in the recording, uint32 in the
        standard"; None if there is none, or if no standard definition of this type is built in.
    """
    if len(definition) > LARGEST_CHARS:
        return _not_understood(msgtype)
    return _difference(msgtype, definition, ros)


@functools.lru_cache(maxsize=256)
def _difference(msgtype: str, definition: str, ros: Literal[1, 2]) -> str | None:
    standard = _standard_fields(ros)
    known = TF_TYPE if msgtype in TF_TYPES else msgtype
    if known not in standard or not definition.strip("\0 \t\r\n"):
        return None
    try:
        recorded = stated_fields(msgtype, definition)
    except NoDefinitionError:
        return _not_understood(msgtype)
    if msgtype not in recorded:
        return f"the definition in the recording does not define {msgtype}"
    return _first_difference(known, {**recorded, known: recorded[msgtype]}, standard)


@functools.cache
def _standard_fields(ros: Literal[1, 2]) -> Fields:
    from replay.codec.typestores import ros1_typestore, ros2_typestore

    store = ros1_typestore() if ros == 1 else ros2_typestore()
    return {
        name: [(field, _type_name(kind)) for field, kind in fields] for name, (_, fields) in store.fielddefs.items()
    }


def _not_understood(msgtype: str) -> str:
    return f"the definition of {msgtype} in the recording cannot be understood"


def _first_difference(msgtype: str, recorded: Fields, standard: Fields) -> str | None:
    """Return the first difference of a type or, depth first, of one within it."""
    expected = standard[msgtype]
    for (name, kind), (own_name, own_kind) in zip(expected, recorded[msgtype], strict=False):
        if name != own_name:
            return f"a field of {msgtype} is {own_name} in the recording, {name} in the standard"
        if kind != own_kind:
            return f"{name} of {msgtype} is {own_kind} in the recording, {kind} in the standard"
        inner = kind.partition("[")[0]
        if inner in standard and inner in recorded:
            difference = _first_difference(inner, recorded, standard)
            if difference is not None:
                return difference
    return _missing_or_extra(msgtype, recorded[msgtype], expected)


def _missing_or_extra(
    msgtype: str, recorded: Sequence[tuple[str, str]], expected: Sequence[tuple[str, str]]
) -> str | None:
    if len(recorded) > len(expected):
        return f"{msgtype} has the field {recorded[len(expected)][0]} in the recording, and not in the standard"
    if len(recorded) < len(expected):
        return f"{msgtype} has no field {expected[len(recorded)][0]} in the recording, but in the standard"
    return None


def _type_name(field: FieldDesc) -> str:
    """Return a field's type as in a definition, without its bounds, which are not in the bytes."""
    from rosbags.interfaces import Nodetype

    if field[0] == Nodetype.BASE:
        return field[1][0]
    if field[0] == Nodetype.NAME:
        return field[1]
    inner, size = field[1]
    return f"{_type_name(inner)}[{size if field[0] == Nodetype.ARRAY else ''}]"
