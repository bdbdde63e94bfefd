"""The fields that a text defines: in the language of ROS messages, or in IDL as far as ROS uses it.

A text comes with a recording and may be anything, so that it is read in one pass, in time that grows with its length
alone. What has no part in the bytes of a message is passed over: comments, constants, defaults, bounds, annotations.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

Fields = Mapping[str, Sequence[tuple[str, str]]]
"""Names of fields with their types, such as ``int8[]`` and ``std_msgs/msg/Header``, by name of the type."""

_SEPARATOR = re.compile(r"^={3,}[ \t]*$", re.MULTILINE)
_IDL_TITLE = re.compile(r"^IDL: ", re.MULTILINE)
_IDL_BODY = re.compile(r"^[ \t]*module\s+\w+\s*\{", re.MULTILINE)

# --- messages

_MSG_TITLE = "MSG:"
_ANNOTATIONS = re.compile(r"(@[a-z]+\s+)+")
_MSG_FIELD = re.compile(
    r"(?P<type>[A-Za-z]\w*(?:/[A-Za-z]\w*)*)(?:<=\d+)?(?P<size>\[(?:(?:<=)?\d+)?\])?\s+(?P<name>[A-Za-z]\w*)"
    r"(?:\s*(?P<constant>=).*|\s+\S.*)?"
)
_MSG_NAME = re.compile(r"[A-Za-z]\w*(/\w+)*")
_MSG_BASE = re.compile(r"bool|byte|char|float(32|64)|u?int(8|16|32|64)|string")
_MSG_ALIASES = {
    "time": "builtin_interfaces/msg/Time",
    "duration": "builtin_interfaces/msg/Duration",
    "Header": "std_msgs/msg/Header",
}

# --- IDL

_IDL_BESIDE = re.compile(r"^(IDL: |[ \t]*#).*$", re.MULTILINE)
_IDL_TOKEN = re.compile(
    r"\s+|//[^\n]*|/\*[\s\S]*?(?:\*/|\Z)"
    r"|(?P<token>\"(?:[^\"\\\n]|\\.)*+\"?|'(?:[^'\\\n]|\\.)*+'?|(?:::)?[A-Za-z_]\w*(?:::[A-Za-z_]\w*)*|[\w.]+|[^\w\s])"
)
_IDL_NAME = re.compile(r"[A-Za-z_]\w*")
_IDL_SCOPED = re.compile(r"(::)?[A-Za-z_]\w*(::[A-Za-z_]\w*)*")
_IDL_WORDS = {"unsigned", "long", "short", "double"}
_MOST_MODULES = 8
_IDL_BASE = {
    "short": "int16",
    "long": "int32",
    "long long": "int64",
    "unsigned short": "uint16",
    "unsigned long": "uint32",
    "unsigned long long": "uint64",
    "float": "float32",
    "double": "float64",
    "long double": "float128",
    "boolean": "bool",
    "octet": "byte",
    **{name: name for name in ("char", "wchar", "string", "wstring")},
    **{f"{sign}int{bits}": f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)},
}


class NoDefinitionError(Exception):
    """The text is no definition."""


def fields_in(msgtype: str, text: str) -> Fields:
    """Return the fields of each type that a text defines.

    Parameters
    ----------
    msgtype
        The type that the text begins with, in the form ``nav_msgs/msg/OccupancyGrid``; of IDL the text says so itself.

    Raises
    ------
    NoDefinitionError
        If it is no definition.
    """
    text = text.replace("\r\n", "\n")
    parts = _SEPARATOR.split(text)
    if _IDL_TITLE.search(text) or _IDL_BODY.search(text):
        found: dict[str, Sequence[tuple[str, str]]] = {}
        for part in parts:
            found.update(_Idl(_IDL_BESIDE.sub("", part)).structs())
        return found
    head, *others = parts
    return dict([_message(msgtype, head.split("\n")), *(_titled(part) for part in others)])


def _titled(part: str) -> tuple[str, Sequence[tuple[str, str]]]:
    """Return a type within, whose first line names it."""
    title, *lines = part.lstrip("\n").split("\n")
    name = title.removeprefix(_MSG_TITLE).strip()
    if not title.startswith(_MSG_TITLE) or not _MSG_NAME.fullmatch(name):
        raise NoDefinitionError
    return _message(_full_name(name), lines)


def _message(msgtype: str, lines: Sequence[str]) -> tuple[str, Sequence[tuple[str, str]]]:
    fields = []
    for line in lines:
        plain = line.partition("#")[0].strip()
        annotations = _ANNOTATIONS.match(f"{plain} ")
        plain = plain[annotations.end() :] if annotations else plain
        if not plain:
            continue
        match = _MSG_FIELD.fullmatch(plain)
        if match is None:
            raise NoDefinitionError
        if not match["constant"]:
            fields.append((match["name"], _message_type(msgtype, match["type"]) + _size(match["size"])))
    return msgtype, fields


def _message_type(owner: str, name: str) -> str:
    if _MSG_BASE.fullmatch(name):
        return name
    name = _MSG_ALIASES.get(name, name)
    return _full_name(name) if "/" in name else f"{owner.rpartition('/')[0]}/{name}"


def _full_name(name: str) -> str:
    """Return a type's name with the part between its package and itself, which ROS 1 leaves out."""
    package, _, own = name.rpartition("/")
    return name if package.rpartition("/")[2] in {"msg", "action"} else f"{package}/msg/{own}"


def _size(text: str | None) -> str:
    """Return how many elements an array has, as in a type's name, without an upper bound."""
    return "" if text is None else "[]" if "<" in text else text


class _Idl:
    """Reads a text in IDL from its begin to its end."""

    def __init__(self, text: str) -> None:
        self._tokens = [match["token"] for match in _IDL_TOKEN.finditer(text) if match["token"]]
        self._at = 0
        self._scope: list[str] = []
        self._typedefs: dict[str, str] = {}
        self._structs: dict[str, Sequence[tuple[str, str]]] = {}

    def structs(self) -> Fields:
        """Return the fields of all structs."""
        while self._at < len(self._tokens):
            self._pass_annotations()
            self._define(self._next())
        if self._scope:
            raise NoDefinitionError
        return self._structs

    def _define(self, keyword: str) -> None:
        if keyword == "module" and len(self._scope) < _MOST_MODULES:
            self._scope.append(self._name())
            self._expect("{")
        elif keyword == "}" and self._scope:
            self._scope.pop()
            self._expect(";")
        elif keyword == "struct":
            self._define_struct()
        elif keyword == "typedef":
            for name, kind in self._declared():
                self._typedefs["/".join([*self._scope, name])] = kind
        elif keyword in {"const", "enum"}:
            while self._next() != ";":
                pass
        else:
            raise NoDefinitionError

    def _define_struct(self) -> None:
        name = "/".join([*self._scope, self._name()])
        fields: list[tuple[str, str]] = []
        self._expect("{")
        while True:
            self._pass_annotations()
            if self._peek() == "}":
                break
            fields += self._declared()
        self._at += 1
        self._expect(";")
        self._structs[name] = fields

    def _declared(self) -> list[tuple[str, str]]:
        """Return the names that are declared with a type, up to the semicolon."""
        kind, found = self._type(), []
        while True:
            found.append((self._name(), kind + self._array_size(kind)))
            following = self._next()
            if following == ";":
                return found
            if following != ",":
                raise NoDefinitionError

    def _array_size(self, kind: str) -> str:
        if self._peek() != "[":
            return ""
        _, size, end = self._next(), self._next(), self._next()
        if end != "]" or kind.endswith("]"):
            raise NoDefinitionError
        return f"[{size}]"

    def _type(self) -> str:
        if self._peek() != "sequence":
            return self._single_type()
        self._at += 1
        self._expect("<")
        kind = self._single_type()
        self._pass_bound(",")
        self._expect(">")
        if kind.endswith("]"):
            raise NoDefinitionError
        return f"{kind}[]"

    def _single_type(self) -> str:
        words = [self._next()]
        while words[0] in _IDL_WORDS and self._peek() in _IDL_WORDS:
            words.append(self._next())
        name = " ".join(words)
        if name in {"string", "wstring"} and self._peek() == "<":
            self._pass_bound("<")
            self._expect(">")
        if name in _IDL_BASE:
            return _IDL_BASE[name]
        if name == "sequence" or not _IDL_SCOPED.fullmatch(name):
            raise NoDefinitionError
        return self._resolved(name.replace("::", "/"))

    def _pass_bound(self, begin: str) -> None:
        if self._peek() == begin:
            self._at += 2

    def _resolved(self, name: str) -> str:
        """Return what a name stands for where it is used."""
        if name.startswith("/"):
            return self._typedefs.get(name[1:], name[1:])
        for depth in range(len(self._scope), -1, -1):
            full = "/".join([*self._scope[:depth], name])
            if full in self._typedefs or full in self._structs:
                return self._typedefs.get(full, full)
        return name if "/" in name else "/".join([*self._scope, name])

    def _pass_annotations(self) -> None:
        while self._peek() == "@":
            self._at += 2
            depth = 0
            while depth or self._peek() == "(":
                depth += {"(": 1, ")": -1}.get(self._next(), 0)

    def _name(self) -> str:
        name = self._next()
        if not _IDL_NAME.fullmatch(name):
            raise NoDefinitionError
        return name

    def _expect(self, token: str) -> None:
        if self._next() != token:
            raise NoDefinitionError

    def _peek(self) -> str:
        return self._tokens[self._at] if self._at < len(self._tokens) else ""

    def _next(self) -> str:
        if self._at >= len(self._tokens):
            raise NoDefinitionError
        self._at += 1
        return self._tokens[self._at - 1]
