"""The report of a run that was made before: its JSON file, or the last report in its MCAP."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from replay.errors import InputError
from replay.events import SCHEMA, Report
from replay.options import TimeBound
from replay.sources.base import Encoding
from replay.sources.boundary import translated
from replay.sources.mcap.file import McapFile
from replay.sources.mcap.records import MAGIC
from replay.topics import REPORT_TOPIC

MOST_BYTES = 256 << 20
_HEAD_BYTES = 4096
_RECORDINGS = (b"#ROSBAG V", b"SQLite format 3\0", b"\x28\xb5\x2f\xfd")
_RERUN = b"RRF"
_EXPECTED = "expected a report that `replay merge` wrote: OUT.json, or OUT.mcap"


class _ReportFile(McapFile):
    """An MCAP of which reports are read, which are JSON."""

    encodings: ClassVar[Mapping[str, Encoding]] = {"json": "json"}


def read_report(path: str | os.PathLike[str], at: TimeBound | None = None) -> Report:
    """Return a run's report.

    Parameters
    ----------
    path
        The JSON or the MCAP that the run wrote.
    at
        As of which time, of an MCAP; None for the last report. Seconds count from the run's first map.

    Returns
    -------
    report
        As ``docs/report.schema.json`` describes it: lengths in metres, angles in radians, times in nanoseconds.

    Raises
    ------
    InputError
        If it is no report, not whole, of another version, or of a time before the first one.
    """
    path = Path(path)
    if holds_mcap(path):
        return _from_mcap(path, at)
    if at is not None:
        raise InputError(f"{path}: this holds the final report alone; give OUT.mcap for an earlier time")
    _refuse_recording(path)
    with translated(path):
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise InputError(f"{path}: it has {size} bytes; {_EXPECTED}, of at most {MOST_BYTES}")
        content = path.read_bytes()
    return _parsed(path, content)


def since_1970(path: Path, report: Report, at: TimeBound) -> TimeBound:
    """Return a time of a run as one that does not count from its first map.

    Raises
    ------
    InputError
        If the report does not say when that was.
    """
    return TimeBound(_bound_ns(path, report, at), relative=False)


def holds_mcap(path: Path) -> bool:
    """Tell whether a file begins as an MCAP does."""
    return _head(path).startswith(MAGIC)


def holds_report(path: Path) -> bool:
    """Tell whether this is a run that was made before: JSON, or an MCAP with reports in it."""
    if not path.is_file():
        return False
    head = _head(path)
    if head.startswith(MAGIC):
        with _ReportFile(path) as file:
            return any(topic.name == REPORT_TOPIC for topic in file.info.topics)
    # a saved map may be YAML in braces
    return head.lstrip().startswith(b"{") and (b'"schema"' in head or path.suffix == ".json")


def _head(path: Path) -> bytes:
    with translated(path):
        if not path.exists():
            raise InputError(f"{path}: it does not exist; {_EXPECTED}")
        if not path.is_file():
            raise InputError(f"{path}: this is no regular file; {_EXPECTED}")
        with path.open("rb") as file:
            return file.read(_HEAD_BYTES)


def _refuse_recording(path: Path) -> None:
    """Say what to give instead of a recording of maps, or of Rerun's."""
    head = _head(path)
    if head.startswith(_RECORDINGS):
        raise InputError(f"{path}: this is a recording; {_EXPECTED}; to make one: replay merge {path}")
    if head.startswith(_RERUN):
        raise InputError(f"{path}: this is a Rerun recording; {_EXPECTED}, which stand beside it")


def _from_mcap(path: Path, at: TimeBound | None) -> Report:
    with _ReportFile(path, most_bytes=MOST_BYTES) as file:
        if not any(topic.name == REPORT_TOPIC for topic in file.info.topics):
            raise InputError(f"{path}: it holds no {REPORT_TOPIC}; {_EXPECTED}; to make one: replay merge {path}")
        last = found = _latest(file)
        if last is not None and at is not None and last["stamp_ns"] is not None:
            bound_ns = _bound_ns(path, last, at)
            found = last if last["stamp_ns"] <= bound_ns else _latest(file, bound_ns)
        losses = file.losses.all
    if losses:
        raise InputError(
            f"{path}: {losses[0].place}: {losses[0].detail}; its last report may be lost: give OUT.json, or merge again"
        )
    if last is None or found is None:
        raise InputError(f"{path}: {'there is no report' if last is None else 'the run begins after that time'}")
    return found if found is last else _with_history(found, last)


def _latest(file: McapFile, until_ns: int | None = None) -> Report | None:
    """Return the last report up to a time, found by its log time, so that no other one must be parsed."""
    message = file.latest([REPORT_TOPIC], until_ns)
    return None if message is None else _parsed(file.path, bytes(message.data))


def _with_history(report: Report, final: Report) -> Report:
    """Return a report of a time before the end with all of the history until then, of which it holds the last part."""
    if final.get("history_before") != 0 or "history_before" not in report:
        return report  # of an older version, or of a run that did not end
    until = report["history_before"] + len(report["history"])
    return {**report, "history": final["history"][:until], "history_before": 0}


def _bound_ns(path: Path, report: Report, at: TimeBound) -> int:
    if not at.relative:
        return at.ns
    first_ns = report.get("first_stamp_ns")
    if not isinstance(first_ns, int):
        raise InputError(f"{path}: its report does not say when the run began; give the time as nanoseconds with ns")
    return at.absolute_ns(first_ns)


def _parsed(path: Path, content: bytes) -> dict[str, Any]:
    try:
        report = json.loads(content)
    except (ValueError, RecursionError) as error:
        ends = "it is empty" if not content.strip() else f"this is no JSON, or it was cut off ({_one_line(error)})"
        raise InputError(f"{path}: {ends}; {_EXPECTED}") from error
    if not isinstance(report, dict) or not isinstance(report.get("schema"), str):
        raise InputError(f'{path}: this is JSON of something else; {_EXPECTED}, with "schema": "{SCHEMA}"')
    if report["schema"] != SCHEMA:
        raise InputError(
            f"{path}: this is a report of the form {report['schema']!r}, and {SCHEMA} is read; merge again, or use the "
            f"version of replay that wrote it"
        )
    return report


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
