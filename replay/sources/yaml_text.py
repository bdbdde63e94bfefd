"""YAML files beside recordings: plain values alone, of bounded size and depth, and never by reference.

By references (``&a``, ``*a``) a few lines can stand for more than any memory holds. No program that writes these files
uses them.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import TYPE_CHECKING, Any

from replay.errors import InputError
from replay.sources.boundary import COMMON, OF_LIBRARIES, translated

if TYPE_CHECKING:
    from ruamel.yaml import YAML
    from ruamel.yaml.nodes import Node

MOST_BYTES = 8 << 20
MOST_DEPTH = 40


@functools.cache
def foreign_errors() -> tuple[type[Exception], ...]:
    """Return what may be raised while a YAML file is read."""
    from ruamel.yaml.error import YAMLError

    return (*COMMON, *OF_LIBRARIES, YAMLError)


def load_yaml(path: Path) -> object:
    """Return what a YAML file says.

    Raises
    ------
    InputError
        If it cannot be read, or is larger or deeper than any that describes a recording, or refers to itself.
    """
    with translated(path, foreign_errors()):
        if not path.is_file():
            raise InputError(f"{path}: this is no regular file; expected a description of a recording")
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise InputError(f"{path}: it has {size} bytes; expected a description of {MOST_BYTES} bytes at most")
        return reader(path).load(path.read_text(encoding="utf-8"))


def reader(path: Path) -> YAML:
    """Return what reads a file, within these limits."""
    from ruamel.yaml import YAML
    from ruamel.yaml.composer import Composer
    from ruamel.yaml.events import AliasEvent

    class Bounded(Composer):
        """Refuses references and deep nesting where they are met, before anything is made of them."""

        depth = 0

        def compose_node(self, parent: Any, index: Any) -> Node | None:  # noqa: ANN401 - as in the class above
            event = self.parser.peek_event()
            line = event.start_mark.line + 1
            if isinstance(event, AliasEvent):
                raise InputError(f"{path}: line {line} refers to another value; write the value there")
            if self.depth >= MOST_DEPTH:
                raise InputError(f"{path}: line {line} is nested more than {MOST_DEPTH} deep; expected plain values")
            self.depth += 1
            try:
                node: Node | None = super().compose_node(parent, index)
            finally:
                self.depth -= 1
            return node

    # pure: the reader written in C takes no composer
    reader = YAML(typ="safe", pure=True)
    reader.Composer = Bounded
    return reader
