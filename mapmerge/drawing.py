"""What all pictures have in common: colours, text, titles."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Rgb = NDArray[np.uint8]
Colour = tuple[int, int, int]

MAX_SIDE_PX = 1024
BANNER_PX = 36

PAPER: Colour = (255, 255, 255)
INK: Colour = (60, 60, 60)
MARK: Colour = (214, 39, 40)
AGREE: Colour = (20, 150, 60)

_FONT = cv2.FONT_HERSHEY_SIMPLEX


def titled(image: Rgb, title: str) -> Rgb:
    """Return the picture below a strip with its title, which is as large as fits."""
    size = min(0.6, image.shape[1] / (len(title) * 16))
    strip = np.full((max(1, round(BANNER_PX * size / 0.6)), image.shape[1], 3), 255, np.uint8)
    text(strip, title, (8, int(24 * size / 0.6)), size)
    return np.vstack([strip, image])


def text(image: Rgb, words: str, at: tuple[int, int], size: float, colour: Colour = INK) -> None:
    """Write into a picture, from this point of the base line on."""
    cv2.putText(image, words, at, _FONT, size, colour, 1, cv2.LINE_AA)
