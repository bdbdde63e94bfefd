"""How sure placements are, and how they stand among others."""

import math
from dataclasses import asdict, replace

import pytest

from mapmerge.config import HIGHEST_CONFIDENCE
from mapmerge.match.confidence import UNRIVALLED, Additive, Curve, confidence, contest, log_odds_of, logistic
from tests.cues import CONTEST, FIT


def among(**changes):
    return replace(CONTEST, **changes)


class TestCurve:
    CURVE = Curve((1.0, 2.0, 4.0), (3.0, -2.0))

    @pytest.mark.parametrize(
        ("value", "adds"), [(0.0, 0.0), (1.0, 0.0), (1.5, 1.5), (2.0, 3.0), (3.0, 2.0), (4.0, 1.0), (9.0, 1.0)]
    )
    def test_is_linear_between_its_knots_and_flat_beyond(self, value, adds):
        assert self.CURVE.at(value) == pytest.approx(adds)

    def test_a_model_adds_them_up(self):
        model = Additive(-1.0, {"share": Curve((0.0, 1.0), (2.0,)), "lead_log_odds": self.CURVE})
        assert model.log_odds(replace(CONTEST, share=0.25, lead_log_odds=9.0)) == pytest.approx(-1.0 + 0.5 + 1.0)


class TestContest:
    POOR = replace(FIT, score_m=30.0)

    def test_alone_nothing_competes(self):
        found = contest([FIT], [2.0])
        assert (found.log_odds, found.lead_log_odds, found.likeness) == (2.0, UNRIVALLED, 0.0)
        assert found.lead_m == FIT.score_m
        assert found.share == pytest.approx(logistic(2.0))

    def test_rivals_take_their_share(self):
        found = contest([FIT, self.POOR, self.POOR], [3.0, 1.0, 0.0])
        assert found.lead_log_odds == pytest.approx(2.0)
        total = 1.0 + math.exp(3.0) + math.exp(1.0) + 1.0
        assert found.share == pytest.approx(math.exp(3.0) / total)
        assert found.likeness == pytest.approx(0.5)
        assert found.crowd == pytest.approx(1.0 + math.exp(-4.0) + math.exp(-6.0))
        assert found.lead_m == pytest.approx(30.0)

    def test_one_that_scores_more_but_is_less_likely_leaves_no_lead_in_metres(self):
        found = contest([self.POOR, FIT], [3.0, 1.0])
        assert (found.lead_m, found.likeness) == (0.0, 1.0)
        assert found.lead_log_odds == pytest.approx(2.0)

    @pytest.mark.parametrize("score_m", [-5.0, 0.0])
    def test_a_score_below_nothing_competes_with_none(self, score_m):
        alone = contest([FIT], [3.0])
        found = contest([FIT, replace(self.POOR, score_m=score_m)], [3.0, -9.0])
        assert (found.likeness, found.lead_m) == (alone.likeness, alone.lead_m)

    def test_the_order_of_rivals_does_not_matter(self):
        rivals = [self.POOR, replace(FIT, score_m=10.0), FIT]
        one, other = (
            contest([FIT, *fits], [2.0, *log_odds])
            for fits, log_odds in ((rivals, [1.0, 0.0, -1.0]), (rivals[::-1], [-1.0, 0.0, 1.0]))
        )
        assert asdict(one) == pytest.approx(asdict(other))

    @pytest.mark.parametrize("size", [1e3, -1e3])
    def test_extreme_odds_stay_finite(self, size):
        found = contest([FIT, FIT], [size, size])
        assert 0.0 <= found.share <= 0.5
        assert found.lead_log_odds == 0.0


class TestConfidence:
    def test_a_clear_placement_is_sure(self):
        assert confidence(CONTEST) > 0.99

    @pytest.mark.parametrize("count", [2, 3, 8])
    def test_of_placements_that_are_as_likely_one_is_right(self, count):
        """However much wall agrees, such as at a corridor whose rooms nobody can tell apart."""
        assert confidence(contest([FIT] * count, [9.0] * count)) <= 1.0 / count

    def test_one_that_is_less_likely_than_another_is_not_believed(self):
        assert confidence(contest([FIT, FIT], [6.0, 9.0])) < 0.01

    def test_no_placement_is_surer_than_was_measured(self):
        best = among(lead_log_odds=1e3, log_odds=1e3, share=1.0, likeness=0.0, lead_m=1e3, clearance=9.0)
        assert confidence(best) <= HIGHEST_CONFIDENCE < 1.0

    def test_the_best_of_many_searches_is_less_sure(self):
        unsure = among(log_odds=1.0, lead_log_odds=2.0, share=0.7, clearance=1.0)
        alone, of_two, of_many = (confidence(unsure, tries) for tries in (1.0, 2.0, 13.0))
        assert 0.5 < alone < HIGHEST_CONFIDENCE
        assert of_two / (1.0 - of_two) == pytest.approx(alone / (1.0 - alone) / 2)
        assert of_many / (1.0 - of_many) == pytest.approx(alone / (1.0 - alone) / 13)


def test_odds_fall_where_walls_stand_in_free_space():
    assert log_odds_of(
        replace(FIT, slack_agreement=0.8, far_share=0.1, slack_far_share=0.1, solidity=1.6)
    ) < log_odds_of(FIT)
