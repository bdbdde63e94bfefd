"""Temporary copies of recordings: gone with the run that made them, or with the next one if it was killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from replay import file_lock
from replay.sources import temporary as module
from replay.sources.temporary import temporary_folder
from tests.data_paths import ROOT

_HOLDS_ONE = """
import sys
from replay.sources.temporary import temporary_folder
with temporary_folder() as folder:
    (folder / "run.mcap").write_bytes(bytes(1000))
    print(folder, flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


@contextmanager
def running(folder: Path) -> Iterator[tuple[subprocess.Popen[str], Path]]:
    """Another run, and where it has its copies."""
    environment = {**os.environ, "TMPDIR": str(folder), "TEMP": str(folder), "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        [sys.executable, "-c", _HOLDS_ONE],
        env=environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        try:
            yield process, Path(process.stdout.readline().strip())
        finally:
            process.kill()


def test_it_is_gone_at_the_end(temporary: Path) -> None:
    with temporary_folder() as first, temporary_folder() as second:
        (first / "run.mcap").write_bytes(b"1")
        assert first.is_dir()
        assert second.is_dir()
        assert len(list(temporary.iterdir())) == 2
    assert not list(temporary.iterdir())


def test_what_a_killed_run_left_is_removed_by_the_next(temporary: Path) -> None:
    with running(temporary) as (process, copies):
        process.kill()
        process.wait()
        assert (copies / "run.mcap").exists()
        with temporary_folder():
            assert not copies.exists()
            assert len(list(temporary.iterdir())) == 1


def test_what_a_run_still_uses_stays(temporary: Path) -> None:
    with running(temporary) as (process, copies):
        with temporary_folder():
            pass
        assert (copies / "run.mcap").exists()
        if sys.platform != "win32":
            process.send_signal(signal.SIGSTOP)
            with temporary_folder():
                pass
            assert (copies / "run.mcap").exists()
            process.send_signal(signal.SIGCONT)


def test_what_others_have_stays(temporary: Path) -> None:
    """A folder of the same beginning without a lock; a file; a link that leads elsewhere."""
    (temporary / "replay-backup").mkdir()
    (temporary / "replay-backup" / "run.mcap").write_bytes(b"dear")
    (temporary / "replay-notes").write_bytes(b"dear")
    target = temporary / "target"
    target.mkdir()
    (target / "lock").write_bytes(b"")
    (target / "run.mcap").write_bytes(b"dear")
    (temporary / "replay-link").symlink_to(target, target_is_directory=True)
    with temporary_folder():
        pass
    assert (temporary / "replay-backup" / "run.mcap").read_bytes() == b"dear"
    assert (temporary / "replay-notes").read_bytes() == b"dear"
    assert (target / "run.mcap").read_bytes() == b"dear"


def test_where_there_are_no_locks_nothing_is_taken_for_left_over(
    temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "try_lock", lambda _: True)
    with running(temporary) as (_, copies):
        with temporary_folder():
            pass
        assert (copies / "run.mcap").exists()


def test_a_folder_that_another_run_took_for_left_over_is_not_used(
    temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the moment before it is locked."""
    swept: list[Path] = []

    def sweep_first(descriptor: int) -> bool:
        if not swept:
            (folder,) = temporary.iterdir()
            swept.append(folder)
            (folder / "lock").unlink()
            folder.rmdir()
        return file_lock.try_lock(descriptor)

    monkeypatch.setattr(module, "try_lock", sweep_first)
    with temporary_folder() as folder:
        assert folder.is_dir()
        assert folder.parent != swept[0]
    assert not list(temporary.iterdir())
