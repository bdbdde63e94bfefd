"""The examples for CI do what they say: their steps are run in a shell, as a runner would, but without the network."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import pytest
from junitparser import JUnitXml
from packaging.requirements import Requirement
from ruamel.yaml import YAML

from tests.data_paths import ROOT

EXAMPLES = ROOT / "docs/examples/ci"
BASH = shutil.which("bash")
pytestmark = pytest.mark.skipif(BASH is None or os.name == "nt", reason="there is no bash")


@dataclass(frozen=True)
class Runner:
    """A folder in which steps are run; ``pip`` only notes what it is asked for, and ``replay`` is this one."""

    folder: Path

    def __post_init__(self) -> None:
        tools = self.folder / "bin"
        tools.mkdir()
        self._tool("pip", 'echo "$@" >> "$RUNNER_FOLDER/pip.txt"')
        self._tool("replay", f'PYTHONPATH={ROOT} exec {sys.executable} -m replay "$@"')

    def _tool(self, name: str, text: str) -> None:
        path = self.folder / "bin" / name
        path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
        path.chmod(0o755)

    @property
    def installed(self) -> str:
        return (self.folder / "pip.txt").read_text(encoding="utf-8")

    @property
    def summary(self) -> Path:
        return self.folder / "summary.md"

    def run(self, script: str, cwd: Path, **variables: str) -> subprocess.CompletedProcess[str]:
        """Run a script as GitHub runs one whose shell is bash."""
        given = {
            "PATH": f"{self.folder / 'bin'}{os.pathsep}{os.environ['PATH']}",
            "RUNNER_FOLDER": str(self.folder),
            "GITHUB_STEP_SUMMARY": str(self.summary),
            **variables,
        }
        command = [str(BASH), "--noprofile", "--norc", "-eo", "pipefail", "-c", script]
        return subprocess.run(
            command, cwd=cwd, env={**os.environ, **given}, capture_output=True, text=True, timeout=300
        )


@pytest.fixture
def runner(tmp_path: Path) -> Runner:
    folder = tmp_path / "runner"
    folder.mkdir()
    return Runner(folder)


@pytest.fixture
def work(tmp_path: Path) -> Path:
    """A checkout of somebody's repository with a mission."""
    maps = tmp_path / "work" / "maps"
    maps.mkdir(parents=True)
    shutil.copy(ROOT / "samples/two_robots.mcap", maps / "mission.mcap")
    shutil.copy(EXAMPLES / "expect.yaml", maps / "expect.yaml")
    return maps.parent


def read(path: Path) -> Any:
    return YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))


def steps(name: str) -> Iterator[Mapping[str, Any]]:
    """Yield the steps of a workflow, whose form is that of GitHub."""
    workflow = read(EXAMPLES / name)
    assert {"name", "on", "jobs"} <= workflow.keys()
    for job in workflow["jobs"].values():
        assert job["runs-on"]
        for step in job["steps"]:
            assert ("run" in step) != ("uses" in step)
            yield step


def scripts(name: str) -> list[tuple[str, bool]]:
    """Return what is run, and whether it is run also after a failure."""
    return [(step["run"], step.get("if") == "always()") for step in steps(name) if "run" in step]


def test_every_example_is_a_workflow() -> None:
    names = sorted(path.name for path in EXAMPLES.glob("replay-*.yml"))
    assert names == ["replay-check.yml", "replay-compare.yml"]
    for name in names:
        pinned = [step["uses"] for step in steps(name) if "uses" in step]
        assert all(re.fullmatch(r"actions/[a-z-]+@v\d+", each) for each in pinned)


def test_a_check_that_holds(runner: Runner, work: Path) -> None:
    for script, _ in scripts("replay-check.yml"):
        ran = runner.run(script, work)
        assert ran.returncode == 0, ran.stdout + ran.stderr
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = Requirement(runner.installed.strip().removeprefix("install "))
    assert wanted.name == project["name"]
    assert wanted.url == "git+https://example.com/OWNER/replay@TAG"  # no package index has it
    (suite,) = JUnitXml.fromfile(str(work / "replay.xml"))
    assert (suite.tests, suite.failures) == (10, 0)
    assert "all 10 expectations hold" in runner.summary.read_text(encoding="utf-8")
    assert cv2.imread(str(work / "merged.png")) is not None


def test_a_check_that_does_not_hold_fails_its_step_and_is_still_shown(runner: Runner, work: Path) -> None:
    expect = work / "maps/expect.yaml"
    expect.write_text(expect.read_text(encoding="utf-8").replace("x_m: 28", "x_m: 27"), encoding="utf-8")
    statuses = [(runner.run(script, work).returncode, always) for script, always in scripts("replay-check.yml")]
    assert statuses == [(0, False), (1, False), (0, True)]
    (suite,) = JUnitXml.fromfile(str(work / "replay.xml"))
    assert suite.failures == 1
    assert "1 of 10 expectations does not hold" in runner.summary.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("settings", "status"), [("[merge.verify]\nmin_confidence = 0.9\n", 0), ('robots = ["r2", "r1"]\n', 1)]
)
def test_a_comparison_of_two_branches(runner: Runner, work: Path, settings: str, status: int) -> None:
    shutil.copytree(work, work.parent / "base")
    shutil.move(work.parent / "base", work / "base")
    (work / "base/maps/replay.toml").write_text('robots = ["r1", "r2"]\n', encoding="utf-8")
    (work / "maps/replay.toml").write_text(settings, encoding="utf-8")
    *_, (script, _) = scripts("replay-compare.yml")
    ran = runner.run(script, work)
    assert ran.returncode == status, ran.stdout + ran.stderr
    verdict = "difference between before.json and after.json"
    assert (f"1 {verdict}" if status else f"no {verdict}") in ran.stdout.splitlines()


def test_the_action(runner: Runner, work: Path) -> None:
    action = read(ROOT / "action.yml")
    assert action["runs"]["using"] == "composite"
    ran = []
    for step in action["runs"]["steps"]:
        if "run" not in step:
            continue
        assert step["shell"] == "bash"
        # what is given must not become a part of the script
        assert "${{" not in step["run"]
        given = {"runs": "maps/mission.mcap", "expect": "maps/expect.yaml", "flags": "--robots r1,r2"}
        values = {name: str(given.get(name, known.get("default"))) for name, known in action["inputs"].items()}
        variables = {name: _filled(text, values) for name, text in step.get("env", {}).items()}
        ran.append(runner.run(step["run"], work, GITHUB_ACTION_PATH=str(ROOT), **variables))
    assert [each.returncode for each in ran] == [0, 0], [each.stderr for each in ran]
    assert (ROOT / "requirements/run.txt").is_file()
    assert f"--require-hashes -r {ROOT}/requirements/run.txt" in runner.installed
    (suite,) = JUnitXml.fromfile(str(work / "replay.xml"))
    assert suite.failures == 0
    assert runner.summary.is_file()


def _filled(text: str, values: Mapping[str, str]) -> str:
    return re.sub(r"\$\{\{ inputs\.(\w+) \}\}", lambda found: values[found[1]], text)


def test_the_documents_show_the_steps_that_are_run() -> None:
    page = (ROOT / "docs/ci.md").read_text(encoding="utf-8")
    for script, always in scripts("replay-check.yml"):
        if not always:
            assert " ".join(script.split()) in " ".join(page.split())
