"""The commands beside the program: each answers what it takes, and refuses what it cannot use in one line."""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks import flags
from tests.data_paths import ROOT

OF_PROCESSES = {"benchmarks/faults/worker.py", "benchmarks/speed/child.py"}
"""Which the benchmarks start themselves."""

COMMANDS = sorted(
    name
    for folder in ("benchmarks", "samples", "scripts")
    for path in (ROOT / folder).rglob("*.py")
    if 'if __name__ == "__main__"' in path.read_text(encoding="utf-8")
    if (name := path.relative_to(ROOT).as_posix()) not in OF_PROCESSES
)


def ended(monkeypatch: pytest.MonkeyPatch, name: str, *arguments: object) -> object:
    """Run a command in this process, and return what it ends with."""
    monkeypatch.setattr(sys, "argv", [str(ROOT / name), *map(str, arguments)])
    with pytest.raises(SystemExit) as end:
        runpy.run_path(str(ROOT / name), run_name="__main__")
    return end.value.code


def test_there_are_commands() -> None:
    assert {"benchmarks/truth.py", "benchmarks/faults/__main__.py", "scripts/pictures.py"} <= set(COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_each_says_what_it_takes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    assert ended(monkeypatch, name, "--help") == 0
    assert capsys.readouterr().out.startswith("usage: ")


@pytest.mark.parametrize("name", ["samples/generate.py", "scripts/pictures.py", "scripts/reports.py"])
def test_files_that_need_others_here_find_them(name: str, tmp_path: Path) -> None:
    bare = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    ran = subprocess.run(
        [sys.executable, ROOT / name, "--help"], cwd=tmp_path, env=bare, capture_output=True, text=True, check=False
    )
    assert (ran.returncode, ran.stderr) == (0, "")


@pytest.mark.parametrize("name", COMMANDS)
def test_each_refuses_what_it_does_not_know(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    if name == "benchmarks/profile.py":
        pytest.skip("its other flags are those of replay merge")
    assert ended(monkeypatch, name, "--no-such-flag") == 2
    assert "error: " in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("benchmarks/calibrate.py {nowhere}", "nowhere: there is no such file"),
        ("benchmarks/calibrate.py {text}", "text: these are no observations of benchmarks.collect"),
        ("benchmarks/collect.py {nowhere}/out.jsonl", "there is no folder"),
        ("benchmarks/collect.py {new} --processes 0", "argument --processes: 0: expected 1 or more"),
        ("benchmarks/collect.py {new} --missions -1", "argument --missions: -1: expected 0 or more"),
        ("benchmarks/faults/__main__.py --tries -1", "argument --tries: -1: expected 1 or more"),
        ("benchmarks/faults/__main__.py --seconds nan", "argument --seconds: nan: expected more than 0"),
        ("benchmarks/large_recording.py --gib -1", "argument --gib: -1: expected more than 0"),
        ("benchmarks/large_recording.py --work {text}/a", "text is no folder"),
        ("benchmarks/long_mission.py --work {text}", "text is no folder"),
        ("benchmarks/long_mission.py --work {new} --side 9", "--side 9: a floor has 50 cells a side at least"),
        ("benchmarks/paper.py --pictures {text}", "text is no folder"),
        ("benchmarks/profile.py {new} --output {nowhere}/out.svg", "there is no folder"),
        ("benchmarks/speed/__main__.py --work {text}", "text is no folder"),
        ("benchmarks/speed/__main__.py --share 2", "argument --share: 2: expected more than 0, and 1 at most"),
        ("benchmarks/truth.py --share 0", "argument --share: 0: expected more than 0, and 1 at most"),
        ("benchmarks/truth.py --json {folder}", "a folder has this name"),
        ("samples/generate.py --out {text}/a", "Not a directory"),
        ("scripts/screenshot.py {text} {new}", "text: this is no Rerun recording"),
        ("scripts/step_pictures.py {nowhere} r2 {new}", "nowhere: it does not exist"),
        ("scripts/step_pictures.py {text} r2 {new}", "text: "),
        ("scripts/step_pictures.py {sample} r2 {new}", "two_robots.mcap: there are no pictures of r2"),
    ],
)
def test_what_cannot_be_used_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path, command: str, said: str
) -> None:
    places = {"nowhere": tmp_path / "nowhere", "new": tmp_path / "new", "folder": tmp_path, "text": tmp_path / "text"}
    places["text"].write_text("no recording")
    name, *arguments = command.format(**places, sample=ROOT / "samples" / "two_robots.mcap").split()
    assert ended(monkeypatch, name, *arguments) == 2
    lines = capsys.readouterr().err.splitlines()
    assert "error: " in lines[-1]
    assert said in lines[-1]


def test_what_can_be_used_is_taken(tmp_path: Path) -> None:
    (tmp_path / "text").touch()
    assert flags.file(str(tmp_path / "text")) == tmp_path / "text"
    assert flags.new_file(str(tmp_path / "text")) == tmp_path / "text"
    assert flags.folder(str(tmp_path / "a" / "b")) == tmp_path / "a" / "b"
    assert (flags.count("1"), flags.count_or_none("0"), flags.size("4.2"), flags.share("1")) == (1, 0, 4.2, 1.0)
