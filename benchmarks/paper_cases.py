"""The authors' own maps, where they truly lie, and what a method makes of them."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from ruamel.yaml import YAML

from benchmarks.exhaustive import exhaustive
from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from mapmerge.match import Match, load_matcher
from mapmerge.prepare import prepare
from mapmerge.prepared import PreparedMap
from mapmerge.sim2 import Sim2, wrap_angle
from mapmerge.verify import Scores, verify
from replay.sources.map_server.map_image import Thresholds, cells_from_pixels

MAX_ERROR_M = 0.25
MAX_ERROR_DEG = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """Two maps of the paper, and where the source truly lies on the target.

    Parameters
    ----------
    label
        What the paper calls the set.
    truth
        Between the map frames, by exhaustive alignment; None where the maps are not to be placed on each other.
    at_m
        Middle of what the source knows, in its map frame: where errors are measured.
    """

    label: str
    target_name: str
    source_name: str
    target: Grid
    source: Grid
    truth: Sim2 | None
    truth_scores: Scores | None
    at_m: tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a method made of a case."""

    match: Match
    seconds: float
    error_m: float
    error_deg: float

    @property
    def right(self) -> bool:
        """Whether the transform is right, accepted or not."""
        return self.error_m <= MAX_ERROR_M and self.error_deg <= MAX_ERROR_DEG

    @property
    def omega(self) -> float:
        """The acceptance index; 0 without a placement."""
        return self.match.scores.acceptance if self.match.scores else 0.0


SCENARIO_1 = (
    ("set 1", "scenario1_map1", "scenario1_map2"),
    ("set 2", "scenario1_map1", "scenario1_map3"),
    ("set 3, σ 01", "scenario1_map1", "scenario1_map4_sigma01"),
    ("set 3, σ 05", "scenario1_map1", "scenario1_map4_sigma05"),
)
SCENARIO_2 = (
    ("y3, y1", "scenario2_y3", "scenario2_y1"),
    ("y3, y2", "scenario2_y3", "scenario2_y2"),
    ("turned y1", "scenario2_y3_1", "scenario2_y1_1"),
    ("turned y2", "scenario2_y3_1", "scenario2_y2_1"),
)
STRANGERS = ("y1, y2", "scenario2_y1", "scenario2_y2")


def load_map(folder: Path, name: str) -> Grid:
    """Return a map as map_server reads it, but for its opacity.

    The turned maps have a fourth channel, which is opaque throughout. map_server counts it as brightness, which makes
    unknown cells free; the authors' programs will not have looked at it.
    """
    description = YAML(typ="safe").load((folder / f"{name}.yaml").read_text(encoding="utf-8"))
    pixels = np.asarray(cv2.imread(str(folder / description["image"]), cv2.IMREAD_GRAYSCALE), np.uint8)
    thresholds = Thresholds(description["occupied_thresh"], description["free_thresh"], bool(description["negate"]))
    return Grid(cells_from_pixels(pixels, "trinary", thresholds), description["resolution"])


def load_case(folder: Path, label: str, target_name: str, source_name: str) -> Case:
    """Return two of the authors' maps with the truth between them."""
    target, source = load_map(folder, target_name), load_map(folder, source_name)
    ready = _prepared(target, source)
    truth = exhaustive(target, source)
    pose = ready[0].grid.map_from_grid.inverse() @ truth @ ready[1].grid.map_from_grid
    scores = verify(*ready, pose, MergeConfig().verify)
    return Case(label, target_name, source_name, target, source, truth, scores, _middle_m(source))


def run(case: Case, config: MergeConfig) -> Outcome:
    """Return what a method makes of a case."""
    matcher = load_matcher(config.method)
    resolution_m = _working_m(case.target, case.source)
    begin = time.process_time()
    target, source = (matcher.prepare(grid, resolution_m, config) for grid in (case.target, case.source))
    match = matcher.match(target, source, config)
    seconds = time.process_time() - begin
    return Outcome(match, seconds, *errors(match.target_from_source, case.truth, case.at_m))


def errors(found: Sim2 | None, truth: Sim2 | None, at_m: tuple[float, float]) -> tuple[float, float]:
    """Return how far a placement is off, in metres at a point of the source, and in degrees."""
    if found is None or truth is None:
        return math.inf, math.inf
    x_m, y_m = found.apply_point(*at_m)
    true_x_m, true_y_m = truth.apply_point(*at_m)
    turn_rad = wrap_angle(found.yaw_rad - truth.yaw_rad)
    return math.hypot(x_m - true_x_m, y_m - true_y_m), abs(math.degrees(turn_rad))


def _prepared(target: Grid, source: Grid) -> tuple[PreparedMap, PreparedMap]:
    config, resolution_m = MergeConfig(), _working_m(target, source)
    return prepare(target, resolution_m, config), prepare(source, resolution_m, config)


def _working_m(target: Grid, source: Grid) -> float:
    return max(MergeConfig().search.working_cell_m, target.resolution_m, source.resolution_m)


def _middle_m(grid: Grid) -> tuple[float, float]:
    known_m = grid.centres_m(grid.known)
    x_m, y_m = ((known_m.min(axis=0) + known_m.max(axis=0)) / 2).tolist()
    return x_m, y_m
