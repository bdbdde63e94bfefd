"""What the Rerun recording holds, read back with Rerun's own reader, and that the viewer can show it."""

from __future__ import annotations

import re
import subprocess
import sys
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from mapmerge.merger import Merger
from mapmerge.outcome import Status
from mapmerge.sim2 import IDENTITY, Sim2
from replay.errors import OutputError
from replay.events import Event, Finished, Merged, Moved, Noted, RobotInput, Skipped, Started, Timing
from replay.gallery import Gallery
from replay.options import OutputOptions, RunOptions
from replay.report import ReportBuilder
from replay.sinks.partial_file import PartialFile
from replay.sinks.rerun_entities import GROUND
from replay.sinks.rerun_file import RerunSink
from replay.sinks.rerun_labels import label_places_m
from replay.sinks.rerun_layout import Box, lay_out
from replay.sinks.rerun_patches import LEAST_CELLS, MAX_SIDE_CELLS
from replay.sinks.rerun_paths import PIECE_POSES
from replay.sinks.rerun_stream import RrdStream
from replay.skip_cause import SkipCause
from replay.viewer import environment, program
from tests.data_paths import ROOT
from tests.floors import filled
from tests.renderer import needs_renderer
from tests.rrd import contents, rows_of
from tests.runs import bare_room, flat_map, reference_from
from tests.scenarios import events_of as events_in

ROBOTS = ("r1", "r2", "odd one/ü.3", "r4")
STRANGER = "odd one/ü.3"
STRANGER_PATH = rr.escape_entity_path_part(STRANGER)
STAMPS = tuple(1_700_000_000_000_000_001 + index * 1_234_567_891 for index in range(6))
OPTIONS = RunOptions(runs=())


@pytest.fixture(autouse=True)
def strict() -> Iterator[None]:
    """Let the library raise where it would only warn."""
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


def events_of(
    robots: Sequence[str],
    ticks: Mapping[int, Mapping[str, Grid]],
    skipped: Mapping[int, Skipped] | None = None,
    options: RunOptions = OPTIONS,
) -> list[Event]:
    """Return what a run with these maps would yield, as `replay.pipeline.run` does."""
    inputs = tuple(RobotInput(robot, f"/{robot}/map", f"{robot}/map", "header", (0,), 9) for robot in robots)
    settings = options.settings()
    merger = Merger(robots, options.merge)
    report, gallery = ReportBuilder(inputs, settings, "9.9"), Gallery("changed", merger.explain)
    found: list[Event] = [Started(inputs, settings, ({"name": "run.mcap"},))]
    for stamp_ns, grids in ticks.items():
        if skipped and stamp_ns in skipped:
            found.append(skipped[stamp_ns])
        result = merger.step(grids)
        report.take(stamp_ns, result)
        written = report.build(stamp_ns, result, ({"name": "run.mcap"},))
        found.append(Merged(stamp_ns, result, written, gallery.due(result), Timing(0.1, 0.2), 1, 9))
    last_ns = max(ticks, default=None)
    final = report.build(last_ns, merger.result, ({"name": "run.mcap", "sha256": "ab"},), is_last=True)
    return [*found, Finished(final)]


@pytest.fixture(scope="module")
def story() -> list[Event]:
    """A stranger beside two robots of which one is placed, withdrawn and placed again; a fourth says nothing."""
    ticks = {
        STAMPS[0]: {"r2": flat_map("r2", 1.0)},
        STAMPS[1]: {"r1": flat_map("r1"), STRANGER: bare_room()},
        STAMPS[2]: {"r2": flat_map("r2")},
        STAMPS[3]: {"r2": flat_map("r2")},
        STAMPS[4]: {"r2": bare_room()},
        STAMPS[5]: {"r2": flat_map("r2")},
    }
    cause = Skipped("r4", "/r4/map", 12, SkipCause.EMPTY, "it has 0 × 0 cells", "run.mcap")
    return events_of(ROBOTS, ticks, {STAMPS[2]: cause})


def written(path: Path, events: Sequence[Event]) -> Path:
    sink = RerunSink(PartialFile.claimed(path), OutputOptions(path.with_suffix(".mcap")))
    for event in events:
        sink.take(event)
    sink.finish()
    sink.publish()
    return path


@pytest.fixture(scope="module")
def recording(story: list[Event], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("rrd") / "run.rrd", story)


class Entity:
    """All rows of one entity that have a time; if none has, those without."""

    def __init__(self, path: Path, name: str) -> None:
        batches = [chunk.to_record_batch() for chunk in RrdReader(path).stream() if chunk.entity_path == name]
        assert batches, name
        rows = [row for batch in batches for row in rows_of(batch)]
        timed = [row for row in rows if "log_time" in row]
        self.rows = sorted(timed, key=lambda row: row["log_time"]) if timed else rows

    @property
    def stamps(self) -> list[int]:
        return [row["log_time"] for row in self.rows]

    def values(self, component: str) -> list[Any]:
        """Return the only instance of a component in each row, None where the row has not any."""
        return [(row.get(component) or [None])[0] for row in self.rows]


def misplaced(story: list[Event]) -> list[Event]:
    """Return the same run, but that r2 was placed a metre beside its place when it was placed first."""
    events = list(story)
    first = next(
        index
        for index, event in enumerate(events)
        if isinstance(event, Merged) and event.result.robots["r2"].status is Status.MERGED
    )
    event = events[first]
    assert isinstance(event, Merged)
    outcome = event.result.robots["r2"]
    assert outcome.merged_from_map is not None
    robots = {**event.result.robots, "r2": replace(outcome, merged_from_map=Sim2(1.0, 1.0) @ outcome.merged_from_map)}
    events[first] = replace(event, result=replace(event.result, robots=robots))
    return events


GREY, COLOURS = (int(getattr(rr.ColorModel, name).value) for name in ("L", "RGB"))


def pixels_of(row: Mapping[str, Any]) -> np.ndarray:
    """Return the picture of a logged map, row 0 with the lowest y again."""
    shape = row["GridMap:format"][0]
    channels = (3,) if shape["color_model"] == COLOURS else ()
    return np.array(row["GridMap:data"][0], np.uint8).reshape(shape["height"], shape["width"], *channels)[::-1]


def shades_of(row: Mapping[str, Any]) -> np.ndarray:
    """Return the shades of a logged map; of colours the red, which green changes least."""
    pixels = pixels_of(row)
    return pixels if pixels.ndim == 2 else pixels[..., 0]


# What is there, and when


def test_the_entities_are_those_of_the_documented_tree(recording: Path) -> None:
    found = {chunk.entity_path for chunk in RrdReader(recording).stream()}
    for robot in ("r1", "r2", STRANGER_PATH):
        assert {f"/merged/robots/{robot}{part}" for part in ("", "/map")} <= found
        assert any(path.startswith(f"/merged/robots/{robot}/walls/") for path in found)
        assert f"/merged/labels/{robot}" in found
    assert {"/merged/map", "/decisions", "/robots", "/about", "/plots/step_ms/merge"} <= found
    assert {"/summary", "/legend", "/skipped", "/status/r2", "/plots/pose/yaw/r2", "/evidence/r2/candidates"} <= found
    assert {f"/evidence/r2/{name}" for name in ("overlay", "orientation_spectra", "correlation_surface")} <= found
    assert not any("r4" in path for path in found if not path.startswith(("/plots", "/status")))


def test_every_entity_is_documented(recording: Path, story: list[Event], tmp_path: Path) -> None:
    text = (ROOT / "docs" / "output-formats.md").read_text(encoding="utf-8")
    rows = [line for line in text[text.index("## Rerun recording") :].splitlines() if line.startswith("| `/")]
    named = [name for row in rows for name in re.findall(r"`(/[^`]+)`", row.split("|")[1])]
    patterns = {name: re.compile(re.sub(r"<\w+>", r"(?:[^/\\\\]|\\\\.)+", name)) for name in named}
    driven = written(tmp_path / "driven.rrd", events_in("driven"))
    side = 2 * int(LEAST_CELLS**0.5)
    changed = np.zeros((side, side), np.int8)
    changed[3, 4] = 100
    ticks = {STAMPS[0]: {"r1": filled(0, side, side)}, STAMPS[1]: {"r1": Grid(changed, 0.05)}}
    large = written(tmp_path / "large.rrd", events_of(["r1"], ticks))
    wrong = written(tmp_path / "wrong.rrd", misplaced(story))
    found = {chunk.entity_path for path in (recording, driven, large, wrong) for chunk in RrdReader(path).stream()}
    assert {path for path in found if not any(pattern.fullmatch(path) for pattern in patterns.values())} == set()
    unused = {name for name, pattern in patterns.items() if not any(map(pattern.fullmatch, found))}
    assert unused == {"/plots/acceptance/limit"}, "the method that is used states a confidence"


def test_all_times_are_those_of_the_ticks(recording: Path) -> None:
    stamps: set[int] = set()
    for chunk in RrdReader(recording).stream():
        assert chunk.is_static or set(chunk.timeline_names) == {"log_time", "elapsed", "tick"}
        if not chunk.is_static:
            stamps |= {row["log_time"] for row in rows_of(chunk.to_record_batch())}
    assert stamps == set(STAMPS)
    assert Entity(recording, "/plots/step_ms/merge").stamps == list(STAMPS)


def test_maps_are_logged_when_they_change(recording: Path) -> None:
    assert Entity(recording, "/merged/robots/r1/map").stamps == [STAMPS[1]]
    assert Entity(recording, "/merged/robots/r2/map").stamps == [STAMPS[index] for index in (0, 2, 4, 5)]
    assert Entity(recording, "/merged/map").stamps == [STAMPS[index] for index in (1, 2, 4, 5)]


def test_maps_are_those_of_the_result(recording: Path, story: list[Event]) -> None:
    last = next(event for event in reversed(story) if isinstance(event, Merged))
    known = last.result.grids["r2"].cropped_to_known()
    for path, grid in (("/merged/map", last.result.merged), ("/merged/robots/r2/map", known)):
        row = Entity(recording, path).rows[-1]
        shades = shades_of(row)
        assert shades.shape == grid.cells.shape
        assert np.array_equal(shades == GROUND[0], grid.cells < 0)
        assert np.array_equal(shades > 100, grid.cells >= 65)
        pose = grid.map_from_grid
        assert row["GridMap:translation"][0] == pytest.approx([pose.x_m, pose.y_m, 0.0])
        assert row["GridMap:quaternion"][0] == pytest.approx([0, 0, np.sin(pose.yaw_rad / 2), np.cos(pose.yaw_rad / 2)])
        assert row["GridMap:cell_size"][0] == pytest.approx(grid.resolution_m)
    paths = {chunk.entity_path for chunk in RrdReader(recording).stream()}
    tiles = [Entity(recording, path).rows[-1] for path in paths if path.startswith("/merged/robots/r2/walls/")]
    assert sum(len(row["Points3D:positions"] or ()) for row in tiles) == np.count_nonzero(known.cells >= 65)


def test_the_merged_map_is_tinted_while_maps_are_placed(recording: Path, story: list[Event]) -> None:
    entity = Entity(recording, "/merged/map")
    assert [row["GridMap:format"][0]["color_model"] for row in entity.rows] == [GREY, COLOURS, GREY, COLOURS]
    pixels, cell_m = pixels_of(entity.rows[-1]).astype(int), entity.rows[-1]["GridMap:cell_size"][0]
    green = pixels[..., 1] > pixels[..., 0]
    last = next(event for event in reversed(story) if isinstance(event, Merged))
    assert green.sum() * cell_m**2 == pytest.approx(last.result.robots["r2"].agreement.overlap_m2, rel=0.2)


def test_contradictions_are_marked_above_the_walls_until_they_are_gone(story: list[Event], tmp_path: Path) -> None:
    entity = Entity(written(tmp_path / "wrong.rrd", misplaced(story)), "/merged/contradictions")
    places, *_, cleared = entity.rows
    assert len(places["Points3D:positions"]) > 20
    assert all(z > 0.1 for _, _, z in places["Points3D:positions"])
    assert cleared.get("Clear:is_recursive") == [False]


def test_ways_grow_piece_by_piece_and_are_parted_where_robots_jump(story: list[Event], tmp_path: Path) -> None:
    ticks = [event for event in story if isinstance(event, Merged)]
    straight = np.zeros((PIECE_POSES + 50, 3))
    straight[:, 0] = 0.1 * np.arange(len(straight))
    jumped = straight[:9] + np.array([0.0, 50.0, 1.5])
    ways = {1: Moved("r1", straight), 2: Moved("r1", jumped), 0: Moved("r4", straight)}
    moved = {id(ticks[index]): way for index, way in ways.items()}
    events = [replace(each, moved=(moved[id(each)],)) if id(each) in moved else each for each in story]
    path = written(tmp_path / "ways.rrd", events)
    assert Entity(path, "/merged/robots/r1/path/0").stamps == [STAMPS[1]]
    last = Entity(path, "/merged/robots/r1/path/1")
    assert last.stamps == [STAMPS[1], STAMPS[2]]
    assert [len(strip) for strip in last.rows[1]["LineStrips3D:strips"]] == [51, 9]
    assert last.rows[0]["LineStrips3D:strips"][0][-1][:2] == pytest.approx(straight[-1, :2])
    position = Entity(path, "/merged/robots/r1/position").rows[-1]
    assert position["Points3D:positions"][0][:2] == pytest.approx(jumped[-1, :2])
    x, y, _ = position["Arrows3D:vectors"][0]
    assert np.arctan2(y, x) == pytest.approx(1.5)
    assert not any("/r4/path" in chunk.entity_path for chunk in RrdReader(path).stream())


def test_a_placed_map_is_under_its_placement(recording: Path) -> None:
    row = Entity(recording, "/merged/robots/r2").rows[-1]
    true = reference_from("r2")
    assert row["Transform3D:translation"][0][:2] == pytest.approx([true.x_m, true.y_m], abs=0.15)
    x, y, z, w = row["Transform3D:quaternion"][0]
    assert (x, y) == (0, 0)
    assert 2 * np.arctan2(z, w) == pytest.approx(true.yaw_rad, abs=0.02)


def test_a_map_that_is_not_placed_is_beside_the_merged_map_with_its_reason(recording: Path, story: list[Event]) -> None:
    last = next(event for event in reversed(story) if isinstance(event, Merged))
    assert last.result.robots[STRANGER].status is Status.UNMERGED
    merged = last.result.merged
    right_m = merged.map_from_grid.x_m + merged.cols * merged.resolution_m
    grid = last.result.grids[STRANGER].cropped_to_known()
    x_m, *_ = Entity(recording, f"/merged/robots/{STRANGER_PATH}").rows[-1]["Transform3D:translation"][0]
    assert x_m + grid.map_from_grid.x_m > right_m
    label = Entity(recording, f"/merged/labels/{STRANGER_PATH}").values("Points3D:labels")[-1]
    reason = last.result.robots[STRANGER].reason
    assert label == f"{STRANGER}: not merged,\n{str(reason.code).replace('_', ' ')}"
    assert reason.message in Entity(recording, "/summary").values("TextDocument:text")[-1].replace("\\", "")


def test_labels_follow_the_status(recording: Path) -> None:
    entity = Entity(recording, "/merged/labels/r2")
    labels = dict(zip(entity.stamps, entity.values("Points3D:labels"), strict=True))
    assert labels[STAMPS[0]] == "r2: not merged,\nno reference map"
    assert labels[STAMPS[2]] == "r2"
    assert labels[STAMPS[4]].startswith("r2: not merged,\n")
    assert labels[STAMPS[5]] == "r2"


def test_pictures_are_those_of_the_events(recording: Path, story: list[Event]) -> None:
    for event in story:
        for item in event.pictures if isinstance(event, Merged) else ():
            path = f"/evidence/{STRANGER_PATH if item.robot == STRANGER else item.robot}/{item.picture.step}"
            entity = Entity(recording, path)
            row = entity.rows[entity.stamps.index(event.stamp_ns)]
            shape = row["Image:format"][0]
            pixels = np.array(row["Image:buffer"][0], np.uint8).reshape(shape["height"], shape["width"], 3)
            assert np.array_equal(pixels, item.picture.rgb)


# Numbers and words


def test_refused_values_are_apart_from_those_of_placed_maps(recording: Path) -> None:
    placed = Entity(recording, "/plots/acceptance/placed/r2")
    values = dict(zip(placed.stamps, placed.values("Scalars:scalars"), strict=True))
    assert list(values) == [STAMPS[index] for index in (2, 3, 4, 5)]
    assert np.isnan(values.pop(STAMPS[4]))
    assert min(values.values()) > 0.95
    assert not set(Entity(recording, "/plots/overlap_m2/refused/r2").stamps) & set(values)


def test_decisions_say_what_happened_and_why(recording: Path) -> None:
    entity = Entity(recording, "/decisions")
    said = list(zip(entity.stamps, entity.values("TextLog:level"), entity.values("TextLog:text"), strict=True))
    expected = [
        (STAMPS[2], "WARN", "r4: a message of /r4/map was skipped: it has 0 × 0 cells"),
        (STAMPS[2], "INFO", "r2 placed on r1: "),
        (STAMPS[4], "WARN", "the map of r2 jumped in its own frame"),
        (STAMPS[4], "WARN", "r2 is withdrawn: not placed on "),
        (STAMPS[5], "INFO", "r2 placed on r1: "),
        (STAMPS[5], "WARN", "end: 2 of 4 maps are merged"),
        (STAMPS[5], "WARN", f"{STRANGER} is not merged: not placed on "),
        (STAMPS[5], "WARN", "r4 is not merged: no map that shows anything yet"),
    ]
    for (stamp_ns, level, words), (expected_ns, expected_level, begin) in zip(said, expected, strict=True):
        assert (stamp_ns, level) == (expected_ns, expected_level)
        assert words.startswith(f"+{(stamp_ns - STAMPS[0]) / 1e9:.1f} s  {begin}")


def test_the_table_has_every_robot(recording: Path) -> None:
    text = Entity(recording, "/robots").values("TextDocument:text")[-1]
    head, rule, *rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("|")]
    assert head[0] == "robot"
    assert set(rule) == {"---"}
    assert [row[0] for row in rows] == list(ROBOTS)
    assert [row[1] for row in rows] == ["reference", "merged", "unmerged", "no\\_map"]


def test_the_summary_says_the_first_setbacks_and_how_many_more(tmp_path: Path) -> None:
    maps = [{"r2": bare_room() if index % 2 else flat_map("r2")} for index in range(11)]
    events = events_of(("r1", "r2"), dict(enumerate([{"r1": flat_map("r1")}, *maps])))
    pages = Entity(written(tmp_path / "run.rrd", events), "/summary").values("TextDocument:text")
    wrong = pages[-1].partition("went wrong")[2].partition("### Decisions")[0].strip().splitlines()
    told = ["- the map of **r2** jumped in its own frame", "- **r2** was withdrawn for some time"]
    assert [line.partition(":")[0] for line in wrong] == [*told, *told, *told, "- and 4 more"]
    assert "jumped" not in pages[1]


def test_candidates_are_those_of_a_pair_and_say_their_frame(recording: Path) -> None:
    """The pair is called by both robots: the reason of either names the other one."""
    pages = Entity(recording, "/evidence/r2/candidates").values("TextDocument:text")
    assert pages[-1].startswith("# r1 and r2: accepted\n")
    assert any(page.startswith("# r1 and r2: **refused**\n") for page in pages)
    assert "Where the map frame of r2 lies in that of r1" in pages[-1]


def test_names_in_pages_are_read_as_they_are(tmp_path: Path) -> None:
    name = "a|b_*c*_#`d`<e>~~f~~{g}"
    events = events_of(("r1", name), {0: {"r1": flat_map("r1")}})
    path = written(tmp_path / "run.rrd", events)
    escaped = re.sub(r"([^\w])", r"\\\1", name).replace("_", "\\_")
    for page in ("/summary", "/robots"):
        assert f"**{escaped}**" in Entity(path, page).values("TextDocument:text")[-1]
    other = written(tmp_path / "other.rrd", events_of((name, "r1"), {0: {"r1": flat_map("r1")}}))
    assert f"Reference: **{escaped}**" in Entity(other, "/about").values("TextDocument:text")[-1]


def test_about_holds_inputs_and_settings(recording: Path) -> None:
    entity = Entity(recording, "/about")
    assert "log_time" not in entity.rows[0]
    (text,) = entity.values("TextDocument:text")
    assert '"sha256": "ab"' in text
    assert '"min_acceptance": 0.95' in text


# What the viewer is told


def test_the_blueprint_opens_on_the_end_from_above(recording: Path) -> None:
    reader = RrdReader(recording)
    (store,) = reader.blueprints()
    assert store.application_id == reader.recordings()[0].application_id
    logged = [row for chunk in reader.stream(store=store) for row in rows_of(chunk.to_record_batch())]
    merged = {name: value for row in logged for name, value in row.items() if value}
    assert merged["TimePanelBlueprint:timeline"] == ["elapsed"]
    assert merged["TimePanelBlueprint:play_state"] == [3]  # following: at the newest data
    assert merged["EyeControls3D:position"][0][:2] == merged["EyeControls3D:look_target"][0][:2]
    classes = [row["ViewBlueprint:class_identifier"][0] for row in logged if row.get("ViewBlueprint:class_identifier")]
    assert {"3D", "2D", "TimeSeries", "TextLog", "TextDocument", "StateTimeline"} <= set(classes)
    names = [row["ContainerBlueprint:display_name"][0] for row in logged if row.get("ContainerBlueprint:display_name")]
    assert {"Merged", "Method", "Over time", "Decisions", "r2"} <= set(names)


def test_two_runs_write_the_same_but_for_the_time_they_took(
    story: list[Event], recording: Path, tmp_path: Path
) -> None:
    slower = [replace(event, timing=Timing(3.0, 4.0)) if isinstance(event, Merged) else event for event in story]
    again = written(tmp_path / "again.rrd", slower)
    assert RrdReader(again).recordings()[0].recording_id == RrdReader(recording).recordings()[0].recording_id
    assert contents(again) == contents(recording)


# Odd runs


def test_a_run_without_any_map_is_still_a_recording(tmp_path: Path) -> None:
    skipped = Skipped("r1", "/r1/map", 12, SkipCause.EMPTY, "it has 0 × 0 cells", "run.mcap")
    started, finished = events_of(["r1"], {})
    path = written(tmp_path / "none.rrd", [started, skipped, finished])
    texts = Entity(path, "/decisions").values("TextLog:text")
    assert "r1 is not merged: no map that shows anything yet" in texts


def test_what_a_reader_should_know_is_among_the_decisions(tmp_path: Path) -> None:
    started, *rest = events_of(["r1"], {STAMPS[0]: {"r1": flat_map("r1")}})
    skipped = Skipped("", "/tf", 12, SkipCause.BAD_TRANSFORM, "the transform from 'b' to 'a' is none", "run.mcap")
    path = written(tmp_path / "noted.rrd", [started, Noted("r2", "no prior is used for it"), skipped, *rest])
    texts = Entity(path, "/decisions").values("TextLog:text")
    assert "+0.0 s  r2: no prior is used for it" in texts
    assert "+0.0 s  a message of /tf was skipped: the transform from 'b' to 'a' is none" in texts


def test_maps_that_know_nothing_or_have_no_walls_are_no_trouble(tmp_path: Path) -> None:
    ticks = {
        STAMPS[0]: {"r1": filled(-1, 20, 30), "r2": filled(0, 20, 30)},
        STAMPS[1]: {"r1": filled(0, 20, 30), "r2": filled(-1, 20, 30)},
        STAMPS[2]: {"r1": Grid(np.zeros((0, 0), np.int8), 0.05)},
    }
    path = written(tmp_path / "bare.rrd", events_of(["r1", "r2"], ticks))
    assert Entity(path, "/merged/robots/r1/map").stamps == list(STAMPS[:3])
    assert Entity(path, "/merged/labels/r2").rows[-1].get("Clear:is_recursive") == [False]


def test_a_map_larger_than_a_texture_is_shown_coarser(tmp_path: Path) -> None:
    cells = np.zeros((3, MAX_SIDE_CELLS + 2), np.int8)
    cells[1, 5] = 100
    path = written(tmp_path / "wide.rrd", events_of(["r1"], {STAMPS[0]: {"r1": Grid(cells, 0.05)}}))
    row = Entity(path, "/merged/robots/r1/map").rows[0]
    assert row["GridMap:cell_size"][0] == pytest.approx(0.1)
    assert shades_of(row).shape == (2, MAX_SIDE_CELLS // 2 + 1)
    assert shades_of(row)[0, 2] == shades_of(row).max() > 100


def test_a_run_without_pictures_has_no_views_for_them(story: list[Event], tmp_path: Path) -> None:
    plain = [replace(event, pictures=()) if isinstance(event, Merged) else event for event in story]
    reader = RrdReader(written(tmp_path / "plain.rrd", plain))
    (store,) = reader.blueprints()
    text = str([rows_of(chunk.to_record_batch()) for chunk in reader.stream(store=store)])
    assert "Spatial3DView" not in text
    assert "'3D'" in text
    assert "'2D'" not in text


# The file


def test_the_final_name_is_given_only_when_published(story: list[Event], tmp_path: Path) -> None:
    path = tmp_path / "run.rrd"
    sink = RerunSink(PartialFile.claimed(path), OutputOptions(tmp_path / "run.mcap"))
    for event in story[:3]:
        sink.take(event)
    assert [each.name for each in tmp_path.iterdir()] == ["run.rrd.partial"]
    sink.discard()
    sink.discard()
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_not_there_is_an_output_error(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"run\.rrd: cannot be written: No such file or directory"):
        PartialFile.claimed(tmp_path / "none" / "run.rrd")


def test_errors_of_the_library_are_output_errors(
    story: list[Event], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_self: RrdStream, _stamp_ns: int) -> None:
        raise RuntimeError("it broke")

    sink = RerunSink(PartialFile.claimed(tmp_path / "run.rrd"), OutputOptions(tmp_path / "run.mcap"))
    sink.take(story[0])
    monkeypatch.setattr(RrdStream, "at", fail)
    with pytest.raises(OutputError, match=r"run\.rrd: cannot be written: it broke"):
        sink.take(story[1])
    sink.discard()


@pytest.mark.skipif(sys.platform == "win32", reason="no limit on the size of files there")
def test_a_full_disk_ends_the_run_and_does_not_hang(tmp_path: Path) -> None:
    script = textwrap.dedent("""
        import resource, signal, sys, uuid
        from pathlib import Path
        import numpy as np, rerun as rr
        from replay.sinks.partial_file import PartialFile
        from replay.sinks.rerun_stream import RrdStream

        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
        file = PartialFile.claimed(Path(sys.argv[1]))
        stream = RrdStream(file, uuid.UUID(int=7))
        stream.at(1)
        noise = np.random.default_rng(1).integers(0, 255, (300, 300, 3), np.uint8)
        for name in "abc":
            stream.log([name], rr.Image(noise))
        try:
            stream.finish()
        except OSError as error:
            print("refused:", error)
        stream.close()
        file.discard()
    """)
    done = subprocess.run(
        [sys.executable, "-c", script, tmp_path / "run.rrd"], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("refused: ")
    assert "File too large" in done.stdout
    assert not list(tmp_path.iterdir())


# Where maps are shown


SQUARE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])


def test_parked_maps_overlap_nothing(story: list[Event]) -> None:
    last = next(event.result for event in reversed(story) if isinstance(event, Merged))
    refused = last.robots[STRANGER]
    robots = {"r1": last.robots["r1"]}
    for index in range(7):
        placement = replace(refused.placement, component=f"s{index}", component_from_map=Sim2(index, 0.0, 0.3 * index))
        robots[f"s{index}"] = replace(refused, placement=placement)
    corners_m = {robot: SQUARE * (1.0 + index % 3) for index, robot in enumerate(robots)}
    layout = lay_out(replace(last, robots=robots), corners_m, corners_m)
    assert list(layout.merged_from_map) == list(robots)
    boxes = [Box.around(pose.apply(corners_m[robot])) for robot, pose in layout.merged_from_map.items()]
    for index, one in enumerate(boxes):
        for other in boxes[index + 1 :]:
            beside = one.x1_m < other.x0_m or other.x1_m < one.x0_m
            assert beside or one.y1_m < other.y0_m or other.y1_m < one.y0_m
    assert layout.extent == Box.around(np.array([[b.x0_m, b.y0_m] for b in boxes] + [[b.x1_m, b.y1_m] for b in boxes]))


def test_maps_that_fit_each_other_are_parked_as_they_fit(story: list[Event]) -> None:
    last = next(event.result for event in reversed(story) if isinstance(event, Merged))
    refused = last.robots[STRANGER]
    fits = Sim2(1.0, 2.0, 0.5)
    placements = {"a": IDENTITY, "b": fits}
    robots = {
        robot: replace(refused, placement=replace(refused.placement, component="a", component_from_map=pose))
        for robot, pose in placements.items()
    }
    shown = lay_out(replace(last, robots=robots), {"a": SQUARE, "b": SQUARE}, {}).merged_from_map
    assert (shown["a"].inverse() @ shown["b"]).is_close(fits, distance_m=1e-9, angle_rad=1e-9, at_m=(0.0, 0.0))


def test_names_stand_where_only_their_robot_was() -> None:
    strip_m = np.stack([np.arange(10.0), np.zeros(10)], axis=1)
    places_m = {"a": strip_m, "b": strip_m, "c": strip_m}
    found = label_places_m({"a": IDENTITY, "b": Sim2(4.0, 0.0), "c": Sim2(4.0, 0.0)}, places_m)
    assert found["a"] == (0.0, 0.0)
    assert found["b"][0] > 9.0
    assert abs(found["c"][0] - found["b"][0]) > 3.0


def test_the_name_of_a_map_alone_is_in_its_middle() -> None:
    assert label_places_m({"a": IDENTITY}, {"a": np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])}) == {"a": (1.0, 0.0)}


# The viewer


@pytest.fixture(scope="module")
def runs(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Runs of all outcomes: one robot of three is not merged, all are, nobody has a map, the paper's method."""
    folder = tmp_path_factory.mktemp("runs")
    by_paper = replace(OPTIONS, merge=MergeConfig(method="paper"))
    ticks = {STAMPS[0]: {"r1": flat_map("r1"), "r2": flat_map("r2")}}
    return {
        "partly": recording,
        "merged": written(folder / "merged.rrd", events_in("driven")),
        "empty": written(folder / "empty.rrd", events_in("no_map_at_all")),
        "none": written(folder / "none.rrd", events_of(["r1"], {})),
        "paper": written(folder / "paper.rrd", events_of(["r1", "r2"], ticks, options=by_paper)),
    }


TABS = ("Merged", "Method", "Over time", "Decisions")


@pytest.mark.parametrize("name", ["partly", "merged", "empty", "none", "paper"])
def test_the_viewer_shows_every_tab_at_every_time_without_complaint(
    runs: dict[str, Path], name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    needs_renderer()
    from scripts import screenshot
    from scripts.screenshot import complaints, seek, show, show_tab, tabs, viewer

    monkeypatch.setattr(screenshot, "SETTLE_S", 0.5)  # long enough for views to report
    shown: set[str] = set()
    with viewer("1000x700") as client:
        show(client, runs[name])
        assert tabs(client) == [tab for tab in TABS if tab != "Method" or name not in ("empty", "none")]
        for time_fraction in (1.0, 0.0, 0.5):
            seek(client, time_fraction)
            for tab in tabs(client):
                show_tab(client, tab)
                assert complaints(client) == []
                shown |= {view.name for view in client.get_state().views if view.visible}
        client.save_screenshot(str(tmp_path / "shot.png"))
    assert {
        "Maps",
        "Outcome",
        "Acceptance index",
        "Placed at yaw, °",
        "Robots at this time",
        "Skipped until this time",
    } <= shown
    assert ("Candidates" in shown) == (name not in ("empty", "none"))
    assert ("Interest points" in shown) == (name == "paper")
    assert (tmp_path / "shot.png").stat().st_size > 10_000


def test_the_library_finds_no_difference_between_two_runs(runs: dict[str, Path], tmp_path: Path) -> None:
    """Of a run in which nobody was withdrawn: the library holds gaps in lines to differ from themselves."""
    again = written(tmp_path / "again.rrd", events_in("driven"))
    done = subprocess.run(
        [str(program()), "rrd", "compare", "--unordered", str(runs["merged"]), str(again)],
        capture_output=True,
        text=True,
        timeout=60,
        env=environment(),
    )
    assert done.returncode == 0, done.stderr
