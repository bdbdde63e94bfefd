"""Nothing is reached over a network, and nothing is left behind but the outputs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests import forbidden
from tests.bags import write_saved_map
from tests.data_paths import ROOT

RUN = "from replay.cli import main\nsys.exit(main(sys.argv[1:]))"
SAMPLES = ROOT / "samples"


@pytest.fixture(params=[False, True], ids=["python", "kernel"])
def sandbox(request: pytest.FixtureRequest) -> bool:
    """Who watches."""
    if request.param and (missing := forbidden.sandbox_missing()):
        pytest.skip(missing)
    return bool(request.param)


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """An empty home, which is also where temporary files go."""
    folder = tmp_path / "home"
    folder.mkdir()
    return folder


@pytest.mark.parametrize(
    "code",
    [
        "import socket; socket.socket().connect(('127.0.0.1', 9))",
        "import socket; socket.getaddrinfo('replay.invalid', 80)",
        "import urllib.request; urllib.request.urlopen('http://127.0.0.1:9/')",
    ],
)
def test_whoever_reaches_out_is_ended(code: str, home: Path, sandbox: bool) -> None:
    assert forbidden.was_ended(forbidden.python(code, folder=home, sandbox=sandbox))


def test_whoever_does_not_is_left_alone(home: Path, sandbox: bool) -> None:
    assert forbidden.python("print('fine')", folder=home, sandbox=sandbox).stdout == "fine\n"


def test_merging_reaches_nothing_and_leaves_nothing_but_its_outputs(tmp_path: Path, home: Path, sandbox: bool) -> None:
    outputs = tmp_path / "outputs"
    outputs.mkdir()
    arguments = ("merge", SAMPLES / "two_robots.mcap", "-o", outputs / "out.mcap", "--images", "changed")
    arguments = (*arguments, "--report", outputs / "out.html")
    done = forbidden.python(RUN, *arguments, folder=home, sandbox=sandbox)
    assert done.returncode == 0, done.stderr
    assert {each.name for each in outputs.iterdir()} == {"out.mcap", "out.rrd", "out.html", "out.json"}
    assert list(home.rglob("*")) == []


@pytest.mark.parametrize("recording", ["three_robots.bag", "bag_per_robot/alpha", "map.yaml"])
def test_reading_any_format_reaches_nothing(recording: str, tmp_path: Path, home: Path, sandbox: bool) -> None:
    path = SAMPLES / recording
    if recording == "map.yaml":
        path = write_saved_map(tmp_path / recording, np.zeros((30, 40), np.uint8))
    done = forbidden.python(RUN, "info", path, folder=home, sandbox=sandbox)
    assert done.returncode == 0, done.stderr
    assert list(home.rglob("*")) == []


def test_the_viewer_is_told_to_keep_to_itself(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.syspath_prepend(str(ROOT))
    from scripts.screenshot import private_environment

    told = private_environment(str(tmp_path))
    assert told["CI"] == "1"
    assert told["HTTPS_PROXY"].startswith("http://127.0.0.1:")
    assert {told[name] for name in ("HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME")} == {str(tmp_path)}
