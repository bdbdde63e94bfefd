"""What the file system says of a path that was given, before anything is opened."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from replay.errors import ReplayError


@contextmanager
def path_errors(path: Path, kind: type[ReplayError]) -> Iterator[None]:
    """Translate what is raised where a path is looked up that no file can have, or that may not be looked up."""
    try:
        yield
    except FileNotFoundError as error:  # of a relative path alone: any other may name what is not there
        raise kind(f"{path}: the current folder is no longer there; change to another") from error
    except OSError as error:
        raise kind(f"{path}: {error.strerror}; give another path") from error
    except ValueError as error:  # of characters that no path can hold, such as NUL
        raise kind(f"{path}: no file can have this name; give another") from error
    except RuntimeError as error:
        raise kind(f"{path}: its links lead in a circle; give another path") from error
