"""Few files that may be open, and switches of the libraries."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests.bags import write_mcap
from tests.program import PROGRAM, quiet
from tests.runs import seen

resource = pytest.importorskip("resource", reason="no limit on open files there")

_LIMIT = 40


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Recordings of a robot each, as many as files may be open."""
    folder = tmp_path_factory.mktemp("many")
    return [write_mcap(folder / f"r{n:02}.mcap", [seen("r1", float(n), topic=f"/r{n}/map")]) for n in range(_LIMIT)]


def run(folder: Path, *arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*PROGRAM, *map(str, arguments)],
        cwd=folder,
        env={**quiet(), **environment},
        text=True,
        capture_output=True,
        timeout=120,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (_LIMIT, _LIMIT)),
    )


@pytest.mark.parametrize("command", ["merge", "info"])
@pytest.mark.parametrize("spare", [-1, 1, 3, 4, 5, 7, 9, 11, 12, 13, 15])
def test_too_many_recordings_at_once(many: list[Path], tmp_path: Path, command: str, spare: int) -> None:
    """Whatever it is that can no longer be opened."""
    outputs = ("-o", "out.mcap", "--jobs", "1") if command == "merge" else ()
    done = run(tmp_path, command, *many[: _LIMIT - 3 - spare], *outputs)
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith("replay: error: ")
    assert "raise the limit (`ulimit -n`), or give fewer recordings at once" in line
    assert not list(tmp_path.iterdir())


def test_as_many_as_there_may_be(many: list[Path], tmp_path: Path) -> None:
    """Else the limit above would refuse anything."""
    done = run(tmp_path, "merge", *many[: _LIMIT - 3 - 16], "-o", "out.mcap", "--jobs", "2", "--images", "none")
    assert done.returncode == 0, done.stderr
    assert {each.name for each in tmp_path.iterdir()} == {"out.json", "out.mcap", "out.rrd"}


@pytest.mark.parametrize("switch", ["off", "on"])
def test_the_rerun_recording_is_written_whatever_its_librarys_switch_says(
    two: Path, tmp_path: Path, switch: str
) -> None:
    done = run(tmp_path, "merge", two, "-o", "out.mcap", "--images", "none", RERUN=switch)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out.rrd").stat().st_size > 10_000
