"""Laws of the confidence, whatever model it comes from."""

import math
from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from mapmerge.match.confidence import confidence
from mapmerge.match.cues import Cues, clearance

shares = st.floats(0.0, 1.0)
lengths_m = st.floats(0.0, 500.0)


@st.composite
def cues_of_some_placement(draw):
    worse, better = sorted((draw(shares), draw(shares)))
    matched_wall_m, lead_m, slack_agreement = draw(lengths_m), draw(lengths_m), max(worse, draw(shares))
    return Cues(
        matched_wall_m=matched_wall_m,
        wall_agreement=worse,
        other_wall_agreement=better,
        far_share=draw(shares) * (1 - worse),
        slack_agreement=slack_agreement,
        bend_m=draw(st.floats(0.0, 2.0)),
        likeness=draw(shares),
        lead_m=lead_m,
        clearance=clearance(lead_m, matched_wall_m, slack_agreement),
        rival_agreement=draw(shares),
        acceptance=draw(shares),
        overlap_m2=draw(st.floats(0.0, 5000.0)),
        overlap_fraction=draw(shares),
        aligned=draw(st.floats(-1.0, 1.0)),
        held_m=draw(lengths_m),
        tight_share=draw(shares),
    )


anything = cues_of_some_placement()
ROUNDING = 1e-12


def changed(cues, **changes):
    """Return other cues, with the clearance that follows."""
    new = replace(cues, **changes)
    return replace(new, clearance=clearance(new.lead_m, new.matched_wall_m, new.slack_agreement))


@given(anything)
def test_is_a_probability(cues):
    assert math.isfinite(confidence(cues))
    assert 0.0 <= confidence(cues) <= 1.0


@given(anything, shares)
def test_more_agreement_never_lowers_it(cues, share):
    """Of both directions together: the worse one stays the worse one."""
    more = cues.wall_agreement + share * (1.0 - cues.wall_agreement)
    better = changed(
        cues,
        wall_agreement=more,
        other_wall_agreement=max(more, cues.other_wall_agreement),
        slack_agreement=max(more, cues.slack_agreement),
    )
    assert confidence(better) >= confidence(cues) - ROUNDING


@given(anything, shares)
def test_walls_amid_free_space_never_raise_it(cues, share):
    worse = changed(cues, far_share=cues.far_share + share * (1.0 - cues.far_share))
    assert confidence(worse) <= confidence(cues) + ROUNDING


@given(anything, shares)
def test_a_rival_that_is_more_alike_never_raises_it(cues, share):
    """Its score comes nearer, so that the lead shrinks."""
    likeness = cues.likeness + share * (1.0 - cues.likeness)
    lead_m = cues.lead_m * (1.0 - likeness) / max(1.0 - cues.likeness, 1e-9)
    rival = changed(cues, likeness=likeness, lead_m=min(lead_m, cues.lead_m))
    assert confidence(rival) <= confidence(cues) + ROUNDING


@given(anything, shares)
def test_a_rival_that_agrees_better_never_raises_it(cues, share):
    rival = changed(cues, rival_agreement=cues.rival_agreement + share * (1.0 - cues.rival_agreement))
    assert confidence(rival) <= confidence(cues) + ROUNDING


@given(anything.filter(lambda cues: cues.clearance >= 0.0), st.floats(1.0, 5.0))
def test_more_of_the_same_never_lowers_it(cues, factor):
    """Larger maps that agree as well as these: more wall, more ground, a larger lead, firmer hold.

    Where more speaks against a placement than it leads by, more of the same is more against it.
    """
    larger = changed(
        cues,
        matched_wall_m=cues.matched_wall_m * factor,
        held_m=cues.held_m * factor,
        lead_m=cues.lead_m * factor,
        overlap_m2=cues.overlap_m2 * factor,
    )
    assert confidence(larger) >= confidence(cues) - ROUNDING


@given(anything, st.floats(0.999, 1.0))
def test_of_two_placements_that_are_as_good_one_is_wrong(cues, likeness):
    """However well both fit."""
    assert confidence(changed(cues, likeness=likeness, lead_m=0.0)) <= 0.51
