"""What the documents promise is what is there."""

from __future__ import annotations

import json
import re
from collections import Counter
from importlib import resources
from pathlib import Path
from urllib.parse import unquote, urlsplit

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


DOCUMENTS = sorted(
    path.relative_to(ROOT).as_posix()
    for pattern in ("*.md", "docs/**/*.md", "examples/**/*.md", "samples/**/*.md", "benchmarks/**/*.md")
    for path in ROOT.glob(pattern)
)


def prose(document: Path) -> str:
    """Return a document without its blocks of code."""
    return re.sub(r"^(```|~~~).*?^\1", "", document.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


def anchors(document: Path) -> set[str]:
    """Return the places of a document that links may name, as GitHub makes them of headings."""
    text = prose(document)
    found = set(re.findall(r'<\w+ (?:id|name)="([^"]+)"', text))
    taken: Counter[str] = Counter()
    for heading in re.findall(r"^#{1,6} +(.+?)[ #]*$", text, re.MULTILINE):
        shown = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        slug = re.sub(r"[^\w\- ]", "", shown.lower()).replace(" ", "-")
        found.add(f"{slug}-{taken[slug]}" if taken[slug] else slug)
        taken[slug] += 1
    return found


def broken_links(document: Path) -> list[str]:
    """Return the links within the repository that lead nowhere, or to no place of a document."""
    text = re.sub(r"`[^`\n]+`", "", prose(document))
    links = re.findall(r'\]\(([^)\s]+)(?: "[^"]*")?\)', text) + re.findall(r'(?:href|src|srcset)="([^"]+)"', text)
    broken = []
    for link in links:
        parts = urlsplit(link)
        if parts.scheme or parts.netloc:
            continue
        target = document.parent / unquote(parts.path) if parts.path else document
        if not target.exists() or (parts.fragment and target.suffix == ".md" and parts.fragment not in anchors(target)):
            broken.append(link)
    return broken


@pytest.mark.parametrize("name", DOCUMENTS)
def test_links_lead_somewhere(name: str) -> None:
    assert broken_links(ROOT / name) == []


def test_links_that_lead_nowhere_are_found(tmp_path: Path) -> None:
    page, other = tmp_path / "page.md", tmp_path / "other.md"
    other.write_text("# What's `a_b`, and 2?\n\n## Again\n\n## Again\n\n```sh\n# no heading\n```\n", encoding="utf-8")
    good = ("other.md", "other.md#whats-a_b-and-2", "other.md#again-1", "#here", "https://example.org/x#y", ".")
    bad = ("gone.md", "other.md#what", "other.md#again-2", "other.md#no-heading", "#there")
    lines = [f"[words]({link})" for link in (*good, *bad)]
    page.write_text("\n".join(["## Here", *lines, '<img src="gone.png">']), encoding="utf-8")
    assert broken_links(page) == [*bad, "gone.png"]


@pytest.mark.parametrize("package", ["mapmerge", "replay"])
def test_architecture_names_each_module_once(package: str) -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    section = text.partition(f"\n## {package}\n")[2].partition("\n## ")[0]
    rows = "".join(re.findall(r"^\| (`[^|]+) \|", section, re.MULTILINE))
    named = Counter(re.findall(r"`([a-z_0-9/]+(?:\.py|/))`", rows))
    assert [name for name, times in named.items() if times > 1] == []
    assert [name for name in named if not (ROOT / package / name).exists()] == []
    there = {path.name for path in (ROOT / package).glob("*.py")} - {"__init__.py", "__main__.py"}
    assert there - set(named) == set()
