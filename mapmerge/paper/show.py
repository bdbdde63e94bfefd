"""What the paper's figures 5 to 10 and 14 to 17 show, as evidence."""

from __future__ import annotations

import math

import numpy as np

from mapmerge.evidence import Evidence, ImagesEvidence, MarkedImage
from mapmerge.paper.correction import Correction
from mapmerge.paper.features import Features
from mapmerge.paper.interest import Cells
from mapmerge.paper.pixels import Image
from mapmerge.paper.radon import Radon
from mapmerge.sim2 import Points

_NO_MARKS: Points = np.empty((0, 2))
_NO_PAIRS: Cells = np.empty((0, 2), np.intp)


def correction_evidence(
    target: Correction, source: Correction, target_features: Features, source_features: Features
) -> tuple[Evidence, ...]:
    """Return the pictures of both maps after each step of the image correction, and their features."""
    turns = " and ".join(f"{math.degrees(each.radon.turn_rad):.1f}°" for each in (target, source))
    marks = " and ".join(str(len(each.marks)) for each in (target, source))
    return (
        _both("binarised", "Binarised: occupied cells", target.binary, source.binary),
        _radon(target.radon, source.radon),
        _both(
            "rotated",
            f"Turned by {turns}, so that the longest wall is parallel to an axis",
            target.turned.interpolated,
            source.turned.interpolated,
        ),
        _both("closed", "Binarised again and closed", target.closed, source.closed),
        _both(
            "interest_points",
            f"Interest points of Algorithm 1: {marks}",
            target.closed,
            source.closed,
            target.marks.astype(np.float64),
            source.marks.astype(np.float64),
        ),
        _both("corrected", "Lines redrawn by Algorithm 2", target.corrected, source.corrected),
        keypoints_evidence((target.thickened, target_features), (source.thickened, source_features)),
    )


def keypoints_evidence(target: tuple[Image, Features], source: tuple[Image, Features]) -> Evidence:
    """Return both pictures with their SIFT features."""
    counts = " and ".join(str(len(features.pixels)) for _, features in (target, source))
    marks = target[1].pixels, source[1].pixels
    return _both("keypoints", f"SIFT features: {counts}", target[0], source[0], *marks)


def pairs_evidence(target: tuple[Image, Features], source: tuple[Image, Features], pairs: Cells) -> Evidence:
    """Return both pictures with the features that conform to the placement, joined.

    Parameters
    ----------
    pairs
        Shape (N, 2): a feature of the source and one of the target.
    """
    fewest = min(len(target[1].pixels), len(source[1].pixels))
    return ImagesEvidence(
        step="inliers",
        title=f"Features that conform to the placement: {len(pairs)}, of at most {fewest}",
        target=MarkedImage("target", target[0], target[1].pixels[pairs[:, 1]]),
        source=MarkedImage("source", source[0], source[1].pixels[pairs[:, 0]]),
        pairs=np.repeat(np.arange(len(pairs), dtype=np.intp)[:, None], 2, axis=1),
    )


def _radon(target: Radon, source: Radon) -> Evidence:
    """Return the Radon transforms, α to the right and s upwards, with their largest values marked."""
    title = "Radon transform over α (0° to 180°, to the right) and s (upwards); the longest wall is marked"
    return ImagesEvidence("radon", title, _radon_image("target", target), _radon_image("source", source), _NO_PAIRS)


def _radon_image(label: str, transform: Radon) -> MarkedImage:
    return MarkedImage(label, np.ascontiguousarray(_grey(transform).T), np.array([transform.peak], np.float64))


def _grey(transform: Radon) -> Image:
    most = float(transform.values.max())
    # a square root, as one long wall outshines all others
    return np.sqrt(transform.values / most * 255.0**2 if most > 0 else transform.values).astype(np.uint8)


def _both(
    step: str,
    title: str,
    target: Image,
    source: Image,
    target_marks: Points = _NO_MARKS,
    source_marks: Points = _NO_MARKS,
) -> Evidence:
    return ImagesEvidence(
        step=step,
        title=title,
        target=MarkedImage("target", target, target_marks),
        source=MarkedImage("source", source, source_marks),
        pairs=_NO_PAIRS,
    )
