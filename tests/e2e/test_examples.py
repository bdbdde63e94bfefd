"""The examples run, say what they promise, and fit a page; those of docstrings are right."""

from __future__ import annotations

import doctest
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from tests.data_paths import ROOT

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
SAYS = {
    "merge_two_grids.py": (
        "r2: merged at x 28.16 m, y 0.90 m, yaw 124.9°",
        "the origin of r2's map lies at (28.1",
        "map1: unmerged: not placed on map0: ",
    ),
    "feed_a_merger.py": (
        "r1 and r2 were searched, as both maps are there for the first time",
        "r2 placed: placed on r1: ",
        "r2: merged at x 28.16 m",
    ),
    "replay_a_recording.py": (
        "merging r1 from /r1/map, r2 from /r2/map",
        "1 of 16 messages; placed: nobody yet",
        "r2 is merged",
        "wrote merged.json, merged.mcap of 16 maps",
        "refused: there is no map of robot 'r3'",
    ),
}


def test_each_example_is_told_of() -> None:
    page = (ROOT / "examples" / "README.md").read_text(encoding="utf-8")
    assert sorted(SAYS) == [path.name for path in EXAMPLES]
    assert all(f"]({path.name})" in page for path in EXAMPLES)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.name)
def test_examples_run_and_say_what_they_promise(path: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-W", "error", str(path), str(tmp_path)]
    ran = subprocess.run(command, capture_output=True, text=True, encoding="utf-8", timeout=240, cwd=ROOT)
    assert ran.returncode == 0, ran.stderr
    assert ran.stderr == ""
    for words in SAYS[path.name]:
        assert words in ran.stdout


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.name)
def test_examples_fit_a_page(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 60
    assert text.count("\n# %% ") >= 3


@pytest.mark.parametrize("module", ["mapmerge.once", "replay.api"])
def test_examples_of_docstrings(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    found = doctest.testmod(import_module(module), raise_on_error=True)
    assert found.attempted >= 3
