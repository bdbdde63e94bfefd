"""What the documents promise is what is there."""

from __future__ import annotations

import json
import re
from importlib import resources
from pathlib import Path

import jsonschema
import pytest

import replay
from mapmerge.match import MATCHERS
from mapmerge.outcome import ChangeKind, Status
from mapmerge.reasons import ReasonCode
from replay.arguments import command_parser
from replay.commands import COMMANDS
from replay.settings.keys import all_settings, known_keys
from replay.skip_cause import SkipCause
from tests.data_paths import ROOT
from tests.outputs import topics

SCHEMA = json.loads(resources.files("replay").joinpath("schemas/report.schema.json").read_text("utf-8"))
FORMATS = (ROOT / "docs/output-formats.md").read_text(encoding="utf-8")


GUIDES = ("README.md", "docs/tutorial.md", "docs/configuration.md", "docs/ci.md", "docs/export.md", "docs/faq.md")


def section_of(text: str, heading: str, until: str = "\n## ") -> str:
    """Return what stands below a heading."""
    return text.partition(f"{heading}\n")[2].partition(until)[0]


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


def test_every_reason_has_something_to_do() -> None:
    page = (ROOT / "docs/tuning.md").read_text(encoding="utf-8")
    told = {code for row in re.findall(r"^\| (`[^|]+)\|", page, re.MULTILINE) for code in re.findall(r"`(\w+)`", row)}
    fine = {str(ReasonCode.REFERENCE), str(ReasonCode.ACCEPTED)}
    assert {str(code) for code in ReasonCode} - fine <= told


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


def test_pages_that_the_program_writes_are_up_to_date() -> None:
    from scripts import reference_pages

    for name, text in reference_pages.pages().items():
        assert (reference_pages.DOCS / name).read_text(encoding="utf-8") == text, f"{name}: run make docs"


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_and_flag_is_documented(command: str) -> None:
    section = section_of((ROOT / "docs/cli.md").read_text(encoding="utf-8"), f"## replay {command}")
    for action in command_parser(command)._actions:
        for flag in action.option_strings:
            assert re.search(rf"(?<![\w-]){re.escape(flag)}(?![\w-])", section), flag
    tutorials = "".join((ROOT / name).read_text(encoding="utf-8") for name in GUIDES)
    assert f"replay {command}" in tutorials, "no page says what it is for"


def test_every_setting_is_documented() -> None:
    page = (ROOT / "docs/settings.md").read_text(encoding="utf-8")
    for key in known_keys(all_settings()):
        section, _, name = key.rpartition(".")
        part = section_of(page, f"[{section}]", until="\n[") if section else page.partition("\n[")[0]
        assert re.search(rf"^(# )?{re.escape(name)} (=|is not set)", part, re.MULTILINE), key


def test_every_topic_is_documented(tmp_path: Path, two: Path) -> None:
    part = section_of(FORMATS, "## MCAP")
    documented = re.findall(r"^\| `(/[^`]+)` \|", part, re.MULTILINE)
    shapes = [re.compile(re.sub(r"<\w+>", "[^/]+", topic)) for topic in documented]
    written: set[str] = set()
    for method in MATCHERS:
        output = tmp_path / f"{method}.mcap"
        replay.merge(two, method=method, images="all").write(output, rrd=False, copy_maps=True)
        found = topics(output)
        written |= set(found)
        for topic in found:
            if topic.startswith("/merged/images/"):
                assert f"| `{topic.rpartition('/')[2]}` |" in part or f"`{topic.rpartition('/')[2]}`" in part, topic
    assert all(any(shape.fullmatch(topic) for shape in shapes) for topic in written), written
    assert all(any(shape.fullmatch(topic) for topic in written) for shape in shapes), documented


@pytest.mark.parametrize(
    "name",
    [
        *("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"),
        *("docs/output-formats.md", "docs/benchmarks.md", "docs/configuration.md"),
        *("docs/python.md", "docs/index.md", "examples/README.md"),
        *("docs/tutorial.md", "docs/tuning.md", "docs/faq.md", "docs/comparison.md", "docs/how-it-decides.md"),
        *("docs/ci.md", "docs/export.md", "docs/method.md", "SECURITY.md"),
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
