"""Write docs/cli.md from the program's own --help, or check that it is up to date (--check)."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

from replay.commands import COMMANDS

DOCS = Path(__file__).resolve().parents[1] / "docs" / "cli.md"
HEAD = """\
# Command line

Written by `make docs` from the program's own `--help`; `make test` checks that it is up to date.
"""


def reference() -> str:
    """Return the text of the page."""
    environment = {**os.environ, "COLUMNS": "110", "NO_COLOR": "1", "PYTHON_COLORS": "0"}
    parts = [HEAD]
    for command in ((), *((name,) for name in COMMANDS)):
        arguments = [sys.executable, "-m", "replay", *command, "--help"]
        run = subprocess.run(arguments, capture_output=True, text=True, check=True, env=environment)
        parts.append(f"## {' '.join(('replay', *command))}\n\n```text\n{run.stdout.rstrip()}\n```\n")
    return "\n".join(parts)


def main() -> int:
    """Write or check the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true")
    if not parser.parse_args().check:
        DOCS.write_text(reference(), encoding="utf-8")
        return 0
    if DOCS.exists() and DOCS.read_text(encoding="utf-8") == reference():
        return 0
    print(f"{DOCS.name} is not what --help says; run: make docs", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
