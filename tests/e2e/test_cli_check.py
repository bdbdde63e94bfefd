"""`replay check`: whether a run comes out as expected, said to people and to CI."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from junitparser import JUnitXml

from mapmerge.sim2 import Sim2
from replay.arguments import command_parser
from replay.checks.expectation import load_expectation
from replay.errors import OutputError
from tests.bags import write_mcap
from tests.floors import in_frame
from tests.program import Program, Ran, in_process_of_its_own
from tests.runs import bare_room, flat_map, in_log_order, reference_from, seen, two_robots

TRUE = reference_from("r2")
POSE = f"{{x_m: {TRUE.x_m}, y_m: {TRUE.y_m}, yaw_rad: {TRUE.yaw_rad}, within_m: 0.2, within_deg: 1}}"


@pytest.fixture
def mixed(tmp_path: Path) -> Path:
    """A recording of two robots whose maps belong together, and one that saw too little."""
    return write_mcap(tmp_path / "mixed.mcap", in_log_order(two_robots(), [seen("r3", 30.0, bare_room())]))


def checked(replay: Program, run: Path, text: str, *flags: object) -> Ran:
    path = replay.folder / "expect.yaml"
    path.write_text(text, encoding="utf-8")
    return replay("check", run, "--expect", path, *flags)


def test_all_is_as_expected(replay: Program, mixed: Path) -> None:
    text = f"""
reference: r1
other_robots: forbidden
max_skipped: 0
defaults: {{min_acceptance: 0.5}}
robots:
  r1: reference
  r2:
    status: merged
    pose: {POSE}
    min_confidence: 0.9
    min_overlap_m2: 5
    merged_within_s: 30
  r3: {{status: unmerged, reason: [too_little_structure, no_candidate, too_little_overlap]}}
"""
    ran = checked(replay, mixed, text)
    assert ran.status == 0, ran.out
    lines = ran.out.splitlines()
    assert lines[-1] == "all 12 expectations hold"
    assert all(line.startswith("✓ ") for line in lines[:-1])
    assert [path.name for path in replay.folder.iterdir()] == ["mixed.mcap", "expect.yaml"]


@pytest.mark.parametrize(
    ("robots", "said"),
    [
        ("r2: unmerged", "r2: its status is unmerged; it is merged"),
        ("r9: merged", "there is no such robot; there are r1, r2, r3"),
        ("r3: merged", "r3: its status is merged; it is unmerged"),
        ("r3: {status: unmerged, reason: ambiguous}", "r3: the reason is ambiguous; the reason is "),
        ("r2: {status: merged, pose: {x_m: 0, y_m: 0, yaw_deg: 0}}", "it lies "),
        ("r2: {status: merged, min_acceptance: 1}", "its acceptance is at least 1.000; it is 0.9"),
        ("r2: {status: merged, min_confidence: 1}", "its confidence is at least 1.0000; it is 0.9"),
        ("r2: {status: merged, min_overlap_m2: 1000}", "its overlap is at least 1000.0 m²; it is "),
        ("r2: {status: merged, merged_within_s: 1}", "it is merged within 1 s of the first map; it was merged after "),
    ],
)
def test_what_is_not_as_expected_ends_with_1(replay: Program, mixed: Path, robots: str, said: str) -> None:
    ran = checked(replay, mixed, f"robots:\n  {robots}\n")
    assert ran.status == 1
    (line,) = [line for line in ran.out.splitlines() if line.startswith("✗ ")]
    assert said in line
    assert ran.out.splitlines()[-1].startswith("1 of ")


def test_other_expectations_of_a_robot_that_is_not_merged_fail_with_it(replay: Program, mixed: Path) -> None:
    ran = checked(
        replay, mixed, f"robots: {{r3: {{status: merged, pose: {POSE}, min_acceptance: 0, merged_within_s: 99}}}}"
    )
    assert ran.status == 1
    assert [line[0] for line in ran.out.splitlines()[:-1]] == ["✗"] * 4


def test_expectations_of_the_run(replay: Program, mixed: Path) -> None:
    text = "reference: r2\nother_robots: forbidden\nmax_skipped: {damaged: 0}\nrobots: {r1: reference}\n"
    ran = checked(replay, mixed, text)
    assert ran.status == 1
    assert "✗ run: the reference is r2; it is r1" in ran.out
    assert "✗ run: there is no other robot; others: r2, r3" in ran.out
    assert "✓ run: at most 0 messages are skipped as damaged" in ran.out


def test_skipped_messages_count(replay: Program, tmp_path: Path) -> None:
    bad = write_mcap(tmp_path / "bad.mcap", in_log_order(two_robots(), [seen("r2", 40.0, resolution=0.0)]))
    ran = checked(replay, bad, "max_skipped: 0\nrobots: {r2: merged}\n")
    assert ran.status == 1
    assert "✗ run: at most 0 messages are skipped; 1 skipped: 1 bad_resolution" in ran.out
    assert checked(replay, bad, "max_skipped: 1\nrobots: {r2: merged}\n").status == 0


def test_what_is_written_from_a_run_holds_of_it_and_not_of_another(replay: Program, two: Path, mixed: Path) -> None:
    ran = replay("check", two, "--write-expect", "expect.yaml")
    assert (ran.status, ran.out) == (0, "")
    again = replay("check", two, "--expect", "expect.yaml")
    assert again.status == 0, again.out
    assert "it lies at" in again.out
    assert "merged within" in again.out
    assert replay("check", mixed, "--expect", "expect.yaml").status == 1
    assert replay("check", mixed, "--robots", "r1,r2", "--expect", "expect.yaml").status == 0


def test_an_expectation_is_not_replaced_unless_that_is_said(replay: Program, outcome: Path) -> None:
    assert replay("check", outcome, "--write-expect", "expect.yaml").status == 0
    assert "--force" in replay("check", outcome, "--write-expect", "expect.yaml").error
    assert replay("check", outcome, "--write-expect", "expect.yaml", "--force").status == 0
    assert "is an input" in replay("check", outcome, "--write-expect", outcome, "--force").error


def test_names_of_robots_are_written_such_that_they_are_read(replay: Program, tmp_path: Path) -> None:
    odd = write_mcap(
        tmp_path / "odd.mcap",
        in_log_order(
            [seen("r1", 0.0, topic="/no/map"), seen("r2", 1.0, topic="/1e3/map"), seen("r2", 2.0, topic="/x/map")]
        ),
    )
    assert replay("check", odd, "--write-expect", "expect.yaml").status == 0
    assert replay("check", odd, "--expect", "expect.yaml").status == 0


def test_a_run_that_was_made_before_is_not_made_again(replay: Program, outcome: Path) -> None:
    for run in (outcome, outcome.with_suffix(".json")):
        ran = checked(replay, run, "robots: {r2: merged}")
        assert (ran.status, ran.err) == (0, "")
    (replay.folder / "settings.toml").write_text("time.clock = 'log'\n", encoding="utf-8")
    given = [flag for flag in _flags_of_a_merge() if flag.split()[0] not in ("--json", "--config")]
    assert {"--min-confidence", "--method", "--max-memory", "--clock", "--output"} <= {
        flag.split()[0] for flag in given
    }
    for flag in (*given, "--config settings.toml"):
        ran = checked(replay, outcome, "robots: {r2: merged}", *flag.split())
        said = "settings.toml: time.clock: " if flag.startswith("--config") else f"{flag.split()[0]}: "
        assert ran.error.startswith(said), flag
        assert "nothing is merged" in ran.error


def _flags_of_a_merge() -> list[str]:
    """Return all flags of how to merge and what to write, each with a value that it takes."""
    values = {"--clock": "log", "--set": "merge.scale=any"}
    others = ("options", "what is expected", "what is said")
    return [
        action.option_strings[-1]
        + ("" if action.nargs == 0 else f" {values.get(action.option_strings[-1], (action.choices or '1')[0])}")
        for title, action in command_parser("check").grouped()
        if action.option_strings and title not in others
    ]


def test_outputs_are_written_where_they_are_asked_for(replay: Program, two: Path) -> None:
    ran = checked(replay, two, "robots: {r2: unmerged}", "-o", "new.mcap", "--no-rrd")
    assert ran.status == 1
    assert (replay.folder / "new.mcap").is_file()
    assert replay("compare", "new.mcap", "new.json").status == 0


def test_the_report_can_be_printed_instead(replay: Program, outcome: Path) -> None:
    ran = checked(replay, outcome, "robots: {r2: unmerged}", "--json")
    assert ran.status == 1
    assert json.loads(ran.out) == json.loads(outcome.with_suffix(".json").read_text(encoding="utf-8"))
    assert ran.err.startswith("replay: r2: its status is unmerged; it is merged")


def test_a_terminal_that_has_few_characters_is_told_in_those(outcome: Path, tmp_path: Path) -> None:
    (tmp_path / "expect.yaml").write_text("robots: {r1: reference, r2: unmerged}", encoding="utf-8")
    code = "import sys, replay.cli; sys.stdout.reconfigure(encoding='ascii'); sys.exit(replay.cli.main(sys.argv[1:]))"
    command = [sys.executable, "-c", code, "check", str(outcome), "--expect", "expect.yaml"]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 1
    first, second, _ = ran.stdout.splitlines()
    assert first.startswith("ok   r1: ")
    assert second.startswith("FAIL r2: ")


def test_junit_xml_is_read_by_others(replay: Program, mixed: Path) -> None:
    ran = checked(replay, mixed, "robots:\n  r1: reference\n  r2: unmerged\n  r9: merged\n", "--junit", "out.xml")
    assert ran.status == 1
    (suite,) = JUnitXml.fromfile(str(replay.folder / "out.xml"))
    assert (suite.name, suite.tests, suite.failures, suite.errors) == ("mixed.mcap", 3, 2, 0)
    cases = list(suite)
    assert [(case.classname, case.name, case.is_passed) for case in cases] == [
        ("r1", "its status is reference", True),
        ("r2", "its status is unmerged", False),
        ("r9", "its status is merged", False),
    ]
    assert cases[1].result[0].message.startswith("it is merged: placed on r1")


def test_junit_xml_tells_why_nothing_could_be_merged(replay: Program, tmp_path: Path) -> None:
    (tmp_path / "empty.mcap").write_bytes(b"")
    ran = checked(replay, tmp_path / "empty.mcap", "robots: {r2: merged}", "--junit", "out.xml")
    assert ran.status == 2
    (suite,) = JUnitXml.fromfile(str(replay.folder / "out.xml"))
    (case,) = suite
    assert suite.errors == 1
    assert "empty.mcap" in case.result[0].message


def test_junit_xml_holds_any_name(replay: Program, outcome: Path) -> None:
    name = '"<&>\\"\\u0007😀]]>"'
    ran = checked(replay, outcome, f"robots: {{{name}: merged}}", "--junit", "out.xml")
    assert ran.status == 1
    (suite,) = JUnitXml.fromfile(str(replay.folder / "out.xml"))
    (case,) = suite
    assert case.classname == '<&>"\\x07😀]]>'


def test_outputs_repeat_to_the_byte(replay: Program, mixed: Path) -> None:
    written = []
    for _ in range(2):
        checked(replay, mixed, "robots: {r2: unmerged}", "--junit", "out.xml", "--summary", "out.md")
        written.append([(replay.folder / name).read_bytes() for name in ("out.xml", "out.md")])
        (replay.folder / "out.md").unlink()
    assert written[0] == written[1]


def test_a_summary_is_appended_as_markdown(replay: Program, outcome: Path) -> None:
    (replay.folder / "summary.md").write_text("what was there\n", encoding="utf-8")
    ran = checked(replay, outcome, "robots:\n  r1: reference\n  r2: unmerged\n", "--summary", "summary.md")
    assert ran.status == 1
    text = (replay.folder / "summary.md").read_text(encoding="utf-8")
    assert text.startswith("what was there\n### replay check: floor.mcap\n\n1 of 2 expectations does not hold\n")
    rows = [line for line in text.splitlines() if line.startswith("| ")]
    assert [row.split("|")[1:4] for row in rows[1:]] == [
        [" ✗ ", " r2 ", " its status is unmerged "],
        [" ✓ ", " r1 ", " its status is reference "],
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "there is nothing in it"),
        ("robots: {r1: reference}\nrobots: {r2: merged}", "line 2: this is no YAML: found duplicate key"),
        ("robots: [", "line 1: this is no YAML"),
        ("robots: {}", "line 1: robots is {}; expected at least one robot"),
        ("reference: r1", "it has no 'robots'"),
        ("- r1", "is ['r1']; expected a mapping"),
        ("robot: {r1: merged}", "line 1: robot: there is no key 'robot' here; did you mean 'robots'?"),
        ("robots:\n  r2: marged", "line 2: robots.r2.status is 'marged'; expected one of reference, merged"),
        (
            "robots:\n  r2:\n    status: merged\n    min_acceptence: 1",
            "line 4: robots.r2.min_acceptence: there is no key",
        ),
        ("robots: {r2: {status: merged, min_acceptance: 2}}", "is 2; expected a number from 0 to 1"),
        ("robots: {r2: {status: merged, pose: {x_m: 1, y_m: 2}}}", "expected either yaw_deg or yaw_rad"),
        ("robots: {r2: {status: merged, pose: {x_m: a, y_m: 2, yaw_deg: 1}}}", "pose.x_m is 'a'; expected a number"),
        ("robots: {r2: {status: unmerged, pose: {x_m: 1, y_m: 2, yaw_deg: 1}}}", "no such key of a robot whose status"),
        ("robots: {r2: {status: unmerged, reason: bad_luck}}", "expected reasons out of "),
        ("robots: {r2: {status: merged, reason: accepted}}", "no reason of a robot that is to be merged"),
        ("robots: {1: merged}", "expected a name: put it in quotes"),
        ("robots: &a {r1: reference}\nx: *a", "refers to another value"),
        ("max_skipped: -1\nrobots: {r1: reference}", "expected a whole number, 0 or more"),
        ("max_skipped: {lost: 1}\nrobots: {r1: reference}", "there is no key 'lost' here"),
        ("other_robots: no\nrobots: {r1: reference}", "expected one of allowed, forbidden"),
        ("defaults: {status: merged}\nrobots: {r1: reference}", "there is no key 'status' here"),
    ],
)
def test_what_is_wrong_in_an_expectation_is_named_before_anything_is_merged(
    replay: Program, two: Path, text: str, said: str
) -> None:
    ran = checked(replay, two, text)
    assert ran.status == 2
    assert ran.error.startswith(f"{replay.folder / 'expect.yaml'}: ")
    assert said in ran.error


def test_limits_of_a_robot_come_before_defaults(replay: Program, outcome: Path) -> None:
    text = "defaults: {min_overlap_m2: 10000}\nrobots: {r2: {status: merged, min_overlap_m2: 1}}"
    assert checked(replay, outcome, text).status == 0


def test_a_pose_is_compared_at_a_point_of_the_map(replay: Program, outcome: Path) -> None:
    text = f"robots: {{r2: {{status: merged, pose: {{x_m: {TRUE.x_m}, y_m: {TRUE.y_m}, yaw_rad: {TRUE.yaw_rad + 0.02}, "
    assert checked(replay, outcome, f"{text}within_m: 0.3, within_deg: 3}}}}}}").status == 0
    assert checked(replay, outcome, f"{text}at_m: [100, 0], within_m: 0.3, within_deg: 3}}}}}}").status == 1


def test_a_scale_counts_where_it_is_given(replay: Program, outcome: Path) -> None:
    pose = POSE.replace("{", "{scale: 1.2, ")
    assert checked(replay, outcome, f"robots: {{r2: {{status: merged, pose: {pose}}}}}").status == 1
    pose = POSE.replace("{", "{scale: 1.001, ")
    assert checked(replay, outcome, f"robots: {{r2: {{status: merged, pose: {pose}}}}}").status == 0


def test_interrupted_when_all_is_written_says_so(replay: Program, two: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("replay.checks.findings.findings", interrupted)
    for flags, said in ((("-o", "new.mcap"), "the outputs are written"), ((), "nothing was written")):
        ran = checked(replay, two, "robots: {r1: reference}", *flags)
        assert ran.status == 130
        assert ran.err.splitlines()[-1] == f"replay: interrupted; {said}"
        assert (replay.folder / "new.mcap").exists()


def test_no_recording_at_all_is_refused(replay: Program) -> None:
    (replay.folder / "expect.yaml").write_text("robots: {r1: reference}", encoding="utf-8")
    assert "RUN is missing" in replay("check", "--expect", "expect.yaml").error


def test_settings_may_come_from_a_file(replay: Program, two: Path) -> None:
    (replay.folder / "settings.toml").write_text('robots = "r2,r1"\n', encoding="utf-8")
    ran = checked(replay, two, "reference: r2\nrobots: {r1: merged}", "--config", "settings.toml")
    assert ran.status == 0, ran.out + ran.err


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        ((), "give either --expect EXPECT.yaml or --write-expect EXPECT.yaml"),
        (("--expect", "a.yaml", "--write-expect", "b.yaml"), "give either"),
        (("--write-expect", "b.yaml", "--junit", "c.xml"), "give them with --expect"),
        (("--expect", "absent.yaml"), "absent.yaml: it does not exist"),
    ],
)
def test_flags_that_do_not_fit_are_refused(replay: Program, two: Path, flags: tuple[str, ...], said: str) -> None:
    ran = replay("check", two, *flags)
    assert ran.status == 2
    assert said in ran.error


def test_a_summary_without_a_name_is_refused(replay: Program, outcome: Path) -> None:
    assert "$GITHUB_STEP_SUMMARY" in checked(replay, outcome, "robots: {r1: reference}", "--summary", "").error


@pytest.mark.parametrize("flag", ["--junit", "--summary"])
def test_findings_do_not_replace_an_input(replay: Program, outcome: Path, flag: str) -> None:
    content = outcome.read_bytes()
    for path in (outcome, replay.folder / "expect.yaml"):
        ran = checked(replay, outcome, "robots: {r1: reference}", flag, path)
        assert ran.status == 2
        assert "is an input" in ran.error
    assert outcome.read_bytes() == content


def test_nothing_is_left_where_findings_cannot_be_written(replay: Program, outcome: Path) -> None:
    ran = checked(replay, outcome, "robots: {r1: reference}", "--junit", "absent/out.xml")
    assert ran.status == 3
    assert "there is no such folder" in ran.error


def test_help_has_the_words_of_an_expectation() -> None:
    ran = in_process_of_its_own("check", "--help")
    assert "--write-expect" in ran.stdout
    assert "exit status: 0" in ran.stdout


@pytest.mark.parametrize(
    "flags",
    [
        ("-o", "out.mcap", "--junit", "out.json"),
        ("-o", "out.mcap", "--junit", "./out.rrd"),
        ("-o", "out.mcap", "--junit", "out.mcap.partial"),
        ("-o", "other.mcap", "--report", "out.html", "--summary", "out.html"),
        ("--junit", "same", "--summary", "same"),
        ("--junit", "same", "--summary", "same.partial"),
        ("-o", "out.mcap", "--junit", "linked.json"),
    ],
)
def test_outputs_that_would_replace_each_other_are_refused(replay: Program, two: Path, flags: tuple[str, ...]) -> None:
    (replay.folder / "out.json").write_text("before", encoding="utf-8")
    (replay.folder / "linked.json").hardlink_to(replay.folder / "out.json")
    ran = checked(replay, two, "robots: {r1: reference}", *flags, "--force")
    assert ran.status == 2
    assert "is taken by another output" in ran.error
    assert sorted(path.name for path in replay.folder.iterdir()) == ["expect.yaml", "linked.json", "out.json"]
    assert (replay.folder / "out.json").read_text(encoding="utf-8") == "before"


def test_an_expectation_is_not_written_over_the_run_nor_the_run_over_it(replay: Program, two: Path) -> None:
    ran = replay("check", two, "-o", "out.mcap", "--write-expect", "out.json")
    assert (ran.status, "is taken by another output" in ran.error) == (2, True)
    (replay.folder / "out.json").write_text("robots: {r1: reference}", encoding="utf-8")
    ran = replay("check", two, "-o", "out.mcap", "--expect", "out.json", "--force")
    assert (ran.status, "is an input" in ran.error) == (2, True)
    assert [path.name for path in replay.folder.iterdir()] == ["out.json"]


def test_the_image_of_a_saved_map_is_an_input(replay: Program, outcome: Path) -> None:
    assert replay("export", outcome, "-o", "old").status == 0
    before = (replay.folder / "old.pgm").read_bytes()
    ran = checked(replay, replay.folder / "old.yaml", "robots: {old: reference}", "--junit", "old.pgm")
    assert (ran.status, "is an input" in ran.error) == (2, True)
    assert (replay.folder / "old.pgm").read_bytes() == before


@pytest.mark.parametrize(
    "text",
    [
        "{{image: old.pgm, resolution: 0.1, origin: [0, 0, 0], {rest}}}",
        '{{"image": "old.pgm", "resolution": 0.1, "origin": [0, 0, 0], {rest}}}',
    ],
)
def test_a_saved_map_in_braces_is_no_report(replay: Program, outcome: Path, text: str) -> None:
    assert replay("export", outcome, "-o", "old").status == 0
    rest = '"negate": 0, "occupied_thresh": 0.65, "free_thresh": 0.196'
    (replay.folder / "old.yaml").write_text(text.format(rest=rest), encoding="utf-8")
    ran = checked(replay, replay.folder / "old.yaml", "robots: {old: reference}")
    assert ran.status == 0, ran.err


def test_of_a_recording_that_cannot_be_read_no_flag_is_blamed(replay: Program, tmp_path: Path) -> None:
    (tmp_path / "bad.mcap").write_bytes(b"\x89MCAP0\r\n" + b"\xff" * 99)
    ran = checked(replay, tmp_path / "bad.mcap", "robots: {r1: reference}", "--method", "paper")
    assert ran.status == 2
    assert ran.error.startswith(f"{tmp_path / 'bad.mcap'}: ")


def test_expectations_of_maps_far_from_the_origin_of_their_frame_are_of_where_they_are(
    replay: Program, tmp_path: Path
) -> None:
    east_m, north_m = 4.6e5, 5.5e6  # as in UTM
    there = Sim2(east_m, north_m, 0.3)
    maps = {robot: in_frame(flat_map(robot), there) for robot in ("r1", "r2")}
    run = write_mcap(tmp_path / "utm.mcap", [seen(robot, 0.0, grid) for robot, grid in maps.items()])
    report = replay.merge(run).report
    middle_m = maps["r2"].middle_m
    assert report["robots"]["r2"]["status"] == "merged"
    assert report["robots"]["r2"]["centre_m"] == pytest.approx(middle_m, abs=1e-5)
    assert replay("check", "out.json", "--write-expect", "expect.yaml").status == 0
    expected = load_expectation(replay.folder / "expect.yaml").robots["r2"].pose
    assert expected is not None
    assert expected.at_m == pytest.approx(middle_m, abs=1e-3)
    assert (expected.within_m, expected.within_deg) == (0.1, 0.5)
    pose = report["robots"]["r2"]["merged_from_map"]
    found = Sim2(pose["x_m"], pose["y_m"], pose["yaw_rad"])
    assert expected.merged_from_map.apply_point(*middle_m) == pytest.approx(found.apply_point(*middle_m), abs=5e-3)
    # a turn that nobody sees moves the origin by many metres
    turned = Sim2(0.0, 0.0, pose["yaw_rad"] + 2e-5)
    (x_m, y_m), (from_x_m, from_y_m) = found.apply_point(*middle_m), turned.apply_point(*middle_m)
    pose |= {"x_m": x_m - from_x_m, "y_m": y_m - from_y_m, "yaw_rad": turned.yaw_rad}
    (replay.folder / "turned.json").write_text(json.dumps(report), encoding="utf-8")
    for name in ("out.json", "turned.json"):
        ran = replay("check", name, "--expect", "expect.yaml")
        assert ran.status == 0, ran.out


def test_a_job_that_cannot_begin_tells_why(replay: Program, tmp_path: Path, two: Path) -> None:
    junit, told = tmp_path / "out.xml", tmp_path / "summary.md"
    written = ("--junit", junit, "--summary", told)
    assert replay("check", two, "--expect", tmp_path / "none.yaml", *written).status == 2
    assert replay("check", tmp_path / "none.bag", "--expect", tmp_path / "none.yaml", *written).status == 2
    assert "does not exist" in junit.read_text(encoding="utf-8")
    assert told.read_text(encoding="utf-8").count("nothing was checked: ") == 2


@pytest.mark.parametrize("flags", [("--config", "settings.toml"), ("--set", "check.expect=expect.yaml")])
def test_settings_of_what_is_expected_serve_a_run_that_was_made_before(
    replay: Program, outcome: Path, flags: tuple[str, ...]
) -> None:
    (replay.folder / "expect.yaml").write_text("robots: {r2: merged}", encoding="utf-8")
    (replay.folder / "settings.toml").write_text(
        '[check]\nexpect = "expect.yaml"\njunit = "out.xml"\n', encoding="utf-8"
    )
    ran = replay("check", outcome, *flags)
    assert (ran.status, ran.err) == (0, "")
    assert (replay.folder / "out.xml").exists() == (flags[0] == "--config")


GREEN = '<testsuites name="replay check"><testsuite name="earlier" tests="1" failures="0" errors="0" /></testsuites>'


@pytest.mark.parametrize("error", [RuntimeError("odd"), MemoryError(), KeyboardInterrupt(), OutputError("full")])
@pytest.mark.parametrize("can_be_told", [True, False])
def test_no_earlier_findings_stand_for_a_run_that_ends_otherwise(
    replay: Program, two: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException, can_be_told: bool
) -> None:
    junit, summary = replay.folder / "out.xml", replay.folder / "out.md"
    junit.write_text(GREEN, encoding="utf-8")

    def failing(*_: object) -> None:
        (suite,) = JUnitXml.fromfile(str(junit))
        assert suite.errors == 1  # though the process be killed now
        if not can_be_told:
            (replay.folder / "out.xml.partial").mkdir()
        raise error

    monkeypatch.setattr("replay.execute.merge_into", failing)
    ran = checked(replay, two, "robots: {r2: merged}", "--junit", junit, "--summary", summary)
    expected = {RuntimeError: 3, MemoryError: 2, KeyboardInterrupt: 130, OutputError: 3}
    assert ran.status == expected[type(error)]
    (suite,) = JUnitXml.fromfile(str(junit))
    (case,) = suite
    assert suite.errors == 1
    why = case.result[0].message
    words = {RuntimeError: "bug in replay: RuntimeError: odd", MemoryError: "memory", KeyboardInterrupt: "interrupted"}
    assert (words.get(type(error), "full") if can_be_told else "cut off") in why
    assert "nothing was checked: " in summary.read_text(encoding="utf-8")
    if not can_be_told:
        assert "out.xml: cannot be written" in ran.err


def test_findings_are_told_though_they_cannot_be_written(
    replay: Program, outcome: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OutputError("out.xml: cannot be written: No space left on device")

    monkeypatch.setattr("replay.checks.told.junit_xml", full)
    ran = checked(replay, outcome, "robots: {r2: unmerged}", "--junit", "out.xml", "--summary", "out.md")
    assert ran.status == 3
    assert "✗ r2: its status is unmerged; it is merged" in ran.out
    assert ran.error.endswith("No space left on device")
    assert "1 of 1 expectation does not hold" in (replay.folder / "out.md").read_text(encoding="utf-8")


def test_findings_do_not_wait_for_flags_of_a_merge_that_are_wrong(replay: Program, two: Path) -> None:
    (replay.folder / "out.xml").write_text(GREEN, encoding="utf-8")
    flags = ("-o", "out.mcap", "--every", "often", "--junit", "out.xml")
    assert checked(replay, two, "robots: {r2: merged}", *flags).status == 2
    assert "--every: " in (replay.folder / "out.xml").read_text(encoding="utf-8")


@pytest.mark.parametrize("flag", ["--junit", "--summary", "--write-expect"])
@pytest.mark.parametrize("name", ["", ".", "..", "/", "a\0b"])
def test_what_is_no_name_of_a_file_is_refused(replay: Program, outcome: Path, flag: str, name: str) -> None:
    rest = () if flag == "--write-expect" else ("--expect", "expect.yaml")
    (replay.folder / "expect.yaml").write_text("robots: {r2: merged}", encoding="utf-8")
    ran = (
        replay("check", outcome, flag, name, *rest, "--force")
        if not rest
        else replay("check", outcome, flag, name, *rest)
    )
    assert ran.status in (2, 3)
    assert "no file can have this name" in ran.error if "\0" in name else ran.error.startswith(f"{flag}")
    assert [path.name for path in replay.folder.iterdir()] == ["expect.yaml"]


@pytest.mark.parametrize("key", ["? [1, 2]\n: 3", "? {a: b}\n: 3", "[1]: 2", "? ~\n: 3"])
def test_keys_that_are_no_names_are_refused(replay: Program, outcome: Path, key: str) -> None:
    ran = checked(replay, outcome, f"robots: {{r2: merged}}\n{key}\n")
    assert ran.status == 2
    assert ran.error.startswith(f"{replay.folder / 'expect.yaml'}: ")


@pytest.mark.parametrize("version", ["1\nmax_skipped: 99\n#", "1\udc80", "1\u2028robots:"])
def test_nothing_in_a_report_becomes_an_expectation(replay: Program, outcome: Path, version: str) -> None:
    report = json.loads(outcome.with_suffix(".json").read_text(encoding="utf-8"))
    report["version"] = version
    (replay.folder / "odd.json").write_text(json.dumps(report), encoding="utf-8")
    ran = replay("check", "odd.json", "--write-expect", "expect.yaml")
    assert ran.status == 0, ran.err
    assert load_expectation(replay.folder / "expect.yaml").max_skipped == {"": 0}
    assert replay("check", "odd.json", "--expect", "expect.yaml").status == 0


def test_a_run_is_shown_only_where_it_is_written(replay: Program, two: Path) -> None:
    ran = checked(replay, two, "robots: {r2: merged}", "--view")
    assert ran.error.endswith("give --output OUT.mcap as well")
    assert "--no-rrd" not in ran.error


def test_a_page_without_the_other_outputs_is_refused(replay: Program, tmp_path: Path, two: Path) -> None:
    ran = replay("check", two, "--write-expect", tmp_path / "e.yaml", "--report", tmp_path / "page.html")
    assert "give --output OUT.mcap as well" in ran.error
    assert not list(tmp_path.glob("*.html"))
