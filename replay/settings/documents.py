"""Files of settings: TOML, or what a run wrote, which holds its settings."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any

from replay.errors import InputError, UsageError
from replay.settings.keys import refuse_unknown

RUN_SUFFIXES = (".json", ".mcap")
"""Of files that hold the settings of a run."""

NO_PLACE = Path()


@dataclass(frozen=True, slots=True)
class Said:
    """A setting that was said.

    Parameters
    ----------
    value
        As TOML has it; numbers with a point are `Decimal`.
    origin
        Where it was said, to begin an error with.
    folder
        What its paths are relative to.
    """

    value: Any
    origin: str
    folder: Path


def read_settings(path: Path, known: list[str]) -> dict[str, Said]:
    """Return the settings of a file, by their names.

    Raises
    ------
    UsageError
        If it cannot be read, or says what is no setting.
    """
    return dict(_flat(_document(path), known, str(path), path.parent))


def read_assignment(text: str, known: list[str]) -> dict[str, Said]:
    """Return the setting of a ``--set KEY=VALUE``; a value that is none of TOML is text.

    Raises
    ------
    UsageError
        If it is none, or of something that is no setting.
    """
    key, sign, value = text.partition("=")
    key, value = key.strip(), value.strip()
    if not sign or not key or not value:
        raise UsageError(f"--set {text}: expected KEY=VALUE, such as merge.verify.min_overlap_m2=4")
    found: Any = value
    try:
        table = tomllib.loads(f"x = {value}", parse_float=Decimal)
    except (ValueError, RecursionError):
        pass
    else:
        found = table["x"] if len(table) == 1 else value
    for part in reversed(key.split(".")):
        found = {part: found}
    return dict(_flat(found, known, "--set", NO_PLACE))


def _document(path: Path) -> Mapping[str, Any]:
    if path.suffix in RUN_SUFFIXES:
        return _of_run(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        what = "there is no such file" if isinstance(error, FileNotFoundError) else error.strerror
        raise UsageError(f"{path}: {what}; expected settings, as `replay config` prints them") from error
    try:
        return tomllib.loads(data.decode("utf-8-sig"), parse_float=Decimal)
    except UnicodeDecodeError as error:
        raise UsageError(f"{path}: is no text in UTF-8; expected settings in TOML") from error
    except (ValueError, RecursionError) as error:  # also a number of very many digits
        raise UsageError(f"{path}: is no TOML: {' '.join(str(error).split())}") from error


def _of_run(path: Path) -> Mapping[str, Any]:
    from replay.documents import Node
    from replay.report_file import read_report
    from replay.settings.of_run import document_of

    report = Node(path, read_report(path))
    try:
        return document_of(report.need("settings"))
    except InputError as error:
        raise UsageError(f"{error}; these are not settings that a run writes: give the file as it was") from error
    except RecursionError as error:
        raise UsageError(f"{path}: its settings are nested too deep for a run's; give the file as it was") from error


def _flat(
    document: Mapping[str, Any], known: list[str], where: str, folder: Path, above: str = ""
) -> Iterator[tuple[str, Said]]:
    """Yield each setting of nested sections."""
    for name, value in document.items():
        key = f"{above}{name}"
        origin = f"{where} {key}" if where.startswith("--") else f"{where}: {key}"
        if key in known:
            yield key, Said(value, origin, folder)
        elif not any(each.startswith(f"{key}.") for each in known):
            refuse_unknown(key, known, origin)
        elif isinstance(value, dict):
            yield from _flat(value, known, where, folder, f"{key}.")
        else:
            first = next(each for each in known if each.startswith(f"{key}."))
            raise UsageError(f"{origin}: is a section, and no setting; expected one of its settings, such as {first}")
