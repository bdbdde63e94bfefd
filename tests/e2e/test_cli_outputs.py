"""Which files are written, and which are never touched."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from replay.events import Finished
from replay.pipeline import drain
from replay.sinks.partial_file import PartialFile
from tests.bags import write_bare_db3, write_mcap, write_rosbag2, write_saved_map
from tests.disks import read_only, small_disk
from tests.program import Program
from tests.runs import two_robots


def names(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


@pytest.mark.parametrize(
    ("name", "stem"),
    [("run.mcap", "run"), ("floor.2026-05-01.mcap", "floor.2026-05-01"), ("no_suffix", "no_suffix")],
)
def test_default_name(replay: Program, two: Path, tmp_path: Path, name: str, stem: str) -> None:
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    shutil.copy(two, folder / name)
    assert replay("merge", folder / name, "--no-rrd", "--images", "none").status == 0
    assert names(folder) == [name]
    assert names(tmp_path) == ["elsewhere", f"{stem}.merged.json", f"{stem}.merged.mcap"]


def test_default_name_of_a_folder(replay: Program, tmp_path: Path) -> None:
    write_rosbag2(tmp_path / "bag.v2", two_robots())
    assert replay("merge", f"{tmp_path}/bag.v2/", "--no-rrd", "--images", "none").status == 0
    assert names(tmp_path) == ["bag.v2", "bag.v2.merged.json", "bag.v2.merged.mcap"]


def test_default_name_is_that_of_the_first_run(replay: Program, two: Path, tmp_path: Path) -> None:
    shutil.copy(two, tmp_path / "b.mcap")
    shutil.copy(two, tmp_path / "a.mcap")
    choice = ("--topic", "r1=/r1/map", "--topic", "r2=/r2/map")
    assert replay("merge", "r1=b.mcap", "r2=a.mcap", *choice, "--no-rrd", "--images", "none").status == 0
    assert "b.merged.mcap" in names(tmp_path)


def test_three_files_beside_each_other(replay: Program, two: Path, tmp_path: Path) -> None:
    ran = replay("merge", two, "-o", "out.mcap")
    assert ran.status == 0
    assert names(tmp_path) == ["out.json", "out.mcap", "out.rrd"]
    assert ran.err.rstrip().endswith("wrote out.mcap, out.rrd, out.json")


@pytest.mark.parametrize("name", ["out.mcap", "out.json"])
def test_what_exists_is_refused_without_force(replay: Program, two: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("dear to somebody")
    ran = replay("merge", two, "-o", "out.mcap", "--no-rrd", "--images", "none")
    assert ran.status == 2
    assert name in ran.error
    assert "--force" in ran.error
    assert names(tmp_path) == [name]
    assert (tmp_path / name).read_text() == "dear to somebody"
    assert replay("merge", two, "-o", "out.mcap", "--no-rrd", "--images", "none", "--force").status == 0
    assert (tmp_path / name).read_bytes()[:8] != b"dear to "


def test_no_recording_of_another_run_stays_beside_the_outputs(replay: Program, two: Path, tmp_path: Path) -> None:
    (tmp_path / "out.rrd").write_text("of another run")
    assert replay("merge", two, "-o", "out.mcap", "--no-rrd", "--images", "none").status == 2
    assert (tmp_path / "out.rrd").read_text() == "of another run"
    assert replay("merge", two, "-o", "out.mcap", "--no-rrd", "--images", "none", "--force").status == 0
    assert not (tmp_path / "out.rrd").exists()


def test_no_page_of_another_run_stays_beside_the_outputs(replay: Program, two: Path, tmp_path: Path) -> None:
    merge = ("merge", two, "-o", "out.mcap", "--no-rrd", "--images", "none")
    assert replay(*merge, "--report", "out.html").status == 0
    page = (tmp_path / "out.html").read_bytes()
    assert replay(*merge, "--force").status == 0
    assert names(tmp_path) == ["out.json", "out.mcap"]
    # nor one that a run had set aside before it was killed
    (tmp_path / "out.html.replaced").write_bytes(page)
    (tmp_path / "other.html").write_bytes(page)
    assert replay(*merge, "--force").status == 0
    assert names(tmp_path) == ["other.html", "out.json", "out.mcap"]


@pytest.mark.parametrize("kind", ["text", "link", "folder", "page"])
def test_what_is_no_page_of_ours_stays(replay: Program, two: Path, tmp_path: Path, kind: str) -> None:
    page = tmp_path / "out.html"
    mine = '<!DOCTYPE html><html><head><meta name="generator" content="pen and paper"></head></html>'
    (tmp_path / "mine.txt").write_text(mine)
    if kind == "folder":
        page.mkdir()
    elif kind == "link":
        page.symlink_to(tmp_path / "mine.txt")
    else:
        page.write_text("of an earlier run" if kind == "text" else mine)
    before = page.lstat().st_ino
    ran = replay("merge", two, "-o", "out.mcap", "--no-rrd", "--images", "none", "--force")
    assert ran.status == 0, ran.err
    assert page.lstat().st_ino == before
    assert (tmp_path / "mine.txt").read_text() == mine


def test_a_page_that_is_not_written_is_no_hindrance(replay: Program, two: Path, tmp_path: Path) -> None:
    merge = ("merge", two, "-o", "out.mcap", "--no-rrd", "--images", "none")
    assert replay(*merge, "--report", "out.html").status == 0
    for name in ("out.mcap", "out.json"):
        (tmp_path / name).unlink()
    ran = replay(*merge, "--report", "out.html")
    assert ran.status == 2
    assert "there is already out.html" in ran.error
    assert replay(*merge).status == 0
    assert names(tmp_path) == ["out.html", "out.json", "out.mcap"]


def test_a_page_is_put_back_if_the_run_fails(replay: Program, two: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    merge = ("merge", two, "-o", replay.folder / "out.mcap", "--no-rrd", "--images", "none")
    assert replay(*merge, "--report", replay.folder / "out.html").status == 0
    before = contents(replay.folder)
    refuse_to(monkeypatch, "replace", lambda _, target: Path(target).name == "out.json")
    assert replay(*merge, "--force").status == 3
    kept = contents(replay.folder)
    assert kept["out.html"] == before["out.html"]
    assert kept["out.mcap"] == before["out.mcap"]


def test_a_failed_run_leaves_what_was_there(replay: Program, two: Path) -> None:
    before = replay.merge(two)
    kept = before.mcap.read_bytes()
    ran = replay.merge(two, "--robots", "r1,r9")
    assert ran.status == 2
    assert before.mcap.read_bytes() == kept
    assert names(replay.folder) == ["out.json", "out.mcap"]


class TestARunThatFailsAtTheEndLeavesWhatWasThere:
    @pytest.fixture(params=[("out.json", "out.mcap", "out.rrd"), ("out.json", "out.mcap"), ("out.json",), ()], ids=len)
    def there(self, request: pytest.FixtureRequest, tmp_path: Path) -> dict[str, bytes]:
        for name in request.param:
            (tmp_path / name).write_text(f"the {name} of an earlier run")
        return contents(tmp_path)

    @pytest.mark.parametrize("name", ["out.mcap", "out.rrd", "out.json"])
    def test_because_a_file_is_gone(
        self, replay: Program, two: Path, monkeypatch: pytest.MonkeyPatch, there: dict[str, bytes], name: str
    ) -> None:
        def drained(*arguments: Any) -> Finished:
            found = drain(*arguments)
            (replay.folder / f"{name}.partial").unlink()
            return found

        monkeypatch.setattr("replay.pipeline.drain", drained)
        ran = replay("merge", two, "-o", replay.folder / "out.mcap", "--force", "--images", "none")
        assert ran.status == 3
        assert f"{name}.partial was removed or replaced while it was written" in ran.err.splitlines()[-1]
        assert contents(replay.folder) == there

    @pytest.mark.parametrize("has_links", [True, False])
    @pytest.mark.parametrize("name", ["out.mcap", "out.rrd", "out.json"])
    def test_because_a_file_cannot_have_its_name(
        self,
        replay: Program,
        two: Path,
        monkeypatch: pytest.MonkeyPatch,
        there: dict[str, bytes],
        name: str,
        has_links: bool,
    ) -> None:
        refuse_to(monkeypatch, "replace", lambda _, target: Path(target).name == name and Path(_).suffix == ".partial")
        refuse_to(monkeypatch, "link", lambda *_: not has_links)
        ran = replay("merge", two, "-o", replay.folder / "out.mcap", "--force", "--images", "none")
        assert ran.status == 3
        assert f"{name}: cannot be written: Operation not permitted" in ran.err.splitlines()[-1]
        assert contents(replay.folder) == there

    @pytest.mark.parametrize("name", ["out.mcap", "out.rrd", "out.json"])
    def test_because_an_older_file_cannot_be_moved(
        self, replay: Program, two: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
    ) -> None:
        """As in a folder with the sticky bit, of a file that is somebody else's."""
        for each in ("out.json", "out.mcap", "out.rrd"):
            (tmp_path / each).write_text(f"the {each} of an earlier run")
        there = contents(tmp_path)
        refuse_to(monkeypatch, "replace", lambda old, new: name in {Path(old).name, Path(new).name})
        refuse_to(monkeypatch, "link", lambda old, _: Path(old).name == name)
        ran = replay("merge", two, "-o", tmp_path / "out.mcap", "--force", "--images", "none")
        assert ran.status == 3
        assert contents(tmp_path) == there


def contents(folder: Path) -> dict[str, bytes]:
    return {each.name: each.read_bytes() for each in folder.iterdir()}


def refuse_to(monkeypatch: pytest.MonkeyPatch, call: str, when: Callable[..., bool]) -> None:
    """Let a call of the system fail when it is given this."""
    before = getattr(os, call)

    def called(*arguments: Any, **options: Any) -> None:
        if when(*arguments):
            raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))
        before(*arguments, **options)

    monkeypatch.setattr(os, call, called)


class TestInputsAreNeverWritten:
    def test_by_name(self, replay: Program, two: Path, tmp_path: Path) -> None:
        shutil.copy(two, tmp_path / "run.mcap")
        (tmp_path / "folder").mkdir()
        for output in ("run.mcap", "./folder/../run.mcap", tmp_path / "run.mcap"):
            ran = replay("merge", "run.mcap", "-o", output, "--no-rrd", "--force")
            assert ran.status == 2
            assert "is an input" in ran.error
        assert (tmp_path / "run.mcap").read_bytes() == two.read_bytes()

    def test_through_a_link(self, replay: Program, two: Path, tmp_path: Path) -> None:
        shutil.copy(two, tmp_path / "run.mcap")
        (tmp_path / "link.mcap").symlink_to("run.mcap")
        for run, output in (("run.mcap", "link.mcap"), ("link.mcap", "run.mcap")):
            assert "is an input" in replay("merge", run, "-o", output, "--no-rrd", "--force").error

    @pytest.mark.parametrize("link", [Path.symlink_to, Path.hardlink_to])
    @pytest.mark.parametrize(
        "name",
        [
            "out.mcap",
            "out.rrd",
            "out.json",
            "out.mcap.partial",
            "out.json.partial",
            "out.json.replaced",
            "out.mcap.recovering",
        ],
    )
    def test_through_any_link(
        self, replay: Program, two: Path, tmp_path: Path, name: str, link: Callable[[Path, Path], None]
    ) -> None:
        run = shutil.copy(two, tmp_path / "run.mcap")
        link(tmp_path / name, run)
        ran = replay.merge(run)
        assert ran.status == 2
        assert f"{name} is an input" in ran.error
        assert run.read_bytes() == two.read_bytes()
        assert names(tmp_path) == sorted([name, "run.mcap"])

    def test_through_a_link_to_a_part_of_a_bag(self, replay: Program, tmp_path: Path) -> None:
        bag = write_rosbag2(tmp_path / "bag", two_robots(), "mcap")
        (part,) = bag.glob("*.mcap")
        kept = part.read_bytes()
        (tmp_path / "out.mcap").hardlink_to(part)
        assert "is an input" in replay.merge(bag).error
        assert part.read_bytes() == kept

    @pytest.mark.parametrize("link", [None, Path.symlink_to, Path.hardlink_to])
    def test_the_image_of_a_saved_map(
        self, replay: Program, tmp_path: Path, link: Callable[[Path, Path], None] | None
    ) -> None:
        """It may lie anywhere, and have any name."""
        run = write_saved_map(tmp_path / "map.yaml", np.zeros((40, 50), np.uint8))
        (image,) = set(tmp_path.iterdir()) - {run}
        if link is None:
            run.write_text(run.read_text().replace(image.name, "out.json"))
            image = image.rename(tmp_path / "out.json")
        else:
            link(tmp_path / "out.json", image)
        kept = image.read_bytes()
        ran = replay.merge(run)
        assert ran.status == 2
        assert "out.json is an input" in ran.error
        assert image.read_bytes() == kept
        assert names(tmp_path) == sorted({"map.yaml", image.name, "out.json"})

    @pytest.mark.parametrize("suffix", ["-wal", "-journal"])
    def test_what_lies_beside_a_db3(self, replay: Program, tmp_path: Path, suffix: str) -> None:
        run = write_bare_db3(tmp_path / "run.db3", two_robots())
        (tmp_path / "out.json").write_bytes(b"x" * 600)
        (tmp_path / f"run.db3{suffix}").hardlink_to(tmp_path / "out.json")
        ran = replay.merge(run)
        assert ran.status == 2
        assert "out.json is an input" in ran.error
        assert (tmp_path / "out.json").read_bytes() == b"x" * 600

    def test_under_the_temporary_name(self, replay: Program, two: Path, tmp_path: Path) -> None:
        shutil.copy(two, tmp_path / "run.mcap.partial")
        ran = replay("merge", "run.mcap.partial", "-o", "run.mcap", "--no-rrd", "--force")
        assert ran.status == 2
        assert (tmp_path / "run.mcap.partial").read_bytes() == two.read_bytes()

    def test_within_a_bag_folder(self, replay: Program, tmp_path: Path) -> None:
        bag = write_rosbag2(tmp_path / "bag", two_robots(), "mcap")
        (part,) = bag.glob("*.mcap")
        kept = part.read_bytes()
        for output in (part, bag / "merged.mcap"):
            ran = replay("merge", bag, "-o", output, "--no-rrd", "--force")
            assert ran.status == 2
            assert "input" in ran.error
        assert part.read_bytes() == kept


class TestWhereNothingCanBeWritten:
    @pytest.mark.parametrize(
        ("number", "remedy"),
        [
            (errno.EACCES, "make the folder one that you may write to"),
            (errno.EROFS, "make the folder one that you may write to"),
            (errno.ENOSPC, "free space"),
            (errno.EDQUOT, "free space"),
            (errno.EFBIG, "`ulimit -f`"),
            (errno.EIO, "give another name"),
        ],
    )
    def test_it_is_said_what_to_do(
        self, replay: Program, two: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, remedy: str
    ) -> None:
        """By hand, because the owner of a container may write everywhere."""

        def refused(*_: object) -> bool:
            raise OSError(number, os.strerror(number))

        monkeypatch.setattr(PartialFile, "_make", refused)
        ran = replay.merge(two)
        assert ran.status == 3
        assert ran.error.startswith(f"{tmp_path / 'out.mcap'}: cannot be written: {os.strerror(number)}; ")
        assert remedy in ran.error
        assert "another name" in ran.error

    def test_no_folder(self, replay: Program, two: Path, tmp_path: Path) -> None:
        ran = replay("merge", two, "-o", "nowhere/out.mcap", "--no-rrd")
        assert ran.status == 3
        assert "no such folder" in ran.error
        assert not names(tmp_path)

    def test_a_folder_that_takes_no_files(self, replay: Program, two: Path) -> None:
        folder = Path("/proc/self")
        if not folder.is_dir():
            pytest.skip("a folder that takes no files, whoever asks, is only known on Linux")
        ran = replay("merge", two, "-o", folder / "out.mcap", "--no-rrd")
        assert ran.status == 3
        assert f"{folder}/out.mcap: cannot be written" in ran.error
        assert ran.error.endswith("; give another name")

    def test_a_folder_that_becomes_read_only(
        self, replay: Program, two: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        out = tmp_path / "out"
        out.mkdir()
        (out / "out.json").write_text("of an earlier run")
        with ExitStack() as stack:

            def drained(*arguments: Any) -> Finished:
                found = drain(*arguments)
                stack.enter_context(read_only(out))
                return found

            monkeypatch.setattr("replay.pipeline.drain", drained)
            ran = replay("merge", two, "-o", out / "out.mcap", "--force", "--images", "none")
            assert ran.status == 3
            assert "cannot be written: " in ran.err.splitlines()[-1]
            assert ran.err.endswith("; make the folder one that you may write to, or give another name\n")
            assert not {"out.mcap", "out.rrd"} & set(names(out))
            assert (out / "out.json").read_text() == "of an earlier run"

    def test_a_folder_that_vanishes(
        self, replay: Program, two: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        out = tmp_path / "out"
        out.mkdir()

        def drained(*arguments: Any) -> Finished:
            found = drain(*arguments)
            out.rename(tmp_path / "elsewhere")
            return found

        monkeypatch.setattr("replay.pipeline.drain", drained)
        ran = replay("merge", two, "-o", out / "out.mcap", "--no-rrd", "--images", "none")
        assert ran.status == 3
        assert "cannot be written: " in ran.err.splitlines()[-1]
        assert names(tmp_path) == ["elsewhere"]
        assert names(tmp_path / "elsewhere") == ["out.json.partial", "out.mcap.partial"]

    def test_what_appears_during_the_run_is_not_replaced(
        self, replay: Program, two: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def drained(*arguments: Any) -> Finished:
            found = drain(*arguments)
            (tmp_path / "out.json").write_text("dear to somebody")
            return found

        monkeypatch.setattr("replay.pipeline.drain", drained)
        ran = replay("merge", two, "-o", "out.mcap", "--no-rrd", "--images", "none")
        assert ran.status == 2
        assert "there is already out.json" in ran.err.splitlines()[-1]
        assert (tmp_path / "out.json").read_text() == "dear to somebody"
        assert names(tmp_path) == ["out.json"]

    @pytest.mark.parametrize("name", ["out.mcap", "out.json", "out.mcap.partial", "out.json.partial"])
    def test_a_folder_in_the_way(self, replay: Program, two: Path, tmp_path: Path, name: str) -> None:
        (tmp_path / name).mkdir()
        ran = replay.merge(two)
        assert ran.status == 3
        assert ran.err.splitlines()[-1].startswith("replay: error: ")
        assert "out." in ran.err.splitlines()[-1]
        assert names(tmp_path) == [name]

    def test_a_full_disk(self, replay: Program, two: Path, tmp_path: Path) -> None:
        outputs = ("-o", tmp_path / "disk" / "out.mcap", "--images", "changed")
        statuses = []
        with small_disk(tmp_path / "disk", 8 << 20) as disk:
            for size_bytes in (4096, 64 << 10, 256 << 10, 8 << 20):
                subprocess.run(["mount", "-o", f"remount,size={size_bytes}", disk], check=True)
                ran = replay("merge", two, *outputs)
                statuses.append(ran.status)
                if ran.status:
                    assert ran.err.splitlines()[-1].startswith(f"replay: error: {disk}/out.")
                    assert ran.err.endswith(
                        "written: No space left on device; free space there, or give another name\n"
                    )
                    assert not names(disk)
        assert statuses == [3, 3, 3, 0]


def test_nothing_is_written_before_the_recording_was_understood(replay: Program, tmp_path: Path) -> None:
    (tmp_path / "broken.mcap").write_bytes(b"not at all")
    assert replay("merge", "broken.mcap", "--no-rrd").status == 2
    assert names(tmp_path) == ["broken.mcap"]


def test_a_run_into_a_folder_of_its_own(replay: Program, tmp_path: Path) -> None:
    write_mcap(tmp_path / "run.mcap", two_robots())
    (tmp_path / "out").mkdir()
    assert replay("merge", "run.mcap", "-o", "out/floor.mcap", "--no-rrd", "--images", "none").status == 0
    assert names(tmp_path / "out") == ["floor.json", "floor.mcap"]
