"""What the documents promise is what is there."""

from __future__ import annotations

import json
import re
from importlib import resources

import jsonschema
import pytest

from mapmerge.outcome import ChangeKind, Status
from mapmerge.reasons import ReasonCode
from replay.skip_cause import SkipCause
from tests.data_paths import ROOT

SCHEMA = json.loads(resources.files("replay").joinpath("schemas/report.schema.json").read_text("utf-8"))
FORMATS = (ROOT / "docs/output-formats.md").read_text(encoding="utf-8")


def table(heading: str) -> list[str]:
    """Return the codes that a section of the document lists."""
    section = FORMATS.partition(f"### {heading}\n")[2].partition("\n#")[0]
    return re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE)


def test_the_schema_in_the_documents_is_the_one_that_is_used() -> None:
    copy = (ROOT / "docs/report.schema.json").read_bytes()
    assert copy == resources.files("replay").joinpath("schemas/report.schema.json").read_bytes()


def test_the_schema_is_one() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize("part", [SCHEMA, *SCHEMA["$defs"].values()])
def test_the_schema_is_closed_and_requires_all_it_knows(part: dict) -> None:
    if "properties" in part:
        assert part["additionalProperties"] is False
        assert sorted(part["required"]) == sorted(part["properties"])


def test_reason_codes() -> None:
    expected = [str(code) for code in ReasonCode]
    assert table("Reason codes") == expected
    assert SCHEMA["$defs"]["reason"]["properties"]["code"]["enum"] == expected


def test_causes_of_skipped_messages() -> None:
    expected = [str(cause) for cause in SkipCause]
    assert table("Causes of skipped messages") == expected
    assert SCHEMA["properties"]["skipped"]["propertyNames"]["enum"] == expected


def test_statuses() -> None:
    expected = [str(status) for status in Status]
    assert table("Status") == expected
    assert SCHEMA["$defs"]["robot"]["properties"]["status"]["enum"] == expected


def test_events() -> None:
    assert SCHEMA["$defs"]["change"]["properties"]["event"]["enum"] == [str(kind) for kind in ChangeKind]


def test_command_line_reference() -> None:
    from scripts import cli_reference

    assert cli_reference.DOCS.read_text(encoding="utf-8") == cli_reference.reference()


@pytest.mark.parametrize(
    "name",
    [
        *("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"),
        *("docs/output-formats.md", "docs/benchmarks.md", "docs/configuration.md"),
        *("docs/python.md", "docs/index.md", "examples/README.md"),
    ],
)
def test_links_lead_somewhere(name: str) -> None:
    document = ROOT / name
    for target in re.findall(r"\]\(([^)#:]+)\)", document.read_text(encoding="utf-8")):
        assert (document.parent / target).exists(), target


def test_architecture_names_modules_that_are_there() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    for package in ("mapmerge", "replay"):
        section = text.partition(f"\n## {package}\n")[2].partition("\n## ")[0]
        rows = "".join(re.findall(r"^\| (`[^|]+) \|", section, re.MULTILINE))
        for module in re.findall(r"`([a-z_0-9]+(?:\.py|/))`", rows):
            assert list((ROOT / package).rglob(module.rstrip("/"))), module
