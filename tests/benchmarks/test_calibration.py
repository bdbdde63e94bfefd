"""What the confidence is fitted on, and the fit."""

import json
import math
from dataclasses import asdict, astuple, fields, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import observations
from benchmarks.bends import MOST_M, bent, random_bend
from benchmarks.calibrate import AGAINST, BY_RULE, Model, balanced, cue_array, fitted, source_of, statement
from benchmarks.observations import BLOCK, Job, Observation, errors, groups, jobs, observed, read
from mapmerge.match import calibration
from mapmerge.match.calibration import CURVES
from mapmerge.match.confidence import HIGHEST, Curve, confidence
from mapmerge.match.cues import Cues
from mapmerge.sim2 import Sim2
from samples.kinds import KINDS
from samples.pairs import Pair
from tests.floors import WALL, flat, walled_room

NAMES = [cue.name for cue in fields(Cues)]
CUES = Cues(
    matched_wall_m=45.0,
    wall_agreement=0.95,
    other_wall_agreement=0.97,
    far_share=0.01,
    slack_agreement=0.97,
    bend_m=0.05,
    likeness=0.2,
    lead_m=48.0,
    clearance=3.0,
    rival_agreement=0.4,
    acceptance=0.98,
    overlap_m2=40.0,
    overlap_fraction=0.6,
    aligned=0.95,
    held_m=15.0,
    tight_share=0.9,
)
SEEN = Observation("a pair", "recorded", False, True, False, 0.4, False, 0.1, 0.01, CUES)


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
        assert replace(SEEN, **change).right is right

    def test_is_read_as_it_was_written(self, tmp_path):
        path = tmp_path / "seen.jsonl"
        others = [SEEN, replace(SEEN, name="another", group="office", error_m=3.0)]
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
        found = observed(Job("office", BLOCK))
        assert [item.name for item in found if item.held_out] == [
            "office-7",
            "office-7-next floor",
            "office-7-next wing",
        ]
        assert len(found) == 3 * BLOCK + 3
        assert all(
            item.right == item.related == item.name.startswith("office-") & ("next" not in item.name) for item in found
        )
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


def chance_of(cues):
    log_odds = -3.0 + 0.12 * cues[:, NAMES.index("overlap_m2")] - 30.0 * cues[:, NAMES.index("far_share")]
    return 1.0 / (1.0 + np.exp(-log_odds))


@pytest.fixture(scope="module")
def known():
    """Cues, the chance of being right that they mean, and a draw for each."""
    rng = np.random.default_rng(3)
    cues = np.tile(np.array(astuple(CUES)), (3000, 1))
    cues[:, NAMES.index("overlap_m2")] = rng.uniform(1.0, 60.0, len(cues))
    cues[:, NAMES.index("far_share")] = rng.uniform(0.0, 0.1, len(cues))
    cues[:, NAMES.index("held_m")] = rng.uniform(1.0, 40.0, len(cues))
    return cues, chance_of(cues), rng.uniform(size=len(cues))


@pytest.fixture(scope="module")
def model(known):
    cues, chance, drawn_at = known
    return fitted(cues, drawn_at < chance, np.ones(len(cues)))


class TestFit:
    """Of placements whose chance of being right is known: it rises with one cue and falls with another."""

    def test_recovers_it(self, known, model):
        cues, chance, _ = known
        off = np.abs(model.confidence(cues) - chance)
        assert off.mean() < 0.03
        assert np.quantile(off, 0.95) < 0.1

    def test_what_does_not_matter_adds_little(self, model):
        totals = {name: abs(rises.sum()) for name, rises in zip(NAMES, model.rises, strict=True)}
        assert totals["overlap_m2"] > 4.0
        assert totals["far_share"] > 2.0
        assert totals["held_m"] < 0.6

    def test_never_rises_against_what_a_cue_says(self, known):
        """Whatever was seen, such as the very contrary."""
        cues, chance, drawn_at = known
        for right in (drawn_at < chance, drawn_at > chance):
            model = fitted(cues, right, np.ones(len(cues)))
            for name, knots, rises in zip(NAMES, model.knots, model.rises, strict=True):
                assert (np.diff(knots) > 0.0).all()
                assert (rises * (-1.0 if name in AGAINST else 1.0) >= 0.0).all(), name
                assert name != BY_RULE or not rises.any()

    def test_is_what_the_library_computes_from_its_text(self, known, model, monkeypatch):
        text = source_of(model)
        read_back = {}
        exec(text, read_back)  # noqa: S102
        assert read_back["INTERCEPT"] == pytest.approx(model.intercept, abs=1e-4)
        assert list(read_back["CURVES"]) == NAMES
        for (knots, rises), mine, my_rises in zip(read_back["CURVES"].values(), model.knots, model.rises, strict=True):
            assert knots == pytest.approx(mine, abs=1e-4)
            assert rises == pytest.approx(my_rises, abs=1e-4)
        curves = {name: Curve(*values) for name, values in read_back["CURVES"].items()}
        monkeypatch.setattr("mapmerge.match.confidence._CURVES", curves)
        monkeypatch.setattr("mapmerge.match.confidence.INTERCEPT", read_back["INTERCEPT"])
        for row in known[0][:50]:
            assert confidence(Cues(*row.tolist())) == pytest.approx(
                min(HIGHEST, float(model.confidence(row[None])[0])), abs=2e-3
            )


class TestCalibration:
    def test_has_a_curve_of_every_cue(self):
        assert set(CURVES) == set(NAMES)
        for name, (knots, rises) in CURVES.items():
            assert len(knots) == len(rises) + 1
            assert list(knots) == sorted(set(knots))
            assert all(rise * (-1.0 if name in AGAINST else 1.0) >= 0.0 for rise in rises), name
        assert not any(CURVES[BY_RULE][1])

    def test_was_written_by_the_program_that_writes_it(self):
        knots, rises = zip(*CURVES.values(), strict=True)
        model = Model(tuple(map(np.array, knots)), tuple(map(np.array, rises)), calibration.INTERCEPT)
        assert source_of(model) == Path(calibration.__file__).read_text(encoding="utf-8")

    def test_groups_count_as_much(self):
        others = [SEEN, *(replace(SEEN, group="office", name=str(number)) for number in range(4))]
        assert balanced(others).tolist() == [1.0, 0.25, 0.25, 0.25, 0.25]

    def test_says_how_many_of_the_accepted_are_wrong(self):
        found = [SEEN, replace(SEEN, error_m=9.0), replace(SEEN, group="office")]
        lines = statement(found, np.array([0.999, 0.995, 0.5]), 0.99)
        assert cue_array(found).shape == (3, len(NAMES))
        assert "2 accepted,   1 wrong" in next(line for line in lines if line.split()[0] == "recorded")
        assert "0 accepted,   0 wrong" in next(line for line in lines if line.split()[0] == "office")
        assert "0.3–0.5: 1/3" in lines[-1]


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
