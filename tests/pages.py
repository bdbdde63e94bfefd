"""Reads a report page back, as a browser would take it apart."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import html5lib

from replay.events import Event
from replay.html.page import page
from replay.html.story import StoryTeller
from replay.options import RunOptions
from replay.pipeline import merge
from tests.scenarios import events_of


def page_of(scenario: str) -> str:
    """Return the page of a scenario."""
    return _told(events_of(scenario))


def page_of_run(options: RunOptions) -> str:
    """Return the page of a run."""
    return _told(merge(options))


def _told(events: Iterable[Event]) -> str:
    teller = StoryTeller()
    stories = [teller.take(event) for event in events]
    assert stories[-1] is not None
    return page(stories[-1])


class Page:
    """A page; one that is not well-formed is refused."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.root: Element = html5lib.HTMLParser(strict=True, namespaceHTMLElements=False).parse(text)

    @staticmethod
    def read(path: Path) -> Page:
        return Page(path.read_text(encoding="utf-8"))

    def all(self, tag: str, *, kind: str | None = None) -> list[Element]:
        found = [each for each in self.root.iter() if str(each.tag).rpartition("}")[2] == tag]
        return [each for each in found if kind is None or kind in each.get("class", "").split()]

    def section(self, name: str) -> Element:
        """Return a section by the id of its heading."""
        return next(each for each in self.all("section") if each.get("aria-labelledby") == name)

    def words(self, name: str | None = None) -> str:
        """Return what a reader sees, of a section or of all of the body."""
        part = self.section(name) if name else self.all("body")[0]
        return " ".join("".join(_texts(part)).split())

    def texts(self) -> Iterator[str]:
        """Yield each text that a reader sees, but for commands, which are whole."""
        for each in self.root.iter():
            if each.tag not in ("script", "style", "pre"):
                yield each.text or ""
            yield each.tail or ""

    def rows(self, name: str) -> list[list[str]]:
        """Return the cells of a section's tables, row by row, without the head."""
        bodies = list(self.section(name).iter("tbody"))
        return [[" ".join("".join(_texts(cell)).split()) for cell in row] for body in bodies for row in body.iter("tr")]

    def attributes(self) -> Iterator[tuple[str, str, str]]:
        """Yield tag, name and value of each attribute."""
        for each in self.root.iter():
            for name, value in each.attrib.items():
                yield str(each.tag).rpartition("}")[2], str(name).rpartition("}")[2], value

    @property
    def command(self) -> str:
        """How to run it again."""
        return str(next(each.text for each in self.all("pre") if each.get("aria-label") == "Command"))

    @property
    def series(self) -> dict[str, Any]:
        """The values of the plots."""
        return json.loads(next(each.text or "" for each in self.all("script") if each.get("id") == "series"))


def _texts(element: Element) -> Iterator[str]:
    if element.tag in ("script", "style"):
        return
    yield element.text or ""
    for child in element:
        yield from _texts(child)
        yield child.tail or ""
