"""The fields that the text of a message definition states: in ROS's own format, or in IDL.

A text may be written to take long to read: so each of its characters is looked at once, whatever it says. What has no
part in the bytes of a message is passed over unread: constants, annotations, defaults, bounds.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

Fields = Mapping[str, Sequence[tuple[str, str]]]
"""By name of a message, the names and types of its fields."""

_MOST_LEVELS = 8
_LONGEST_NAME_CHARS = 256
_SEPARATOR_LINE = re.compile(r"^={3,}[ \t]*$", re.MULTILINE)
_NUMBERS = {"bool", "byte", "char", "float32", "float64"} | {
    f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)
}
_BASE = _NUMBERS | {"string", "wstring"}


class NoDefinitionError(Exception):
    """A text is no message definition."""


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
    if _IDL_TITLE.search(text) or _IDL_BODY.search(text):
        return _Idl(_IDL_BESIDE.sub("", _SEPARATOR_LINE.sub("", text))).fields
    return _msg_fields(msgtype, text)


# --- ROS's own format

_MSG_TITLE = re.compile(r"MSG: ([A-Za-z0-9/_]{1,256})[ \t]*")
_MSG_FIELD = re.compile(r"(?P<kind>[A-Za-z][\w/]*)(?:<=\d+)?(?P<array>\[(?:<=)?\d*\])?[ \t]+(?P<name>[A-Za-z]\w*)")
_MSG_LONG = {
    "time": "builtin_interfaces/msg/Time",
    "duration": "builtin_interfaces/msg/Duration",
    "Header": "std_msgs/msg/Header",
}


def _msg_fields(msgtype: str, text: str) -> Fields:
    first, *others = _SEPARATOR_LINE.split(text)
    fields = {msgtype: _msg_part(msgtype, first)}
    for part in others:
        title, _, body = part.strip().partition("\n")
        named = _MSG_TITLE.fullmatch(title)
        if named is None:
            raise NoDefinitionError
        name = _full_name(named[1])
        fields[name] = _msg_part(name, body)
    return fields


def _msg_part(owner: str, text: str) -> list[tuple[str, str]]:
    lines = (line.strip(" \t") for line in text.split("\n"))
    found = (_msg_line(owner, line) for line in lines if line and not line.startswith(("#", "@")))
    return [each for each in found if each is not None]


def _msg_line(owner: str, line: str) -> tuple[str, str] | None:
    """Return name and type of the field that a line states; None if it states a constant."""
    match = _MSG_FIELD.match(line)
    if match is None:
        raise NoDefinitionError
    rest = line[match.end() :]
    kind, array = match["kind"], match["array"]
    if rest.lstrip(" \t").startswith("="):
        if kind not in _BASE or array:
            raise NoDefinitionError
        return None
    # a default, or a comment
    if rest and rest[0] not in " \t#":
        raise NoDefinitionError
    size = "" if array is None else "[]" if "<" in array else array
    return match["name"], _msg_type(owner, kind) + size


def _msg_type(owner: str, kind: str) -> str:
    if kind in _BASE:
        return kind
    if kind in _MSG_LONG:
        return _MSG_LONG[kind]
    return _full_name(kind) if "/" in kind else f"{owner.rpartition('/')[0]}/{kind}"


def _full_name(name: str) -> str:
    package, _, kind = name.rpartition("/")
    return name if package.endswith(("/msg", "/action")) or not package else f"{package}/msg/{kind}"


# --- IDL

# lines that are none of IDL's: titles, and directives such as #include
_IDL_TITLE = re.compile(r"^IDL: .*$", re.MULTILINE)
_IDL_BESIDE = re.compile(r"^(IDL: |[ \t]*#).*$", re.MULTILINE)
_IDL_BODY = re.compile(r"^[ \t]*module[ \t]+\w+\s*\{", re.MULTILINE)
# what begins a comment or text and does not end it comes last, as what is none
_IDL_TOKEN = re.compile(
    r"""(?P<space>\s+|//[^\n]*|/\*(?s:.*?)\*/)|(?P<text>"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')"""
    r"""|(?P<bad>/\*|["'])|(?P<word>(?:::)?[A-Za-z_]\w*(?:::[A-Za-z_]\w*)*|\d[\w.]*|.)"""
)
_IDL_BASE = {
    **{name: name for name in _BASE - {"byte"}},
    "boolean": "bool",
    "octet": "byte",
    "wchar": "wchar",
    "float": "float32",
    "double": "float64",
    "short": "int16",
    "long": "int32",
    "long long": "int64",
    "long double": "float128",
    "unsigned short": "uint16",
    "unsigned long": "uint32",
    "unsigned long long": "uint64",
}
_IDL_SEVERAL = {"unsigned", "short", "long", "double"}


class _Idl:
    """Reads the structs of a text in IDL.

    Attributes
    ----------
    fields
        What they state.
    """

    def __init__(self, text: str) -> None:
        self.fields: dict[str, list[tuple[str, str]]] = {}
        self._words = _idl_words(text)
        self._at = 0
        self._modules: list[str] = []
        # name and array of what they stand for
        self._aliases: dict[str, tuple[str, str]] = {}
        while self._at < len(self._words):
            self._definition()
        if self._modules or not self.fields:
            raise NoDefinitionError

    def _definition(self) -> None:
        self._annotations()
        word = self._take()
        if word == "module":
            self._modules.append(self._name())
            self._expect("{")
            if len(self._modules) > _MOST_LEVELS:
                raise NoDefinitionError
        elif word == "}" and self._modules:
            self._modules.pop()
            self._expect(";")
        elif word in {"const", "enum"}:
            self._skip_to(";")
        elif word == "typedef":
            for name, alias in self._members():
                self._aliases[self._scoped(name)] = alias
        elif word == "struct":
            self._struct()
        else:
            raise NoDefinitionError

    def _struct(self) -> None:
        fields = self.fields[self._scoped(self._name())] = []
        self._expect("{")
        while True:
            self._annotations()
            if self._peek() == "}":
                break
            fields += [(name, kind + array) for name, (kind, array) in self._members()]
        self._expect("}")
        self._expect(";")

    def _members(self) -> list[tuple[str, tuple[str, str]]]:
        """Take a type, and the names that are of this type."""
        kind, array = self._type()
        members = []
        while True:
            name, own = self._name(), ""
            if self._peek() == "[":
                own = f"[{self._in('[', ']')}]"
            members.append((name, (kind, _one_array(array, own))))
            if self._take_any(",", ";") == ";":
                return members

    def _type(self) -> tuple[str, str]:
        if self._peek() != "sequence":
            return self._single_type()
        self._take()
        self._expect("<")
        kind, array = self._single_type()
        if self._take_any(",", ">") == ",":
            self._take()
            self._expect(">")
        return kind, _one_array(array, "[]")

    def _single_type(self) -> tuple[str, str]:
        word = self._take()
        if word in _IDL_SEVERAL:
            while self._peek() in _IDL_SEVERAL:
                word = f"{word} {self._take()}"
                if word not in _IDL_BASE:
                    raise NoDefinitionError
        if word in {"string", "wstring"} and self._peek() == "<":
            self._in("<", ">")
        return (_IDL_BASE[word], "") if word in _IDL_BASE else self._resolved(word)

    def _resolved(self, word: str) -> tuple[str, str]:
        """Return what a name stands for where it is."""
        if not _is_name(word):
            raise NoDefinitionError
        name = word.replace("::", "/").strip("/")
        levels = [0] if word.startswith("::") else range(len(self._modules), -1, -1)
        for level in levels:
            candidate = "/".join((*self._modules[:level], name))
            if candidate in self._aliases:
                return self._aliases[candidate]
            if candidate in self.fields:
                return candidate, ""
        return (name if "/" in name else self._scoped(name)), ""

    def _annotations(self) -> None:
        while self._peek() == "@":
            self._take()
            self._take()
            if self._peek() == "(":
                self._skip_group()

    def _skip_group(self) -> None:
        depth = 0
        while True:
            word = self._take()
            depth += (word == "(") - (word == ")")
            if not depth:
                return

    def _skip_to(self, end: str) -> None:
        while self._take() != end:
            pass

    def _in(self, begin: str, end: str) -> str:
        """Take one word in brackets."""
        self._expect(begin)
        word = self._take()
        self._expect(end)
        return word

    def _name(self) -> str:
        word = self._take()
        if not _is_name(word) or "::" in word:
            raise NoDefinitionError
        return word

    def _scoped(self, name: str) -> str:
        return "/".join((*self._modules, name))

    def _peek(self) -> str:
        return self._words[self._at] if self._at < len(self._words) else ""

    def _take(self) -> str:
        word = self._peek()
        if not word:
            raise NoDefinitionError
        self._at += 1
        return word

    def _take_any(self, *expected: str) -> str:
        word = self._take()
        if word not in expected:
            raise NoDefinitionError
        return word

    def _expect(self, word: str) -> None:
        self._take_any(word)


def _idl_words(text: str) -> list[str]:
    words = []
    for match in _IDL_TOKEN.finditer(text):
        if match.lastgroup == "bad":
            raise NoDefinitionError
        if match.lastgroup != "space":
            words.append(match.group())
    return words


def _is_name(word: str) -> bool:
    return len(word) <= _LONGEST_NAME_CHARS and (word.lstrip(":")[:1].isalpha() or word[:1] == "_")


def _one_array(first: str, second: str) -> str:
    if first and second:
        raise NoDefinitionError
    return first or second
