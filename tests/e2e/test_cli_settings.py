"""`--config`, `--set` and `replay config`: what is said there is what flags would say."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path

import pytest

from tests.data_paths import ROOT
from tests.program import Program

SAMPLE = ROOT / "samples" / "two_robots.mcap"
FLAGS = (
    *("--robots", "r2,r1", "--start", "3.5", "--stop", "200", "--reorder-window", ".5", "--every", "2"),
    *("--topic", "/{robot}/map", "--init-pose", "r1=15.36,23.62,-124.9deg", "--min-confidence", "0.9"),
    *("--max-memory", "500M", "--copy-maps", "--set", "merge.refine.points=900"),
)


def written(folder: Path, text: str, name: str = "replay.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def error_of(replay: Program, folder: Path, text: str) -> str:
    path = written(folder, text)
    error = replay.merge(SAMPLE, "--config", path).error
    assert error.startswith(f"{path}: ")
    return error.removeprefix(f"{path}: ")


def test_all_that_is_printed_is_the_very_same_run(replay: Program, tmp_path: Path) -> None:
    shutil.copy(SAMPLE, tmp_path / "run.mcap")
    by_flags = replay.merge(tmp_path / "run.mcap", *FLAGS, images="changed")
    bytes_before = by_flags.mcap.read_bytes(), by_flags.report_path.read_bytes()
    config = written(tmp_path, replay("config", *FLAGS).out)
    assert replay("config", "--config", config).out == config.read_text(encoding="utf-8")
    by_file = replay("merge", tmp_path / "run.mcap", "--config", config, "-o", by_flags.mcap, "--no-rrd", "--force")
    assert by_file.status == 0, by_file.err
    assert (by_flags.mcap.read_bytes(), by_flags.report_path.read_bytes()) == bytes_before


@pytest.mark.parametrize("suffix", ["json", "mcap"])
def test_what_a_run_wrote_is_the_very_same_run(replay: Program, tmp_path: Path, suffix: str) -> None:
    by_flags = replay.merge(SAMPLE, *FLAGS, images="changed")
    first = tmp_path / f"first.{suffix}"
    shutil.copy(by_flags.mcap.with_suffix(f".{suffix}"), first)
    bytes_before = by_flags.mcap.read_bytes(), by_flags.report_path.read_bytes()
    again = replay("merge", SAMPLE, "--config", first, "-o", by_flags.mcap, "--no-rrd", "--force")
    assert again.status == 0, again.err
    assert (by_flags.mcap.read_bytes(), by_flags.report_path.read_bytes()) == bytes_before
    assert replay("config", "--from", first).out == replay("config", "--config", first).out


def test_a_file_may_say_all(replay: Program, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its paths are relative to its folder, wherever the program is started."""
    folder = tmp_path / "mission"
    folder.mkdir()
    shutil.copy(SAMPLE, folder / "run.mcap")
    written(folder, 'runs = ["run.mcap"]\n[outputs]\noutput = "merged.mcap"\nno_rrd = true\nimages = "none"\n')
    monkeypatch.chdir(tmp_path)
    assert replay("merge", "--config", "mission/replay.toml").status == 0
    assert (folder / "merged.json").exists()
    assert replay("info", "--config", "mission/replay.toml").status == 0


def test_runs_of_a_file_may_name_robots(replay: Program, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "samples" / "bag_per_robot", tmp_path / "bags")
    names = sorted(path.name for path in (tmp_path / "bags").iterdir())
    runs = [f"x{number}=bags/{name}" for number, name in enumerate(names)]
    config = written(tmp_path, f"runs = {runs}")
    said = replay("info", "--config", config).out
    assert all(f"x{number} (" in said for number in range(len(names))), said


def test_flags_win_and_replace_lists(replay: Program, tmp_path: Path) -> None:
    config = written(
        tmp_path,
        'robots = ["r1", "r2"]\ntopics = ["r1=/a", "r2=/b"]\n[time]\nstart = 5\nstop = 2026-01-01T00:00:00Z\n',
    )
    flags = ("--robots", "r2,r1", "--topic", "r1=/c", "--set", "time.stop=9")
    found = tomllib.loads(replay("config", "--config", config, *flags).out)
    assert found["robots"] == ["r2", "r1"]
    assert found["topics"] == ["r1=/c"]
    assert found["time"]["start"] == 5
    assert found["time"]["stop"] == 9


def test_all_defaults_are_the_run_without_a_file(replay: Program, tmp_path: Path) -> None:
    config = tmp_path / "replay.toml"
    config.write_text("\ufeff" + replay("config").out, encoding="utf-8")  # as some editors begin files
    outputs = ("-o", tmp_path / "out.mcap", "--no-rrd", "--force", "--stop", "100")
    digests = set()
    for flags in ((), ("--config", config)):
        ran = replay("merge", SAMPLE, *outputs, *flags)
        assert ran.status == 0, ran.err
        digests.add((ran.mcap.read_bytes(), ran.report_path.read_bytes()))
    assert len(digests) == 1


def test_robots_of_a_file_can_be_all_again(replay: Program, tmp_path: Path) -> None:
    config = written(tmp_path, 'robots = ["r2", "r1"]\n')
    assert "robots" not in tomllib.loads(replay("config", "--config", config, "--set", "robots=[]").out)


def test_a_switch_of_a_file_can_be_switched_off(replay: Program, tmp_path: Path) -> None:
    config = written(tmp_path, "[rules]\nstrict = true\n")
    said = replay("config", "--config", config, "--set", "rules.strict=false").out
    assert tomllib.loads(said)["rules"]["strict"] is False


def test_what_is_not_the_default_is_marked(replay: Program) -> None:
    said = replay("config", "--min-confidence", "0.99", "--set", "merge.watch.map_growth=2").out
    marked = [line for line in said.splitlines() if "# set" in line]
    assert marked == [
        "min_confidence = 0.99  # set; the default is 0.92",
        "map_growth = 2.0  # set; the default is 1.5",
    ]
    changed = replay("config", "--changed", "--set", "merge.watch.map_growth=2").out
    assert tomllib.loads(changed) == {"merge": {"watch": {"map_growth": 2.0}}}


def test_the_defaults_that_are_printed_say_what_each_is_for(replay: Program) -> None:
    said = replay("config").out
    assert tomllib.loads(said)["merge"]["verify"]["min_overlap_m2"] == 6.0
    lines = said.splitlines()
    for number, line in enumerate(lines):
        if " = " in line and not line.startswith("#"):
            above = next(each for each in reversed(lines[:number]) if not each or each.startswith("#"))
            assert above.startswith("# "), line


def test_texts_are_escaped(replay: Program) -> None:
    said = replay("config", 'a"b\\c\n.mcap', "--robots", "é,\u202e").out
    found = tomllib.loads(said)
    assert found["runs"] == ['a"b\\c\n.mcap']
    assert found["robots"] == ["é", "\u202e"]


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ('robts = ["a"]', "robts: there is no such setting; did you mean robots?"),
        ("[placing]\nmethod = 'paper'", "placing.method: there is no such setting; did you mean merge.method?"),
        ("[verify]\nmin_overlap_m2 = 4", "verify: there is no such setting; did you mean merge.verify?"),
        ("force = true", "force: is said for each run anew; give --force on the command line"),
        ("[check]\nwrite_expect = 'a'", "check.write_expect: is said for each run anew; give --write-expect on the"),
        ("time = 5", "time: is a section, and no setting; expected one of its settings, such as time.clock"),
        ("[time]\nstart = 'noon'", "time.start: 'noon' is no time; expected seconds after the first map"),
        ("[time]\nclock = 'heder'", "time.clock: 'heder' is none of header, log; did you mean header?"),
        ("[time]\nreorder_window_s = -5", "time.reorder_window_s: '-5' is no number of seconds; expected"),
        ("[time]\nstart = [1]", "time.start is [1]; expected one value"),
        ("[rules]\nstrict = 'yes'", 'rules.strict is "yes"; expected true or false'),
        ("[rules]\njobs = 0", "rules.jobs: 0: expected a number of threads, 1 to 999"),
        ("robots = [1]", "robots is [1]; expected a list of texts"),
        ("[placing]\ninit_poses = ['r2=1']", "placing.init_poses: r2=1: expected R=X,Y,YAW"),
        ("[placing]\ninit_poses = ['r9=1,2,3']", "placing.init_poses: r9: no such robot is merged"),
        (
            "[merge]\nmethod = 'papr'",
            "merge.method: 'papr' is none of correlation, existing, paper; did you mean",
        ),
        ("[merge]\nscale_range = [1]", "merge.scale_range is [1]; expected a list of 2 numbers"),
        ("[merge.verify]\nmin_confidence = 2", "merge.verify.min_confidence: 2: expected a probability above 0"),
        ("[merge.verify]\nmin_overlap_m2 = true", "merge.verify.min_overlap_m2 is true; expected a number"),
        (
            "[merge.verify]\nmin_overlap_m2 = nan",
            "merge.verify: min_overlap_m2 is nan; expected a number from 0",
        ),
        ("[merge.cells]\np_free = 0.9", "merge.cells: p_free is 0.9 and p_occupied 0.65; expected"),
        ("[merge.watch]\nlongest_search_wait = 1.5", "merge.watch.longest_search_wait is 1.5; expected a whole number"),
        ("x = 1\ny = = 2", "is no TOML: Invalid value (at line 2, column 5)"),
    ],
)
def test_errors_say_which_setting_and_what_was_expected(replay: Program, tmp_path: Path, text: str, error: str) -> None:
    assert error_of(replay, tmp_path, text).startswith(error)


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (("--config", "nowhere.toml"), "nowhere.toml: there is no such file; expected settings"),
        (("--config", "."), ".: Is a directory; expected settings"),
        (("--set", "ab"), "--set ab: expected KEY=VALUE"),
        (("--set", "merge.verify.min_overlap=2"), "--set merge.verify.min_overlap: there is no such setting; did you"),
        (("--set", "time.start=noon"), "--set time.start: 'noon' is no time"),
        (("--config", str(SAMPLE)), f"{SAMPLE}: it holds no /merged/report"),
        (
            ("--config", str(ROOT / "docs/report.schema.json")),
            f"{ROOT}/docs/report.schema.json: this is JSON",
        ),
    ],
)
def test_files_that_are_none(replay: Program, arguments: tuple[str, ...], error: str) -> None:
    assert replay.merge(SAMPLE, *arguments).error.startswith(error)


def test_without_a_recording_there_is_no_run(replay: Program) -> None:
    assert replay.merge().error == (
        "RUN is missing; expected one recording or more, PATH or ROBOT=PATH, such as `replay merge run.mcap`"
    )


def test_the_example_of_the_documents_is_a_file_of_settings(replay: Program, tmp_path: Path) -> None:
    page = (ROOT / "docs" / "configuration.md").read_text(encoding="utf-8")
    example = page.partition("```toml\n")[2].partition("```")[0]
    found = tomllib.loads(replay("config", "--config", written(tmp_path, example)).out)
    assert found["merge"]["verify"]["min_overlap_m2"] == 10.0
    assert found["outputs"]["output"] == str(tmp_path / "floor.mcap")


def test_recordings_may_stand_between_flags(replay: Program) -> None:
    said = replay("config", "--robots", "r1,r2", "a.mcap", "--start", "5", "b.mcap", "--topic", "r1=/x").out
    found = tomllib.loads(said)
    assert (found["runs"], found["robots"], found["topics"]) == (["a.mcap", "b.mcap"], ["r1", "r2"], ["r1=/x"])
    dashed = tomllib.loads(replay("config", "--start", "5", "--", "-a.mcap", "b.mcap").out)
    assert (dashed["runs"], dashed["time"]["start"]) == (["-a.mcap", "b.mcap"], 5)
