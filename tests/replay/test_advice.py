"""There is something to do about every reason that is no success."""

from __future__ import annotations

import re

import pytest

from mapmerge.reasons import ReasonCode
from replay.advice import ADVICE
from replay.arguments import parsed
from tests.data_paths import ROOT

FINE = {ReasonCode.REFERENCE, ReasonCode.ACCEPTED}


@pytest.mark.parametrize("code", ReasonCode)
def test_every_reason_has_a_hint_unless_there_is_nothing_to_do(code: ReasonCode) -> None:
    assert bool(ADVICE[code]) == (code not in FINE)


@pytest.mark.parametrize("code", sorted(set(ReasonCode) - FINE))
def test_a_hint_is_a_sentence_of_flags_that_are_there(code: ReasonCode) -> None:
    hint = ADVICE[code]
    assert hint[0].isupper()
    assert hint.endswith(".")
    assert hint.count("`") % 2 == 0
    merge = parsed(["merge", "run.mcap"])
    for flag in re.findall(r"--([a-z-]+)", hint):
        assert hasattr(merge, flag.replace("-", "_")), flag


@pytest.mark.parametrize("code", [code for code in ReasonCode if code not in FINE])
def test_the_document_says_the_same(code: ReasonCode) -> None:
    page = (ROOT / "docs" / "tuning.md").read_text(encoding="utf-8")
    (row,) = (line for line in page.splitlines() if line.startswith(f"| `{code}`"))
    assert ADVICE[code] in row
