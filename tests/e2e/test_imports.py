"""What is imported when: `--help` starts fast, and `mapmerge` stands alone."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from replay.commands import COMMANDS
from tests.data_paths import ROOT

HEAVY = {"numpy", "cv2", "rosbags", "mcap", "rerun", "rich", "ruamel", "lz4", "zstandard", "jinja2", "PIL"}
_LOADED = "import sys; print('\\n'.join(sorted({name.partition('.')[0] for name in sys.modules})), file=sys.stderr)"


def loaded(code: str) -> set[str]:
    """Return the packages that are loaded after this code, in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\n{_LOADED}"], cwd=ROOT, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    return set(done.stderr.split())


@pytest.mark.parametrize("arguments", [("--help",), *((name, "--help") for name in COMMANDS), ("--version",), ("fly",)])
def test_help_imports_nothing_heavy(arguments: tuple[str, ...]) -> None:
    code = (
        "import contextlib, io\nfrom replay.cli import main\n"
        "with contextlib.suppress(SystemExit), contextlib.redirect_stderr(io.StringIO()):\n"
        f"    main({list(arguments)})"
    )
    assert not loaded(code) & HEAVY


QUIET = "import contextlib, io\nfrom replay.cli import main\nwith contextlib.redirect_stdout(io.StringIO()):\n    "
RUN = ROOT / "samples" / "two_robots.mcap"


def test_info_imports_nothing_that_merges() -> None:
    found = loaded(f"{QUIET}main(['info', {str(RUN)!r}])")
    assert {"numpy", "rosbags"} <= found
    assert not found & {"cv2", "rerun", "rich", "ruamel", "lz4"}


def test_comparing_reports_imports_nothing_that_reads_maps(tmp_path_factory: pytest.TempPathFactory) -> None:
    report = tmp_path_factory.mktemp("out") / "report.json"
    keys = {"version": "1", "reference": "r1", "robots": {}, "skipped": {}, "settings": {}, "inputs": []}
    report.write_text(json.dumps({"schema": "replay.report/1", **keys}), encoding="utf-8")
    found = loaded(f"{QUIET}main(['compare', {str(report)!r}, {str(report)!r}])")
    assert not found & {"cv2", "rosbags", "rerun", "rich", "ruamel"}


def test_recovering_imports_nothing_that_knows_maps(tmp_path_factory: pytest.TempPathFactory) -> None:
    new = tmp_path_factory.mktemp("out") / "new.mcap"
    code = "with contextlib.redirect_stderr(io.StringIO()):\n        "
    found = loaded(f"{QUIET}{code}main(['recover', {str(RUN)!r}, '-o', {str(new)!r}])")
    assert "mcap" in found
    assert not found & {"cv2", "rosbags", "rerun", "rich", "ruamel"}


def test_all_that_mapmerge_offers_is_there() -> None:
    import mapmerge

    assert [getattr(mapmerge, name).__name__ for name in mapmerge.__all__] == mapmerge.__all__
    with pytest.raises(AttributeError, match="nothing"):
        _ = mapmerge.nothing


@pytest.mark.parametrize("package", ["replay", "mapmerge"])
def test_packages_are_light(package: str) -> None:
    assert not loaded(f"import {package}") & HEAVY


def test_mapmerge_stands_alone() -> None:
    assert not loaded("import mapmerge") & {"replay", "rosbags", "mcap", "rerun", "rich"}


def test_mapmerge_works_where_nothing_else_is_installed() -> None:
    blocked = sorted({"replay", "rosbags", "mcap", "rerun", "rich", "ruamel"})
    loaded(
        f"import sys\nfor name in {blocked}: sys.modules[name] = None\n"
        "import numpy as np\nfrom mapmerge import Grid, Merger\n"
        "grid = Grid(np.zeros((9, 9), np.int8), 0.1)\n"
        "Merger(['a', 'b']).step({'a': grid, 'b': grid})"
    )


def test_what_is_not_written_is_not_imported_for(tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("out")
    run = ROOT / "samples" / "two_robots.mcap"
    code = (
        "import contextlib, io\nfrom replay.cli import main\n"
        "with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):\n"
        f"    main(['merge', {str(run)!r}, '-o', {str(folder / 'out.mcap')!r}, '--no-rrd', '--stop', '1'])"
    )
    assert not loaded(code) & {"rerun", "jinja2", "PIL"}
