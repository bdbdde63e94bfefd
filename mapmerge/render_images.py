"""Pictures of two images side by side, with marks and the lines between marks that were paired."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from mapmerge.drawing import (
    AGREE,
    BANNER_PX,
    INK,
    LABEL_PX,
    MARK,
    MAX_SIDE_PX,
    Colour,
    Label,
    Named,
    Rgb,
    text,
    titled,
)
from mapmerge.evidence import ImagesEvidence, MarkedImage
from mapmerge.sim2 import Points

_GAP_PX = 8
_LABEL_PX = 34
_MAX_ZOOM = 8.0
_MANY_MARKS = 150
_BEHIND: Colour = (232, 232, 232)


@dataclass(frozen=True, slots=True)
class _Panel:
    """Where one image lies in the picture: pixels of its upper left corner, and its magnification."""

    left: int
    top: int
    width: int
    height: int
    zoom: float

    def place(self, marks: Points, rows: int) -> Points:
        """Return where marks of the image lie in the picture; the image's rows go upwards."""
        x = (marks[:, 0] + 0.5) * self.zoom + self.left
        y = (rows - marks[:, 1] - 0.5) * self.zoom + self.top
        return np.stack([x, y], axis=1)


def side_by_side(evidence: ImagesEvidence, named: Named) -> Rgb:
    """Return both images, seen with y upwards, beside or above each other, whichever shows them larger."""
    images = evidence.target, evidence.source
    panels = max((_laid_out(images, beside=True), _laid_out(images, beside=False)), key=_smaller_zoom)
    width = max(panel.left + panel.width for panel in panels)
    height = max(panel.top + panel.height for panel in panels)
    picture = np.full((height, width, 3), _BEHIND, np.uint8)
    for image, panel in zip(images, panels, strict=True):
        _paste(picture, image, panel, named)
    ones, others = (
        panel.place(image.marks, image.pixels.shape[0]) for image, panel in zip(images, panels, strict=True)
    )
    for one, other in evidence.pairs:
        cv2.line(picture, _whole(ones[one]), _whole(others[other]), AGREE, 1, cv2.LINE_AA)
    for places in (ones, others):
        for place in places:
            _mark(picture, _whole(place), len(places))
    return titled(picture, evidence.title)


def _smaller_zoom(panels: tuple[_Panel, _Panel]) -> float:
    return min(panel.zoom for panel in panels)


def _laid_out(images: tuple[MarkedImage, MarkedImage], *, beside: bool) -> tuple[_Panel, _Panel]:
    """Return where the images go, each as large as its half of the picture allows."""
    across, down = (2, 1) if beside else (1, 2)
    box = (
        (MAX_SIDE_PX - _GAP_PX * (across - 1)) // across,
        (MAX_SIDE_PX - BANNER_PX - _GAP_PX * (down - 1)) // down - _LABEL_PX,
    )
    sizes = [(max(1, image.pixels.shape[1]), max(1, image.pixels.shape[0])) for image in images]
    zooms = [min(box[0] / width, box[1] / height, _MAX_ZOOM) for width, height in sizes]
    shown = [
        (max(1, int(width * zoom)), max(1, int(height * zoom)))
        for (width, height), zoom in zip(sizes, zooms, strict=True)
    ]
    first = _Panel(0, _LABEL_PX, *shown[0], zooms[0])
    if beside:
        return first, _Panel(shown[0][0] + _GAP_PX, _LABEL_PX, *shown[1], zooms[1])
    return first, _Panel(0, 2 * _LABEL_PX + shown[0][1] + _GAP_PX, *shown[1], zooms[1])


def _paste(picture: Rgb, image: MarkedImage, panel: _Panel, named: Named) -> None:
    label = named.label(image.label) or Label(image.label, INK)
    text(picture, label.words, (panel.left + 6, panel.top - 9), LABEL_PX, label.colour, weight=600)
    if image.pixels.size == 0:
        return
    interpolation = cv2.INTER_AREA if panel.zoom < 1 else cv2.INTER_NEAREST
    grey = cv2.resize(image.pixels[::-1], (panel.width, panel.height), interpolation=interpolation)
    area = picture[panel.top : panel.top + panel.height, panel.left : panel.left + panel.width]
    area[:] = np.asarray(grey, np.uint8)[:, :, None]


def _mark(picture: Rgb, at: tuple[int, int], marks: int) -> None:
    """Mark a place: the fewer marks there are, the larger each is."""
    if marks > _MANY_MARKS:
        cv2.circle(picture, at, 1, MARK, -1)
    else:
        cv2.circle(picture, at, 3 if marks > 1 else 8, MARK, 1 if marks > 1 else 2, cv2.LINE_AA)


def _whole(place: Points) -> tuple[int, int]:
    return int(place[0]), int(place[1])
