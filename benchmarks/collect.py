"""Matches pairs with known truth and notes what was seen: ``python -m benchmarks.collect OUT.jsonl``."""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.observations import collect, jobs


def main() -> None:
    """Collect observations."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("out", type=Path)
    parser.add_argument("--missions", type=int, default=60, help="missions of each kind of building")
    parser.add_argument("--cuts", type=int, default=2000, help="cut pairs of recorded maps, and as many strangers")
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    collect(jobs(options.missions, options.cuts), options.out, options.processes)


if __name__ == "__main__":
    main()
