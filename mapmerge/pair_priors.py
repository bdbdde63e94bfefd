"""What is believed of pairs of maps, from what is believed of each map alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mapmerge.outcome import Pair
from mapmerge.prior import Prior


def pair_priors(
    reference: str, pairs: Sequence[Pair], priors: Mapping[str, Prior], before: Mapping[Pair, Prior]
) -> dict[Pair, Prior]:
    """Return what is believed of each pair: the very value of before, where it differs from that by jitter only.

    Parameters
    ----------
    priors
        Where robots' map frames are believed to lie in the reference's.
    before
        What was returned last.
    """
    believed: dict[Pair, Prior] = {}
    for pair in pairs:
        prior, known = _prior_of(pair, reference, priors), before.get(pair)
        if prior is not None:
            believed[pair] = known if known is not None and known.is_about(prior) else prior
    return believed


def _prior_of(pair: Pair, reference: str, priors: Mapping[str, Prior]) -> Prior | None:
    """Return what is believed of a pair, from what is believed of both robots' places in the reference's frame."""
    target, source = pair
    if source not in priors or (target != reference and target not in priors):
        return None
    return priors[source] if target == reference else priors[target].inverse().compose(priors[source])
