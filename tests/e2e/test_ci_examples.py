"""The examples for CI do what they say: their steps are run in a shell, as a runner would, but without the network."""

from __future__ import annotations

import json
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
        self.tool("pip", 'echo "$@" >> "$RUNNER_FOLDER/pip.txt"')
        self.tool("replay", f'PYTHONPATH={ROOT} exec {sys.executable} -m replay "$@"')

    def tool(self, name: str, text: str) -> None:
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


def scripts(name: str) -> list[tuple[str, str]]:
    """Return what is run, and on which condition."""
    return [(step["run"], step.get("if", "success()")) for step in steps(name) if "run" in step]


def is_run(condition: str, work: Path, *, failed: bool) -> bool:
    """Tell whether a step is run; of GitHub's expressions only these are known."""
    for term in condition.split(" && "):
        if term == "success()":
            holds = not failed
        elif term == "always()":
            holds = True
        else:
            names = re.fullmatch(r"hashFiles\('([\w.]+)'\) != ''", term)
            assert names, f"{term}: teach the tests what this is"
            holds = any(work.glob(names[1]))
        if not holds:
            return False
    return True


def statuses_of(name: str, runner: Runner, work: Path) -> list[int | None]:
    """Run the steps of a workflow; return the status of each, None of one that is left out."""
    statuses: list[int | None] = []
    for script, condition in scripts(name):
        is_wanted = is_run(condition, work, failed=any(statuses))
        statuses.append(runner.run(script, work).returncode if is_wanted else None)
    return statuses


def test_every_example_is_a_workflow() -> None:
    names = sorted(path.name for path in EXAMPLES.glob("replay-*.yml"))
    assert names == ["replay-check.yml", "replay-compare.yml"]
    for name in names:
        pinned = [step["uses"] for step in steps(name) if "uses" in step]
        assert all(re.fullmatch(r"actions/[a-z-]+@v\d+", each) for each in pinned)


def test_a_check_that_holds(runner: Runner, work: Path) -> None:
    assert statuses_of("replay-check.yml", runner, work) == [0, 0, 0]
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
    assert statuses_of("replay-check.yml", runner, work) == [0, 1, 0]
    (suite,) = JUnitXml.fromfile(str(work / "replay.xml"))
    assert suite.failures == 1
    assert "1 of 10 expectations does not hold" in runner.summary.read_text(encoding="utf-8")


def test_a_check_of_what_cannot_be_merged_is_the_only_step_that_fails(runner: Runner, work: Path) -> None:
    (work / "maps/mission.mcap").write_bytes(b"")
    assert statuses_of("replay-check.yml", runner, work) == [0, 2, None]
    (suite,) = JUnitXml.fromfile(str(work / "replay.xml"))
    assert suite.errors == 1


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


def acted(runner: Runner, work: Path, **given: str) -> list[subprocess.CompletedProcess[str]]:
    """Run the steps of the action."""
    action = read(ROOT / "action.yml")
    assert action["runs"]["using"] == "composite"
    ran = []
    for step in action["runs"]["steps"]:
        if "run" not in step:
            continue
        assert step["shell"] == "bash"
        # what is given must not become a part of the script
        assert "${{" not in step["run"]
        values = {name: str(given.get(name, known.get("default"))) for name, known in action["inputs"].items()}
        variables = {name: _filled(text, values) for name, text in step.get("env", {}).items()}
        ran.append(runner.run(step["run"], work, GITHUB_ACTION_PATH=str(ROOT), **variables))
    return ran


def test_the_action(runner: Runner, work: Path) -> None:
    ran = acted(runner, work, runs="maps/mission.mcap", expect="maps/expect.yaml", flags="--robots r1,r2")
    assert [each.returncode for each in ran] == [0, 0], [each.stderr for each in ran]
    assert (ROOT / "requirements/run.txt").is_file()
    assert f"--require-hashes -r {ROOT}/requirements/run.txt" in runner.installed
    (suite,) = JUnitXml.fromfile(str(work / "replay.xml"))
    assert suite.failures == 0
    assert runner.summary.is_file()


@pytest.mark.parametrize(
    ("runs", "names"),
    [
        ("first.mcap second.mcap", ["first.mcap", "second.mcap"]),
        ("first.mcap\nsecond.mcap", ["first.mcap", "second.mcap"]),
        ("  first.mcap\n\nthe second.mcap  \n", ["first.mcap", "the second.mcap"]),
        ("the second.mcap\n", ["the second.mcap"]),
        ("r1=first.mcap\nr2=the $(second).mcap\n", ["r1=first.mcap", "r2=the $(second).mcap"]),
    ],
)
def test_the_action_takes_all_recordings(runner: Runner, work: Path, runs: str, names: list[str]) -> None:
    told = runner.folder / "told"
    runner.tool("replay", 'printf "%s\\n" "$@" > "$RUNNER_FOLDER/told"')
    _, ran = acted(runner, work, runs=runs, expect="expect.yaml", flags="--robots\n r1,r2\n--strict")
    assert ran.returncode == 0, ran.stderr
    arguments = told.read_text(encoding="utf-8").splitlines()
    assert arguments[: len(names) + 1] == ["check", *names]
    assert arguments[len(names) + 1] == "--expect"
    assert arguments[-3:] == ["--robots", "r1,r2", "--strict"]


def test_the_action_merges_two_recordings_of_two_lines(runner: Runner, work: Path) -> None:
    shutil.copy(work / "maps/mission.mcap", work / "maps/the other.mcap")
    flags = "--topic r1=/r1/map --topic r2=/r2/map -o out.mcap --no-rrd"
    _, ran = acted(
        runner, work, runs="r1=maps/mission.mcap\nr2=maps/the other.mcap\n", expect="maps/expect.yaml", flags=flags
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    report = json.loads((work / "out.json").read_text(encoding="utf-8"))
    assert [item["name"] for item in report["inputs"]] == ["mission.mcap", "the other.mcap"]


def _filled(text: str, values: Mapping[str, str]) -> str:
    return re.sub(r"\$\{\{ inputs\.(\w+) \}\}", lambda found: values[found[1]], text)


def test_the_documents_show_the_steps_that_are_run() -> None:
    page = (ROOT / "docs/ci.md").read_text(encoding="utf-8")
    for script, condition in scripts("replay-check.yml"):
        if condition == "success()":
            assert " ".join(script.split()) in " ".join(page.split())
