"""Reports that were written, read back: from ``OUT.json``, or from the ``OUT.mcap`` beside it."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from replay.errors import InputError
from replay.report import SCHEMA

_TOPIC = "/merged/report"


def read_report(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the final report of a run.

    Parameters
    ----------
    path
        The JSON or the MCAP that the run wrote.

    Returns
    -------
    report
        As ``docs/report.schema.json`` describes it: lengths in metres, angles in radians, times in nanoseconds.

    Raises
    ------
    InputError
        If it cannot be read, or is no report.
    """
    path = Path(path)
    try:
        text = _last_in_mcap(path) if path.suffix == ".mcap" else path.read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such file") from error
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; give another path") from error
    try:
        report = json.loads(text)
    except ValueError as error:  # also of bytes that are no text
        raise InputError(f"{path}: is no JSON; expected the report of a run, OUT.json") from error
    if not isinstance(report, dict) or report.get("schema") != SCHEMA:
        raise InputError(f"{path}: is no report of a run; expected JSON whose schema is {SCHEMA!r}")
    return report


def _last_in_mcap(path: Path) -> bytes:
    """Return the last report in an MCAP; it is the final one."""
    from mcap.exceptions import McapError
    from mcap.reader import SeekingReader
    from zstandard import ZstdError

    with path.open("rb") as stream:
        try:
            messages = SeekingReader(stream).iter_messages([_TOPIC], reverse=True)
            found = next(iter(messages), None)
        except (McapError, ZstdError, ValueError) as error:
            raise InputError(f"{path}: cannot be read as an MCAP; give the report, OUT.json") from error
    if found is None:
        raise InputError(f"{path}: holds no report of a run; expected an MCAP that `replay merge` wrote")
    return found[2].data
