"""Pictures of evidence. Nothing here decides anything."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.drawing import (
    AGREE,
    BANNER_PX,
    INK,
    LABEL_PX,
    MARK,
    MAX_SIDE_PX,
    PAPER,
    Colour,
    Label,
    Named,
    Rgb,
    text,
    titled,
    width_px,
)
from mapmerge.evidence import CurvesEvidence, Evidence, ImagesEvidence, OverlayEvidence, SurfaceEvidence
from mapmerge.prepared import CELL_FREE, CELL_UNKNOWN, MEETS_WALL, PreparedMap
from mapmerge.render_images import side_by_side
from mapmerge.rounding import fixed
from mapmerge.sim2 import Points, Sim2, wrap_angle

__all__ = ["MAX_SIDE_PX", "Label", "Named", "Picture", "Rgb", "render"]

_FAINT: Colour = (222, 222, 222)
_SERIES: tuple[Colour, ...] = ((148, 103, 189), (140, 86, 75), (44, 160, 44), (23, 160, 180))
_UNKNOWN: Colour = (205, 205, 205)
_FREE_ONE: Colour = (238, 238, 238)
_FREE_BOTH: Colour = (255, 255, 255)
_DISAGREE: Colour = (220, 30, 40)


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """A picture of one step of a method.

    Parameters
    ----------
    step
        Name of the step, fit for a topic name.
    title
        What is shown, in words.
    rgb
        Shape (rows, columns, 3), uint8, row 0 at the top; its longest side is at most `MAX_SIDE_PX`.
    """

    step: str
    title: str
    rgb: Rgb


def render(evidence: Evidence, named: Named | None = None) -> Picture:
    """Return a picture of what a matcher saw in one step.

    Parameters
    ----------
    evidence
        What it saw.
    named
        What the maps are called; ``target`` and ``source`` by default.
    """
    named = named or Named()
    match evidence:
        case CurvesEvidence():
            rgb = _curves(evidence, named)
        case SurfaceEvidence():
            rgb = _surface(evidence, _turned(evidence, named))
        case OverlayEvidence():
            rgb = _overlay(evidence, named)
        case ImagesEvidence():
            rgb = side_by_side(evidence, named)
    title = _turned(evidence, named) if isinstance(evidence, SurfaceEvidence) else evidence.title
    return Picture(evidence.step, title, rgb)


def _curves(evidence: CurvesEvidence, named: Named) -> Rgb:
    """One panel for each curve, over a common axis."""
    width, panel, left, right = 960, 200, 24, 936
    height = panel * len(evidence.curves) + 76
    image = np.full((height, width, 3), 255, np.uint8)
    span = evidence.stop - evidence.start

    def x_px(abscissa: float) -> int:
        return left + round((abscissa - evidence.start) / span * (right - left))

    for index, curve in enumerate(evidence.curves):
        low, high = panel * (index + 1) - 12, panel * index + 40
        for mark in evidence.marks:
            cv2.line(image, (x_px(mark), high), (x_px(mark), low), _FAINT if index < 2 else MARK, 2)
        cv2.line(image, (left, low), (right, low), INK, 1)
        label = named.label(curve.label) or Label(curve.label, _SERIES[index % len(_SERIES)])
        _polyline(image, curve.values, (left, right), (low, high), label.colour)
        at = right - width_px(label.words, LABEL_PX) - 6, high - 12
        text(image, label.words, at, LABEL_PX, label.colour)
    for tick in np.linspace(evidence.start, evidence.stop, 7):
        words = f"{tick:g}"
        at_px = min(max(2, x_px(float(tick)) - width_px(words, LABEL_PX) // 2), width - width_px(words, LABEL_PX) - 2)
        text(image, words, (at_px, height - 42), LABEL_PX)
    text(image, evidence.axis, ((width - width_px(evidence.axis, LABEL_PX)) // 2, height - 10), LABEL_PX)
    labels = [Label("followed", MARK)] if evidence.marks else []
    return _fitted(titled(image, evidence.title, labels))


def _fitted(image: Rgb) -> Rgb:
    """Return a picture that is no larger than it may be."""
    zoom = MAX_SIDE_PX / max(image.shape[:2])
    if zoom >= 1.0:
        return image
    size = max(1, int(image.shape[1] * zoom)), max(1, int(image.shape[0] * zoom))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def _polyline(
    image: Rgb, values: NDArray[np.float64], x_px: tuple[int, int], y_px: tuple[int, int], colour: Colour
) -> None:
    low, high = float(values.min()), float(values.max())
    scaled = (values - low) / (high - low) if high > low else np.zeros_like(values)
    x = x_px[0] + np.arange(len(values)) / len(values) * (x_px[1] - x_px[0])
    y = y_px[0] + scaled * (y_px[1] - y_px[0])
    points = np.rint(np.stack([x, y], axis=1)).astype(np.int32).reshape(-1, 1, 2)
    cv2.polylines(image, [points], isClosed=False, color=colour, thickness=2, lineType=cv2.LINE_AA)


def _turned(evidence: SurfaceEvidence, named: Named) -> str:
    """Return the title of a surface, with the turn of the source as placements say it."""
    if evidence.turn_rad is None:
        return evidence.title
    degrees = fixed(math.degrees(wrap_angle(evidence.turn_rad)), 1)
    return f"{evidence.title}, {named.source.words} turned by {degrees}° on {named.target.words}"


def _surface(evidence: SurfaceEvidence, title: str) -> Rgb:
    """Brighter is better; followed peaks are circled, the chosen one is filled."""
    values = evidence.values
    low, high = float(np.percentile(values, 5)), float(values.max())
    scaled = np.clip((values - low) / (high - low) * 255 if high > low else values * 0, 0, 255)
    zoom = (MAX_SIDE_PX - BANNER_PX) / max(values.shape)
    size = (max(1, int(values.shape[1] * zoom)), max(1, int(values.shape[0] * zoom)))
    interpolation = cv2.INTER_AREA if zoom < 1 else cv2.INTER_LINEAR
    grey = cv2.resize(scaled.astype(np.uint8)[::-1], size, interpolation=interpolation)
    image: Rgb = np.ascontiguousarray(cv2.applyColorMap(grey, cv2.COLORMAP_VIRIDIS)[:, :, ::-1], np.uint8)
    for row, col in evidence.marks:
        _circle(image, _pixel(row, col, values.shape, zoom), 14, PAPER, 2)
    labels = [Label("other candidates", PAPER)] if evidence.marks else []
    if evidence.chosen is not None:
        _circle(image, _pixel(*evidence.chosen, values.shape, zoom), 20, MARK, 4)
        labels.append(Label("chosen", MARK))
    return titled(image, title, labels)


def _circle(image: Rgb, at: tuple[int, int], radius_px: int, colour: Colour, thickness_px: int) -> None:
    """Draw a circle, if any of it may be seen: OpenCV takes no numbers of more than 32 bits."""
    rows, cols = image.shape[:2]
    reach_px = radius_px + thickness_px
    if -reach_px <= at[0] < cols + reach_px and -reach_px <= at[1] < rows + reach_px:
        cv2.circle(image, at, radius_px, colour, thickness_px, cv2.LINE_AA)


def _pixel(row: int, col: int, shape: tuple[int, ...], zoom: float) -> tuple[int, int]:
    return int((col + 0.5) * zoom), int((shape[0] - row - 0.5) * zoom)


def _overlay(evidence: OverlayEvidence, named: Named) -> Rgb:
    """Both maps in the target's grid frame, seen from above with y upwards."""
    target, source, pose = evidence.target, evidence.source, evidence.target_from_source
    corners = np.concatenate([_corners(target), pose.apply(_corners(source))])
    low, high = corners.min(axis=0) - 0.5, corners.max(axis=0) + 0.5
    pixel_m = max(target.resolution_m / 2, float((high - low).max()) / (MAX_SIDE_PX - BANNER_PX))
    cols, rows = (max(1, int(side / pixel_m)) for side in high - low)

    image = _ground(evidence, low, pixel_m, rows, cols)
    back = pose.inverse()
    agree, disagree = [], []
    walls_m = pose.apply(source.wall_cells_m)
    for here, walls, there, at in (
        (target, walls_m, named.source.colour, walls_m),
        (source, back.apply(target.wall_cells_m), named.target.colour, target.wall_cells_m),
    ):
        index = here.flat_index(walls)
        matched = (here.meets.ravel()[index] & MEETS_WALL) > 0
        violated = ~matched & (here.classes.ravel()[index] == CELL_FREE)
        _dots(image, at[~matched & ~violated], low, pixel_m, there)
        agree.append(at[matched])
        disagree.append(at[violated])
    _dots(image, np.concatenate(agree), low, pixel_m, AGREE)
    _dots(image, np.concatenate(disagree), low, pixel_m, _DISAGREE)
    labels = named.target, named.source, Label("agree", AGREE), Label("contradict", _DISAGREE)
    return titled(image, evidence.title, labels)


def _corners(prepared: PreparedMap) -> Points:
    width_m, height_m = prepared.extent_m
    return np.array([[0.0, 0.0], [width_m, 0.0], [0.0, height_m], [width_m, height_m]])


def _ground(evidence: OverlayEvidence, low: Points, pixel_m: float, rows: int, cols: int) -> Rgb:
    """Paint what is unknown, known by one map, free in both, in shades of grey."""
    target_from_pixel = Sim2(float(low[0]), float(low[1]), scale=pixel_m)
    here = _classes_at(evidence.target, target_from_pixel, rows, cols)
    there = _classes_at(evidence.source, evidence.target_from_source.inverse() @ target_from_pixel, rows, cols)
    shade = np.full((rows, cols), _FREE_ONE[0], np.uint8)
    shade[(here == CELL_UNKNOWN) & (there == CELL_UNKNOWN)] = _UNKNOWN[0]
    shade[(here == CELL_FREE) & (there == CELL_FREE)] = _FREE_BOTH[0]
    return np.repeat(shade[::-1, :, None], 3, axis=2)


def _classes_at(prepared: PreparedMap, grid_from_pixel: Sim2, rows: int, cols: int) -> Rgb:
    """Return the class of the cell at each pixel's centre, row 0 at the lowest y."""
    linear = grid_from_pixel.linear / prepared.resolution_m
    first = np.array(grid_from_pixel.apply_point(0.5, 0.5)) / prepared.resolution_m + prepared.margin - 0.5
    matrix = np.hstack([linear, first[:, None]])
    flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    warped = cv2.warpAffine(prepared.classes, matrix, (cols, rows), flags=flags, borderValue=CELL_UNKNOWN)
    return np.asarray(warped, np.uint8)


def _dots(image: Rgb, points_m: Points, low: Points, pixel_m: float, colour: Colour) -> None:
    rows, cols = image.shape[:2]
    pixel = np.floor((points_m - low) / pixel_m).astype(np.intp)
    row, col = rows - 1 - pixel[:, 1], pixel[:, 0]
    for down, right in ((0, 0), (1, 0), (0, 1), (1, 1)):
        image[np.clip(row + down, 0, rows - 1), np.clip(col + right, 0, cols - 1)] = colour
