"""Where flags were said that no command line holds."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from replay.errors import UsageError


@contextmanager
def naming_origins(options: argparse.Namespace) -> Iterator[None]:
    """Say of an error that names a flag where that was said, if it was in a file of settings."""
    origins: Mapping[str, str] = getattr(options, "origins", {})
    try:
        yield
    except UsageError as error:
        found = re.match(r"--?[a-z-]+", str(error))
        if found is None or found[0] not in origins:
            raise
        rest = str(error)[found.end() :].removeprefix(":").lstrip()
        raise UsageError(f"{origins[found[0]]}: {rest}") from error
