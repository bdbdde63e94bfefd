"""Whether a placement is accepted and, in words, why or why not."""

import math
import re
from dataclasses import replace

import pytest

from mapmerge.config import VerifyConfig
from mapmerge.match import Match, Rival
from mapmerge.match.verdict import contradicted, is_far_likelier, judge, too_little_structure
from mapmerge.prior import Prior
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.sim2 import Sim2
from mapmerge.verify import Scores
from tests.cues import CUES
from tests.floors import described, errors, filled, flat, pair_of_maps

LIMITS = VerifyConfig()
SURE = LIMITS.min_confidence
GOOD = Scores(
    score_m=60.0,
    acceptance=0.98,
    overlap_m2=40.0,
    overlap_fraction=0.6,
    wall_agreement=0.95,
    matched_wall_m=45.0,
    violated_wall_m=1.0,
)


def among(**contest):
    """Return the cues with another standing among rivals."""
    return replace(CUES, contest=replace(CUES.contest, **contest))


class TestJudge:
    def test_accepts_what_is_sure(self):
        reason = judge(GOOD, CUES, 0.9999, LIMITS)
        assert reason.code is ReasonCode.ACCEPTED
        assert "40 m²" in reason.message

    @pytest.mark.parametrize(
        ("change", "code", "says"),
        [
            ({"overlap_m2": 5.9}, ReasonCode.TOO_LITTLE_OVERLAP, "5.9 m²"),
            ({"matched_wall_m": 7.9}, ReasonCode.TOO_LITTLE_OVERLAP, "7.9 m of wall"),
        ],
    )
    @pytest.mark.parametrize("confidence", [0.1, 1.0])
    def test_too_little_is_never_accepted(self, change, code, says, confidence):
        reason = judge(replace(GOOD, **change), CUES, confidence, LIMITS)
        assert reason.code is code
        assert says in reason.message

    @pytest.mark.parametrize(
        ("scores", "cues", "code", "says"),
        [
            ({"wall_agreement": 0.7}, {}, ReasonCode.WALLS_DISAGREE, "70%"),
            ({"wall_agreement": 0.79}, {}, ReasonCode.WALLS_DISAGREE, "79%"),
            ({"score_m": -3.0}, {}, ReasonCode.WALLS_DISAGREE, "95%"),
            ({"wall_agreement": 0.7}, {"lead_log_odds": 0.1}, ReasonCode.WALLS_DISAGREE, "70%"),
            ({}, {"lead_log_odds": 0.1}, ReasonCode.AMBIGUOUS, "0.90 times as likely"),
            ({}, {"lead_log_odds": -3.0}, ReasonCode.AMBIGUOUS, "20 times as likely"),
            ({}, {"lead_log_odds": -9.0}, ReasonCode.AMBIGUOUS, "more than 1000 times as likely"),
            ({}, {"lead_log_odds": 2.99}, ReasonCode.AMBIGUOUS, "0.050 times as likely"),
            (
                {},
                {},
                ReasonCode.LOW_CONFIDENCE,
                "on 40 m² 45 m of wall agree, 95% of what can be compared",
            ),
            # of strangers many placements are as unlikely: they do not fit in two places, but in none
            ({}, {"lead_log_odds": 0.1, "log_odds": -0.1}, ReasonCode.LOW_CONFIDENCE, "45 m of wall agree"),
        ],
    )
    def test_says_what_speaks_most_against_what_is_not_sure(self, scores, cues, code, says):
        reason = judge(replace(GOOD, **scores), among(**cues), 0.42, LIMITS)
        assert reason.code is code
        assert says in reason.message
        assert "42%" in reason.message

    @pytest.mark.parametrize("exactly", [{"overlap_m2": 6.0}, {"matched_wall_m": 8.0}, {"wall_agreement": 0.7}])
    def test_the_limits_themselves_pass(self, exactly):
        assert judge(replace(GOOD, **exactly), CUES, SURE, LIMITS).code is ReasonCode.ACCEPTED

    def test_only_the_confidence_decides_over_what_is_large_enough_and_not_hopeless(self):
        poor = replace(GOOD, wall_agreement=0.71), among(likeness=0.99, lead_log_odds=0.0)
        assert judge(*poor, SURE, LIMITS).code is ReasonCode.ACCEPTED

    @pytest.mark.parametrize("confidence", [0.1, 1.0])
    def test_walls_most_of_which_disagree_are_never_accepted(self, confidence):
        reason = judge(replace(GOOD, wall_agreement=0.699), CUES, confidence, LIMITS)
        assert reason.code is ReasonCode.WALLS_DISAGREE
        assert "69% agree, less than 70%" in reason.message

    def test_the_other_half_says_nothing_of_what_is_refused_in_any_case(self):
        """Strangers fit a little in many ways."""
        assert judge(GOOD, CUES, 0.1, LIMITS, CUES.fit).code is ReasonCode.LOW_CONFIDENCE

    @pytest.mark.parametrize("confidence", [LIMITS.witness_confidence, 0.9999])
    def test_the_other_half_of_a_symmetric_building_contests_it_however_sure_it_is(self, confidence):
        reason = judge(GOOD, CUES, confidence, LIMITS, replace(CUES.fit, overlap_m2=9.0))
        assert reason.code is ReasonCode.AMBIGUOUS
        assert "turned by half, walls agree as well, on 9 m² instead of 40 m²" in reason.message

    @pytest.mark.parametrize(("lead_log_odds", "says"), [(12.0, "less than 0.001"), (5.0, "0.007"), (1.0, "0.37")])
    def test_says_how_likely_the_next_best_is(self, lead_log_odds, says):
        assert f"{says} times as likely" in judge(GOOD, among(lead_log_odds=lead_log_odds), SURE, LIMITS).message

    @pytest.mark.parametrize("change", [{"overlap_m2": 5.97}, {"matched_wall_m": 7.999}])
    def test_a_near_miss_does_not_read_like_a_contradiction(self, change):
        """Not "the maps share 6.0 m² of ground, less than 6 m²"."""
        message = judge(replace(GOOD, **change), CUES, 1.0, LIMITS).message
        found, least = map(float, re.findall(r"\d+(?:\.\d+)?", message))
        assert found < least

    @pytest.mark.parametrize("least", [0.5, 0.9, 0.95, 0.999, 0.9999])
    @pytest.mark.parametrize("below", [1e-9, 1e-6, 1e-4, 0.01, 0.3])
    def test_neither_does_a_confidence_that_is_nearly_enough(self, least, below):
        message = judge(GOOD, CUES, least - below, replace(LIMITS, min_confidence=least)).message
        said = re.search(r"confidence is (\d+(?:\.\d+)?)%, less than (\d+(?:\.\d+)?)%", message)
        found, limit = map(float, said.groups())
        assert found < limit
        assert limit == pytest.approx(100 * least)


class TestStructure:
    def test_both_maps_need_walls(self):
        rich, poor = described(flat()), described(filled(100, 1, 100))
        assert too_little_structure(rich, rich, LIMITS) is None
        for pair in ((rich, poor), (poor, rich), (poor, poor)):
            reason = too_little_structure(*pair, LIMITS)
            assert reason.code is ReasonCode.TOO_LITTLE_STRUCTURE
            assert "5.0 m of wall" in reason.message

    @pytest.mark.parametrize("least_m", [0.0, 8.0])
    def test_without_a_wall_nothing_can_be_placed_whatever_is_asked_for(self, least_m):
        rich, none = described(flat()), described(filled(0, 30, 40))
        limits = replace(LIMITS, min_matched_wall_m=least_m)
        for pair in ((rich, none), (none, rich), (none, none)):
            reason = too_little_structure(*pair, limits)
            assert reason.code is ReasonCode.TOO_LITTLE_STRUCTURE
            assert reason.message == "one of the maps shows no wall at all"


class TestFarLikelier:
    """Than a placement that fits the maps as well as any."""

    HERE = Match(Sim2(), GOOD, True, Reason(ReasonCode.ACCEPTED, "fits"), cues=CUES)

    @pytest.mark.parametrize(("log_odds", "is_likelier"), [(3.1, True), (2.9, False), (-5.0, False)])
    def test_by_the_odds_not_by_the_score(self, log_odds, is_likelier):
        found = replace(
            self.HERE, scores=replace(GOOD, score_m=1.0), cues=among(log_odds=CUES.contest.log_odds + log_odds)
        )
        assert is_far_likelier(found, self.HERE, LIMITS) is is_likelier

    @pytest.mark.parametrize("change", [{"overlap_m2": 5.9}, {"matched_wall_m": 7.9}, {"wall_agreement": 0.69}])
    def test_not_where_the_maps_share_or_agree_too_little(self, change):
        found = replace(self.HERE, scores=replace(GOOD, **change), cues=among(log_odds=30.0))
        assert not is_far_likelier(found, self.HERE, LIMITS)

    def test_a_method_without_odds_cannot_tell(self):
        assert not is_far_likelier(replace(self.HERE, cues=None), self.HERE, LIMITS)


class TestContradicted:
    PRIOR = Prior(Sim2(5.0, 1.0, 0.3), 0.1, 0.1, 0.02, "given for r2")
    REASON = Reason(ReasonCode.WALLS_DISAGREE, "of the walls in the overlap 12% agree")
    BELIEVED = Match(Sim2(5.02, 1.0, 0.3), GOOD, False, REASON, rivals=(Rival(Sim2(5.1, 1.0, 0.3), 1.0),))
    ELSEWHERE = Match(Sim2(-1.0, 2.0, 1.0), replace(GOOD, score_m=70.0), True, Reason(ReasonCode.ACCEPTED, "fits"))

    def test_shows_the_free_placement_as_first_rival(self):
        match = contradicted(
            self.BELIEVED, self.ELSEWHERE, self.PRIOR, pair_of_maps(flat(), flat(), self.PRIOR), LIMITS
        )
        assert not match.accepted
        assert match.reason.code is ReasonCode.PRIOR_CONTRADICTED
        assert match.target_from_source == self.BELIEVED.target_from_source
        assert match.rivals == (Rival(Sim2(-1.0, 2.0, 1.0), 70.0), *self.BELIEVED.rivals)
        for words in ("given for r2", self.REASON.message, "-1.00,2.00,57.3deg"):
            assert words in match.reason.message

    def test_says_how_likely_that_is_where_the_method_can_tell(self):
        match, elsewhere = (
            replace(item, cues=among(log_odds=log_odds))
            for item, log_odds in ((self.BELIEVED, 1.0), (self.ELSEWHERE, 5.0))
        )
        pair = pair_of_maps(flat(), flat(), self.PRIOR)
        assert contradicted(match, elsewhere, self.PRIOR, pair, LIMITS).rivals[0].likelihood == pytest.approx(
            math.exp(4.0)
        )

    def test_without_a_placement_the_believed_one_is_shown_with_its_figures(self):
        nothing = Match(None, None, False, Reason(ReasonCode.NO_CANDIDATE, "no placement at all was found"))
        match = contradicted(nothing, self.ELSEWHERE, self.PRIOR, pair_of_maps(flat(), flat(), self.PRIOR), LIMITS)
        assert match.reason.code is ReasonCode.PRIOR_CONTRADICTED
        assert errors(match.target_from_source, self.PRIOR.target_from_source, (0.0, 0.0)) == pytest.approx((0.0, 0.0))
        assert match.scores.overlap_m2 < 40.0
        assert match.rivals[0].target_from_source == Sim2(-1.0, 2.0, 1.0)
