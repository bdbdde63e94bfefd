"""Laws of the confidence, whatever model it comes from."""

import math
from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from mapmerge.match.confidence import confidence, contest, log_odds_of
from mapmerge.match.cues import Fit

shares = st.floats(0.0, 1.0)
lengths_m = st.floats(0.0, 500.0)
ROUNDING = 1e-12


@st.composite
def fits(draw):
    score_m, contradicted_m = draw(st.floats(-200.0, 800.0)), draw(lengths_m)
    return Fit(
        score_m=score_m,
        contradicted_m=contradicted_m,
        wall_agreement=draw(shares),
        matched_wall_m=draw(lengths_m),
        slack_agreement=draw(shares),
        far_share=draw(shares),
        slack_far_share=draw(shares),
        solidity=solidity(score_m, contradicted_m),
        acceptance=draw(shares),
        overlap_m2=draw(st.floats(0.0, 5000.0)),
        overlap_fraction=draw(shares),
        aligned=draw(st.floats(-1.0, 1.0)),
        held_m=draw(lengths_m),
    )


def solidity(score_m, contradicted_m):
    return math.log((1.0 + max(0.0, score_m)) / (1.0 + contradicted_m))


def sure(first, others=()):
    """Return the confidence of the first of some placements."""
    everything = [first, *others]
    return confidence(contest(everything, [log_odds_of(fit) for fit in everything]))


def better(fit, share):
    """Return the same with more agreement and less against it."""
    contradicted_m = fit.contradicted_m * (1.0 - share)
    return replace(
        fit,
        slack_agreement=fit.slack_agreement + share * (1.0 - fit.slack_agreement),
        contradicted_m=contradicted_m,
        far_share=fit.far_share * (1.0 - share),
        slack_far_share=fit.slack_far_share * (1.0 - share),
        solidity=solidity(fit.score_m, contradicted_m),
    )


def larger(fit, factor):
    """Return the same fit of maps that are so many times as large."""
    score_m, contradicted_m = fit.score_m * factor, fit.contradicted_m * factor
    return replace(
        fit,
        score_m=score_m,
        contradicted_m=contradicted_m,
        matched_wall_m=fit.matched_wall_m * factor,
        solidity=solidity(score_m, contradicted_m),
        overlap_m2=fit.overlap_m2 * factor,
        held_m=fit.held_m * factor,
    )


@given(fits(), st.lists(fits(), max_size=4))
def test_is_a_probability(fit, others):
    assert 0.0 <= sure(fit, others) <= 1.0


@given(fits(), st.lists(fits(), max_size=4), shares)
def test_less_against_it_never_lowers_it(fit, others, share):
    assert log_odds_of(better(fit, share)) >= log_odds_of(fit) - ROUNDING
    assert sure(better(fit, share), others) >= sure(fit, others) - ROUNDING


@given(fits(), fits(), st.lists(fits(), max_size=3), shares)
def test_a_rival_with_less_against_it_never_raises_it(fit, rival, others, share):
    assert sure(fit, [better(rival, share), *others]) <= sure(fit, [rival, *others]) + ROUNDING


@given(fits(), st.lists(fits(), max_size=3), fits())
def test_one_more_rival_never_raises_it(fit, others, rival):
    assert sure(fit, [*others, rival]) <= sure(fit, others) + ROUNDING


@given(fits().filter(lambda fit: fit.score_m >= fit.contradicted_m), st.floats(1.0, 5.0))
def test_more_of_the_same_never_lowers_it(fit, factor):
    """Where more speaks against a placement than for it, more of the same is more against it."""
    assert log_odds_of(larger(fit, factor)) >= log_odds_of(fit) - ROUNDING
    assert sure(larger(fit, factor)) >= sure(fit) - ROUNDING


@given(fits(), st.lists(fits(), max_size=3))
def test_of_two_placements_that_are_as_likely_one_is_wrong(fit, others):
    """However well both fit."""
    assert sure(fit, [fit, *others]) <= 0.5 + ROUNDING
