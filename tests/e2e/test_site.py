"""The site is made of the documents as they are, without a warning; and what they say in Python is right."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import mapmerge
import replay
from scripts.site_links import broken, read_pages
from tests.data_paths import ROOT

API = {"mapmerge": mapmerge, "replay": replay}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if find_spec("sphinx") is None or find_spec("furo") is None:
        pytest.skip(
            "Sphinx is not installed here; `make site` installs it in .venv-docs and makes the site as this does"
        )
    folder = tmp_path_factory.mktemp("site")
    flags = ("-q", "-W", "--keep-going", "-n", "-c", "docs", "-d", str(folder / "doctrees"))
    # nothing is fetched: a proxy that is not there would make it fail
    nowhere = {**os.environ, "http_proxy": "http://127.0.0.1:9", "https_proxy": "http://127.0.0.1:9"}
    command = [sys.executable, "-m", "sphinx", *flags, ".", str(folder / "html")]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300, env=nowhere)
    assert ran.returncode == 0, ran.stderr
    assert ran.stderr == ""
    return folder / "html"


def test_all_that_is_offered_has_its_place(site: Path) -> None:
    for name, package in API.items():
        page = (site / "docs" / "api" / f"{name}.html").read_text(encoding="utf-8")
        for each in package.__all__:
            assert f'id="{name}.{each}"' in page, each


def test_the_first_page_leads_to_the_others(site: Path) -> None:
    assert "docs/index.html" in (site / "index.html").read_text(encoding="utf-8")
    first = (site / "docs" / "index.html").read_text(encoding="utf-8")
    for page in ("cli.html", "configuration.html", "../README.html", "api/replay.html"):
        assert f'href="{page}"' in first
        assert (site / "docs" / page).exists()


def test_pages_fetch_nothing(site: Path) -> None:
    for path in site.rglob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert not re.findall(r'<(?:script|link|img)[^>]+(?:src|href)="(https?:)?//', text), path


def test_what_the_documents_say_in_python_is_right(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copy(ROOT / "samples" / "two_robots.mcap", tmp_path / "run.mcap")
    for robot in ("alpha", "bravo"):
        shutil.copytree(ROOT / "samples" / "bag_per_robot" / robot, tmp_path / robot)
    (tmp_path / "alpha").rename(tmp_path / "alpha.bag")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len(blocks) >= 4
    for block in blocks:
        exec(compile(block, "python.md", "exec"), names)  # noqa: S102 - our own
    assert names["report"]["robots"]["r2"]["status"] == "merged"  # type: ignore[index]
    assert (tmp_path / "out.json").exists()


def test_links_that_lead_nowhere_are_found(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "b.html").write_text('<h1 id="top">B</h1><a href="../a.html#there">a</a>', encoding="utf-8")
    (tmp_path / "a.html").write_text(
        '<p id="here"><a href="sub/b.html#top">b</a> <a href="#here">up</a> <a href="https://example.org/x">x</a>',
        encoding="utf-8",
    )
    assert list(broken(tmp_path, read_pages(tmp_path))) == [
        f"{Path('sub') / 'b.html'}: ../a.html#there: there is no such place on that page"
    ]
    (tmp_path / "c.html").write_text('<img src="gone.png">', encoding="utf-8")
    assert any("gone.png: there is no such file" in line for line in broken(tmp_path, read_pages(tmp_path)))
