from pathlib import Path

import pytest

from tests.bags import write_mcap
from tests.program import Program, in_process_of_its_own
from tests.runs import two_robots


@pytest.fixture
def replay(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Program:
    """The program, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return Program(capsys, tmp_path)


@pytest.fixture(scope="session")
def two(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of two robots whose maps can be merged."""
    return write_mcap(tmp_path_factory.mktemp("two") / "two.mcap", two_robots())


@pytest.fixture(scope="session")
def outcome(two: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The MCAP of a run of them, its report beside it, with copies of their maps."""
    path = tmp_path_factory.mktemp("outcome") / "floor.mcap"
    ran = in_process_of_its_own("merge", two, "-o", path, "--no-rrd", "--copy-maps", "--images", "none")
    assert ran.returncode == 0, ran.stderr
    return path
