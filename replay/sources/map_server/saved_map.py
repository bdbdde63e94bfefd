"""Saved maps: the ``map.yaml`` and image that ``map_saver`` writes and ``nav2_map_server`` loads.

A saved map counts as a recording of one message at time 0.
"""

from __future__ import annotations

import functools
import math
import os
import re
import reprlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path, PureWindowsPath
from typing import Any, cast, get_args

import numpy as np

from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2
from replay.codec import encode_grid
from replay.errors import InputError
from replay.sources.base import GRID_TYPE, RawMessage, SourceInfo, TopicInfo
from replay.sources.boundary import COMMON, Closing, translated
from replay.sources.losses import Losses
from replay.sources.map_server.image_file import read_pixels
from replay.sources.map_server.map_image import Mode, Thresholds, cells_from_pixels
from replay.sources.memory import MOST_BYTES
from replay.sources.yaml_text import load_yaml

TOPIC = "/map"
FRAME_ID = "map"

_SUFFIXES = {".yaml", ".yml"}
_IMAGE_KEY = re.compile(rb"^image[ \t]*:", re.MULTILINE)
_REQUIRED = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
_MODES: tuple[Mode, ...] = get_args(Mode)
_TRUE = {"true", "yes", "on", "y"}
_FALSE = {"false", "no", "off", "n"}
_MAX_RESOLUTION_M = float(np.finfo(np.float32).max)


@dataclass(frozen=True, slots=True)
class _Description:
    """What the YAML file says."""

    image: Path
    resolution_m: float
    map_from_grid: Sim2
    mode: Mode
    thresholds: Thresholds


@functools.cache
def _foreign() -> tuple[type[Exception], ...]:
    import cv2

    return (*COMMON, cv2.error)


class SavedMap(Closing):
    """A saved map. Its image is read when its message is asked for."""

    def __init__(self, path: Path, most_bytes: int = MOST_BYTES) -> None:
        del most_bytes  # its image has limits of its own, and its map is left out where it needs too much
        self.path = path
        self.losses = Losses()
        with translated(path, _foreign()):
            self._description = _description(path)

    @property
    def files(self) -> tuple[Path, ...]:
        """Its description, and its image wherever that is."""
        return self.path, self._description.image

    @classmethod
    def recognises(cls, path: Path, head: bytes) -> bool:
        """Tell whether this is a YAML file, or a text that names an image."""
        return path.is_file() and (path.suffix.lower() in _SUFFIXES or _IMAGE_KEY.search(head) is not None)

    @property
    def info(self) -> SourceInfo:
        """One map, without a clock."""
        return SourceInfo("map_server", None, None, (TopicInfo(TOPIC, GRID_TYPE, 1),))

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield the map, if it is asked for."""
        if TOPIC not in topics:
            return
        with translated(self.path, _foreign()):
            known = self._description
            cells = cells_from_pixels(read_pixels(self.path, known.image), known.mode, known.thresholds)
            grid = Grid(cells, known.resolution_m, known.map_from_grid)
            data = bytes(encode_grid(grid, FRAME_ID, stamp_ns=0))
        yield RawMessage(TOPIC, GRID_TYPE, "cdr", 0, data)

    def close(self) -> None:
        """Nothing is held open."""


def _description(path: Path) -> _Description:
    document = _document(path)
    if "rosbag2_bagfile_information" in document:
        raise InputError(f"{path}: this is the metadata of a ROS 2 bag; give its folder instead: {path.parent}")
    missing = [key for key in _REQUIRED if document.get(key) is None]
    if missing:
        raise InputError(
            f"{path}: the key '{missing[0]}' is missing; expected the description of a saved map with "
            f"{', '.join(_REQUIRED)}"
        )
    return _Description(
        _image(path, document["image"]),
        _resolution_m(path, document["resolution"]),
        _origin(path, document["origin"]),
        _mode(path, document),
        Thresholds(
            _fraction(path, "occupied_thresh", document["occupied_thresh"]),
            _fraction(path, "free_thresh", document["free_thresh"]),
            _flag(path, document["negate"]),
        ),
    )


def _image(path: Path, value: object) -> Path:
    """Return where the image is: as ROS has it, anywhere on this machine, relative to the YAML file or not."""
    if not isinstance(value, str):
        raise _wrong(path, "image", value, "the path of an image")
    if os.name == "nt" and _names_another_machine(value):
        raise _wrong(path, "image", value, "a path on this machine: copy the image here")
    image = path.parent / value
    if not image.is_file():
        raise InputError(f"{path}: its image {image} does not exist; copy it to that place, or correct 'image'")
    return image


def _names_another_machine(image: str) -> bool:
    r"""Tell whether Windows would ask another machine for this path, as for ``\\machine\share\map.pgm``."""
    return PureWindowsPath(image).drive.startswith("\\\\")


def _document(path: Path) -> dict[str, Any]:
    document = load_yaml(path)
    if not isinstance(document, dict):
        raise InputError(f"{path}: the key '{_REQUIRED[0]}' is missing; expected the description of a saved map")
    return document


def _wrong(path: Path, key: str, value: object, expected: str) -> InputError:
    return InputError(f"{path}: '{key}' is {reprlib.repr(value)}; expected {expected}: correct '{key}' in this file")


def _number(value: object) -> float:
    """Return a number, NaN for what is none; YAML 1.2 takes some that the map server reads, such as 5e-2, for text."""
    if isinstance(value, bool):
        return math.nan
    try:
        return float(cast("str", value))
    except (TypeError, ValueError, OverflowError):
        return math.nan


def _resolution_m(path: Path, value: object) -> float:
    number = _number(value)
    # As a message holds it: with 32 bits.
    if 0.0 < number <= _MAX_RESOLUTION_M and np.float32(number) > 0.0:
        return number
    raise _wrong(path, "resolution", value, "a positive number of metres per pixel, such as 0.05")


def _origin(path: Path, value: object) -> Sim2:
    numbers = [_number(each) for each in value] if isinstance(value, list) else []
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise _wrong(path, "origin", value, "[x, y, yaw], three numbers in metres and radians")
    return Sim2(*numbers)


def _fraction(path: Path, key: str, value: object) -> float:
    number = _number(value)
    if 0.0 <= number <= 1.0:
        return number
    raise _wrong(path, key, value, "a number from 0 to 1")


def _flag(path: Path, value: object) -> bool:
    text = str(value).lower()
    if text in _TRUE or text in _FALSE:
        return text in _TRUE
    if isinstance(value, int):
        return value != 0
    raise _wrong(path, "negate", value, "0 or 1")


def _mode(path: Path, document: dict[str, Any]) -> Mode:
    name = str(document.get("mode") or _MODES[0]).lower()
    for mode in _MODES:
        if mode == name:
            return mode
    raise _wrong(path, "mode", document["mode"], f"one of {', '.join(_MODES)}")
