"""Whatever a document says, it is understood or refused in one line; nothing that follows from it is infinite."""

from __future__ import annotations

import json
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from replay.checks.expectation import expectation_of
from replay.checks.findings import findings
from replay.checks.junit import junit_xml
from replay.checks.words import summary
from replay.checks.write_expectation import expectation_text
from replay.comparison.differences import Tolerance, compare
from replay.comparison.words import json_text
from replay.documents import Node
from replay.errors import InputError
from replay.evaluation.errors import Limits, pose_errors
from replay.evaluation.truth import truth_of
from replay.evaluation.words import json_text as evaluation_json
from replay.export.transforms import lines
from replay.run_result import RunResult
from tests.scenarios import events_of

FILE = Path("document")
REPORT: dict[str, Any] = json.loads(json.dumps(events_of("three_robots_one_unplaced")[-1].report))
EXPECTATION: dict[str, Any] = {
    "reference": "r1",
    "max_skipped": 0,
    "defaults": {"within_m": 0.1},
    "robots": {
        "r2": {"status": "merged", "pose": {"x_m": 1.0, "y_m": 2.0, "yaw_deg": 3.0}, "merged_within_s": 9},
        "r3": {"status": "unmerged", "reason": "ambiguous"},
    },
}
TRUTH: dict[str, Any] = {
    "reference": "r1",
    "robots": {"r2": {"x_m": 1.0, "y_m": 2.0, "yaw_rad": 3.0, "overlap_centre_m": [1, 2]}, "r3": {"same_place": False}},
}
RESULT = RunResult.of(REPORT, FILE)

numbers = st.floats() | st.integers() | st.sampled_from([0, -1, 1e308, -1e308, 10**400, 5e-324])
values = st.recursive(
    st.none() | st.booleans() | numbers | st.text(max_size=5) | st.sampled_from(["merged", "no_map", "reference"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


def ways(value: object, way: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the keys that lead to each value."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [way, *(found for key, each in inner for found in ways(each, (*way, key)))]


def changed(document: dict[str, Any]) -> st.SearchStrategy[Any]:
    """Return the document with one value replaced or left out."""

    def change(way: tuple[Any, ...], value: Any, *, is_out: bool) -> Any:
        if not way:
            return value
        copy = deepcopy(document)
        node: Any = copy
        for key in way[:-1]:
            node = node[key]
        if is_out:
            del node[way[-1]]
        else:
            node[way[-1]] = value
        return copy

    short = [way for way in ways(document) if way[:1] not in {("pairs",), ("history",)}]
    return st.builds(change, st.sampled_from(short), values, is_out=st.booleans())


def of_report(report: Any) -> None:
    result = RunResult.of(report, FILE)
    json.loads(json_text(compare(RESULT, result, Tolerance())), parse_constant=pytest.fail)
    "".join(lines(result, list(result.robots), 2)).encode()
    expectation_text(result).encode()


def of_expectation(document: Any) -> None:
    found = findings(expectation_of(Node(FILE, document)), RESULT)
    junit_xml(found, "run")
    summary(found, "run").encode()


def of_truth(document: Any) -> None:
    truth = truth_of(Node(FILE, document)).seen_from("r1", FILE)
    json.loads(evaluation_json(pose_errors(RESULT, truth), None, Limits(0.1, 1.0)), parse_constant=pytest.fail)


READERS: list[tuple[dict[str, Any], Callable[[Any], None]]] = [
    (REPORT, of_report),
    (EXPECTATION, of_expectation),
    (TRUTH, of_truth),
]


@pytest.mark.parametrize(("document", "read"), READERS, ids=["report", "expectation", "truth"])
def test_what_is_right_is_read(document: dict[str, Any], read: Callable[[Any], None]) -> None:
    read(document)


@pytest.mark.parametrize(("document", "read"), READERS, ids=["report", "expectation", "truth"])
@given(st.data())
def test_what_is_wrong_is_refused_in_one_line(
    document: dict[str, Any], read: Callable[[Any], None], data: st.DataObject
) -> None:
    said = refusal(read, data.draw(changed(document)))
    assert said is None or said.startswith("document: ")
    assert "\n" not in (said or "")


def refusal(read: Callable[[Any], None], document: Any) -> str | None:
    """Return what is said of a document that is refused."""
    try:
        read(document)
    except InputError as error:
        return str(error)
    return None
