"""The fields that a message definition in ROS's own format states."""

from __future__ import annotations

import re

from replay.sources.definitions.fields import BASE, SEPARATOR_LINE, Fields, NoDefinitionError

_TITLE = re.compile(r"MSG: ([A-Za-z0-9/_]{1,256})[ \t]*")
_FIELD = re.compile(r"(?P<kind>[A-Za-z][\w/]*)(?:<=\d+)?(?P<array>\[(?:<=)?\d*\])?[ \t]+(?P<name>[A-Za-z]\w*)")
_LONG = {
    "time": "builtin_interfaces/msg/Time",
    "duration": "builtin_interfaces/msg/Duration",
    "Header": "std_msgs/msg/Header",
}


def msg_fields(msgtype: str, text: str) -> Fields:
    """Return the fields of each type that a text defines; raises as `stated_fields` does."""
    first, *others = SEPARATOR_LINE.split(text)
    fields = {msgtype: _part(msgtype, first)}
    for part in others:
        title, _, body = part.strip().partition("\n")
        named = _TITLE.fullmatch(title)
        if named is None:
            raise NoDefinitionError
        name = _full_name(named[1])
        fields[name] = _part(name, body)
    return fields


def _part(owner: str, text: str) -> list[tuple[str, str]]:
    lines = (line.strip(" \t") for line in text.split("\n"))
    found = (_line(owner, line) for line in lines if line and not line.startswith(("#", "@")))
    return [each for each in found if each is not None]


def _line(owner: str, line: str) -> tuple[str, str] | None:
    """Return name and type of the field that a line states; None if it states a constant."""
    match = _FIELD.match(line)
    if match is None:
        raise NoDefinitionError
    rest = line[match.end() :]
    kind, array = match["kind"], match["array"]
    if rest.lstrip(" \t").startswith("="):
        if kind not in BASE or array:
            raise NoDefinitionError
        return None
    # a default, or a comment
    if rest and rest[0] not in " \t#":
        raise NoDefinitionError
    size = "" if array is None else "[]" if "<" in array else array
    return match["name"], _type(owner, kind) + size


def _type(owner: str, kind: str) -> str:
    if kind in BASE:
        return kind
    if kind in _LONG:
        return _LONG[kind]
    return _full_name(kind) if "/" in kind else f"{owner.rpartition('/')[0]}/{kind}"


def _full_name(name: str) -> str:
    package, _, kind = name.rpartition("/")
    return name if package.endswith(("/msg", "/action")) or not package else f"{package}/msg/{kind}"
