"""Where recordings with known truth are."""

from __future__ import annotations

import os
from pathlib import Path

VARIABLE = "REPLAY_DATA"


def data_folder() -> Path | None:
    """Return the folder of ``real/``: ``$REPLAY_DATA``, or ``../shared/data`` from the checkout; None if absent."""
    folder = Path(os.environ.get(VARIABLE, Path(__file__).resolve().parents[2] / "shared" / "data"))
    return folder if (folder / "real").is_dir() else None
