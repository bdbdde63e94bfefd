"""`--report`: a page that is written, refused and published as the other outputs are."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shlex
from pathlib import Path

import pytest

from tests.bags import write_mcap
from tests.data_paths import ROOT
from tests.pages import Page
from tests.program import Program
from tests.runs import bare_room, growing, in_log_order, seen

QUIET = ("--images", "none")


def names(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


def test_it_is_written_where_it_is_asked_for(replay: Program, two: Path, tmp_path: Path) -> None:
    (tmp_path / "pages").mkdir()
    ran = replay("merge", two, "-o", "out.mcap", "--no-rrd", "--report", "pages/run.html", *QUIET)
    assert ran.status == 0
    assert names(tmp_path) == ["out.json", "out.mcap", "pages"]
    assert names(tmp_path / "pages") == ["run.html"]
    assert ran.err.rstrip().endswith("wrote out.mcap, pages/run.html, out.json")
    assert "Both maps are merged." in Page.read(tmp_path / "pages/run.html").words()


def test_without_it_no_page_is_written(replay: Program, two: Path, tmp_path: Path) -> None:
    assert replay("merge", two, "-o", "out.mcap", "--no-rrd", *QUIET).status == 0
    assert names(tmp_path) == ["out.json", "out.mcap"]


def test_the_same_run_gives_the_same_page_wherever_it_is(replay: Program, two: Path, tmp_path: Path) -> None:
    digests = set()
    for name, jobs in (("one", "1"), ("another", "2"), ("third", "2")):
        folder = tmp_path / name
        folder.mkdir()
        outputs = ("-o", folder / "out.mcap", "--report", folder / "page.html", "--no-rrd", "--jobs", jobs, *QUIET)
        assert replay("merge", two, *outputs).status == 0
        text = (folder / "page.html").read_bytes()
        assert str(tmp_path).encode() not in text
        assert str(two.parent).encode() not in text
        digests.add(hashlib.sha256(text).hexdigest())
    assert len(digests) == 1


@pytest.mark.parametrize("name", ["page.htm", "page", "page.html.mcap"])
def test_another_ending_is_refused(replay: Program, two: Path, tmp_path: Path, name: str) -> None:
    ran = replay("merge", two, "--report", name)
    assert ran.status == 2
    assert "--report" in ran.error
    assert ".html" in ran.error
    assert names(tmp_path) == []


def test_a_page_that_is_there_is_refused_without_force(replay: Program, two: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text("dear to somebody")
    outputs = ("-o", "out.mcap", "--no-rrd", "--report", page, *QUIET)
    ran = replay("merge", two, *outputs)
    assert ran.status == 2
    assert "page.html" in ran.error
    assert "or another name" in ran.error
    assert page.read_text() == "dear to somebody"
    assert names(tmp_path) == ["page.html"]
    assert replay("merge", two, *outputs, "--force").status == 0
    assert page.read_text().startswith("<!DOCTYPE html>")


def test_a_folder_that_is_not_there_is_refused(replay: Program, two: Path, tmp_path: Path) -> None:
    ran = replay("merge", two, "-o", "out.mcap", "--report", "nowhere/page.html", *QUIET)
    assert ran.status == 3
    assert "nowhere" in ran.error
    assert names(tmp_path) == []


def test_an_input_is_never_replaced(replay: Program, two: Path, tmp_path: Path) -> None:
    (tmp_path / "run.html").symlink_to(two)
    before = two.read_bytes()
    ran = replay("merge", two, "-o", "out.mcap", "--report", "run.html", "--force", *QUIET)
    assert ran.status == 2
    assert "is an input" in ran.error
    assert two.read_bytes() == before


def test_a_run_that_fails_leaves_no_page(replay: Program, tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    run = write_mcap(tmp_path / "in" / "run.mcap", [seen("r1", 0.0), seen("r1", 1.0, resolution=0.0)])
    ran = replay("merge", run, "-o", "out.mcap", "--strict", "--report", "page.html", *QUIET)
    assert ran.status == 2
    assert names(tmp_path) == ["in"]


@pytest.mark.parametrize("name", ["out.mcap", "page.html", "out.json"])
def test_a_run_that_cannot_give_its_names_leaves_the_page_that_was_there(
    replay: Program, two: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    older = {tmp_path / "out.mcap", tmp_path / "out.json", tmp_path / "pages" / "page.html"}
    (tmp_path / "pages").mkdir()
    for path in older:
        path.write_text(f"the {path.name} of an earlier run")
    replace = os.replace

    def refusing(old: str, new: str) -> None:
        if Path(new).name == name and Path(old).suffix == ".partial":
            raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))
        replace(old, new)

    monkeypatch.setattr(os, "replace", refusing)
    ran = replay("merge", two, "-o", "out.mcap", "--no-rrd", "--report", "pages/page.html", "--force", *QUIET)
    assert ran.status == 3
    assert f"{name}: cannot be written" in ran.err.splitlines()[-1]
    assert {path for path in tmp_path.rglob("*") if path.is_file()} == older
    assert {path.read_text() for path in older} == {f"the {path.name} of an earlier run" for path in older}


HOSTILE = {
    "markup": "<script>alert(1)</script>",
    "a broken attribute": "r\"><img src=x onerror='alert(1)'>",
    "an attribute more": 'r" onclick autofocus "',
    "an element in an attribute": 'r"><script>alert(1)</script><i title "',
    "the end of data": "</script><script>alert(1)</script><!--",
    "a template": "{{ 7 * 7 }}{% raw %}",
    "a mark of direction": "r\u202edellac si ti tahw",
    "a line end": "r\nVerdict: all is well",
    "a zero and an escape": "r\x00\x1b[31m",
    "half a character": "r\udce9",
    "quotes": "'\"`$(reboot)\\",
    "very long": "r" * 5000,
    "many words": "word " * 600,
}


@pytest.mark.parametrize("name", HOSTILE.values(), ids=HOSTILE)
def test_a_name_is_only_ever_text(replay: Program, tmp_path: Path, name: str) -> None:
    if "\udce9" in name:
        name = os.fsdecode(os.fsencode(name))
    # in the flag a name ends at the first equals sign: one with it is that of a topic
    topic, named = (f"/{name}/map", ()) if "=" in name else ("/r2/map", ("--topic", f"{name}=/r2/map"))
    messages = in_log_order(growing("r1"), growing("r2", 2.0, topic=topic), [seen("r3", 3.0, bare_room())])
    (tmp_path / "in").mkdir()
    run = write_mcap(tmp_path / "in" / "run.mcap", messages)
    ran = replay(
        "merge", run, "-o", "out.mcap", "--no-rrd", "--report", "page.html", *QUIET,
        "--topic", "r1=/r1/map", *named, "--topic", "r3=/r3/map",
    )  # fmt: skip
    assert ran.status == 0, ran.err
    page = Page.read(tmp_path / "page.html")
    assert sorted(row[1] for row in page.rows("robots")) == ["merged", "not merged", "reference"]
    assert len(page.all("script")) == 2
    assert not any(each.get("src") == "x" for each in page.all("img"))
    assert not any(name.startswith("on") for _, name, _ in page.attributes())
    assert page.text.replace("\n", "").isprintable()
    assert "49" not in page.words().split()
    assert max(len(word) for text in page.texts() for word in text.split()) <= 250


@pytest.mark.parametrize("name", [value for key, value in HOSTILE.items() if key != "half a character"])
def test_a_topic_is_only_ever_text(replay: Program, tmp_path: Path, name: str) -> None:
    messages = [seen("r1", 0.0), seen("r2", 1.0, topic=f"/{name}/map"), seen("r3", 2.0, bare_room(), resolution=-1.0)]
    (tmp_path / "in").mkdir()
    run = write_mcap(tmp_path / "in" / "run.mcap", messages)
    ran = replay("merge", run, "-o", "out.mcap", "--no-rrd", "--report", "page.html", *QUIET)
    assert ran.status == 0, ran.err
    page = Page.read(tmp_path / "page.html")
    assert len(page.all("script")) == 2
    assert not any(each.get("src") == "x" for each in page.all("img"))
    assert page.text.replace("\n", "").isprintable()


@pytest.mark.parametrize(
    "arguments",
    [
        ("samples/two_robots.mcap",),
        ("samples/three_robots.bag", "--robots", "r2,r1", "--start", "1.5", "--stop", "120"),
        ("alpha=samples/bag_per_robot/alpha", "bravo=samples/bag_per_robot/bravo", "--min-confidence", "0.95"),
        (
            "samples/two_robots.mcap",
            "--set",
            "merge.verify.min_overlap_m2=70",
            "--set",
            "merge.refine.reject_m=[0.4, 0.2]",
        ),
        ("bot=samples/bag_per_robot/alpha",),
        ("a=samples/bag_per_robot/alpha", "samples/two_robots.mcap", "--align-starts"),
        ("samples/bag_per_robot/bravo", "samples/bag_per_robot/alpha"),
        ("b=samples/bag_per_robot/bravo", "samples/bag_per_robot/alpha", "--robots", "alpha,b"),
        ("samples/two_robots.mcap", "--every", "2.5", "--copy-maps", "--stop", "40"),
        ("samples/two_robots.mcap", "--clock", "log", "--reorder-window", "0.25", "--max-memory", "300MB"),
        ("samples/two_robots.mcap", "--init-pose", "r2=1,2,30deg+-5,+-5,+-90deg", "--align-starts", "--stop", "40"),
        ("samples/two_robots.mcap", "--set", "merge.verify.tolerance_m=0.2", "--copy-maps", "--every", "2.5"),
        (
            "samples/two_robots.mcap",
            "--topic",
            "/{robot}/map",
            "--method",
            "existing",
            "--scale",
            "free",
            "--stop",
            "20",
        ),
    ],
)
def test_the_command_that_it_names_gives_the_same_again(
    replay: Program, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...]
) -> None:
    monkeypatch.chdir(ROOT)
    one, again = tmp_path / "one.mcap", tmp_path / "again.mcap"
    page = tmp_path / "one.html"
    assert replay("merge", *arguments, "-o", one, "--no-rrd", "--report", page, *QUIET).status == 0
    program, *command = shlex.split(Page.read(page).command)
    assert program == "replay"
    # as in one folder with all of them
    for path in (ROOT / "samples" / "two_robots.mcap", *(ROOT / "samples/bag_per_robot").iterdir()):
        (tmp_path / path.name).symlink_to(path)
    (tmp_path / "three_robots.bag").symlink_to(ROOT / "samples" / "three_robots.bag")
    monkeypatch.chdir(tmp_path)
    assert replay(*command, "-o", again, "--no-rrd").status == 0
    before, after = (json.loads(path.with_suffix(".json").read_text()) for path in (one, again))
    assert before == after
    assert one.read_bytes() == again.read_bytes()


def test_placements_can_be_given_to_another_run(replay: Program, two: Path, tmp_path: Path) -> None:
    assert replay("merge", two, "-o", "a.mcap", "--no-rrd", "--report", "a.html", *QUIET).status == 0
    flags = next(
        each.text
        for each in Page.read(tmp_path / "a.html").all("pre")
        if each.get("aria-label") == "Placements as flags"
    )
    given = replay("merge", two, "-o", "b.mcap", "--no-rrd", *QUIET, *shlex.split(flags or ""))
    assert given.status == 0
    prior = json.loads((tmp_path / "b.json").read_text())["robots"]["r2"]["prior"]
    placed = json.loads((tmp_path / "a.json").read_text())["robots"]["r2"]["merged_from_map"]
    assert prior["pose"]["x_m"] == pytest.approx(placed["x_m"], abs=0.001)
    assert prior["pose"]["yaw_rad"] == pytest.approx(placed["yaw_rad"], abs=0.0001)
