"""Matches pairs with known truth and notes what was seen: ``python -m benchmarks.collect OUT.jsonl``."""

from __future__ import annotations

import argparse

from benchmarks.data import VARIABLE, data_folder
from benchmarks.flags import count, count_or_none, new_file
from benchmarks.observations import SEEDS_OF_MISSIONS, collect, jobs


def main() -> None:
    """Collect observations."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("out", type=new_file, metavar="OUT.jsonl")
    parser.add_argument("--missions", type=count_or_none, default=60, help="missions of each kind of building")
    parser.add_argument(
        "--cuts", type=count_or_none, default=2000, help="cut pairs of recorded maps, and as many strangers"
    )
    parser.add_argument("--processes", type=count, default=2, help="how many work at once")
    options = parser.parse_args()
    if options.missions > SEEDS_OF_MISSIONS:
        parser.error(f"--missions {options.missions}: seeds from {SEEDS_OF_MISSIONS} on are those of look-alike floors")
    if options.cuts and data_folder() is None:
        parser.error(
            f"--cuts {options.cuts}: there are no recordings; set {VARIABLE} to the folder of real/, or give --cuts 0"
        )
    collect(jobs(options.missions, options.cuts), options.out, options.processes)


if __name__ == "__main__":
    main()
