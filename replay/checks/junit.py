"""Findings as JUnit XML, which CI systems show: a test suite for the run, a test case for each expectation."""

from __future__ import annotations

import re
from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from replay.checks.findings import Finding
from replay.plain_text import plain

# What no XML document can hold, however it is escaped.
_NOT_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit_xml(found: Sequence[Finding], title: str) -> bytes:
    """Return the findings as a document."""
    failures = sum(not item.holds for item in found)
    root, suite = _suite(title, len(found), failures=failures)
    for item in found:
        case = SubElement(suite, "testcase", classname=_text(item.subject), name=_text(item.expected))
        if not item.holds:
            failure = SubElement(case, "failure", message=_text(item.found), type="expectation")
            failure.text = _text(f"expected: {item.expected}\nfound: {item.found}")
    return _bytes(root)


def junit_error_xml(message: str, title: str) -> bytes:
    """Return a document that says why there are no findings."""
    root, suite = _suite(title, 1, errors=1)
    case = SubElement(suite, "testcase", classname="run", name="it can be merged")
    SubElement(case, "error", message=_text(message), type="error")
    return _bytes(root)


def _suite(title: str, tests: int, *, failures: int = 0, errors: int = 0) -> tuple[Element, Element]:
    counts = {"tests": str(tests), "failures": str(failures), "errors": str(errors)}
    root = Element("testsuites", {"name": "replay check", **counts})
    return root, SubElement(root, "testsuite", {"name": _text(title), **counts, "skipped": "0"})


def _text(text: str) -> str:
    return _NOT_XML.sub("�", "\n".join(map(plain, text.split("\n"))))


def _bytes(root: Element) -> bytes:
    indent(root)
    content: bytes = tostring(root, encoding="utf-8", xml_declaration=True)
    return content + b"\n"
