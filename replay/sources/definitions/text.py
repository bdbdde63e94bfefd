"""The fields that the text of a message definition states: in ROS's own format, or in IDL.

A text may be written to take long to read: so each of its characters is looked at once, whatever it says. What has no
part in the bytes of a message is passed over unread: constants, annotations, defaults, bounds.
"""

from __future__ import annotations

from replay.sources.definitions.fields import Fields
from replay.sources.definitions.idl import idl_fields, is_idl
from replay.sources.definitions.msg import msg_fields


def stated_fields(msgtype: str, text: str) -> Fields:
    """Return the fields of each type that a text defines.

    Parameters
    ----------
    msgtype
        What the text defines first, where it does not say so itself.

    Raises
    ------
    NoDefinitionError
        If it is no definition.
    """
    text = text.replace("\r\n", "\n").strip("\0")
    return idl_fields(text) if is_idl(text) else msg_fields(msgtype, text)
