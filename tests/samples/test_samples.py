"""The sample recordings are what they claim to be, and their generator repeats itself."""

import json
import math
import sqlite3
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2
from samples.drive import follow, route, stops, survey, tour
from samples.floorplan import FloorStyle, look_alike_corridor, office_floor
from samples.generate import RECIPES, Plan, Recipe, write_apart, write_together
from samples.lidar import Lidar
from samples.mapping import Mapper, SensorModel
from samples.record import write_bag1, write_bag2, write_mcap
from samples.world import Box, Room, World

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
TOGETHER = {"two_robots": "two_robots.mcap", "three_robots": "three_robots.bag"}
RECORDINGS = [*TOGETHER.values(), "bag_per_robot/alpha", "bag_per_robot/bravo"]
TINY = Recipe(
    floor_seed=2,
    direction_rad=0.4,
    style=FloorStyle(width_m=9.0, height_m=7.0),
    plans=(Plan("r1", (0.0, 1.0), 0.37, maps=2), Plan("r2", (1.0, 0.0), 1.9, maps=2, restart_heading_rad=0.6)),
)


def read(path):
    """Return (topic, log time, message) of everything in a recording."""
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        return [
            (connection.topic, log_ns, reader.deserialize(data, connection.msgtype))
            for connection, log_ns, data in reader.messages()
        ]


def maps(path, topic):
    return [(log_ns, message) for name, log_ns, message in read(path) if name == topic]


def stamp_ns(header):
    return header.stamp.sec * 1_000_000_000 + header.stamp.nanosec


def grid_of(message):
    info = message.info
    assert (info.origin.orientation.z, info.origin.orientation.w) == (0.0, 1.0)
    cells = message.data.reshape(info.height, info.width)
    return Grid(cells, round(info.resolution, 6), Sim2(info.origin.position.x, info.origin.position.y))


def last_grids(name):
    """Return the last map of every robot of a sample."""
    if name in TOGETHER:
        robots = [plan.name for plan in RECIPES[name].plans]
        paths = {robot: (SAMPLES / TOGETHER[name], f"/{robot}/map") for robot in robots}
    else:
        paths = {robot: (SAMPLES / name / robot, "/map") for robot in ("alpha", "bravo")}
    return {robot: grid_of(maps(*place)[-1][1]) for robot, place in paths.items()}


def truth(name):
    return json.loads((SAMPLES / f"{name}.truth.json").read_text(encoding="utf-8"))


def share_near(reference, grid, record):
    """Return which share of a map's occupied cells lie within 0.1 m of the reference's, where both know."""
    ref_from_map = Sim2(record["x_m"], record["y_m"], record["yaw_rad"])
    free = (reference.cells < 60).astype(np.uint8)
    away_m = cv2.distanceTransform(free, cv2.DIST_L2, 5) * reference.resolution_m
    points = ref_from_map.apply(grid.centres_m(grid.cells > 60))
    cells = np.floor(reference.map_from_grid.inverse().apply(points) / reference.resolution_m).astype(int)
    cells = cells[((cells >= 0) & (cells < (reference.cols, reference.rows))).all(axis=1)]
    both = cells[reference.known[cells[:, 1], cells[:, 0]]]
    assert len(both) > 500
    return np.mean(away_m[both[:, 1], both[:, 0]] <= 0.1)


def size(path):
    return sum(file.stat().st_size for file in ([path] if path.is_file() else path.iterdir()))


class TestRecordings:
    @pytest.mark.parametrize("name", RECORDINGS)
    def test_is_small(self, name):
        assert 100_000 < size(SAMPLES / name) < 1_000_000

    @pytest.mark.parametrize("name", RECORDINGS)
    def test_has_growing_maps_and_poses_in_their_frames(self, name):
        messages = read(SAMPLES / name)
        assert [log_ns for _, log_ns, _ in messages] == sorted(log_ns for _, log_ns, _ in messages)
        for topic in {topic for topic, _, _ in messages} - {"/tf"}:
            grids = [message for name, _, message in messages if name == topic]
            assert 6 <= len(grids) <= 8
            assert {grid.header.frame_id for grid in grids} == {topic[1:]}
            assert len({(grid.info.width, grid.info.height) for grid in grids}) > 3
            values = np.unique(grids[-1].data)
            assert values[0] == -1
            assert values[-1] <= 100
            assert len(values) > 40
            base = topic[1:].replace("map", "base_link")
            poses = [message for name, _, message in messages if name == "/tf"]
            mine = [pose.transforms[0] for pose in poses if pose.transforms[0].child_frame_id == base]
            assert len(mine) > 100
            assert {transform.header.frame_id for transform in mine} == {topic[1:]}

    def test_mcap_library_reads_the_mcap(self):
        with (SAMPLES / "two_robots.mcap").open("rb") as file:
            reader = make_reader(file, validate_crcs=True)
            assert reader.get_header().profile == "ros2"
            found = {(schema.name, channel.topic) for schema, channel, _ in reader.iter_messages()}
        grid, tf = "nav_msgs/msg/OccupancyGrid", "tf2_msgs/msg/TFMessage"
        assert found == {(grid, "/r1/map"), (grid, "/r2/map"), (tf, "/tf")}

    @pytest.mark.parametrize("robot", ["alpha", "bravo"])
    def test_stamps_lag_and_keep_their_order(self, robot):
        found = maps(SAMPLES / "bag_per_robot" / robot, "/map")
        stamps = [stamp_ns(message.header) for _, message in found]
        assert all(one < other for one, other in pairwise(stamps))
        assert all(0.3e9 <= log_ns - stamp <= 1.2e9 for (log_ns, _), stamp in zip(found, stamps, strict=True))


class TestTruth:
    @pytest.mark.parametrize("name", RECIPES)
    def test_walls_meet(self, name):
        record, grids = truth(name), last_grids(name)
        assert record["robots"].keys() == grids.keys() - {record["reference"]}
        for robot, found in record["robots"].items():
            assert found["same_place"]
            assert 0.4 <= found["overlap"] <= 0.75
            assert share_near(grids[record["reference"]], grids[robot], found) > 0.9
            moved = found | {"x_m": found["x_m"] + 0.5}
            assert share_near(grids[record["reference"]], grids[robot], moved) < 0.6

    @pytest.mark.parametrize("name", RECIPES)
    def test_no_frame_is_turned_by_a_right_angle(self, name):
        for found in truth(name)["robots"].values():
            assert abs(math.remainder(found["yaw_rad"], math.pi / 2)) > 0.1

    def test_bravo_begins_anew(self):
        found = maps(SAMPLES / "bag_per_robot/bravo", "/map")
        record = truth("bag_per_robot")["robots"]["bravo"]
        restart_ns = record["before_restart"]["restart_stamp_ns"]
        before = [message for log_ns, message in found if log_ns < restart_ns]
        after = [message for _, message in found if stamp_ns(message.header) > restart_ns]
        assert len(before) + len(after) == len(found)
        assert grid_of(after[0]).known_area_m2 < grid_of(before[-1]).known_area_m2
        assert grid_of(after[-1]).known_area_m2 > 60.0
        reference = last_grids("bag_per_robot")["alpha"]
        assert share_near(reference, grid_of(before[-1]), record["before_restart"]) > 0.9


class TestGenerator:
    @pytest.mark.parametrize(("suffix", "write"), [("mcap", write_mcap), ("bag", write_bag1)])
    def test_repeats_itself(self, tmp_path, suffix, write):
        paths = [tmp_path / f"{run}.{suffix}" for run in "ab"]
        for path in paths:
            write_together(path, TINY, 0, write)
        assert paths[0].read_bytes() == paths[1].read_bytes()
        assert paths[0].with_suffix(".truth.json").read_bytes() == paths[1].with_suffix(".truth.json").read_bytes()
        other = tmp_path / f"c.{suffix}"
        write_together(other, TINY, 1, write)
        assert other.read_bytes() != paths[0].read_bytes()

    def test_repeats_itself_in_folders(self, tmp_path):
        for run in "ab":
            write_apart(tmp_path / run, TINY, 0, write_bag2)
        for robot in ("r1", "r2"):
            rows = []
            for run in "ab":
                connection = sqlite3.connect(tmp_path / run / robot / f"{robot}.db3")
                rows.append(connection.execute("SELECT topic_id, timestamp, data FROM messages").fetchall())
                connection.close()
            assert rows[0]
            assert rows[0] == rows[1]

    def test_replaces_what_is_there(self, tmp_path):
        for _ in range(2):
            write_together(tmp_path / "x.mcap", TINY, 0, write_mcap)
            write_apart(tmp_path / "y", TINY, 0, write_bag2)


class TestParts:
    def test_a_beam_ends_at_the_wall(self):
        wall = np.array([[2.0, -5.0, 2.0, 5.0]])
        world = World(Box(-5, -5, 5, 5), (Room("empty", Box(-5, -5, 5, 5)),), (), wall, np.ones(1))
        lidar = Lidar(beams_per_turn=360, max_range_m=20.0, noise_m=0.0, dropout=0.0)
        ranges = lidar.scan(world, Sim2(0.0, 0.0, 0.3), np.random.default_rng(0))
        across = 2.0 / np.cos(lidar.angles_rad + 0.3)
        hit = (across > 0.0) & (across * np.abs(np.sin(lidar.angles_rad + 0.3)) < 5.0)
        assert np.isfinite(ranges).tolist() == hit.tolist()
        np.testing.assert_allclose(ranges[hit], across[hit], atol=1e-9)

    def test_half_a_field_of_view_is_half_the_beams(self):
        assert len(Lidar(beams_per_turn=360, field_rad=math.pi).angles_rad) == 180

    def test_a_map_grows_and_keeps_what_it_had(self):
        mapper = Mapper(SensorModel())
        assert mapper.grid().cells.size == 0
        mapper.add((0.0, 0.0), np.array([[1.01, 0.01]]))
        small = mapper.grid()
        mapper.add((0.0, 0.0), np.array([[-9.0, 7.0]]))
        large = mapper.grid()
        assert small.cells.shape == (1, 21)
        assert large.cells.shape == (141, 201)
        assert np.array_equal(large.cells[0, 181:], small.cells[0, 1:])
        assert small.cells[0, -1] > 50 > small.cells[0, -2]

    @pytest.mark.parametrize("seed", range(4))
    def test_a_robot_can_visit_nearly_every_room(self, seed):
        world = office_floor(seed)
        terrain = survey(world)
        everywhere = stops(world, terrain)
        assert len({stop.room for stop in everywhere}) >= 0.8 * len(world.rooms)
        way = route(terrain, tour(world, everywhere[:6]))
        assert all(terrain.clearance_m[terrain.cell((x, y))] > 0.0 for x, y in way[::5])

    def test_a_robot_arrives(self):
        world = look_alike_corridor(4)
        visited = tour(world, stops(world, survey(world)))
        pace = replace(RECIPES["two_robots"].robot.pace, speed_m_s=1.0)
        poses = follow(route(survey(world), visited), 0.7, pace)
        assert poses[0].yaw_rad == pytest.approx(0.7)
        assert math.hypot(poses[-1].x_m - visited[-1].x_m, poses[-1].y_m - visited[-1].y_m) < 0.5
