"""Maps as pictures for people, in the colours of RViz: free white, occupied black, unknown greenish grey."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mapmerge.grid import MAX_PERCENT, Grid
from replay.export.image import png

_UNKNOWN_BGR = (134, 137, 112)


def files(grid: Grid, stem: Path, _mode: str) -> Mapping[Path, bytes]:
    """Return a picture of a map, a pixel for each cell, y upwards."""
    cells = grid.cells[::-1]
    shade = 255 - (255 * np.maximum(cells, 0).astype(np.int32)) // MAX_PERCENT
    pixels = np.repeat(shade.astype(np.uint8)[..., None], 3, axis=2)
    pixels[cells < 0] = _UNKNOWN_BGR
    return {stem.with_name(f"{stem.name}.png"): png(pixels)}
