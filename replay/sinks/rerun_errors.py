"""The boundary to the Rerun library: what it raises leaves as an `OutputError`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pyarrow import ArrowException  # type: ignore[import-untyped]

from replay.errors import OutputError
from replay.sinks.partial_file import one_line, output_errors

_PANICS = "pyo3_runtime"


@contextmanager
def rerun_errors(path: Path) -> Iterator[None]:
    """Translate errors of the library, of what it keeps its data in, and of the file system."""
    try:
        with output_errors(path, RuntimeError, ArrowException):
            yield
    except BaseException as error:
        # A panic of the library is an exception that no `except Exception` sees, and whose class cannot be imported.
        if type(error).__module__ != _PANICS:
            raise
        raise OutputError(f"{path}: cannot be written: {one_line(error)}") from error
