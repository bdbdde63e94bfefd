"""Names that a recording holds, made fit to be shown: what is in a file must not steer a terminal, nor hide."""

from __future__ import annotations

import re
from collections.abc import Sequence

MOST_NAMED = 20
_LONGEST_WORD = 200
_LONGEST_NAME = 100
_LONG_WORD = re.compile(rf"\S{{{_LONGEST_WORD + 1},}}")


def plain(text: str) -> str:
    """Return a line with all that is not seen in it escaped: control characters, line ends, marks of direction.

    Words that are too long to be read, as only names are, are cut.
    """
    return _LONG_WORD.sub(lambda word: f"{word[0][: _LONGEST_WORD - 1]}…", escaped(text))


def escaped(text: str) -> str:
    """Return text with all that is not seen in it escaped."""
    return text if text.isprintable() else "".join(map(_escaped, text))


def brief(name: str) -> str:
    """Return a name within a line: escaped, and cut if it is too long to be one, whatever words are in it."""
    shown = escaped(name[: _LONGEST_NAME + 1])
    return shown if len(shown) <= _LONGEST_NAME else f"{shown[: _LONGEST_NAME - 1]}…"


def plain_json(text: str) -> str:
    r"""Return JSON with all that is not seen in its strings as \u escapes; its own line ends stay."""
    if text.replace("\n", "").isprintable():
        return text
    return "".join(each if each.isprintable() or each == "\n" else _json_escape(each) for each in text)


def ascii_json(text: str) -> str:
    r"""Return JSON with all that is not ASCII as \u escapes: it stands in its strings."""
    return "".join(each if each.isascii() else _json_escape(each) for each in text)


def ascii_toml(text: str) -> str:
    r"""Return TOML with all that is not ASCII as \U escapes: it stands in texts in double quotes, and comments."""
    return "".join(each if each.isascii() else f"\\U{ord(each):08x}" for each in text)


def listed(names: Sequence[str], between: str = ", ") -> str:
    """Return names as a list, of very many the first ones and how many there are more."""
    more = len(names) - MOST_NAMED
    return between.join(names) if more <= 0 else f"{between.join(names[:MOST_NAMED])} and {more} more"


def _escaped(character: str) -> str:
    return character if character.isprintable() else character.encode("unicode_escape").decode("ascii")


def _json_escape(character: str) -> str:
    units = character.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[at]:02x}{units[at + 1]:02x}" for at in range(0, len(units), 2))
