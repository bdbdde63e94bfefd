"""Where recordings with known truth are, and what is known of them."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

from mapmerge.sim2 import Sim2

VARIABLE = "REPLAY_DATA"


@dataclass(frozen=True, slots=True)
class Truth:
    """What is known of one robot's map.

    Parameters
    ----------
    reference_from_map
        Where its map frame lies in the reference's; None if the map is of another place.
    centre_m
        A point of its map frame amid the overlap, at which positions are compared.
    """

    reference_from_map: Sim2 | None
    centre_m: tuple[float, float]


def data_folder() -> Path | None:
    """Return the folder of ``real/``: ``$REPLAY_DATA``, or ``../shared/data`` from the checkout; None if absent."""
    folder = Path(os.environ.get(VARIABLE, Path(__file__).resolve().parents[2] / "shared" / "data"))
    return folder if (folder / "real").is_dir() else None


def read_truth(path: Path) -> dict[str, Truth]:
    """Read the truth file of a recording."""
    robots = json.loads(path.read_text(encoding="utf-8"))["robots"]
    return {
        name: Truth(
            Sim2(item["x_m"], item["y_m"], item["yaw_rad"]) if item["same_place"] else None,
            tuple(item["overlap_centre_m"] or (0.0, 0.0)),
        )
        for name, item in robots.items()
    }
