"""The command: what it prints, writes and returns."""

import json

import pytest

from benchmarks import truth
from benchmarks.cases import Case

CASES = [Case("home", 1, "same place"), Case("home", 1, "other building")]


@pytest.fixture
def few_cases(monkeypatch):
    """Have the command measure two pairs only."""
    monkeypatch.setattr(truth, "cases", lambda _share: CASES)


@pytest.mark.usefixtures("few_cases")
def test_simulated_pairs(tmp_path, capsys):
    path = tmp_path / "results.json"
    arguments = ["--parts", "simulated", "--processes", "1", "--json", str(path)]
    status = truth.main(arguments)
    printed = capsys.readouterr().out
    assert "by kind and overlap" in printed
    assert "Held out of the fit" in printed
    assert status == int("FAILS" in printed)
    results = json.loads(path.read_text(encoding="utf-8"))["Result"]
    assert [item["related"] for item in results] == ["same place", "other building"]
    assert results[1]["verdict"] in ("refused", "false merge")


@pytest.mark.usefixtures("few_cases")
def test_without_the_shared_data(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("REPLAY_DATA", str(tmp_path / "absent"))
    truth.main(["--parts", "real", "--processes", "1"])
    assert "REPLAY_DATA" in capsys.readouterr().err
