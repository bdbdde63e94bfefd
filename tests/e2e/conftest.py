from pathlib import Path

import pytest

from tests.bags import write_mcap
from tests.program import Program
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
