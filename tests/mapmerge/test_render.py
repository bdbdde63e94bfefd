"""Pictures of evidence: their form, whatever they show."""

import numpy as np
import pytest

from mapmerge.drawing import BANNER_PX, TITLE_PX, titled, width_px, wrapped
from mapmerge.evidence import (
    Curve,
    CurvesEvidence,
    ImagesEvidence,
    MarkedImage,
    OverlayEvidence,
    SurfaceEvidence,
)
from mapmerge.grid import Grid
from mapmerge.render import MAX_SIDE_PX, Label, Named, render
from mapmerge.sim2 import IDENTITY, Sim2
from tests.floors import filled, flat, prepared_map

RNG = np.random.default_rng(0)
RAMP = np.linspace(-1.0, 1.0, 180)


def curves(*values, marks=(10.0, 90.0)):
    named = tuple(Curve(f"curve {number}", each) for number, each in enumerate(values))
    return CurvesEvidence("curves", "Some curves", "angle [°]", 0.0, 180.0, named, marks)


def surface(values, marks=(), chosen=None):
    return SurfaceEvidence("surface", "A surface", np.asarray(values, np.float32), marks, chosen)


def overlay(target, source, pose=IDENTITY):
    return OverlayEvidence("overlay", "Two maps", prepared_map(target), prepared_map(source), pose, 0.15)


def images(target, source, pairs=()):
    """Two pictures of these shapes, with a mark in the middle and one in the first cell."""
    both = []
    for label, shape in (("target", target), ("source", source)):
        middle = [shape[1] // 2, shape[0] // 2]
        marks = np.array([middle, [0, 0]], float) if min(shape) else np.empty((0, 2))
        both.append(MarkedImage(label, np.zeros(shape, np.uint8), marks))
    return ImagesEvidence("images", "Two pictures", *both, np.array(pairs, np.intp).reshape(-1, 2))


CASES = {
    "three curves": curves(RAMP, RAMP**2, -RAMP),
    "one flat curve": curves(np.zeros(180), marks=()),
    "five curves": curves(*[RAMP] * 5),
    "one value": curves(np.ones(1)),
    "a surface": surface(RNG.normal(size=(120, 200)), ((3, 4), (119, 199)), (60, 100)),
    "marks far away": surface(np.zeros((30, 30)), ((-(10**12), 5), (5, 10**300)), (2 * 10**9, 2 * 10**9)),
    "a flat surface": surface(np.zeros((30, 30))),
    "a large surface": surface(RNG.normal(size=(3000, 50)), ((0, 0),), (2999, 49)),
    "one row": surface(RNG.normal(size=(1, 400)), ((0, 3),), (0, 399)),
    "one column": surface(RNG.normal(size=(2000, 1)), ((3, 0),)),
    "an overlay": overlay(flat(), flat(ragged=1), Sim2(0.3, 0.2, 0.1)),
    "far apart": overlay(flat(), flat(), Sim2(90.0, 5.0, 0.1)),
    "without a wall": overlay(flat(), filled(0, 50, 40)),
    "nothing known": overlay(filled(-1, 5, 5), filled(0, 0, 0)),
    "one cell": overlay(filled(100, 1, 1), filled(100, 1, 1)),
    "two images": images((200, 300), (120, 90), [(0, 0), (1, 1)]),
    "images of one cell": images((1, 1), (1, 1), [(0, 0)]),
    "large images": images((3000, 50), (20, 4000), [(0, 1)]),
    "images of nothing": images((0, 0), (0, 9)),
    "long and thin": overlay(filled(100, 1, 4000), filled(100, 1, 4000)),
}


@pytest.mark.parametrize("name", CASES)
def test_pictures_are_rgb_and_not_too_large(name):
    picture = render(CASES[name])
    assert picture.rgb.dtype == np.uint8
    assert picture.rgb.ndim == 3
    assert picture.rgb.shape[2] == 3
    assert 0 < max(picture.rgb.shape) <= MAX_SIDE_PX
    assert min(picture.rgb.shape) > 0
    assert (picture.step, picture.title) == (CASES[name].step, CASES[name].title)


@pytest.mark.parametrize("name", CASES)
def test_pictures_repeat_themselves(name):
    assert np.array_equal(render(CASES[name]).rgb, render(CASES[name]).rgb)


def colours(picture):
    """Return the colours below the title."""
    return set(map(tuple, picture.rgb[BANNER_PX:].reshape(-1, 3).tolist()))


def test_an_overlay_tells_walls_that_agree_from_those_that_do_not():
    good, bad = colours(render(overlay(flat(), flat()))), colours(render(overlay(flat(), flat(), Sim2(0.4, 0.4))))
    green, red = (20, 150, 60), (220, 30, 40)
    assert green in good
    assert red not in good
    assert red in bad


def test_up_is_up():
    """A target with a wall high up in the map."""
    cells = np.zeros((200, 200), np.int8)
    cells[150:155] = 100
    picture = render(overlay(Grid(cells, 0.05), filled(0, 200, 200)))
    red_rows = np.flatnonzero((picture.rgb[BANNER_PX:] == (220, 30, 40)).all(axis=2).any(axis=1))
    assert red_rows.mean() < (picture.rgb.shape[0] - BANNER_PX) / 2


def test_what_is_free_in_both_maps_is_lighter_and_in_its_place():
    """The source covers the lower part of the target; the picture is as wide as it need not be padded."""
    rgb = render(overlay(filled(0, 200, 400), filled(0, 80, 400))).rgb
    white_rows = np.flatnonzero((rgb[BANNER_PX:] == 255).all(axis=2).mean(axis=1) > 0.5) + BANNER_PX
    assert white_rows.mean() > 0.6 * rgb.shape[0]
    assert len(white_rows) == pytest.approx(80 * 2, abs=3)


def test_the_chosen_shift_is_marked_where_it_is():
    picture = render(surface(np.zeros((100, 100)), chosen=(20, 70)))
    body = picture.rgb[-picture.rgb.shape[1] :]
    rows, cols = np.nonzero((body == (214, 39, 40)).all(axis=2))
    zoom = body.shape[1] / 100
    assert cols.mean() == pytest.approx(70.5 * zoom, abs=2)
    assert rows.mean() == pytest.approx((99.5 - 20) * zoom, abs=2)


def test_marks_are_where_they_are_and_pairs_are_joined():
    """The first cell, which has the lowest y, is at the lower left of each picture."""
    rgb = render(images((100, 100), (100, 100), [(1, 1)])).rgb
    top = BANNER_PX + 34
    rows, cols = np.nonzero(rgb[top:, :, 1].astype(int) - rgb[top:, :, 0] > 60)
    assert cols.min() < 20
    assert cols.max() - cols.min() == pytest.approx(rgb.shape[1] / 2, abs=12)
    assert rows.min() + top > rgb.shape[0] - 20


def test_flat_images_are_shown_above_each_other():
    above, beside = render(images((100, 400), (100, 400))).rgb, render(images((400, 100), (400, 100))).rgb
    assert above.shape[1] > 0.9 * MAX_SIDE_PX
    assert beside.shape[0] > 0.9 * MAX_SIDE_PX


def test_pictures_say_which_map_is_which_and_in_which_colour():
    named = Named(Label("alpha", (1, 90, 200)), Label("bravo", (200, 90, 1)))
    apart = overlay(filled(100, 40, 40), filled(100, 40, 40), Sim2(5.0, 0.0))
    assert {(1, 90, 200), (200, 90, 1)} <= colours(render(apart, named))
    for evidence in (apart, images((100, 100), (100, 100)), curves_of_both()):
        assert not np.array_equal(render(evidence, named).rgb, render(evidence).rgb)


def curves_of_both():
    return CurvesEvidence("curves", "Both", "angle", 0.0, 1.0, (Curve("target", RAMP), Curve("source", RAMP)), ())


def test_long_titles_are_broken_or_made_smaller_so_that_all_of_them_is_there():
    words = "a title of many words that goes on and on"
    lines = wrapped(words, TITLE_PX, 300)
    assert " ".join(lines) == words
    assert max(width_px(line, TITLE_PX, 600) for line in lines) <= 300
    for title in ("short", words, " ".join([words] * 9), "x" * 300):
        for side_px in (1, 300, 900):
            picture = titled(np.zeros((5, side_px, 3), np.uint8), title)
            assert 5 < picture.shape[0] <= 5 + BANNER_PX
            assert (picture[:-5] < 128).any()
            assert (picture[-5:, :1] == picture[-5:, -1:]).all()
