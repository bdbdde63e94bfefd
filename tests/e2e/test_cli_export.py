"""`replay export`: maps as map_server loads them, pictures and transforms, read back as their users would."""

from __future__ import annotations

import json
import math
import re
import shlex
import subprocess
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from ruamel.yaml import YAML

from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2
from replay.codec import decode
from replay.messages import GridMessage
from replay.sources import open_source
from tests.bags import write_mcap, write_saved_map
from tests.data_paths import ROOT
from tests.outputs import maps
from tests.program import Program, Ran
from tests.runs import (
    RESOLUTION_M,
    at,
    bare_room,
    flat_map,
    growing,
    in_log_order,
    reference_from,
    seen,
    two_robots,
    updated,
)

MAP_SAVER = {"free": 254, "occupied": 0, "unknown": 205}


def described(path: Path) -> dict[str, Any]:
    return YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))


def pixels(path: Path) -> np.ndarray:
    found = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert found is not None
    return found


def loaded(path: Path) -> Grid:
    """Return the map that replay reads a saved one as, which is how map_server does."""
    with open_source(path) as source:
        (raw,) = source.messages(["/map"])
    message = decode(raw)
    assert isinstance(message, GridMessage)
    return message.grid


def in_three(cells: np.ndarray) -> np.ndarray:
    return np.select([cells < 0, cells <= 25, cells >= 65], [-1, 0, 100], -1)


def test_the_merged_map_as_map_saver_writes_it(replay: Program, outcome: Path) -> None:
    ran = replay("export", outcome)
    merged = maps(outcome)[-1].grid
    assert (ran.status, ran.out) == (0, "")
    assert sorted(path.name for path in replay.folder.iterdir()) == ["floor.pgm", "floor.yaml"]
    assert described(replay.folder / "floor.yaml") == {
        "image": "floor.pgm",
        "mode": "trinary",
        "resolution": RESOLUTION_M,
        "origin": pytest.approx([merged.map_from_grid.x_m, merged.map_from_grid.y_m, merged.map_from_grid.yaw_rad]),
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    image = pixels(replay.folder / "floor.pgm")
    assert image.dtype == np.uint8
    expected = np.select([merged.cells < 0, merged.cells <= 25, merged.cells >= 65], [205, 254, 0], 205)
    assert np.array_equal(image, expected[::-1])
    assert set(np.unique(image)) == set(MAP_SAVER.values())
    assert (replay.folder / "floor.pgm").read_bytes().startswith(b"P5\n# ")


def test_what_is_loaded_is_what_was_written(replay: Program, outcome: Path) -> None:
    merged = maps(outcome)[-1].grid
    for mode, cells in (("trinary", in_three(merged.cells)), ("scale", merged.cells), ("raw", merged.cells)):
        assert replay("export", outcome, "--mode", mode, "-o", mode).status == 0
        found = loaded(replay.folder / f"{mode}.yaml")
        assert np.array_equal(found.cells, cells), mode
        assert found.resolution_m == merged.resolution_m
        assert found.map_from_grid.is_close(merged.map_from_grid, distance_m=1e-8, angle_rad=1e-8, at_m=(9.0, 9.0))


def test_a_saved_map_can_be_merged_again(replay: Program, outcome: Path, two: Path) -> None:
    assert replay("export", outcome, "-o", "old.yaml").status == 0
    ran = replay.merge(f"old={replay.folder / 'old.yaml'}", two, "--robots", "old,r2")
    assert ran.statuses == {"old": "reference", "r2": "merged"}
    pose, true = ran.robots["r2"]["merged_from_map"], reference_from("r2")
    assert math.hypot(pose["x_m"] - true.x_m, pose["y_m"] - true.y_m) < 0.1


def test_turned_origins_are_kept_and_named(replay: Program, tmp_path: Path) -> None:
    turned = Grid(flat_map("r1").cells, RESOLUTION_M, Sim2(-3.25, 12.5, 0.7))
    run = write_mcap(
        tmp_path / "turned.mcap", [seen("r1", 0.0, turned, turn=(0.0, 0.0, math.sin(0.35), math.cos(0.35)))]
    )
    ran = replay("export", run)
    assert "its origin is turned by 40.11°" in ran.err
    assert described(replay.folder / "turned.yaml")["origin"] == pytest.approx([-3.25, 12.5, 0.7])


def test_as_of_a_time(replay: Program, outcome: Path) -> None:
    every = maps(outcome)
    for name, time in (("early", "5"), ("same", f"{at(5.0)}ns"), ("late", "99")):
        assert replay("export", outcome, "--at", time, "-o", name, "--mode", "raw").status == 0
    early = [each.grid for each in every if each.stamp_ns <= at(5.0)][-1]
    assert np.array_equal(loaded(replay.folder / "early.yaml").cells, early.cells)
    assert np.array_equal(loaded(replay.folder / "same.yaml").cells, early.cells)
    assert np.array_equal(loaded(replay.folder / "late.yaml").cells, every[-1].grid.cells)
    assert "the run begins after that time" in replay("export", outcome, "--at", "1ns", "-o", "never").error


def test_any_map_of_any_recording_with_its_updates(replay: Program, tmp_path: Path) -> None:
    patch = np.full((4, 5), 100, np.int8)
    run = write_mcap(tmp_path / "run.mcap", [seen("r1", 0.0), updated("r1", 1.0, 3, 2, patch), seen("r2", 2.0)])
    ran = replay("export", run)
    assert ran.status == 2
    assert "--topic /r1/map  --topic /r2/map" in ran.error
    assert replay("export", run, "--topic", "/r1/map", "--mode", "raw").status == 0
    expected = flat_map("r1").cells.copy()
    expected[2:6, 3:8] = 100
    assert np.array_equal(loaded(replay.folder / "run.yaml").cells, expected)
    assert "there are: /r1/map, /r2/map" in replay("export", run, "--topic", "/r3/map").error


def test_a_picture_in_the_colours_of_rviz(replay: Program, outcome: Path) -> None:
    assert replay("export", outcome, "--to", "png", "-o", "floor.png").status == 0
    cells, image = maps(outcome)[-1].grid.cells[::-1], pixels(replay.folder / "floor.png")
    assert image.shape == (*cells.shape, 3)
    assert (image[cells < 0] == (134, 137, 112)).all()
    assert (image[cells == 0] == 255).all()
    assert (image[cells == 100] == 0).all()


@pytest.mark.parametrize("fails", [lambda _: (False, None), lambda encode: encode(".png", np.zeros((2, 0)))])
@pytest.mark.parametrize("flags", [("--to", "png"), ("--mode", "scale")])
def test_a_picture_that_cannot_be_made_is_an_error_of_one_line(
    replay: Program, outcome: Path, monkeypatch: pytest.MonkeyPatch, fails: Any, flags: tuple[str, ...]
) -> None:
    encode = cv2.imencode
    monkeypatch.setattr("replay.export.image.cv2.imencode", lambda *_: fails(encode))
    before = sorted(replay.folder.iterdir())
    ran = replay("export", outcome, *flags, "-o", "floor")
    assert ran.status == 3
    assert "the picture cannot be made" in ran.error
    assert sorted(replay.folder.iterdir()) == before


def test_robots_own_maps_lie_on_the_merged_one(replay: Program, outcome: Path, two: Path) -> None:
    merged = maps(outcome)[-1].grid
    assert replay("export", outcome, "--robots", "r1,r2", "--mode", "raw").status == 0
    first, second = (loaded(replay.folder / f"floor.{robot}.yaml") for robot in ("r1", "r2"))
    assert first.cells.shape == second.cells.shape == merged.cells.shape
    either = (first.cells >= 0) | (second.cells >= 0)
    contradicted = (merged.cells < 0) & either
    assert not (merged.cells[~either] >= 0).any()
    assert (np.abs(first.cells[contradicted].astype(int) - second.cells[contradicted]) == 100).all()
    alone = (first.cells >= 0) & (second.cells < 0)
    assert alone.any()
    assert np.array_equal(first.cells[alone], merged.cells[alone])
    # nothing is interpolated: what is there was there before
    assert set(np.unique(second.cells)) <= set(np.unique(flat_map("r2").cells)) | {-1}
    for source in (outcome, outcome.with_suffix(".json")):
        ran = replay("export", source, "--robots", "r2", "--maps", two, "--mode", "raw", "-o", "again", "--force")
        assert ran.status == 0, ran.err
        assert loaded(replay.folder / "again.yaml").same_as(second)


def test_robots_maps_as_of_a_time(replay: Program, outcome: Path, two: Path) -> None:
    for number, more in enumerate(((), ("--maps", two))):
        ran = replay("export", outcome, "--robots", "r1", "--at", "5", "--mode", "raw", "-o", f"out{number}", *more)
        assert ran.status == 0, ran.err
    early, other = (loaded(replay.folder / f"out{number}.yaml") for number in range(2))
    assert early.same_as(other)
    assert 0 < (early.cells >= 0).sum() < (flat_map("r1").cells >= 0).sum()


def test_maps_are_those_that_were_merged_though_the_recording_goes_on(replay: Program, two: Path) -> None:
    replay.merge(two, "--stop", "13")
    for number, more in enumerate(((), ("--at", "13"))):
        flags = ("--robots", "r1", "--maps", two, "-o", f"out{number}")
        assert replay("export", "out.mcap", *flags, *more).status == 0
    assert (replay.folder / "out0.pgm").read_bytes() == (replay.folder / "out1.pgm").read_bytes()


def test_what_is_missing_for_robots_maps_is_said(replay: Program, two: Path, tmp_path: Path) -> None:
    mixed = write_mcap(tmp_path / "mixed.mcap", in_log_order(two_robots(), [seen("r3", 30.0, bare_room())]))
    out = replay.merge(mixed).mcap
    assert "as --maps run.mcap, or merge again with --copy-maps" in replay("export", out, "--robots", "r2").error
    assert "r3 is not placed: " in replay("export", out, "--robots", "r3", "--maps", mixed).error
    assert "there are r1, r2, r3" in replay("export", out, "--robots", "r9").error
    assert "mixed.mcap was merged, and is not given" in replay("export", out, "--robots", "r2", "--maps", two).error
    assert "a report holds no map" in replay("export", out.with_suffix(".json")).error
    assert "say whose" in replay("export", out, "--maps", mixed).error
    assert "leave it out" in replay("export", out, "--robots", "r1", "--topic", "/merged/map").error


def test_transforms_are_commands_for_the_shell(replay: Program, tmp_path: Path) -> None:
    mixed = write_mcap(tmp_path / "mixed.mcap", in_log_order(two_robots(), [seen("r3", 30.0, bare_room())]))
    out = replay.merge(mixed)
    ran = replay("export", out.mcap, "--to", "tf")
    assert (ran.status, ran.err) == (0, "")
    _, *all_lines, unplaced, last = ran.out.splitlines()
    assert last == "wait"
    comments, lines = all_lines[::2], all_lines[1::2]
    assert comments == [f"# {robot}/map is what {robot} recorded as 'map'" for robot in ("r1", "r2")]
    assert unplaced.startswith("# r3 is not placed: ")
    assert replay("export", out.report_path, "--to", "tf").out.splitlines()[1:] == [*all_lines, unplaced, last]
    for robot, line in zip(("r1", "r2"), lines, strict=True):
        *words, beside = shlex.split(line)
        assert beside == "&"
        assert words[:4] == ["ros2", "run", "tf2_ros", "static_transform_publisher"]
        flags = dict(zip(words[4::2], words[5::2], strict=True))
        pose = out.robots[robot]["merged_from_map"]
        assert (flags["--frame-id"], flags["--child-frame-id"]) == ("merged", out.robots[robot]["map_frame"])
        found = [float(flags[flag]) for flag in ("--x", "--y", "--yaw")]
        assert found == pytest.approx([pose["x_m"], pose["y_m"], pose["yaw_rad"]], abs=1e-6)
        assert [flags[flag] for flag in ("--z", "--pitch", "--roll")] == ["0", "0", "0"]


def test_transforms_for_ros_1_and_of_some_robots_and_to_a_file(replay: Program, outcome: Path) -> None:
    ran = replay("export", outcome, "--to", "tf", "--ros", "1", "--robots", "r2", "-o", "tf.sh")
    assert (ran.status, ran.out) == (0, "")
    comment, renamed, line = (replay.folder / "tf.sh").read_text(encoding="utf-8").splitlines()
    assert comment.startswith("# floor.mcap: ")
    assert renamed == "# r2/map is what r2 recorded as 'map'"
    number = r"-?\d+\.\d{6}"
    command = rf"rosrun tf2_ros static_transform_publisher {number} {number} 0 {number}\d{{3}} 0 0 merged r2/map"
    assert re.fullmatch(command, line)


def test_transforms_as_of_a_time(replay: Program, outcome: Path) -> None:
    ran = replay("export", outcome, "--to", "tf", "--at", "1")
    assert "# r2 is not placed" in ran.out
    assert "final report alone" in replay("export", outcome.with_suffix(".json"), "--to", "tf", "--at", "1").error


def test_a_script_of_transforms_runs_them_beside_each_other(replay: Program, outcome: Path) -> None:
    assert replay("export", outcome, "--to", "tf", "-o", "tf.sh").status == 0
    stand_in = "ros2() { echo began >>began; until [ $(wc -l <began) = 2 ]; do sleep 0.01; done; }\n"
    script = stand_in + (replay.folder / "tf.sh").read_text(encoding="utf-8")
    subprocess.run(["bash", "-c", script], cwd=replay.folder, check=True, timeout=60.0)
    assert (replay.folder / "began").read_text(encoding="utf-8") == "began\n" * 2


@pytest.mark.parametrize("target", ["tf", "png"])
def test_a_time_after_the_run_is_named(replay: Program, outcome: Path, target: str) -> None:
    ran = replay("export", outcome, "--to", target, "--at", "9999", "-o", "late")
    assert ran.status == 0
    assert "--at 9999 is after the run, which ends at " in ran.err
    in_time = replay("export", outcome, "--to", target, "--at", "1", "-o", "early")
    assert "is after the run" not in in_time.err


def test_a_scale_is_no_transform(replay: Program, outcome: Path) -> None:
    report = json.loads(outcome.with_suffix(".json").read_text(encoding="utf-8"))
    report["robots"]["r2"]["merged_from_map"]["scale"] = 1.25
    report["robots"]["r1"]["map_frame"] = "map; rm -rf"
    (replay.folder / "scaled.json").write_text(json.dumps(report), encoding="utf-8")
    _, renamed, first, second = replay("export", "scaled.json", "--to", "tf").out.splitlines()
    assert second.startswith("# r2 is placed with a scale of 1.250000, which no transform can say")
    assert shlex.split(first)[-1] == "map; rm -rf"
    assert renamed == "# map; rm -rf is what r1 recorded as 'map'"


def test_nothing_is_replaced_unless_that_is_said(replay: Program, outcome: Path) -> None:
    (replay.folder / "floor.yaml").write_text("mine", encoding="utf-8")
    assert "there is already" in replay("export", outcome).error
    assert [path.name for path in replay.folder.iterdir()] == ["floor.yaml"]
    assert replay("export", outcome, "--force").status == 0
    assert sorted(path.name for path in replay.folder.iterdir()) == ["floor.pgm", "floor.yaml"]


def test_no_input_is_replaced(replay: Program, tmp_path: Path) -> None:
    saved = write_saved_map(tmp_path / "saved.yaml", np.full((4, 4), 254, np.uint8), "saved.pgm")
    content = (tmp_path / "saved.pgm").read_bytes()
    for name in ("saved", "saved.yaml", "saved.pgm"):
        ran = replay("export", saved, "-o", name, "--force")
        assert ran.status == 2
        assert "is an input" in ran.error
    assert (tmp_path / "saved.pgm").read_bytes() == content


def test_both_files_or_none(replay: Program, outcome: Path) -> None:
    (replay.folder / "floor.yaml").mkdir()
    ran = replay("export", outcome, "--force")
    assert ran.status == 3
    assert [path.name for path in replay.folder.iterdir()] == ["floor.yaml"]
    assert "there is no such folder" in replay("export", outcome, "-o", "absent/floor").error


@pytest.mark.parametrize("name", ["floor", "floor.yaml", "floor.pgm"])
def test_a_name_may_have_its_ending(replay: Program, outcome: Path, name: str) -> None:
    assert replay("export", outcome, "-o", name).status == 0
    assert sorted(path.name for path in replay.folder.iterdir()) == ["floor.pgm", "floor.yaml"]


@pytest.mark.parametrize("name", ["floor.v2", "a floor: 1", "étage", "no", "#1"])
def test_any_name_leads_to_its_image(replay: Program, outcome: Path, name: str) -> None:
    assert replay("export", outcome, "-o", name, "--mode", "raw").status == 0
    assert described(replay.folder / f"{name}.yaml")["image"] == f"{name}.pgm"
    assert loaded(replay.folder / f"{name}.yaml").cells.shape == maps(outcome)[-1].grid.cells.shape


def test_exports_repeat_to_the_byte(replay: Program, outcome: Path) -> None:
    written = []
    for _ in range(2):
        for target in ("map_server", "png"):
            assert replay("export", outcome, "--to", target, "--force").status == 0
        written.append({path.name: path.read_bytes() for path in replay.folder.iterdir()})
    assert written[0] == written[1]


def test_a_map_that_cannot_be_used_is_left_out_and_named(replay: Program, tmp_path: Path) -> None:
    run = write_mcap(tmp_path / "run.mcap", [seen("r1", 0.0), seen("r1", 1.0, bare_room(), resolution=0.0)])
    ran = replay("export", run, "--mode", "raw")
    assert ran.status == 0
    assert "replay: skipped (run.mcap, /r1/map at " in ran.err
    assert "bad_resolution" in ran.err
    assert np.array_equal(loaded(replay.folder / "run.yaml").cells, flat_map("r1").cells)


def test_maps_of_a_recording_for_each_robot(replay: Program) -> None:
    runs = [ROOT / "samples/bag_per_robot" / name for name in ("alpha", "bravo")]
    out = replay.merge(*runs).mcap
    maps_of = [flag for run in runs for flag in ("--maps", run)]
    assert "bravo was merged, and is not given" in replay("export", out, "--robots", "alpha", "--maps", runs[0]).error
    ran = replay("export", out, "--robots", "alpha,bravo", *maps_of, "--mode", "raw")
    assert ran.status == 0, ran.err
    merged = maps(out)[-1].grid.cells
    known = [loaded(replay.folder / f"out.{run.name}.yaml").cells >= 0 for run in runs]
    assert known[0].shape == merged.shape
    # the poses of a report are rounded, so that a cell may lie beside the one that it was merged from
    assert (known[0] | known[1])[merged >= 0].mean() > 0.999


@pytest.mark.parametrize("content", [b"", b"nothing", b"\x89MCAP0\r\n"])
def test_what_is_no_recording_is_refused(replay: Program, content: bytes) -> None:
    (replay.folder / "bad.mcap").write_bytes(content)
    assert replay("export", "bad.mcap").error.startswith("bad.mcap: ")
    assert replay("export", "bad.mcap", "--to", "tf").error.startswith("bad.mcap: ")


def test_maps_are_taken_of_what_was_merged_alone(replay: Program, tmp_path: Path) -> None:
    for folder, robot in (("a", "r1"), ("b", "r2"), ("c", "r2")):
        (tmp_path / folder).mkdir()
        last = flat_map(robot) if folder != "c" else bare_room()
        write_mcap(
            tmp_path / folder / "run.mcap", [*growing(robot, topic="/map"), seen(robot, 40.0, last, topic="/map")]
        )
    one, other, third = (tmp_path / folder / "run.mcap" for folder in "abc")
    out = replay.merge(f"r1={one}", f"r2={other}").mcap

    def exported(*runs: str, file: Path = out, robots: str = "r2", flags: tuple[str, ...] = ()) -> Ran:
        maps_of = [flag for run in runs for flag in ("--maps", run)]
        return replay("export", file, "--robots", robots, *maps_of, "--mode", "raw", "--force", *flags)

    assert "run.mcap was merged, and is not given" in exported(f"r2={other}").error
    assert "is not the recording that was merged: it has " in exported(f"r1={one}", f"r2={third}").error
    assert "is not the recording that was merged" in exported(f"r2={one}", f"r1={other}").error
    assert "r3" in exported(f"r1={one}", f"r3={other}").error
    for file in (out, out.with_suffix(".json")):
        ran = exported(f"r2={other}", f"r1={one}", file=file)
        assert (ran.status, ran.out) == (0, ""), ran.err
        assert "digests" not in ran.err
    assert exported(f"r1={one}", f"r2={other}", flags=("--at", "12")).status == 0


@pytest.mark.parametrize("flags", [(), ("--at", "12")])
def test_a_recording_of_the_same_size_with_other_maps_is_refused(
    replay: Program, two: Path, tmp_path: Path, flags: tuple[str, ...]
) -> None:
    (tmp_path / "other").mkdir()
    content = bytearray(write_mcap(tmp_path / "other" / two.name, two_robots(), compression="none").read_bytes())
    plain = write_mcap(tmp_path / two.name, two_robots(), compression="none")
    out = replay.merge(plain).mcap
    cells = flat_map("r2", 9.0).cells.tobytes()
    at_byte = content.index(cells) + cells.index(b"\x64")
    content[at_byte] = 0x32
    other = tmp_path / "other" / two.name
    other.write_bytes(content)
    ran = replay("export", out, "--robots", "r2", "--maps", other, *flags)
    assert ran.status == 2
    assert "its maps have another digest" in ran.err
    assert replay("export", out, "--robots", "r2", "--maps", plain, *flags).status == 0


@pytest.mark.parametrize("flags", [("--start", "5"), ("--stop", "11"), ("--start", "5", "--stop", "15")])
def test_maps_of_a_part_of_a_recording_are_those_of_that_part(
    replay: Program, two: Path, flags: tuple[str, ...]
) -> None:
    out = replay.merge(two, *flags).mcap
    assert replay("export", out, "--robots", "r1", "--maps", two, "--mode", "raw", "-o", "r1").status == 0
    assert (loaded(replay.folder / "r1.yaml").cells >= 0).any()


def test_comments_stay_comments_whatever_names_are_in_them(replay: Program, outcome: Path) -> None:
    report = json.loads(outcome.with_suffix(".json").read_text(encoding="utf-8"))
    evil = "r2\ntouch pwned\r\x1b[2J"
    found = report["robots"].pop("r2")
    report["robots"][evil] = {**found, "status": "unmerged", "merged_from_map": None}
    report["robots"][evil]["reason"] = {"code": "ambiguous", "message": evil}
    report["reference"] = evil
    path = replay.folder / "a\ntouch pwned.json"
    path.write_text(json.dumps(report), encoding="utf-8")
    ran = replay("export", path, "--to", "tf")
    assert (ran.status, ran.err) == (0, "")
    lines = ran.out.split("\n")
    assert [line[:2] for line in lines] == ["# ", "# ", "ro", "# ", ""]
    assert "".join(lines).isprintable()


def test_a_reason_that_there_is_not_is_refused(replay: Program, outcome: Path) -> None:
    report = json.loads(outcome.with_suffix(".json").read_text(encoding="utf-8"))
    report["robots"]["r2"]["reason"]["code"] = "x\ntouch pwned"
    (replay.folder / "bad.json").write_text(json.dumps(report), encoding="utf-8")
    error = replay("export", "bad.json", "--to", "tf").error
    assert "robots.r2.reason.code is 'x\\ntouch pwned'; expected one of reference, accepted" in error


@pytest.mark.parametrize(
    ("target", "name"),
    [
        *((target, name) for target in ("map_server", "tf") for name in ("", ".", "..", "/", "there", "there/..")),
        ("map_server", ".yaml"),
        ("png", "there/.png"),
    ],
)
def test_a_name_that_no_file_can_have_is_refused(replay: Program, outcome: Path, target: str, name: str) -> None:
    (replay.folder / "there").mkdir()
    ran = replay("export", outcome, "--to", target, "-o", name)
    assert ran.status == 2
    assert "expected a name, such as " in ran.error
    assert [path.name for path in replay.folder.rglob("*")] == ["there"]


def test_who_is_not_in_the_merged_map_is_said(replay: Program, tmp_path: Path) -> None:
    run = write_mcap(tmp_path / "run.mcap", in_log_order(growing("r1"), [seen("r2", 30.0, bare_room())]))
    assert replay("merge", run, "--no-rrd", "-o", tmp_path / "out.mcap").status == 0
    ran = replay("export", tmp_path / "out.mcap", "-o", tmp_path / "floor")
    assert ran.status == 0
    assert "not in the merged map: r2;" in ran.err


@pytest.mark.parametrize("ros", ["1", "2"])
@pytest.mark.parametrize("frame", ["f" * 300, f"a {'b' * 250}", "it's; $(x)", "é"])
def test_a_frame_is_as_it_is_in_its_command(replay: Program, outcome: Path, frame: str, ros: str) -> None:
    report = json.loads(outcome.with_suffix(".json").read_text(encoding="utf-8"))
    report["robots"]["r2"]["map_frame"] = frame
    (replay.folder / "odd.json").write_text(json.dumps(report), encoding="utf-8")
    ran = replay("export", "odd.json", "--to", "tf", "--robots", "r2", "--ros", ros)
    assert shlex.split(ran.out.splitlines()[-1])[-1] == frame


@pytest.mark.parametrize(
    ("frame", "ros"), [("-h", "2"), ("-h", "1"), ("a\nb", "2"), ("\u202emap", "2"), ("", "2"), ("__name:=x", "1")]
)
def test_a_frame_that_no_command_can_name_is_a_comment(replay: Program, outcome: Path, frame: str, ros: str) -> None:
    report = json.loads(outcome.with_suffix(".json").read_text(encoding="utf-8"))
    report["robots"]["r2"]["map_frame"] = frame
    (replay.folder / "odd.json").write_text(json.dumps(report), encoding="utf-8")
    lines = replay("export", "odd.json", "--to", "tf", "--ros", ros).out.splitlines()[1:]
    assert lines[-1].startswith("# r2: its frame ")
    assert "cannot be typed: it" in lines[-1]
    # that of r1 is alone, so that there is nothing to wait for
    (command,) = (line for line in lines if not line.startswith("#"))
    assert command.endswith(" r1/map")


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (("--robots", ""), "--robots : expected names with commas between them"),
        (("--robots", "r1,"), "--robots r1,: expected names"),
        (("--to", "png", "--mode", "raw"), "--mode is how map_server maps hold cells"),
        (("--to", "tf", "--mode", "raw"), "--mode is how map_server maps hold cells"),
        (("--ros", "2"), "--ros is for which ROS transforms are"),
        (("--to", "tf", "--robots", "r2", "--maps", "x.mcap"), "not with --to tf"),
        (("--to", "tf", "--robots", ""), "--robots : expected names"),
    ],
)
def test_flags_that_say_nothing_are_refused(replay: Program, outcome: Path, flags: tuple[str, ...], said: str) -> None:
    ran = replay("export", outcome, *flags)
    assert ran.status == 2
    assert said in ran.error
    assert not list(replay.folder.iterdir())


def test_a_link_gives_its_own_name(replay: Program, outcome: Path) -> None:
    for link in ("latest", "newest.mcap"):
        (replay.folder / link).symlink_to(outcome)
        assert replay("export", link).status == 0
    assert {path.name for path in replay.folder.glob("*.pgm")} == {"latest.pgm", "newest.pgm"}


def test_who_is_merged_later_is_not_said_to_be_left_out(replay: Program, outcome: Path) -> None:
    ran = replay("export", outcome, "--at", "1", "--to", "png", "-o", "early")
    assert "replay: not in the merged map at that time: r2" in ran.err.splitlines()
    assert "not in the merged map" not in replay("export", outcome, "--to", "png", "-o", "late").err


def test_a_time_before_the_first_merged_map_is_told_when_that_is(replay: Program, tmp_path: Path) -> None:
    run = write_mcap(tmp_path / "late.mcap", [seen("r2", 0.0), seen("r1", 1.3), seen("r2", 2.0)])
    out = replay.merge(run).mcap
    ran = replay("export", out, "--at", "1")
    assert ran.error == f"{out}: the first merged map is of 1.3 s after the first map"
    assert replay("export", out, "--at", "1.3", "-o", "then").status == 0
    first = replay("export", run, "--topic", "/r1/map", "--at", "1ns").error
    time = first.rpartition("(")[2].removesuffix(")")
    assert "the first map is of 2" in first
    assert replay("export", run, "--topic", "/r1/map", "--at", time, "-o", "first").status == 0
