"""Write the reports that the documents show, from recordings that are not part of the repository, and a picture of one.

    python scripts/reports.py [DATA]

DATA is the folder that holds ``real/``; `$REPLAY_DATA` if nothing is said.
"""

from __future__ import annotations

import argparse
import io
import os
import sys
import tempfile
from pathlib import Path

from PIL import Image

if not __package__:  # run as a script: only this folder is on the path
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from replay.cli import main as replay
from scripts.browser import browser, missing, picture, show

ROOT = Path(__file__).resolve().parent.parent
RECORDINGS = ("intel_three.bag", "odd_one_out.mcap")
REPORTS = ROOT / "docs" / "reports"
PICTURE = ROOT / "docs" / "images" / "report.png"
_SHOWN = "odd_one_out"
_WINDOW_PX = (1280, 900)
_DOWN_TO_PX = 1740
_WIDTH_PX = 960


def main() -> int:
    """Write them; the first that fails ends it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("data", type=Path, nargs="?", metavar="DATA", default=os.environ.get("REPLAY_DATA"))
    data = parser.parse_args().data
    if data is None:
        parser.error("say where the recordings are: set REPLAY_DATA to the folder that holds real/")
    if (why := missing()) is not None:
        parser.error(why)
    REPORTS.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        for name in RECORDINGS:
            page = REPORTS / f"{Path(name).stem}.html"
            outputs = ["-o", f"{scratch}/out.mcap", "--report", str(page), "--no-rrd", "--force"]
            status = replay(["merge", str(Path(data) / "real" / name), *outputs])
            if status:
                return status
    _take_picture(REPORTS / f"{_SHOWN}.html")
    return 0


def _take_picture(page: Path) -> None:
    with browser() as driver:
        show(driver, page, *_WINDOW_PX)
        taken = Image.open(io.BytesIO(picture(driver, _DOWN_TO_PX))).convert("RGB")
        size = _WIDTH_PX, round(_DOWN_TO_PX * _WIDTH_PX / _WINDOW_PX[0])
        taken.resize(size, Image.Resampling.LANCZOS).save(PICTURE, optimize=True)


if __name__ == "__main__":
    sys.exit(main())
