"""What the confidence is fitted on, and the fit."""

import json
import math
from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.optimize
from scipy.optimize import check_grad

from benchmarks import observations
from benchmarks.bends import MOST_M, bent, random_bend
from benchmarks.calibrate import Stated, by_group, recall, source_of, stated, statement
from benchmarks.fitting import (
    AGAINST,
    FOLDS,
    KNOTS,
    Model,
    Models,
    balanced,
    fit_array,
    fitted,
    fitted_confidence,
    fitted_odds,
    folds,
)
from benchmarks.fitting import CONTEST as CONTEST_CUES
from benchmarks.fitting import FIT as FIT_CUES
from benchmarks.observations import BLOCK, Candidate, Job, Observation, errors, groups, jobs, observed, read
from mapmerge.config import VerifyConfig
from mapmerge.match import calibration
from mapmerge.match.confidence import additive, confidence, contest, log_odds_of
from mapmerge.match.weigh import likeliest_first
from mapmerge.sim2 import Sim2
from samples.kinds import KINDS
from samples.pairs import Pair
from tests.cues import FIT
from tests.floors import WALL, flat, walled_room

WEIGHED = Candidate(0.1, 0.01, FIT), Candidate(9.0, 3.0, FIT)
SEEN = Observation("a pair", "recorded", "intel", False, True, False, 0.4, False, WEIGHED)


def off(item, **changes):
    """Return an observation whose first candidate is changed."""
    first, *others = item.candidates
    return replace(item, candidates=(replace(first, **changes), *others))


class TestObservation:
    @pytest.mark.parametrize(
        ("change", "right"),
        [
            ({}, True),
            ({"error_m": 0.6}, False),
            ({"error_rad": math.radians(4.0)}, False),
            ({"error_m": 0.6, "error_rad": math.radians(4.0), "bent": True}, True),
            ({"error_m": 1.1, "bent": True}, False),
            ({"error_m": 0.0, "error_rad": 0.0, "related": False}, False),
        ],
    )
    def test_is_right_where_maps_that_belong_together_lie_as_they_should(self, change, right):
        errors_of = {key: value for key, value in change.items() if key.startswith("error")}
        others = {key: value for key, value in change.items() if key not in errors_of}
        found = replace(off(SEEN, **errors_of), **others)
        assert found.right_one == (0 if right else None)

    def test_of_two_that_are_near_the_nearer_one_is_right(self):
        """At most one placement is."""
        near, nearer = replace(WEIGHED[0], error_m=0.8), replace(WEIGHED[0], error_m=0.6)
        assert replace(SEEN, bent=True, candidates=(near, nearer)).right_one == 1

    def test_without_a_placement_none_is(self):
        assert replace(SEEN, candidates=()).right_one is None

    def test_is_read_as_it_was_written(self, tmp_path):
        path = tmp_path / "seen.jsonl"
        others = [SEEN, off(replace(SEEN, name="another", group="office"), error_m=3.0)]
        path.write_text("".join(json.dumps(asdict(item)) + "\n" for item in others), encoding="utf-8")
        assert read(path) == others
        assert Observation.parse(json.dumps(asdict(SEEN))) == SEEN
        assert {name: len(items) for name, items in groups(others).items()} == {"office": 1, "recorded": 1}

    def test_errors_are_those_at_a_point(self):
        error_m, error_rad = errors(Sim2(1.0, 0.0, math.pi), Sim2(1.0, 0.0, -math.pi), (3.0, 0.0))
        assert (error_m, error_rad) == pytest.approx((0.0, 0.0), abs=1e-9)
        error_m, error_rad = errors(Sim2(0.3, 0.4, 0.1), Sim2(), (0.0, 0.0))
        assert (error_m, error_rad) == pytest.approx((0.5, 0.1))


class TestJobs:
    def test_are_all_that_was_asked_for_once(self):
        found = jobs(2 * BLOCK, 150)
        assert len(found) == len(set(found))
        assert {job.group for job in found} == {*KINDS, "recorded"}
        assert sum(job.group == "recorded" for job in found) == 2
        assert jobs(0, 0) == []

    def test_hold_out_whole_buildings_and_match_all_pairs(self, monkeypatch):
        monkeypatch.setattr(observations, "mission", made_mission)
        monkeypatch.setattr(observations, "pairs", lambda found, _: [flats(found.name)])
        monkeypatch.setattr(observations, "strangers", lambda kind, seed, what: stranger(f"{kind}-{seed}-{what}"))
        monkeypatch.setattr(observations, "CROSSED_A_BLOCK", 3)
        monkeypatch.setattr(observations, "BENT_SHARE", 0.0)
        monkeypatch.setattr(observations, "TWINS_A_MISSION", 2)
        found = observed(Job("office", BLOCK))
        assert [item.name for item in found if item.held_out] == [
            "office-7",
            "office-1007-next floor",
            "office-1007-next wing",
            "office-2007-next floor",
            "office-2007-next wing",
        ]
        assert len(found) == 5 * BLOCK + 3
        assert {item.building for item in found if item.held_out} == {"office-7"}
        assert {item.building for item in found if item.name == "crossed"} == {f"office from {BLOCK}"}
        for item in found:
            assert item.related == (item.name.startswith("office-") and "next" not in item.name)
            assert item.right_one == (0 if item.related else None)
        assert not any(item.bent for item in found)
        crossed = [item for item in found if item.name.startswith("crossed")]
        assert [item.held_out for item in crossed] == [False] * 3
        assert observed(Job("office", BLOCK)) == found


class TestBends:
    @pytest.mark.parametrize("seed", range(4))
    def test_the_truth_of_a_bent_pair_lays_its_walls_on_each_other(self, seed):
        pair = flats("flat")
        found = bent(pair, np.random.default_rng(seed))
        assert found.name == "flat bent"
        assert not found.target.same_as(pair.target)
        assert not found.source.same_as(pair.source)
        moved_m = errors(found.truth, pair.truth, found.centre_m)[0]
        assert moved_m < 3 * MOST_M
        assert wall_gap_m(found, found.truth) < 0.5 * MOST_M
        assert wall_gap_m(found, found.truth) <= wall_gap_m(found, pair.truth) + 0.02
        assert wall_gap_m(found, found.truth @ Sim2(0.6, 0.6)) > wall_gap_m(found, found.truth)

    def test_what_does_not_belong_together_is_bent_too(self):
        pair = stranger("other")
        found = bent(pair, np.random.default_rng(1))
        assert found.truth is None
        assert not found.target.same_as(pair.target)

    def test_points_move_with_the_map(self):
        grid = flats("flat").source
        bend = random_bend(grid, 0.4, np.random.default_rng(2))
        walls_m = grid.centres_m(grid.cells == WALL)
        bent_grid = bend.of(grid)
        assert (bent_grid.resolution_m, bent_grid.map_from_grid) == (grid.resolution_m, grid.map_from_grid)
        moved_m = bend.moved(walls_m, grid)
        assert np.hypot(*(moved_m - walls_m).T).max() > 0.1
        gaps_m = nearest_m(moved_m, bent_grid.centres_m(bent_grid.cells == WALL))
        assert np.quantile(gaps_m, 0.9) < 2 * grid.resolution_m

    def test_no_bend_moves_nothing(self):
        grid = flats("flat").source
        none = random_bend(grid, 0.0, np.random.default_rng(2))
        assert none.of(grid).same_as(grid)


def drawn_fit(rng):
    """Return figures of which two tell how likely a placement is, and one does not."""
    return replace(
        FIT,
        overlap_m2=float(rng.uniform(1.0, 60.0)),
        far_share=float(rng.uniform(0.0, 0.1)),
        held_m=float(rng.uniform(1.0, 40.0)),
    )


def odds_of(fit):
    return -3.0 + 0.12 * fit.overlap_m2 - 30.0 * fit.far_share


@pytest.fixture(scope="module")
def seen():
    """Observations of two or three candidates, one of which is right, or none, as their odds would have it."""
    return drawn(3000, seed=3)


def drawn(count, seed):
    rng = np.random.default_rng(seed)
    found = []
    for number in range(count):
        fits = [drawn_fit(rng) for _ in range(2 + number % 2)]
        chances = np.exp([0.0, *map(odds_of, fits)])
        right = int(rng.choice(len(chances), p=chances / chances.sum())) - 1
        candidates = tuple(Candidate(0.0 if row == right else 9.0, 0.0, fit) for row, fit in enumerate(fits))
        group = "recorded" if number % 3 else "office"
        found.append(
            Observation(f"pair {number}", group, f"{group}-{number % 60}", False, True, False, 0.5, False, candidates)
        )
    return found


@pytest.fixture(scope="module")
def models(seen):
    return fitted(seen)


class TestFit:
    """Of candidates whose odds are known: they rise with one cue and fall with another."""

    def test_recovers_the_odds(self, seen, models):
        values, there, _ = fit_array(seen[:400])
        known = np.array([odds_of(item.fit) for pair in seen[:400] for item in pair.candidates])
        gap = models.odds.log_odds(values)[there] - known
        assert np.abs(gap).mean() < 0.35

    def test_is_calibrated_on_others(self, models):
        said = stated(drawn(3000, seed=4), models)
        for low, high in ((0.0, 0.5), (0.5, 0.8), (0.8, 1.0)):
            within = (said.sure >= low) & (said.sure < high)
            assert within.sum() > 100
            assert said.right[within].mean() == pytest.approx(said.sure[within].mean(), abs=0.05)

    def test_slopes_are_those_of_the_losses(self, seen, monkeypatch):
        """Of both models, at a point away from the end of the search."""
        losses = []
        monkeypatch.setattr("benchmarks.fitting._minimised", lambda loss, cues: losses.append((loss, cues)))
        values, there, right = fit_array(seen[:60])
        fitted_odds(values, there, right, np.ones(60))
        rng = np.random.default_rng(1)
        fitted_confidence(rng.uniform(0.0, 3.0, (60, len(CONTEST_CUES))), right[:, 0], np.ones(60))
        for loss, cues in losses:
            size = sum(len(KNOTS[cue]) - 1 for cue in cues)
            point = np.append(rng.uniform(0.0, 1.0, size), -1.0)
            assert check_grad(lambda at, f=loss: f(at)[0], lambda at, f=loss: f(at)[1], point) < 1e-5

    def test_ends_at_the_same_wherever_it_begins(self, seen, monkeypatch):
        values, there, right = fit_array(seen[:500])
        here = fitted_odds(values, there, right, np.ones(500))
        begin = scipy.optimize.minimize
        monkeypatch.setattr("benchmarks.fitting.minimize", lambda loss, start, **how: begin(loss, start + 0.4, **how))
        there_too = fitted_odds(values, there, right, np.ones(500))
        assert np.abs(here.log_odds(values) - there_too.log_odds(values))[there].max() < 0.01

    def test_says_so_if_it_does_not_end(self, seen, monkeypatch):
        begin = scipy.optimize.minimize
        monkeypatch.setattr(
            "benchmarks.fitting.minimize",
            lambda loss, start, **how: begin(loss, start, **{**how, "options": {"maxiter": 1}}),
        )
        with pytest.raises(RuntimeError, match="did not converge"):
            fitted(seen[:200])

    def test_no_building_is_in_two_parts(self, seen):
        parts = folds(seen)
        assert set(parts.tolist()) == set(range(FOLDS))
        for name in {item.building for item in seen}:
            assert len({part for part, item in zip(parts.tolist(), seen, strict=True) if item.building == name}) == 1

    def test_what_does_not_matter_adds_little(self, models):
        totals = {name: abs(rises.sum()) for name, rises in zip(FIT_CUES, models.odds.rises, strict=True)}
        assert totals["overlap_m2"] > 4.0
        assert totals["far_share"] > 1.5
        assert totals["held_m"] < 0.5

    def test_never_rises_against_what_a_cue_says(self, seen):
        """Whatever was seen, such as the very contrary."""
        values, there, right = fit_array(seen[:600])
        for chosen in (right, there & ~right):
            model = fitted_odds(values, there, chosen, np.ones(len(values)))
            for name, rises in zip(model.cues, model.rises, strict=True):
                assert (rises * (-1.0 if name in AGAINST else 1.0) >= 0.0).all(), name

    def test_is_what_the_library_computes_from_its_text(self, seen, models, monkeypatch):
        read_back = {}
        exec(source_of(models), read_back)  # noqa: S102
        monkeypatch.setattr("mapmerge.match.confidence._ODDS", additive(read_back["ODDS"]))
        monkeypatch.setattr("mapmerge.match.confidence._CONFIDENCE", additive(read_back["CONFIDENCE"]))
        said = stated(seen[:50], models)
        for item, mine in zip(seen, said.sure.tolist(), strict=False):
            fits = [candidate.fit for candidate in item.candidates]
            log_odds = [log_odds_of(fit) for fit in fits]
            order = likeliest_first(fits, log_odds, VerifyConfig())
            standing = contest([fits[row] for row in order], [log_odds[row] for row in order])
            is_enough = fits[order[0]].overlap_m2 >= VerifyConfig().min_overlap_m2
            assert mine == pytest.approx(confidence(standing) if is_enough else 0.0, abs=2e-3)


class TestStated:
    @pytest.mark.parametrize("change", [{"overlap_m2": 5.9}, {"matched_wall_m": 7.9}, {"wall_agreement": 0.69}])
    def test_what_is_never_accepted_is_not_counted_as_accepted(self, models, change):
        poor = replace(FIT, **change)
        found = replace(SEEN, candidates=(Candidate(0.0, 0.0, poor),))
        assert stated([SEEN], models).sure[0] > 0.0
        assert stated([found], models).sure[0] == 0.0

    def test_a_pair_without_a_placement_counts_as_missed(self, models):
        said = stated([SEEN, replace(SEEN, candidates=())], models)
        assert (said.sure[1], said.right[1]) == (0.0, False)

    def test_says_how_often_the_right_one_is_there(self):
        found = [SEEN, replace(SEEN, candidates=()), replace(SEEN, ambiguous=True), replace(SEEN, related=False)]
        assert recall(found) == "the right placement is among those weighed in 1 of 2"


class TestCalibration:
    @pytest.mark.parametrize(("table", "cues"), [(calibration.ODDS, FIT_CUES), (calibration.CONFIDENCE, CONTEST_CUES)])
    def test_has_a_curve_of_every_cue_that_goes_its_way(self, table, cues):
        _, curves = table
        assert tuple(curves) == cues
        for name, (knots, rises) in curves.items():
            assert knots == KNOTS[name]
            assert len(knots) == len(rises) + 1
            assert list(knots) == sorted(set(knots))
            assert all(rise * (-1.0 if name in AGAINST else 1.0) >= 0.0 for rise in rises), name

    def test_was_written_by_the_program_that_writes_it(self):
        written = Models(*(model_of(table) for table in (calibration.ODDS, calibration.CONFIDENCE)))
        assert source_of(written) == Path(calibration.__file__).read_text(encoding="utf-8")

    def test_groups_count_as_much(self):
        others = [SEEN, *(replace(SEEN, group="office", name=str(number)) for number in range(4))]
        assert balanced(others).tolist() == [1.0, 0.25, 0.25, 0.25, 0.25]

    def test_says_how_many_of_the_accepted_are_wrong(self):
        found = [
            SEEN,
            off(replace(SEEN, building="fr101"), error_m=9.0),
            replace(SEEN, group="office"),
            replace(SEEN, ambiguous=True),
        ]
        right = np.array([item.right_one == 0 for item in found])
        said = Stated(np.array([0.999, 0.995, 0.5, 0.999]), right)
        at_90, at_999 = (line.split() for line in statement(found, said, [0.9, 0.999])[1:])
        assert at_90[:3] == ["0.9", "2", "1"]
        assert at_999[:3] == ["0.999", "1", "0"]
        assert "1 of 2 (95% bound" in " ".join(at_90)
        assert "0.3–0.5: 1/3" in " ".join(at_90)
        assert " ".join(at_90).endswith("0 of 1 wrong")
        assert by_group(found, said, 0.9) == [
            "  office         0 accepted,   0 wrong",
            "  recorded       2 accepted,   1 wrong",
        ]


def model_of(table):
    intercept, curves = table
    return Model(tuple(curves), tuple(np.array(rises) for _, rises in curves.values()), intercept)


THERE = Sim2(-3.0, -2.0, 0.31)


def made_mission(kind, seed):
    robots = [SimpleNamespace(maps=[SimpleNamespace(grid=flat(ragged=seed))])]
    return SimpleNamespace(name=f"{kind}-{seed}", robots=robots)


def flats(name):
    """Return two maps of one flat."""
    truth = Sim2(-1.0, -1.0).inverse() @ THERE
    grids = flat(ragged=1), flat(THERE, ragged=2, size_m=15.0)
    return Pair(name, "flat", *grids, truth, THERE.inverse().apply_point(4.5, 3.0), 1.0, 0.0, False, "same place")


def stranger(name):
    other = walled_room((7.0, 4.0), open_ends=False, ragged=3)
    return Pair(name, "flat", flat(ragged=1), other, None, (0.0, 0.0), 0.0, 0.0, False, "other building")


def nearest_m(points_m, others_m):
    """Return how far each point is from the nearest of the others."""
    parts = np.array_split(points_m, max(1, len(points_m) // 200))
    return np.concatenate([np.hypot(*(part[:, None] - others_m).transpose(2, 0, 1)).min(axis=1) for part in parts])


def wall_gap_m(pair, placement):
    """Return how far the source's walls are from the target's, on average."""
    target, source = (grid.centres_m(grid.cells == WALL) for grid in (pair.target, pair.source))
    return float(nearest_m(placement.apply(source[::5]), target).mean())
