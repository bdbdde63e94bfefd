"""YAML and JSON files that people write, as `Node`; of YAML with the lines in which values begin."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from replay.documents import Keys, Node
from replay.errors import InputError

if TYPE_CHECKING:
    from ruamel.yaml.nodes import Node as YamlNode

MOST_BYTES = 8 << 20


def read_yaml(path: Path, expected: str) -> Node:
    """Return what a YAML file says.

    Parameters
    ----------
    expected
        What it should be, for errors.

    Raises
    ------
    InputError
        If it cannot be read or is no YAML, with the line.
    """
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    from replay.sources.yaml_text import reader

    text = _text(path, expected)
    try:
        value = reader(path).load(text)
        composed = reader(path).compose(text)
    except MarkedYAMLError as error:
        line = f"line {error.problem_mark.line + 1}: " if error.problem_mark else ""
        raise InputError(f"{path}: {line}this is no YAML: {error.problem or error.context}") from error
    except (YAMLError, ValueError) as error:
        raise InputError(f"{path}: this is no YAML: {' '.join(str(error).split())}; expected {expected}") from error
    if value is None:
        raise InputError(f"{path}: there is nothing in it; expected {expected}")
    return Node(path, value, (), dict(_lines(composed, ())))


def read_json(path: Path, expected: str) -> Node:
    """Return what a JSON file says.

    Parameters
    ----------
    expected
        What it should be, for errors.

    Raises
    ------
    InputError
        If it cannot be read or is no JSON.
    """
    try:
        return Node(path, json.loads(_text(path, expected)))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: this is no JSON: {' '.join(str(error).split())}; expected {expected}") from error


def _text(path: Path, expected: str) -> str:
    try:
        if path.exists() and not path.is_file():
            raise InputError(f"{path}: this is no regular file; expected {expected}")
        content = path.read_bytes() if path.stat().st_size <= MOST_BYTES else None
    except FileNotFoundError as error:
        raise InputError(f"{path}: it does not exist; expected {expected}") from error
    except OSError as error:
        raise InputError(f"{path}: it cannot be read: {error.strerror}") from error
    if content is None:
        raise InputError(f"{path}: it has more than {MOST_BYTES} bytes; expected {expected}")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: this is no text in UTF-8: byte {error.start} is none of it; expected {expected}"
        ) from error


def _lines(node: YamlNode, keys: Keys) -> Iterator[tuple[Keys, int]]:
    from ruamel.yaml.nodes import MappingNode, ScalarNode, SequenceNode

    if keys:
        yield keys, node.start_mark.line + 1
    if isinstance(node, MappingNode):
        for key, value in node.value:
            if isinstance(key, ScalarNode):
                yield from _lines(value, (*keys, key.value))
    elif isinstance(node, SequenceNode):
        for at, value in enumerate(node.value):
            yield from _lines(value, (*keys, at))
