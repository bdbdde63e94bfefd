"""Where something to look at outputs with is missing, a test says so; where it must be there, it fails."""

from __future__ import annotations

import pytest

from tests.data_paths import ROOT
from tests.viewers import require


@pytest.mark.parametrize("required", ["", "1"])
def test_where_nothing_is_missing_a_test_goes_on(monkeypatch: pytest.MonkeyPatch, required: str) -> None:
    monkeypatch.setenv("REPLAY_REQUIRE_VIEWERS", required)
    try:
        require(None)
    except (pytest.skip.Exception, pytest.fail.Exception) as error:  # a skip would be no failure of this test
        raise AssertionError("there is nothing to skip or to fail for") from error


def test_what_is_missing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("REPLAY_REQUIRE_VIEWERS", raising=False)
    with pytest.raises(pytest.skip.Exception, match="there is no browser"):
        require("there is no browser")


def test_it_may_be_forbidden_to_skip(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("REPLAY_REQUIRE_VIEWERS", "1")
    with pytest.raises(pytest.fail.Exception, match="there is no browser"):
        require("there is no browser")


def test_ci_installs_them_and_forbids_the_skip() -> None:
    text = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    for package in ("mesa-vulkan-drivers", "chromium", "chromium-driver"):
        assert f" {package} " in text
    assert text.index("REPLAY_REQUIRE_VIEWERS=1") < text.index("make test")
