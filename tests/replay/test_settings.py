"""Settings of files: which there are, what they are called, and what is said of each."""

from __future__ import annotations

import argparse
import json
import re
from dataclasses import fields, is_dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any

import pytest

from mapmerge.config import MergeConfig
from replay.arguments import command_parser
from replay.commands import COMMANDS
from replay.documents import Node
from replay.errors import InputError, UsageError
from replay.init_pose import InitPose
from replay.options import MOST_NS, OutputOptions, RunOptions, TimeBound, seconds_to_ns
from replay.runs import RunPath, TopicChoice
from replay.settings import fields as merge_fields
from replay.settings import keys
from replay.settings.choice import chosen_by
from replay.settings.documents import read_assignment, read_settings
from replay.settings.of_run import document_of, reading_of
from replay.settings.show import as_toml, shown_settings

TAKING = [name for name in COMMANDS if command_parser(name).takes_settings]
ALL = keys.known_keys(keys.all_settings())


def field_names(config: Any, prefix: str = "merge") -> list[str]:
    names = []
    for item in fields(config):
        value = getattr(config, item.name)
        key = f"{prefix}.{item.name}"
        names += field_names(value, key) if is_dataclass(value) else [key]
    return names


def test_merge_takes_settings() -> None:
    assert {"merge", "config", "info"} <= set(TAKING)


@pytest.mark.parametrize("command", TAKING)
def test_each_flag_is_a_setting_or_of_one_call(command: str) -> None:
    """A flag in a group that is not known here would silently be none."""
    parser = command_parser(command)
    settings = {action.dest for action in keys.settings_of(parser).values()}
    for title, action in parser.grouped():
        assert (action.dest in settings) is not (action.dest in keys.OF_ONE_CALL), (title, action.dest)


def test_each_setting_of_a_command_is_in_the_list() -> None:
    assert set(keys.settings_of(command_parser("config"))) == set(keys.all_settings())


@pytest.mark.parametrize("command", TAKING)
def test_a_flag_is_the_same_setting_of_each_command(command: str) -> None:
    names = {action.dest: key for key, action in keys.all_settings().items()}
    assert all(names[action.dest] == key for key, action in keys.settings_of(command_parser(command)).items())


def test_each_field_of_the_merger_is_a_setting() -> None:
    assert list(merge_fields.leaves()) == field_names(MergeConfig())
    assert set(field_names(MergeConfig())) <= set(ALL)


def test_each_field_is_told_of() -> None:
    assert [key for key in merge_fields.leaves() if not merge_fields.words().get(key)] == []


def test_flags_that_are_fields_are_found_there_alone() -> None:
    names = [key for key in ALL if key.rpartition(".")[2] in ("method", "scale", "min_confidence")]
    assert sorted(names) == sorted(keys.ELSEWHERE.values())


@pytest.mark.parametrize("key", list(merge_fields.leaves()))
def test_each_field_takes_its_default_from_a_file(key: str) -> None:
    default = dict(merge_fields.values_of(MergeConfig()))[key]
    value = json.loads(json.dumps(default), parse_float=Decimal)  # tuples as lists, as TOML has them
    assert merge_fields.read(key, value, "x") == default
    assert merge_fields.put_together({key: default}) == MergeConfig()


@pytest.mark.parametrize("key", list(merge_fields.leaves()))
def test_each_field_refuses_what_is_not_of_its_type(key: str) -> None:
    with pytest.raises(UsageError, match=r"x is \{?a section; expected"):
        merge_fields.read(key, {}, "x")


def test_fields_keep_the_defaults_of_the_settings_that_they_are_in() -> None:
    """The other method draws with another distance than the paper's."""
    config = merge_fields.put_together({"merge.existing.ransac.draws": 7})
    assert (config.existing.ransac.draws, config.existing.ransac.inlier_m) == (7, 0.1)


@pytest.mark.parametrize(
    ("key", "meant"),
    [
        ("robot", "robots"),
        ("topic", "topics"),
        ("tiem", "time"),
        ("reorder_window_s", "time.reorder_window_s"),
        ("time.reorder-window", "time.reorder_window_s"),
        ("placing.min_confidence", "merge.verify.min_confidence"),
        ("merge.verify.min_overlap", "merge.verify.min_overlap_m2"),
        ("merge.existing.max_feature", "merge.existing.max_features"),
        ("init_pose", "placing.init_poses"),
    ],
)
def test_what_may_have_been_meant(key: str, meant: str) -> None:
    with pytest.raises(UsageError, match=f"there is no such setting; did you mean {meant}\\?"):
        keys.refuse_unknown(key, ALL, key)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("time.start=60", 60),
        ("time.start = 2.5", Decimal("2.5")),
        ("time.start=12ns", "12ns"),
        ("merge.method=paper", "paper"),
        ('merge.method="paper"', "paper"),
        ("rules.strict=false", False),
        ("merge.refine.reject_m=[0.5, 1]", [Decimal("0.5"), 1]),
        ("outputs.output=a=b.mcap", "a=b.mcap"),
        ("robots=a\nb = 1", "a\nb = 1"),
        ("robots=1\nb = 1", "1\nb = 1"),
    ],
)
def test_assignments(text: str, value: object) -> None:
    (said,) = read_assignment(text, ALL).values()
    assert said.value == value


def test_the_settings_of_a_run_are_those_of_a_file(tmp_path: Path) -> None:
    options = RunOptions(
        (RunPath(None, Path("run.mcap")),),
        robots=("a", "b"),
        topics=(TopicChoice("a", "/x"), TopicChoice(None, "/{robot}/map")),
        start=TimeBound(1, relative=True),
        stop=TimeBound(1_700_000_000_123_456_789, relative=False),
        reorder_window_ns=250_000_001,
        init_poses=(InitPose("b", 1e-7, -2.0, 0.1 + 0.2),),
        use_tf=True,
        max_memory_bytes=1 << 30,
    )
    written = OutputOptions(tmp_path / "x.mcap", every_ns=5, copy_maps=True)
    settings = {**options.settings(), "outputs": written.settings("all")}
    document = document_of(Node(Path("out.json"), json.loads(json.dumps(settings))))
    assert document["robots"] == ["a", "b"]
    assert document["topics"] == ["a=/x", "/{robot}/map"]
    assert document["time"]["start"] == Decimal("1e-9")
    assert document["time"]["stop"] == "1700000000123456789ns"
    assert document["time"]["reorder_window_s"] == Decimal("0.250000001")
    assert [InitPose.parse(text) for text in document["placing"]["init_poses"]] == list(options.init_poses)
    assert document["outputs"] == {"images": "all", "every_s": Decimal("5e-9"), "copy_maps": True}
    assert document["rules"] == {"max_memory": 1 << 30}
    assert sorted(document["merge"]) == sorted(item.name for item in fields(MergeConfig))


@pytest.mark.parametrize("text", ["1969-01-01", "0001-01-01", "9999-12-31", "-5ns", "1000000000000", "0.000000001"])
def test_any_time_that_a_run_takes_is_read_from_its_report(tmp_path: Path, text: str) -> None:
    bound = TimeBound.parse(text)
    settings = RunOptions((), start=bound, stop=bound, reorder_window_ns=MOST_NS).settings()
    path = tmp_path / "out.json"
    path.write_text(json.dumps({"schema": "replay.report/1", "settings": settings}), encoding="utf-8")
    chosen = chosen_by(command_parser("merge"), {"config": path})
    assert [TimeBound.parse(str(chosen[name])) for name in ("start", "stop")] == [bound, bound]
    assert seconds_to_ns(str(chosen["reorder_window"])) == MOST_NS
    told = reading_of(Node(path, json.loads(path.read_text(encoding="utf-8"))).need("settings"))
    assert (told["start"], told["stop"], told["reorder_window_ns"]) == (bound, bound, MOST_NS)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"clock": "sun"}, "settings.clock is 'sun'; expected header or log"),
        ({"start": {"ns": -1, "relative": True}}, "settings.start.ns is -1; expected a whole number, 0 or more"),
        ({"start": {"ns": MOST_NS + 1, "relative": False}}, "settings.start.ns is .*; expected a whole number of nano"),
        ({"stop": {"ns": 1}}, "settings.stop has no 'relative'"),
        ({"align_starts": "no"}, "settings.align_starts is 'no'; expected true or false"),
        ({"topics": "x"}, "settings.topics is 'x'; expected a list"),
    ],
)
def test_exports_read_settings_as_files_are_read(change: dict[str, object], said: str) -> None:
    settings = Node(Path("out.json"), {**RunOptions(()).settings(), **change}, ("settings",))
    for read in (reading_of, document_of):
        with pytest.raises(InputError, match=said):
            read(settings)


def test_reports_of_runs_that_were_not_written_have_settings_too(tmp_path: Path) -> None:
    settings = {**RunOptions(()).settings(), "outputs": None}
    assert document_of(Node(Path("out.json"), settings))["outputs"] == {}
    path = tmp_path / "out.json"
    path.write_text(json.dumps({"schema": "replay.report/1", "settings": {}}), encoding="utf-8")
    with pytest.raises(UsageError, match="not settings that a run writes"):
        read_settings(path, ALL)


def nested(depth: int) -> object:
    found: object = 1
    for _ in range(depth):
        found = {"verify": found}
    return found


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ([], "settings is \\[\\]; expected a mapping"),
        ("x", "settings is 'x'; expected a mapping"),
        ({"outputs": [1]}, "settings.outputs is"),
        ({"outputs": {"every_ns": -1}}, "settings.outputs.every_ns is -1; expected a whole number"),
        ({"reorder_window_ns": "abc"}, "settings.reorder_window_ns is 'abc'; expected a whole number"),
        ({"start": {"ns": 10**400, "relative": True}}, "settings.start.ns is .*; expected a whole number"),
        ({"start": 5}, "settings.start is 5"),
        ({"stop": {"ns": 1, "relative": "no"}}, "settings.stop.relative is 'no'; expected true or false"),
        ({"topics": [5]}, "settings.topics.0 is 5"),
        ({"topics": {}}, "settings.topics is {}; expected a list"),
        ({"robots": [1]}, "settings.robots.0 is 1; expected a text"),
        ({"init_poses": [{"robot": "a", "x_m": "b"}]}, "settings.init_poses.0.x_m is 'b'; expected a number"),
        ({"init_poses": [{"robot": "a"}]}, "settings.init_poses.0 has no 'x_m'"),
        ({"use_tf": None}, "settings has no 'use_tf'"),
        ({"max_memory_bytes": True}, "settings.max_memory_bytes is True"),
        ({"merge": [1]}, "settings.merge is \\[1\\]; expected a mapping"),
        ({"merge": {"verify": [1]}}, "merge.verify: is a section, and no setting"),
        ({"merge": nested(900)}, "merge.verify.verify: there is no such setting|its settings are nested too deep"),
    ],
)
def test_settings_that_no_run_wrote_are_refused(tmp_path: Path, change: object, said: str) -> None:
    path = tmp_path / "out.json"
    settings = {**RunOptions(()).settings(), **change} if isinstance(change, dict) else change
    path.write_text(json.dumps({"schema": "replay.report/1", "settings": settings}), encoding="utf-8")
    with pytest.raises(UsageError, match=rf"^{re.escape(str(path))}: ({said})"):
        read_settings(path, ALL)


@pytest.mark.parametrize(
    "text", [f"x = {'[' * 3000}{']' * 3000}", f"robots = {'9' * 5000}", f"time.start = {'{a=' * 3000}1{'}' * 3000}"]
)
def test_toml_that_cannot_be_read_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "replay.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UsageError, match="is no TOML: "):
        read_settings(path, ALL)
    assert read_assignment(text.replace(" = ", "=").replace("x=", "robots="), ALL)


def test_a_number_that_is_too_large_is_none() -> None:
    with pytest.raises(UsageError, match="expected a number"):
        merge_fields.read("merge.verify.min_overlap_m2", 10**400, "x")


@pytest.mark.parametrize("value", ["1e300000", "1e999999999", "-1e999999999", "1e-999999999", "9" * 4000])
@pytest.mark.parametrize(
    "key", ["time.start", "time.reorder_window_s", "outputs.every_s", "rules.max_memory", "rules.jobs"]
)
def test_a_number_of_very_many_digits_is_not_written_out(key: str, value: str) -> None:
    parser = command_parser("config")
    chosen = chosen_by(parser, {"set": [f"{key}={value}"]})
    (text,) = (value for name, value in chosen.items() if name not in ("merge_fields", "origins"))
    assert len(str(text)) <= 4000
    options = argparse.Namespace(**{**vars(parser.parse_args([])), **chosen})
    assert as_toml([item for item in shown_settings(parser, options, MergeConfig()) if item.is_changed])


def test_quotes_of_a_text_are_its_own() -> None:
    chosen = chosen_by(command_parser("merge"), {"set": ["outputs.report='\"a\".html'", "rules.max_memory='\"'"]})
    assert (str(chosen["report"]), chosen["max_memory"]) == ('"a".html', '"')


def test_what_adds_to_lists_is_named_for_several() -> None:
    parser = command_parser("merge")
    appending = {
        key.rpartition(".")[2]
        for key, action in keys.settings_of(parser).items()
        if isinstance(action, argparse._AppendAction)
    }
    assert appending == {"topics", "init_poses"}
