"""Runs the program as a user does, and returns what it said and wrote."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from replay.cli import main
from replay.interrupts import NUMBERS

PROGRAM = (sys.executable, "-m", "replay")


@dataclass(frozen=True)
class Ran:
    """How a run ended.

    Parameters
    ----------
    mcap
        The MCAP it would write.
    """

    status: int
    out: str
    err: str
    mcap: Path

    @property
    def report_path(self) -> Path:
        return self.mcap.with_suffix(".json")

    @property
    def report(self) -> dict[str, Any]:
        assert self.status in (0, 1), self.err
        return json.loads(self.report_path.read_text(encoding="utf-8"))

    @property
    def robots(self) -> dict[str, Any]:
        return self.report["robots"]

    @property
    def statuses(self) -> dict[str, str]:
        return {robot: found["status"] for robot, found in self.robots.items()}

    @property
    def error(self) -> str:
        """The one line that a failed run ends with."""
        lines = self.err.splitlines()
        assert len(lines) == 1, self.err
        assert lines[0].startswith("replay: error: ")
        return lines[0].removeprefix("replay: error: ")


class Program:
    """The command line, in this process."""

    def __init__(self, capsys: pytest.CaptureFixture[str], folder: Path) -> None:
        self._capsys = capsys
        self.folder = folder

    def __call__(self, *arguments: object) -> Ran:
        handlers = {number: signal.getsignal(number) for number in NUMBERS}
        self._capsys.readouterr()
        try:
            status = main([str(each) for each in arguments])
        except SystemExit as stop:
            status = int(stop.code or 0)
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)
        said = self._capsys.readouterr()
        return Ran(status, said.out, said.err, self.folder / "out.mcap")

    def merge(self, *arguments: object, images: str = "none") -> Ran:
        """Merge into ``out.mcap``, without what costs time."""
        outputs = ("-o", self.folder / "out.mcap", "--no-rrd", "--force", "--images", images)
        return self("merge", *arguments, *outputs)


def in_process_of_its_own(*arguments: object, **options: Any) -> subprocess.CompletedProcess[str]:
    command = [*PROGRAM, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, env=quiet(), **options)


def started(*arguments: object, cwd: Path) -> subprocess.Popen[str]:
    command = [*PROGRAM, *map(str, arguments)]
    return subprocess.Popen(command, cwd=cwd, env=quiet(), text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def wait_for(path: Path, process: subprocess.Popen[str]) -> None:
    """Wait until a file is there that a running program writes."""
    for _ in range(3000):
        if path.exists():
            return
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    raise AssertionError(f"{path} did not appear")


def quiet() -> dict[str, str]:
    """Return an environment in which output is that of any terminal."""
    return {**os.environ, "NO_COLOR": "1", "COLUMNS": "200", "PYTHONUNBUFFERED": ""}
