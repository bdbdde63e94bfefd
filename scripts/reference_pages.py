"""Write docs/cli.md and docs/settings.md from what the program says, or check that they are up to date (--check)."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from replay.commands import COMMANDS

DOCS = Path(__file__).resolve().parents[1] / "docs"
_CLI_HEAD = """\
# Command line

Written by `make docs` from the program's own `--help`; `make test` checks that it is up to date.
"""
_SETTINGS_HEAD = """\
# All settings

What `replay config` prints: a file with all defaults, each with what it is for. [Settings](configuration.md) says how
to give such a file to a run. Written by `make docs`; `make test` checks that it is up to date.
"""


def pages() -> Mapping[str, str]:
    """Return the text of each page, by the name of its file."""
    return {"cli.md": _cli(), "settings.md": f"{_SETTINGS_HEAD}\n```toml\n{_said('config')}\n```\n"}


def _cli() -> str:
    parts = [_section(command) for command in ((), *((name,) for name in COMMANDS))]
    return "\n".join([_CLI_HEAD, *parts])


def _section(command: tuple[str, ...]) -> str:
    return f"## {' '.join(('replay', *command))}\n\n```text\n{_said(*command, '--help')}\n```\n"


def _said(*arguments: str) -> str:
    """Return what the program prints, as on any terminal of that width."""
    environment = {**os.environ, "COLUMNS": "110", "NO_COLOR": "1", "PYTHON_COLORS": "0"}
    command = [sys.executable, "-m", "replay", *arguments]
    run = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    return run.stdout.rstrip()


def main() -> int:
    """Write or check the pages."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true")
    is_check = parser.parse_args().check
    stale = []
    for name, text in pages().items():
        path = DOCS / name
        if not is_check:
            path.write_text(text, encoding="utf-8")
        elif not path.exists() or path.read_text(encoding="utf-8") != text:
            stale.append(name)
    if stale:
        print(f"{', '.join(stale)}: not what the program says; run: make docs", file=sys.stderr)
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())
