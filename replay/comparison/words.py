"""A comparison of two runs, to read and as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from replay.columns import columns
from replay.comparison.differences import Comparison
from replay.plain_text import plain, plain_json
from replay.words import counted


def lines(comparison: Comparison, before: Path, after: Path) -> Iterator[str]:
    """Yield the comparison as lines to read."""
    yield from (f"note: {note}" for note in comparison.notes)
    if not comparison.differences:
        yield f"no difference between {before} and {after}"
        return
    yield f"{counted(len(comparison.differences), 'difference')} between {before} and {after}"
    rows = [("robot", "what", "before", "after", "difference")]
    rows += [
        (item.robot or "(run)", item.what, item.before, item.after, item.detail) for item in comparison.differences
    ]
    yield from columns([[plain(cell) for cell in row] for row in rows])


def json_text(comparison: Comparison) -> str:
    """Return the comparison as JSON."""
    values = {
        "differences": [asdict(item) for item in comparison.differences],
        "notes": list(comparison.notes),
    }
    return plain_json(json.dumps(values, indent=2, ensure_ascii=False)) + "\n"
