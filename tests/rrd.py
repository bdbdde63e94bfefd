"""What Rerun recordings hold, read back with Rerun's own reader."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pyarrow as pa
from rerun.chunk import RrdReader


def rows_of(batch: pa.RecordBatch) -> list[dict[str, Any]]:
    """Return the rows of a chunk, times in nanoseconds."""
    columns = {name: batch.column(name) for name in batch.schema.names}
    for timeline in {"log_time", "elapsed"} & set(columns):
        columns[timeline] = columns[timeline].cast(pa.int64())
    return [{name: column[index].as_py() for name, column in columns.items()} for index in range(batch.num_rows)]


def contents(path: Path) -> list[tuple[str, str]]:
    """Return all that a recording says but the wall times of a run, to compare two of them."""
    found = []
    for chunk in RrdReader(path).stream():
        if not chunk.entity_path.startswith("/plots/step_ms"):
            rows = rows_of(chunk.to_record_batch())
            found.append((chunk.entity_path, str([{**row, "rerun.controls.RowId": None} for row in rows])))
    return sorted(found)
