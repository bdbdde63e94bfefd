"""Where the recordings are that some tests use and that are not part of the project."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def shared_data(name: str) -> Path:
    """Return a file or folder of the shared data; skip the test where there is none."""
    folder = Path(os.environ.get("REPLAY_DATA") or ROOT.parent / "shared" / "data")
    path = folder / name
    if not path.exists():
        pytest.skip(f"{path} is absent: set REPLAY_DATA to the folder of the shared recordings")
    return path
