from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from mapmerge.grid import Grid
from replay.codec import decode
from replay.messages import GridMessage
from replay.sources import open_source
from replay.sources.map_server.map_image import Mode, Thresholds, cells_from_pixels
from tests.bags import write_saved_map
from tests.data_paths import shared_data
from tests.replay.test_sources_open import refused

GRAY = np.array([[0, 88, 89, 90], [204, 205, 206, 255]], np.uint8)


def _grid(path: Path) -> Grid:
    with open_source(path) as source:
        (message,) = source.messages(["/map"])
    decoded = decode(message)
    assert isinstance(decoded, GridMessage)
    return decoded.grid


def _cells(pixels: Any, mode: Mode = "trinary", *, negate: bool = False) -> list[list[int]]:
    """Return the cells with the image's top row first, as the pixels are written here."""
    return cells_from_pixels(np.array(pixels, np.uint8), mode, Thresholds(0.65, 0.196, negate))[::-1].tolist()


def test_the_top_row_of_the_image_is_the_last_row_of_the_map(tmp_path: Path) -> None:
    grid = _grid(write_saved_map(tmp_path / "map.yaml", GRAY))
    # 1 − 89/255 is 0.651; 1 − 205/255 is 0.19608, which is not below 0.196: the usual gray is unknown.
    assert grid.cells.tolist() == [[-1, -1, 0, 0], [100, 100, 100, -1]]
    pose = grid.map_from_grid
    assert (pose.x_m, pose.y_m, pose.yaw_rad) == pytest.approx((-1.5, 2.25, 0.3))
    assert grid.resolution_m == pytest.approx(0.05)


def test_trinary_negate() -> None:
    assert _cells(GRAY, negate=True) == [[0, -1, -1, -1], [100, 100, 100, 100]]
    assert _cells([[49, 50, 165, 166]], negate=True) == [[0, -1, -1, 100]]


def test_trinary_takes_the_mean_of_the_colours() -> None:
    assert _cells([[[0, 0, 255], [255, 255, 255], [0, 255, 255]]]) == [[100, 0, -1]]


def test_trinary_takes_opacity_as_one_more_channel() -> None:
    # Opaque black is 0.75 dark, opaque white 0; transparent white is 0.25 dark, neither.
    assert _cells([[[0, 0, 0, 255], [255, 255, 255, 255], [255, 255, 255, 0], [0, 0, 0, 0]]]) == [[100, 0, -1, 100]]


def test_scale_is_graded_between_the_thresholds() -> None:
    # Darkness 0.5 lies at (0.5 − 0.196) / 0.454 = 0.67 between them.
    assert _cells([[0, 255, 127, 128, 200]], "scale") == [[100, 0, 67, 67, 4]]


def test_scale_knows_only_what_is_opaque() -> None:
    assert _cells([[[0, 0, 0, 255], [0, 0, 0, 254], [255, 255, 255, 0]]], "scale") == [[100, -1, -1]]


def test_scale_leaves_opacity_out_of_the_brightness() -> None:
    assert _cells([[[127, 127, 127, 255]]], "scale") == _cells([[127]], "scale")


@pytest.mark.parametrize("negate", [False, True])
def test_raw_takes_the_values_as_they_are(negate: bool) -> None:
    assert _cells([[0, 1, 99, 100, 101, 255]], "raw", negate=negate) == [[0, 1, 99, 100, -1, -1]]


def test_thresholds_that_leave_nothing_between() -> None:
    cells = cells_from_pixels(np.array([[0, 128, 255]], np.uint8), "scale", Thresholds(0.5, 0.5, negate=False))
    assert cells[0, 0] == 100
    assert cells[0, 2] == 0


@pytest.mark.parametrize(
    ("keys", "cells"),
    [
        ({"mode": "Raw"}, [[0, 88, 89, 90], [-1, -1, -1, -1]]),
        ({"negate": "yes"}, [[0, -1, -1, -1], [100, 100, 100, 100]]),
        ({"negate": True}, [[0, -1, -1, -1], [100, 100, 100, 100]]),
        ({"occupied_thresh": "65e-2"}, [[100, 100, 100, -1], [-1, -1, 0, 0]]),
    ],
)
def test_what_the_yaml_may_say(tmp_path: Path, keys: dict[str, Any], cells: list[list[int]]) -> None:
    assert _grid(write_saved_map(tmp_path / "map.yaml", GRAY, **keys)).cells[::-1].tolist() == cells


def test_image_in_another_folder(tmp_path: Path) -> None:
    (tmp_path / "images").mkdir()
    assert _grid(write_saved_map(tmp_path / "m.yaml", GRAY, image="images/m.png")).cols == 4
    assert _grid(write_saved_map(tmp_path / "n.yaml", GRAY, image=str(tmp_path / "images" / "n.png"))).cols == 4


def test_the_name_of_the_yaml_does_not_matter(tmp_path: Path) -> None:
    assert _grid(write_saved_map(tmp_path / "map.txt", GRAY)).cols == 4


@pytest.mark.parametrize("key", ["image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh"])
def test_a_missing_key_is_named(tmp_path: Path, key: str) -> None:
    refused(write_saved_map(tmp_path / "map.yaml", GRAY, without=[key]), f"'{key}' is missing")


@pytest.mark.parametrize("text", ["[1, 2]", "hello", "", "a: 1"])
def test_yaml_that_is_no_map(tmp_path: Path, text: str) -> None:
    path = tmp_path / "map.yaml"
    path.write_text(text + "\n")
    refused(path, "'image' is missing")


@pytest.mark.parametrize(
    ("key", "values", "expected"),
    [
        ("resolution", ["fine", '"a\\nb"', "[0.05]", "true", "2001-01-01"], "a positive number of metres per pixel"),
        ("resolution", [0, 0.0, -0.05, ".nan", ".inf", "-.inf", 1e39, 1e-60], "a positive number of metres per pixel"),
        ("origin", [5, "[]", [1, 2], [1, 2, 3, 4], "[1, 2, x]", "[1, 2, .nan]", "[-.inf, 0, 0]"], "three numbers in m"),
        ("origin", ["{x: 1, y: 2, yaw: 3}", "[1, 2, [3]]", f"[1, 2, {10**400}]"], "[x, y, yaw]"),
        ("occupied_thresh", ["much", 65, -0.1, ".nan", "[0.65]"], "a number from 0 to 1"),
        ("free_thresh", ["little", 1.1, -1, ".nan", "{}"], "a number from 0 to 1"),
        ("mode", ["best", 1, "[raw]"], "one of trinary, scale, raw"),
        ("negate", ["perhaps", 0.5], "0 or 1"),
    ],
)
def test_a_value_that_is_wrong_is_named_with_what_is_expected(
    tmp_path: Path, key: str, values: list[object], expected: str
) -> None:
    for value in values:
        path = write_saved_map(tmp_path / "map.yaml", GRAY, **{key: value})
        text = refused(path, f"'{key}' is ", f"correct '{key}' in this file")
        assert text.startswith(f"{path}: ")
        assert expected in text
        assert "copy it again" not in text


def test_yaml_that_cannot_be_read(tmp_path: Path) -> None:
    refused(write_saved_map(tmp_path / "map.yaml", GRAY, origin="[1, 2"), "cannot be read")


def test_thresholds_at_their_ends(tmp_path: Path) -> None:
    assert _grid(write_saved_map(tmp_path / "map.yaml", GRAY, occupied_thresh=1, free_thresh=0)).cols == 4


def test_missing_image(tmp_path: Path) -> None:
    path = write_saved_map(tmp_path / "map.yaml", GRAY)
    (tmp_path / "map.pgm").unlink()
    refused(path, str(tmp_path / "map.pgm"), "does not exist")


def test_image_that_is_none(tmp_path: Path) -> None:
    path = write_saved_map(tmp_path / "map.yaml", GRAY)
    for content in (b"", b"hello"):
        (tmp_path / "map.pgm").write_bytes(content)
        refused(path, str(tmp_path / "map.pgm"), "PNG")


def test_16_bits_are_refused(tmp_path: Path) -> None:
    path = write_saved_map(tmp_path / "map.yaml", GRAY.astype(np.uint16) * 257, image="map.png")
    refused(path, str(tmp_path / "map.png"), "uint16", "8 bits")


def test_shared_maps() -> None:
    grid = _grid(shared_data("sunil/demo_1.yaml"))
    image = cv2.imread(str(shared_data("sunil/demo_1.pgm")), cv2.IMREAD_UNCHANGED)
    assert (grid.rows, grid.cols) == image.shape
    assert np.array_equal(grid.cells == 100, image[::-1] == 0)
    assert np.array_equal(grid.cells == 0, image[::-1] == 254)
