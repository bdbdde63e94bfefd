"""Pictures like the paper's figures 14 to 17, 20 and 21."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from benchmarks.paper_cases import Case, Outcome
from mapmerge.config import MergeConfig
from mapmerge.fuse import fuse
from mapmerge.grid import Grid
from mapmerge.paper.pixels import class_pixels
from mapmerge.render import Rgb, render
from mapmerge.result import MergeResult
from mapmerge.sim2 import IDENTITY
from mapmerge.warp import Layer

_STEPS = ("keypoints", "inliers", "overlay")
_MAX_SIDE_PX = 1000


def write_pictures(folder: Path, cases: list[Case], found: dict[tuple[str, str], Outcome]) -> None:
    """Write for every set and method what it saw and what came of it.

    ``..._keypoints`` is like figures 15 and 16, ``..._overlay`` like figures 14, 17 and 20, ``..._merged`` the maps
    fused at the placement that was found, whether it was accepted or not.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for case in cases:
        for (label, method), outcome in found.items():
            if label != case.label:
                continue
            name = f"{case.target_name}_{case.source_name}_{method}".replace("scenario", "s")
            for evidence in outcome.match.evidence:
                if evidence.step in _STEPS:
                    _write(folder / f"{name}_{evidence.step}.png", render(evidence).rgb)
            pose = outcome.match.target_from_source
            if pose is not None:
                layers = [Layer(case.target, IDENTITY), Layer(case.source, pose)]
                fused = fuse(layers, case.target, MergeConfig().cells)
                _write(folder / f"{name}_merged.png", _map_picture(fused.grid))


def write_global_map(folder: Path, result: MergeResult) -> None:
    """Write the map of all robots, as in figure 21."""
    if result.merged is not None:
        _write(folder / "s2_global_map_paper.png", _map_picture(result.merged))


def _map_picture(grid: Grid) -> Rgb:
    known = grid.cropped_to_known()
    grey = class_pixels(known, MergeConfig().cells)[::-1]
    zoom = min(4.0, _MAX_SIDE_PX / max(grey.shape))
    size = (max(1, int(grey.shape[1] * zoom)), max(1, int(grey.shape[0] * zoom)))
    shown = cv2.resize(grey, size, interpolation=cv2.INTER_AREA if zoom < 1 else cv2.INTER_NEAREST)
    return np.repeat(np.asarray(shown, np.uint8)[:, :, None], 3, axis=2)


def _write(path: Path, rgb: Rgb) -> None:
    ok, data = cv2.imencode(".png", np.ascontiguousarray(rgb[:, :, ::-1]))
    if not ok:
        raise OSError(f"{path}: the picture cannot be encoded")
    path.write_bytes(data.tobytes())
