"""What is installed is pinned: each package in one version, with the hashes of its files."""

from __future__ import annotations

import importlib.util
import re
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

from tests.data_paths import ROOT

LOCKS = ("run.txt", "dev.txt", "docs.txt", "tools.txt")
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
ASKED: dict[str, list[str]] = {
    "run.txt": [*PROJECT["project"]["dependencies"], *PROJECT["build-system"]["requires"]],
    "dev.txt": [*PROJECT["project"]["dependencies"], *PROJECT["project"]["optional-dependencies"]["dev"]],
    "docs.txt": [*PROJECT["project"]["dependencies"], *PROJECT["project"]["optional-dependencies"]["docs"]],
    "tools.txt": PROJECT["dependency-groups"]["tools"],
}
PLACES = [
    {"python_version": version, "python_full_version": f"{version}.0", "sys_platform": system}
    for version in ("3.11", "3.12", "3.13", "3.14")
    for system in ("linux", "darwin", "win32")
]


@dataclass(frozen=True)
class Pin:
    requirement: Requirement
    hashes: list[str]

    @property
    def name(self) -> str:
        return canonicalize_name(self.requirement.name)

    @property
    def version(self) -> Version:
        (specifier,) = self.requirement.specifier
        assert specifier.operator == "==", self.requirement
        return Version(specifier.version)

    def holds(self, place: dict[str, str]) -> bool:
        return self.requirement.marker is None or self.requirement.marker.evaluate(place)


def pins(lock: str) -> Iterator[Pin]:
    text = (ROOT / "requirements" / lock).read_text(encoding="utf-8").replace("\\\n", " ")
    for line in text.splitlines():
        if line and not line.startswith(("#", "-")):
            requirement, *hashes = line.split(" --hash=")
            yield Pin(Requirement(requirement.strip()), [each.strip() for each in hashes])


def pinned(lock: str, place: dict[str, str]) -> dict[str, Version]:
    found = [each for each in pins(lock) if each.holds(place)]
    versions = {each.name: each.version for each in found}
    assert len(versions) == len(found), "a package is pinned twice"
    return versions


@pytest.mark.parametrize("lock", LOCKS)
def test_all_that_is_asked_for_is_pinned_within_its_range_everywhere(lock: str) -> None:
    assert ASKED[lock]
    for place in PLACES:
        versions = pinned(lock, place)
        for asked in map(Requirement, ASKED[lock]):
            if asked.marker is None or asked.marker.evaluate(place):
                assert versions[canonicalize_name(asked.name)] in asked.specifier, (place, str(asked))


@pytest.mark.parametrize("lock", LOCKS)
def test_every_pin_has_hashes(lock: str) -> None:
    for pin in pins(lock):
        assert pin.hashes, pin.name
        assert all(re.fullmatch("sha256:[0-9a-f]{64}", each) for each in pin.hashes), pin.name


@pytest.mark.parametrize("lock", LOCKS)
def test_a_lock_names_no_place_on_the_network(lock: str) -> None:
    text = (ROOT / "requirements" / lock).read_text(encoding="utf-8")
    assert "://" not in text
    assert "index" not in text


def test_what_is_tested_is_what_is_run() -> None:
    for place in PLACES:
        assert pinned("run.txt", place).items() <= pinned("dev.txt", place).items()
        assert pinned("run.txt", place).items() <= pinned("docs.txt", place).items()


def test_only_pinned_packages_are_installed() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    installs = [line for line in makefile.splitlines() if re.search(r"\binstall\b.*--|/pip ", line)]
    assert len(installs) >= 5
    for line in installs:
        assert re.search(r"--require-hashes|--no-deps --no-build-isolation|\$\((PINNED|PROJECT)\)", line), line


# --- the audit


@pytest.fixture(scope="module")
def audit() -> ModuleType:
    spec = importlib.util.spec_from_file_location("audit_script", ROOT / "scripts" / "audit.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


FINE = {"name": "rich", "version": "15.0.0", "vulns": []}
WEAK = {"name": "pillow", "version": "9.0.0", "vulns": [{"id": "CVE-1", "fix_versions": ["9.0.1"]}]}
UNKNOWN = {"name": "numpy", "skip_reason": "Dependency not found and could not be audited: numpy"}


@pytest.mark.parametrize(
    ("packages", "status"),
    [([FINE], 0), ([FINE, WEAK], 1), ([UNKNOWN, WEAK], 1), ([FINE, UNKNOWN], 3), ([UNKNOWN], 3), ([], 3)],
)
def test_an_audit_that_looked_nothing_up_is_no_success(
    audit: ModuleType, packages: list[dict[str, Any]], status: int
) -> None:
    assert audit.status([audit.understood({"dependencies": packages})]) == status


def test_an_audit_without_an_answer_is_no_success(audit: ModuleType) -> None:
    assert audit.status([audit.understood({"dependencies": [FINE]}), audit.Audit(failure="no network")]) == 3


def test_an_audit_names_what_is_weak_and_what_mends_it(audit: ModuleType) -> None:
    (line,) = audit.understood({"dependencies": [FINE, WEAK]}).vulnerable
    assert line == "pillow 9.0.0: CVE-1; fixed in 9.0.1"
