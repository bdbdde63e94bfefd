"""What the report page tells, whatever happened."""

from __future__ import annotations

import base64
import hashlib
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from mapmerge.config import MergeConfig, VerifyConfig
from replay.html.losses import MEANINGS
from replay.html.roster import Member
from replay.options import RunOptions
from replay.palette import robot_colour
from replay.runs import RunPath
from replay.skip_cause import SkipCause
from tests.bags import write_mcap
from tests.pages import Page, page_of, page_of_run
from tests.runs import two_robots
from tests.scenarios import SCENARIOS

SECTIONS = ("verdict", "robots", "map", "pairs", "refused", "plots", "decisions", "losses", "settings", "provenance")
PLACES = {"href", "src", "srcset", "action", "data", "poster", "background", "xlink:href", "formaction"}


@pytest.fixture(params=SCENARIOS, scope="module")
def any_page(request: pytest.FixtureRequest) -> Page:
    return Page(page_of(request.param))


def test_sections_are_in_order_and_named(any_page: Page) -> None:
    found = [each.get("aria-labelledby") for each in any_page.all("section")]
    assert found == [name for name in SECTIONS if name in found]
    assert set(SECTIONS) - set(found) <= {"pairs", "refused", "plots"}
    ids = [value for _, name, value in any_page.attributes() if name == "id"]
    assert len(set(ids)) == len(ids)
    assert set(found) <= set(ids)


def test_links_lead_somewhere_on_the_page(any_page: Page) -> None:
    ids = {value for _, name, value in any_page.attributes() if name == "id"}
    links = [each.get("href", "") for each in any_page.all("a")]
    assert links
    assert {link.removeprefix("#") for link in links} <= ids


def test_it_loads_nothing(any_page: Page) -> None:
    for tag, name, value in any_page.attributes():
        if name in PLACES:
            assert value.startswith(("data:", "#")), (tag, name, value)
    assert not re.search(r"url\(|@import|https?:", any_page.text)


def test_its_policy_lets_it_run_its_own_script_alone(any_page: Page) -> None:
    policy = next(each.get("content") for each in any_page.all("meta") if each.get("http-equiv"))
    scripts = [each for each in any_page.all("script") if each.get("type") != "application/json"]
    assert len(scripts) == 1
    digest = base64.b64encode(hashlib.sha256((scripts[0].text or "").encode()).digest()).decode()
    assert policy is not None
    assert policy.split("; ")[0] == "default-src 'none'"
    assert f"script-src 'sha256-{digest}'" in policy
    assert not any(name.startswith("on") for _, name, _ in any_page.attributes())


def test_every_picture_says_what_it_shows(any_page: Page) -> None:
    for picture in any_page.all("img"):
        assert picture.get("alt")
        kind, _, data = picture.get("src", "").partition(",")
        assert kind == "data:image/png;base64"
        image = cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_UNCHANGED)
        assert image is not None
        assert image.shape[:2] == (int(picture.get("height", "0")), int(picture.get("width", "0")))
        assert max(image.shape) <= 1600


@pytest.mark.parametrize(
    ("scenario", "sentence"),
    [
        ("merged", "Both maps are merged."),
        ("three_robots_one_unplaced", "2 of 3 maps are merged."),
        ("nobody_merged", "Nothing is merged: none of the other 2 maps was placed on that of r1."),
        ("restarted", "Nothing is merged: the map of r2 was not placed on that of r1."),
        ("no_reference", "Nothing is merged: the reference r1 has no usable map."),
        ("one_robot", "There is only one map: nothing to merge it with."),
    ],
)
def test_the_verdict_comes_first(scenario: str, sentence: str) -> None:
    found = Page(page_of(scenario))
    assert "".join(found.all("h1")[0].itertext()) == sentence
    assert found.words().index(sentence) < 120


def test_who_is_not_merged_is_told_with_why_and_what_to_do() -> None:
    found = Page(page_of("three_robots_one_unplaced"))
    verdict = found.words("verdict")
    assert "r3 is not merged: not placed on" in verdict
    assert "What to do" in verdict
    assert "r3 not placed on" in found.words("refused")
    robots = {row[0]: row[1] for row in found.rows("robots")}
    assert robots == {"r1": "reference", "r2": "merged", "r3": "not merged"}


@pytest.mark.parametrize(("least_m2", "status"), [(6.0, "merged"), (60.0, "not merged")])
def test_the_row_and_the_reason_do_not_contradict_each_other(tmp_path: Path, least_m2: float, status: str) -> None:
    """A refused placement has figures too."""
    path = write_mcap(tmp_path / "run.mcap", two_robots())
    config = MergeConfig(verify=VerifyConfig(min_overlap_m2=least_m2))
    found = Page(page_of_run(RunOptions((RunPath(None, path),), merge=config)))
    row = next(row for row in found.rows("robots") if row[0] == "r2")
    assert row[1] == status
    said = re.search(r"([\d.]+) m² (?:of ground|overlap)", row[-1])
    assert said is not None
    (shown,) = re.findall(r"([\d.]+) m²", " ".join(row[:-1]))
    assert float(said[1]) == pytest.approx(float(shown), abs=0.5)
    assert bool(re.search(r"99\.\d+% refused", " ".join(row))) == (status == "not merged")
    assert ("least confidence" in found.words("verdict")) == (status == "merged")


def test_a_pair_is_called_by_both_robots_and_placements_say_their_frame() -> None:
    """The reason of either robot names the other one, whichever of them the figures take as fixed."""
    found = Page(page_of("nobody_merged"))
    assert [row[:2] for row in found.rows("pairs")] == [["r1", "r2"], ["r1", "r3"], ["r2", "r3"]]
    merged = Page(page_of("merged"))
    (caption,) = (" ".join("".join(each.itertext()).split()) for each in merged.section("pairs").iter("figcaption"))
    assert caption.startswith("r1 and r2 accepted")


def test_layers_of_the_map_are_those_of_the_placed_robots() -> None:
    found = Page(page_of("three_robots_one_unplaced"))
    labels = ["".join(each.itertext()).strip() for each in found.section("map").iter("label")]
    assert labels == ["merged map", "walls of r1", "walls of r2", "where maps overlap"]
    assert "r3 not placed on r1" in found.words("map").partition("Not in the merged map")[2]
    driven = Page(page_of("driven"))
    labels = ["".join(each.itertext()).strip() for each in driven.section("map").iter("label")]
    assert labels[-2:] == ["where maps overlap", "where robots drove"]
    assert "where robots drove, as far as that is known: r1; a dot is where one was last." in driven.words("map")


def test_what_was_lost_is_named() -> None:
    found = Page(page_of("no_reference"))
    assert ["bad_resolution", "1 message", "its resolution is not one that a cell of a map can have"] in found.rows(
        "losses"
    )
    assert "1 message could not be used (bad resolution)" in found.words("verdict")
    assert "Nothing was skipped" in Page(page_of("merged")).words("losses")


def test_notes_and_settings_are_told() -> None:
    found = Page(page_of("believed"))
    assert "Notes" in found.words("losses")
    changed = [row[0] for row in found.rows("settings")]
    assert changed[:2] == ["init_poses", "use_tf"]
    assert "All settings are the defaults." in Page(page_of("merged")).words("settings")


def test_the_decisions_are_those_of_the_run() -> None:
    assert "r2 placed on r1" in Page(page_of("merged")).words("decisions")
    told = Page(page_of("restarted")).words("decisions")
    assert "the map of r2 jumped" in told
    assert "r2 is withdrawn" in told
    assert "Nothing was placed" in Page(page_of("one_robot")).words("decisions")


def test_values_over_time_are_those_of_the_reports() -> None:
    series = Page(page_of("three_robots_one_unplaced")).series
    assert series["robots"] == ["r1", "r2", "r3"]
    assert series["t"][0] == 0.0
    assert series["t"] == sorted(series["t"])
    assert all(len(values) == len(series["t"]) for quantity in series["values"].values() for values in quantity)
    assert set(series["placed"][2]) == {"0"}
    assert series["values"]["x"][0] == [None] * len(series["t"])  # the reference stays where it is
    assert series["values"]["x"][1][-1] is not None


def test_pairs_are_all_there() -> None:
    found = Page(page_of("three_robots_one_unplaced"))
    pictured = list(found.section("pairs").iter("figure"))
    assert len(pictured) + len(found.rows("pairs")) == 3
    assert all(len(list(each.iter("img"))) == 1 for each in pictured)


def test_a_robot_has_its_colour_in_all_outputs() -> None:
    pytest.importorskip("rerun")
    from replay.sinks.rerun_entities import RobotEntities

    for index in range(20):
        assert Member("r", index).rgb == robot_colour(index).ink
        assert RobotEntities("r", index).colour == robot_colour(index).bright


def test_every_cause_has_a_meaning() -> None:
    assert set(MEANINGS) == set(SkipCause)
