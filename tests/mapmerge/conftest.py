"""A matcher whose answers a test decides."""

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from mapmerge.match import MATCHERS, Match, Matcher, Rival
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.sim2 import IDENTITY
from mapmerge.verify import Scores


class ScriptedMatcher(Matcher):
    """Knows maps by the value that fills them, merged maps by the values of all, and counts what it is asked.

    It follows no placement, and has hope for all maps, unless a test says otherwise.
    """

    config = MergeConfig(method="scripted")

    def __init__(self):
        self.answers = {}
        self.prepared = []
        self.matched = []
        self.priors = []
        self.followed = []
        self.glanced = []
        self.is_hope = True
        self.follows = lambda _: None

    def map_of(self, value, resolution_m=0.05):
        return Grid(np.full((20, 20), value, np.int8), resolution_m)

    def fits(self, target, source, pose=IDENTITY, score_m=50.0, confidence=None, weight=None):
        """From now on, the map filled with ``source`` lies at ``pose`` on that filled with ``target``."""
        reason = Reason(ReasonCode.ACCEPTED, f"{source} fits {target}")
        scores = self.scores(score_m)
        self.answers[target, source] = Match(pose, scores, True, reason, confidence, weight=weight)

    def misfits(
        self,
        target,
        source,
        score_m=5.0,
        code=ReasonCode.WALLS_DISAGREE,
        pose=IDENTITY,
        confidence=None,
        wall_agreement=0.9,
        evidence=(),
        rival=None,
    ):
        reason = Reason(code, f"{source} does not fit {target}")
        scores = replace(self.scores(score_m), wall_agreement=wall_agreement)
        rivals = () if rival is None else (Rival(IDENTITY, 1.0, rival),)
        self.answers[target, source] = Match(pose, scores, False, reason, confidence, rivals=rivals, evidence=evidence)

    @staticmethod
    def scores(score_m):
        return Scores(score_m, 0.5, 20.0, 0.25, 0.9, 10.0, 10.0)

    def prepare(self, grid, resolution_m, config):
        assert config is self.config
        values = np.unique(grid.cells[grid.known]).tolist()
        self.prepared.append((values[0] if len(values) == 1 else tuple(values), resolution_m))
        return self.prepared[-1]

    def match(self, target, source, config, prior=None):
        assert config is self.config
        assert target[1] == source[1]
        pair = target[0], source[0]
        self.matched.append(pair)
        self.priors.append(prior)
        nothing = Reason(ReasonCode.NO_CANDIDATE, f"nothing is known of {pair}")
        return self.answers.get(pair, Match(None, None, accepted=False, reason=nothing))

    def follow(self, target, source, known, config, prior=None):
        assert config is self.config
        self.followed.append((target[0], source[0]))
        self.priors.append(prior)
        return self.follows(known)

    def is_hopeful(self, target, source, config):
        assert config is self.config
        self.glanced.append((target[0], source[0]))
        return self.is_hope

    def calls(self):
        """Return what was matched since the last call."""
        matched, self.matched = self.matched, []
        return matched


@pytest.fixture
def scripted(monkeypatch):
    matcher = ScriptedMatcher()
    monkeypatch.setitem(sys.modules, "scripted_matcher", SimpleNamespace(Scripted=lambda: matcher))
    monkeypatch.setitem(MATCHERS, "scripted", "scripted_matcher:Scripted")
    return matcher
