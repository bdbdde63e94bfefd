"""What a matcher saw, kept as data: curves, surfaces, overlays, marked images. `mapmerge.render` makes pictures of it.

A matcher describes each of its steps with one of these kinds, so that a new matcher needs no new drawing code.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmerge.prepared import PreparedMap
from mapmerge.sim2 import Points, Sim2


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """One line of a plot: a value for each of evenly spaced abscissae."""

    label: str
    values: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class CurvesEvidence:
    """Curves over one axis, with the abscissae that were chosen.

    Parameters
    ----------
    step
        Name of the matcher's step, fit for a topic name.
    title
        What is shown, in words.
    axis
        Name and unit of the abscissa.
    start, stop
        Abscissa of the first value, and one step beyond the last.
    """

    step: str
    title: str
    axis: str
    start: float
    stop: float
    curves: tuple[Curve, ...]
    marks: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceEvidence:
    """A score for each shift in x and y.

    Parameters
    ----------
    values
        Shape (rows, columns); row 0 has the lowest y.
    marks
        Row and column of the peaks that were followed, best first.
    chosen
        Row and column of the shift that was chosen, where it lies on this surface.
    turn_rad
        By how much the source's map frame is turned in the target's at this surface; None where that is not said.
    """

    step: str
    title: str
    values: NDArray[np.float32]
    marks: tuple[tuple[int, int], ...]
    chosen: tuple[int, int] | None
    turn_rad: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class OverlayEvidence:
    """Two maps laid on each other at a placement, in the target's grid frame."""

    step: str
    title: str
    target: PreparedMap
    source: PreparedMap
    target_from_source: Sim2
    tolerance_m: float


@dataclass(frozen=True, slots=True, eq=False)
class MarkedImage:
    """A picture with marked places.

    Parameters
    ----------
    label
        Whose picture it is.
    pixels
        Shape (rows, columns), uint8, grey; row 0 has the lowest y.
    marks
        Shape (N, 2): column and row of marked places, whole numbers at the centres of pixels.
    """

    label: str
    pixels: NDArray[np.uint8]
    marks: Points


@dataclass(frozen=True, slots=True, eq=False)
class ImagesEvidence:
    """Pictures of the target and the source side by side, with marks, and lines between marks that were paired.

    Parameters
    ----------
    pairs
        Shape (N, 2): a mark of the first picture and one of the second.
    """

    step: str
    title: str
    target: MarkedImage
    source: MarkedImage
    pairs: NDArray[np.intp]


Evidence = CurvesEvidence | SurfaceEvidence | OverlayEvidence | ImagesEvidence
