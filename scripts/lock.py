"""Write requirements/*.txt anew: every package that is installed, its one version, and the hashes of its wheels.

    make lock              keep the versions that still fit pyproject.toml
    make lock UPGRADE=1    take the newest ones

One file serves Python 3.11 and later on Linux, macOS and Windows; what is needed on some of them alone has a marker.
Where packages come from is said by whoever installs, never here.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
_OPTIONS = (
    *("--universal", "--python-version", "3.11", "--fork-strategy", "fewest", "--generate-hashes"),
    # Wheels alone: what is installed runs nothing on the way, and is what the hash names.
    *("--only-binary", ":all:", "--emit-build-options"),
    *("--no-emit-index-url", "--no-emit-find-links", "--no-header", "--no-annotate", "--quiet"),
)


@dataclass(frozen=True, slots=True)
class Lock:
    """A file of pinned packages: its name, what it is for, and what uv is to resolve."""

    name: str
    purpose: str
    asked: tuple[str, ...]


LOCKS = (
    Lock("run.txt", "to run and to build", ("pyproject.toml", "--group", "build")),
    # As in run.txt, so that what is tested is what is run.
    Lock(
        "dev.txt",
        "to run, build and test",
        ("pyproject.toml", "--extra", "dev", "--group", "build", "--constraints", "requirements/run.txt"),
    ),
    # The pages of the API are made from the code as it is run.
    Lock(
        "docs.txt",
        "to make the site",
        ("pyproject.toml", "--extra", "docs", "--group", "build", "--constraints", "requirements/run.txt"),
    ),
    Lock("tools.txt", "to write and audit these files", ("--group", "tools")),
)


def main() -> int:
    """Write all locks; the first that cannot be written ends it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--upgrade", action="store_true", help="take the newest versions that pyproject.toml allows")
    upgrade = ["--upgrade"] if parser.parse_args().upgrade else []
    (ROOT / "requirements").mkdir(exist_ok=True)
    for lock in LOCKS:
        path = ROOT / "requirements" / lock.name
        output = ["--output-file", str(path.relative_to(ROOT))]
        command = [sys.executable, "-m", "uv", "pip", "compile", *lock.asked, *_OPTIONS, *output, *upgrade]
        subprocess.run(command, cwd=ROOT, check=True)
        _finish(path, lock.purpose)
    return 0


def _finish(path: Path, purpose: str) -> None:
    """Say at the top what the file is, and refuse one that names a place on the network."""
    text = path.read_text(encoding="utf-8")
    if "://" in text:
        path.unlink()
        raise SystemExit(f"{path.name}: it names a place on the network; expected names, versions and hashes alone")
    head = f"# What is needed {purpose}. Written by `make lock`; not to be edited.\n"
    path.write_text(head + text.lstrip("\n"), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    sys.exit(main())
