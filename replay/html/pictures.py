"""Maps as pictures within the page: few colours each, as PNG in a data URI."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmerge.config import CellConfig
from mapmerge.drawing import AGREE
from mapmerge.grid import MAX_PERCENT, Mask
from mapmerge.raster import Comparison, Pixels, compared_on, pixels_around, seen, values_on
from mapmerge.warp import Layer
from replay.palette import Rgb, as_hex

Indices = NDArray[np.uint8]

# What contradicts is as red as in the pictures of the method.
CONTRADICT: Rgb = (220, 30, 40)
_NOTHING: Rgb = (255, 255, 255)
_KNOWN_BY_ONE: Rgb = (238, 240, 243)
_SHARED: Rgb = (255, 255, 255)
_TINT: Rgb = (196, 236, 208)

_GREYS = 24
_COMPRESSION = 6  # more takes ten times as long, for files that are a fifth smaller
_THIN_FROM_PX = 420


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture of maps, seen from above with y upwards.

    Parameters
    ----------
    uri
        Its bytes, as a data URI.
    pixels
        What it shows.
    """

    uri: str
    pixels: Pixels

    @property
    def width_m(self) -> float:
        """What it shows along x."""
        return self.pixels.width_m

    @property
    def height_m(self) -> float:
        """What it shows along y."""
        return self.pixels.height_m

    @property
    def top_m(self) -> float:
        """Its upper edge."""
        return self.pixels.y_m + self.pixels.height_m

    @property
    def bar_m(self) -> float:
        """A round length that is about a fifth of it."""
        return round_length_m(self.width_m / 5.0)


TINT_LEGEND = (
    (as_hex(AGREE), "walls that agree"),
    (as_hex(CONTRADICT), "wall in another's free space"),
    (as_hex(_TINT), "free space that agrees"),
)
"""What the colours of `tint_picture` mean."""


def round_length_m(most_m: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is no longer."""
    power = 10.0 ** math.floor(math.log10(most_m))
    return next(power * step for step in (5.0, 2.0, 1.0) if power * step <= most_m * (1 + 1e-9))


def grey_picture(values: Indices, pixels: Pixels) -> Picture:
    """Return a map in shades of grey; what is unknown is transparent."""
    steps = np.arange(256)
    table = np.where(steps <= MAX_PERCENT, 1 + steps * (_GREYS - 1) // MAX_PERCENT, 0).astype(np.uint8)
    return Picture(_uri(table[values], [_NOTHING, *(_grey(step) for step in range(_GREYS))]), pixels)


def mask_picture(masks: Sequence[tuple[Mask, Rgb]], pixels: Pixels) -> Picture:
    """Return where something is, each in its colour, the last on top; elsewhere it is transparent."""
    indices = np.zeros((pixels.rows, pixels.cols), np.uint8)
    for number, (mask, _) in enumerate(masks, start=1):
        indices[mask] = number
    return Picture(_uri(indices, [_NOTHING, *(colour for _, colour in masks)]), pixels)


def tint_picture(found: Comparison, walls: Mask, pixels: Pixels) -> Picture:
    """Return a tint where maps agree, which walls do, and what contradicts."""
    agreeing, contradicting = visible(walls & found.agree), visible(found.contradict)
    return mask_picture([(found.agree, _TINT), (agreeing, AGREE), (contradicting, CONTRADICT)], pixels)


def single_picture(layer: Layer, colour: Rgb, cells: CellConfig, max_side_px: int) -> Picture | None:
    """Return one map with its walls in a colour; None if it knows nothing."""
    pixels = pixels_around([layer], max_side_px)
    if pixels is None:
        return None
    shown = seen(values_on(layer, pixels, cells), cells)
    indices = np.zeros((pixels.rows, pixels.cols), np.uint8)
    indices[shown.known] = 1
    indices[shown.free] = 2
    indices[visible(shown.walls)] = 3
    return Picture(_uri(indices, [_NOTHING, _KNOWN_BY_ONE, _SHARED, colour]), pixels)


def overlay_picture(
    target: Layer, source: Layer, colours: tuple[Rgb, Rgb], cells: CellConfig, tolerance_m: float, max_side_px: int
) -> Picture | None:
    """Return two maps laid on each other; None if they know nothing.

    Parameters
    ----------
    target, source
        The maps.
    colours
        Of the walls that are those of one of them alone.
    cells
        When a cell counts as occupied or free.
    tolerance_m
        How far walls that agree may be apart.
    max_side_px
        The most pixels a side.
    """
    pixels = pixels_around([target, source], max_side_px)
    if pixels is None:
        return None
    ours, theirs = (seen(values_on(layer, pixels, cells), cells) for layer in (target, source))
    found = compared_on([target, source], pixels, cells, tolerance_m)
    indices = np.zeros((pixels.rows, pixels.cols), np.uint8)
    indices[ours.known | theirs.known] = 1
    indices[ours.known & theirs.known] = 2
    masks = ours.walls, theirs.walls, (ours.walls | theirs.walls) & found.agree, found.contradict
    for number, mask in enumerate(masks, start=3):
        indices[visible(mask)] = number
    return Picture(_uri(indices, [_NOTHING, _KNOWN_BY_ONE, _SHARED, *colours, AGREE, CONTRADICT]), pixels)


def visible(mask: Mask) -> Mask:
    """Return walls as wide as two pixels where a picture is so large that it is shown smaller."""
    if max(mask.shape) < _THIN_FROM_PX:
        return mask
    wide = mask.copy()
    wide[1:] |= mask[:-1]
    wide[:, 1:] |= wide[:, :-1].copy()
    return wide


def _grey(step: int) -> Rgb:
    value = round(255 - step / (_GREYS - 1) * 235)
    return value, value, value


def _uri(indices: Indices, colours: Sequence[Rgb]) -> str:
    """Return a picture of few colours; the first one, where nothing is known, is transparent."""
    from PIL import Image

    # Row 0 has the lowest y in a map, and is the top one in a picture.
    image = Image.fromarray(np.ascontiguousarray(indices[::-1]), mode="P")
    image.putpalette(bytes(part for colour in colours for part in colour))
    stream = io.BytesIO()
    image.save(stream, "PNG", compress_level=_COMPRESSION, transparency=0)
    return f"data:image/png;base64,{base64.b64encode(stream.getvalue()).decode('ascii')}"
