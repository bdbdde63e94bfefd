"""The written MCAP, read back with the libraries that others use."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.interfaces import Qos, QosDurability, QosReliability
from rosbags.rosbag2 import Reader as Rosbag2Reader
from rosbags.typesys import get_types_from_msg

from mapmerge.render import MAX_SIDE_PX
from mapmerge.sim2 import Sim2
from replay import __version__
from replay.codec import ros2_typestore
from replay.events import Finished, Merged, Started
from replay.options import OutputOptions
from replay.pipeline import drain
from replay.sinks.json_file import report_text
from replay.sinks.mcap_file import McapSink, topic_parts
from replay.sinks.partial_file import PartialFile
from tests.bags import SECOND
from tests.outputs import maps, metadata, raw, reports, same_map, summary, topics, transforms
from tests.runs import at, flat_map, is_right, reference_from
from tests.scenarios import SCENARIOS, events_of

TYPES = {
    "/merged/map": "nav_msgs/msg/OccupancyGrid",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/merged/images/r2/orientation_spectra": "sensor_msgs/msg/Image",
    "/merged/images/r2/correlation_surface": "sensor_msgs/msg/Image",
    "/merged/images/r2/overlay": "sensor_msgs/msg/Image",
    "/r1/map": "nav_msgs/msg/OccupancyGrid",
    "/r2/map": "nav_msgs/msg/OccupancyGrid",
}


def write(path: Path, scenario: str = "merged", **options: Any) -> Path:
    sink = McapSink(PartialFile.claimed(path), OutputOptions(path, **options))
    drain(events_of(scenario), [sink])
    sink.finish()
    sink.publish()
    return path


def ticks(scenario: str = "merged") -> list[Merged]:
    return [event for event in events_of(scenario) if isinstance(event, Merged)]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An MCAP with all that can be in one."""
    return write(tmp_path_factory.mktemp("mcap") / "whole.mcap", copy_maps=True)


class TestReaders:
    def test_mcap(self, whole: Path) -> None:
        assert topics(whole) == {**TYPES, "/merged/report": "json"}
        with whole.open("rb") as file:
            reader = make_reader(file, validate_crcs=True)
            assert reader.get_header().profile == "ros2"
            times = [message.log_time for _, _, message in reader.iter_messages(log_time_order=False)]
            assert times == sorted(times)
            assert all(message.publish_time == message.log_time for _, _, message in reader.iter_messages())

    def test_rosbags(self, whole: Path) -> None:
        with AnyReader([whole]) as reader:
            typed = {each.topic: each.msgtype for each in reader.connections if each.topic != "/merged/report"}
            assert typed == TYPES
            counts = dict.fromkeys(topics(whole), 0)
            for connection, time_ns, data in reader.messages():
                counts[connection.topic] += 1
                if connection.topic in TYPES:
                    message: Any = reader.deserialize(data, connection.msgtype)
                    header = (message.transforms[0] if connection.topic == "/tf" else message).header
                    assert header.stamp.sec * SECOND + header.stamp.nanosec == time_ns
            assert counts == {topic: len(raw(whole, topic)) for topic in counts}
            assert (reader.start_time, reader.end_time) == (at(0.0), at(22.0) + 1)

    def test_rerun(self, whole: Path) -> None:
        from rerun.chunk import McapReader

        found: dict[str, set[str]] = {}
        rows = dict.fromkeys(TYPES, 0)
        for chunk in McapReader(whole).stream():
            found.setdefault(chunk.entity_path, set()).update(chunk.to_record_batch().schema.names)
            if chunk.entity_path in rows and "message_log_time" in chunk.timeline_names:
                rows[chunk.entity_path] += chunk.num_rows
        for topic, msgtype in TYPES.items():
            archetype = {
                "OccupancyGrid": "GridMap:data",
                "TFMessage": "Transform3D:quaternion",
                "Image": "Image:buffer",
            }
            assert archetype[msgtype.rsplit("/", 1)[-1]] in found[topic]
            assert rows[topic] >= len(raw(whole, topic))
        assert "McapMessage:data" in found["/merged/report"]

    def test_its_own(self, whole: Path) -> None:
        from replay.sources import open_source

        with open_source(whole) as source:
            assert len(list(source.messages(["/merged/map"]))) == len(maps(whole))

    def test_schemas_hold_all_they_depend_on(self, whole: Path) -> None:
        known = summary(whole)
        for schema in known.schemas.values():
            assert schema.encoding == "ros2msg"
            parsed = get_types_from_msg(schema.data.decode(), schema.name)
            for name, definition in parsed.items():
                assert definition == ros2_typestore().fielddefs[name]

    def test_maps_are_latched(self, whole: Path) -> None:
        """RViz and Nav2 ask for reliable and transient local; they show nothing otherwise."""
        with Rosbag2Reader(whole) as reader:
            offered: dict[str, list[Qos]] = {each.topic: each.ext.offered_qos_profiles for each in reader.connections}
        for topic, msgtype in TYPES.items():
            (qos,) = offered[topic]
            assert qos.reliability is QosReliability.RELIABLE
            latched = msgtype == "nav_msgs/msg/OccupancyGrid"
            assert qos.durability is (QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE)


class TestMaps:
    def test_are_the_merger_s(self, whole: Path) -> None:
        written = {each.stamp_ns: each for each in maps(whole)}
        for event in ticks():
            latest = written[max(time_ns for time_ns in written if time_ns <= event.stamp_ns)]
            assert latest.frame_id == "merged"
            assert event.result.merged is not None
            assert same_map(latest.grid, event.result.merged)

    def test_one_that_did_not_change_is_not_repeated(self, tmp_path: Path) -> None:
        path = write(tmp_path / "run.mcap", "three_robots_one_unplaced")
        before = None
        for written in maps(path):
            assert before is None or not same_map(written.grid, before)
            before = written.grid
        assert len(maps(path)) < len(ticks("three_robots_one_unplaced"))

    @pytest.mark.parametrize(
        ("every_s", "expected_s"),
        [
            (0, [0, 10, 12, 20, 22]),
            (2, [0, 10, 12, 20, 22]),
            (2.5, [0, 10, 20, 22]),
            (11, [0, 12, 22]),
            (20, [0, 20, 22]),
            (1000, [0, 22]),
        ],
    )
    def test_are_thinned_and_the_last_is_always_there(
        self, tmp_path: Path, every_s: float, expected_s: list[int]
    ) -> None:
        path = write(tmp_path / "run.mcap", every_ns=round(every_s * SECOND))
        assert [each.stamp_ns for each in maps(path)] == [at(seconds) for seconds in expected_s]
        last = ticks()[-1].result.merged
        assert last is not None
        assert same_map(maps(path)[-1].grid, last)
        assert len(raw(path, "/tf")) == len(reports(path)) == 6

    def test_of_the_robots_are_copied_if_asked_for(self, whole: Path, tmp_path: Path) -> None:
        for robot in ("r1", "r2"):
            found = maps(whole, f"/{robot}/map")
            assert len(found) == 3
            assert {each.frame_id for each in found} == {f"{robot}/map"}
            assert same_map(found[-1].grid, flat_map(robot))
        assert not {"/r1/map", "/r2/map"} & topics(write(tmp_path / "run.mcap")).keys()

    def test_without_a_cell_is_not_written(self, tmp_path: Path) -> None:
        assert not raw(write(tmp_path / "run.mcap", "nothing_known"), "/merged/map")


class TestTransforms:
    @pytest.mark.parametrize("scenario", SCENARIOS)
    def test_at_every_tick_those_of_the_placed_robots(self, tmp_path: Path, scenario: str) -> None:
        path = write(tmp_path / "run.mcap", scenario)
        started = events_of(scenario)[0]
        assert isinstance(started, Started)
        expected = {}
        for event in ticks(scenario):
            poses = {item.frame: event.result.robots[item.robot].merged_from_map for item in started.robots}
            if event.result.merged is not None:
                expected[event.stamp_ns] = {frame: pose for frame, pose in poses.items() if pose is not None}
        found = dict(transforms(path))
        assert {time_ns: set(each) for time_ns, each in found.items()} == {
            time_ns: set(each) for time_ns, each in expected.items()
        }
        for time_ns, each in found.items():
            for frame, item in each.items():
                known = expected[time_ns][frame]
                shift, turn = item.transform.translation, item.transform.rotation
                assert item.header.frame_id == "merged"
                assert (shift.x, shift.y, shift.z) == (known.x_m, known.y_m, 0.0)
                assert (turn.x, turn.y) == (0.0, 0.0)
                assert Sim2(yaw_rad=2.0 * np.arctan2(turn.z, turn.w)).yaw_rad == pytest.approx(known.yaw_rad)

    def test_take_a_robot_s_map_to_the_merged_one(self, whole: Path) -> None:
        _, found = list(transforms(whole))[-1]
        shift, turn = found["r2/map"].transform.translation, found["r2/map"].transform.rotation
        pose = {"x_m": shift.x, "y_m": shift.y, "yaw_rad": 2.0 * np.arctan2(turn.z, turn.w), "scale": 1.0}
        assert is_right(pose, reference_from("r2"))


class TestReports:
    @pytest.mark.parametrize("scenario", SCENARIOS)
    def test_are_valid_and_end_as_the_file(self, tmp_path: Path, scenario: str) -> None:
        path = write(tmp_path / "run.mcap", scenario)
        schema = json.loads(resources.files("replay").joinpath("schemas/report.schema.json").read_text("utf-8"))
        validator = jsonschema.Draft202012Validator(schema)
        found = reports(path)
        for time_ns, report in found:
            validator.validate(report)
            assert (report["stamp_ns"] or 0) == time_ns
        (finished,) = (event for event in events_of(scenario) if isinstance(event, Finished))
        validator.validate(json.loads(report_text(finished.report)))
        assert found[-1][1] == json.loads(report_text(finished.report))
        assert [time_ns for time_ns, _ in found] == ([event.stamp_ns for event in ticks(scenario)] or [0])

    def test_one_that_says_nothing_new_is_not_written(self, tmp_path: Path) -> None:
        path = tmp_path / "run.mcap"
        *before, last, finished = events_of("merged")
        assert isinstance(last, Merged)
        later = [
            replace(last, stamp_ns=last.stamp_ns + more, report={**last.report, "stamp_ns": last.stamp_ns + more})
            for more in (1, 2)
        ]
        assert isinstance(finished, Finished)
        ended = Finished({**finished.report, "stamp_ns": last.stamp_ns + 2})
        sink = McapSink(PartialFile.claimed(path), OutputOptions(path))
        drain([*before, last, *later, ended], [sink])
        sink.finish()
        sink.publish()
        stamps = [event.stamp_ns for event in ticks()]
        assert [time_ns for time_ns, _ in reports(path)] == [*stamps, stamps[-1] + 2]
        assert [time_ns for time_ns, _ in raw(path, "/tf")][-2:] == [stamps[-1] + 1, stamps[-1] + 2]

    def test_are_as_of_their_stamp(self, whole: Path) -> None:
        for (_, report), event in zip(reports(whole)[:-1], ticks(), strict=False):
            assert report == json.loads(report_text(event.report))
            assert report["inputs"][0]["sha256"] is None
            assert all(change["stamp_ns"] == event.stamp_ns for change in report["history"])

    def test_their_schema_is_attached(self, whole: Path) -> None:
        with whole.open("rb") as file:
            (attached,) = make_reader(file).iter_attachments()
        assert (attached.name, attached.media_type) == ("report.schema.json", "application/schema+json")
        assert attached.data == resources.files("replay").joinpath("schemas/report.schema.json").read_bytes()


class TestImages:
    def test_are_the_gallery_s(self, whole: Path) -> None:
        shown = [(event.stamp_ns, item) for event in ticks() for item in event.pictures]
        for topic in TYPES:
            if not topic.startswith("/merged/images/"):
                continue
            step = topic.rsplit("/", 1)[-1]
            expected = [(time_ns, item.picture.rgb) for time_ns, item in shown if item.picture.step == step]
            assert [time_ns for time_ns, _ in raw(whole, topic)] == [time_ns for time_ns, _ in expected]
            for (_, data), (_, rgb) in zip(raw(whole, topic), expected, strict=True):
                image: Any = ros2_typestore().deserialize_cdr(data, "sensor_msgs/msg/Image")
                assert (image.encoding, image.header.frame_id, image.step) == ("rgb8", "merged", 3 * image.width)
                assert max(image.width, image.height) <= MAX_SIDE_PX == 1024
                assert np.array_equal(image.data.reshape(image.height, image.width, 3), rgb)

    def test_none_if_none_are_due(self, tmp_path: Path) -> None:
        assert not [topic for topic in topics(write(tmp_path / "run.mcap", "restarted")) if "images" in topic]


class TestProvenance:
    def test_at_the_start(self, whole: Path) -> None:
        started = events_of("merged")[0]
        assert isinstance(started, Started)
        found = metadata(whole)["replay.provenance"]
        assert found["version"] == __version__
        assert found["reference"] == "r1"
        assert json.loads(found["robots"]) == ["r1", "r2"]
        assert json.loads(found["settings"]) == started.settings
        assert json.loads(found["inputs"]) == [
            {"name": "run.mcap", "format": "mcap", "size_bytes": started.inputs[0]["size_bytes"]}
        ]

    def test_at_the_end(self, whole: Path) -> None:
        found = json.loads(metadata(whole)["replay.inputs"]["inputs"])
        assert found == reports(whole)[-1][1]["inputs"]
        assert found[0]["messages"] == 6
        assert len(found[0]["sha256"]) == 64


@pytest.mark.parametrize(
    ("robots", "expected"),
    [
        (["r1", "r2"], ["r1", "r2"]),
        (["a.b", "a-b", "a_b"], ["a_b", "a_b_", "a_b__"]),
        (["7up", "fleet/r1", "/x/"], ["_7up", "fleet/r1", "x"]),
        (["merged"], ["merged_"]),
    ],
)
def test_topic_parts(robots: list[str], expected: list[str]) -> None:
    assert topic_parts(robots) == dict(zip(robots, expected, strict=True))
