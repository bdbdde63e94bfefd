"""The fields that a message definition in IDL states."""

from __future__ import annotations

import re

from replay.sources.definitions.fields import BASE, SEPARATOR_LINE, Fields, NoDefinitionError

_MOST_LEVELS = 8
_LONGEST_NAME_CHARS = 256

# lines that are none of IDL's: titles, and directives such as #include
_TITLE = re.compile(r"^IDL: .*$", re.MULTILINE)
_BESIDE = re.compile(r"^(IDL: |[ \t]*#).*$", re.MULTILINE)
_BODY = re.compile(r"^[ \t]*module[ \t]+\w+\s*\{", re.MULTILINE)
# what begins a comment or text and does not end it comes last, as what is none
_TOKEN = re.compile(
    r"""(?P<space>\s+|//[^\n]*|/\*(?s:.*?)\*/)|(?P<text>"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')"""
    r"""|(?P<bad>/\*|["'])|(?P<word>(?:::)?[A-Za-z_]\w*(?:::[A-Za-z_]\w*)*|\d[\w.]*|.)"""
)
_BASE_NAMES = {
    **{name: name for name in BASE - {"byte"}},
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
_SEVERAL = {"unsigned", "short", "long", "double"}


def is_idl(text: str) -> bool:
    """Tell whether a definition is in IDL."""
    return bool(_TITLE.search(text) or _BODY.search(text))


def idl_fields(text: str) -> Fields:
    """Return the fields of each type that a text defines; raises as `stated_fields` does."""
    return _Reader(_BESIDE.sub("", SEPARATOR_LINE.sub("", text))).fields


class _Reader:
    """Reads the structs of a text in IDL.

    Attributes
    ----------
    fields
        What they state.
    """

    def __init__(self, text: str) -> None:
        self.fields: dict[str, list[tuple[str, str]]] = {}
        self._words = _words_of(text)
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
        if word in _SEVERAL:
            while self._peek() in _SEVERAL:
                word = f"{word} {self._take()}"
                if word not in _BASE_NAMES:
                    raise NoDefinitionError
        if word in {"string", "wstring"} and self._peek() == "<":
            self._in("<", ">")
        return (_BASE_NAMES[word], "") if word in _BASE_NAMES else self._resolved(word)

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


def _words_of(text: str) -> list[str]:
    words = []
    for match in _TOKEN.finditer(text):
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
