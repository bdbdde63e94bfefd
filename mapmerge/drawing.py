"""What all pictures have in common: colours, text, titles, and what colours mean."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Rgb = NDArray[np.uint8]
Colour = tuple[int, int, int]

MAX_SIDE_PX = 1024
BANNER_PX = 112
"""The most that a title takes, with what colours mean below it."""

PAPER: Colour = (255, 255, 255)
INK: Colour = (60, 60, 60)
MARK: Colour = (214, 39, 40)
AGREE: Colour = (20, 150, 60)

TITLE_PX = 28
"""Height of text that can still be read where the picture is shown at half its size."""
LABEL_PX = 24

_LEAST_TEXT_PX = 8
_MIN_WIDTH_PX = 512
_GAP_PX = 8
_LINE = 1.25
_BOLD = 600


@dataclass(frozen=True, slots=True)
class Label:
    """Words in a colour: what the colour means in a picture."""

    words: str
    colour: Colour


TARGET = Label("target", (31, 105, 190))
SOURCE = Label("source", (222, 120, 10))


@dataclass(frozen=True, slots=True)
class Named:
    """What the two maps of a pair are called, and their colours."""

    target: Label = TARGET
    source: Label = SOURCE

    def label(self, words: str) -> Label | None:
        """Return the map that a method calls ``target`` or ``source``, None for what is neither."""
        return {TARGET.words: self.target, SOURCE.words: self.source}.get(words)


def titled(image: Rgb, title: str, labels: Sequence[Label] = ()) -> Rgb:
    """Return the picture below a strip with its title and what its colours mean, as large as fits.

    A picture that is too narrow for text is given margins.
    """
    missing_px = max(0, _MIN_WIDTH_PX - image.shape[1])
    if missing_px:
        sides = (0, 0), (missing_px // 2, missing_px - missing_px // 2), (0, 0)
        image = np.pad(image, sides, constant_values=PAPER[0])
    width_px = image.shape[1] - 2 * _GAP_PX
    for size_px in range(TITLE_PX, _LEAST_TEXT_PX - 1, -1):
        lines, rows = wrapped(title, size_px, width_px), _in_rows(labels, size_px, width_px)
        line_px = round(size_px * _LINE)
        height_px = line_px * (len(lines) + len(rows)) + 2 * _GAP_PX
        if height_px <= BANNER_PX:
            break
    strip = np.full((min(height_px, BANNER_PX), image.shape[1], 3), PAPER, np.uint8)
    base_px = _GAP_PX + size_px
    for line in lines:
        text(strip, line, (_GAP_PX, base_px), size_px, weight=_BOLD)
        base_px += line_px
    for row in rows:
        _write_row(strip, row, base_px, size_px)
        base_px += line_px
    return np.vstack([strip, image])


def text(image: Rgb, words: str, at: tuple[int, int], size_px: int, colour: Colour = INK, *, weight: int = 400) -> None:
    """Write into a picture, from this point of the base line on."""
    cv2.putText(image, words, at, colour, _font(), size_px, weight)


def width_px(words: str, size_px: int, weight: int = 400) -> int:
    """Return how wide text is."""
    _, _, width, _ = cv2.getTextSize((1 << 14, 1 << 10), words, (0, 0), _font(), size_px, weight)
    return int(width)


def wrapped(words: str, size_px: int, limit_px: int) -> list[str]:
    """Return text broken into lines that are no wider than this, unless a word is."""
    lines: list[str] = []
    for word in words.split():
        if lines and width_px(f"{lines[-1]} {word}", size_px, _BOLD) <= limit_px:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines


def _font() -> cv2.FontFace:
    return cv2.FontFace("sans")


def _in_rows(labels: Sequence[Label], size_px: int, limit_px: int) -> list[list[Label]]:
    rows: list[list[Label]] = []
    for label in labels:
        if rows and sum(_entry_px(each, size_px) for each in [*rows[-1], label]) <= limit_px:
            rows[-1].append(label)
        else:
            rows.append([label])
    return rows


def _entry_px(label: Label, size_px: int) -> int:
    return width_px(label.words, size_px) + 2 * size_px


def _write_row(image: Rgb, row: Sequence[Label], base_px: int, size_px: int) -> None:
    left_px, side_px = _GAP_PX, round(size_px * 0.7)
    for label in row:
        corner, opposite = (left_px, base_px - side_px), (left_px + side_px, base_px)
        cv2.rectangle(image, corner, opposite, label.colour, -1)
        cv2.rectangle(image, corner, opposite, INK, 1)
        text(image, label.words, (left_px + size_px, base_px), size_px)
        left_px += _entry_px(label, size_px)
