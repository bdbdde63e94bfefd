"""Take the pictures of the documentation anew.

    REPLAY_DATA=FOLDER python scripts/pictures.py

Each shows what the Rerun viewer shows of a run: of samples/three_robots.bag, which README has, and of two real
recordings at their start, middle and end. These are not part of the repository: REPLAY_DATA is the folder that holds
real/, and without it only the first is taken. See scripts/screenshot.py for what is needed to draw.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

if not __package__:  # run as a script: only this folder is on the path
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from replay.cli import main as replay
from scripts.screenshot import taken

ROOT = Path(__file__).resolve().parent.parent
IMAGES = ROOT / "docs" / "images"
SIZE = "1400x897"


@dataclass(frozen=True, slots=True)
class Shot:
    """Pictures of one run.

    Parameters
    ----------
    recording
        From the root of the repository, or from REPLAY_DATA.
    picture
        Name of the pictures; {} stands for the tab and the time, in percent.
    tabs, times
        Which tabs are shown, at which times; None for what the recording opens on.
    """

    recording: str
    picture: str
    tabs: tuple[str | None, ...] = (None,)
    times: tuple[float | None, ...] = (None,)
    is_real: bool = True


SHOTS = (
    Shot("samples/three_robots.bag", "three_robots.png", is_real=False),
    Shot("samples/three_robots.bag", "three_robots_{}.png", ("Method", "Over time", "Decisions"), is_real=False),
    Shot("real/intel_three.bag", "intel_three_{}.png", times=(0.0, 0.5, 1.0)),
    Shot("real/odd_one_out.mcap", "odd_one_out_{}.png", times=(0.0, 0.5, 1.0)),
)


def main() -> int:
    """Take all pictures that can be taken; 1 if a view complains."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    data = os.environ.get("REPLAY_DATA")
    found: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        for shot in SHOTS:
            if shot.is_real and data is None:
                print(f"{shot.recording}: left out; set REPLAY_DATA to the folder that holds it", file=sys.stderr)
                continue
            path = (Path(data) if shot.is_real and data else ROOT) / shot.recording
            run = Path(folder) / "run.mcap"
            status = replay(["merge", str(path), "-o", str(run), "--force"])
            if status != 0:
                return status
            found += taken(run.with_suffix(".rrd"), IMAGES / shot.picture, shot.times, shot.tabs, SIZE)
    for complaint in found:
        print(complaint, file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
