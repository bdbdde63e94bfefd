"""Rerun's viewer: to look at recordings, and at a run while it goes on. It is kept off the network."""

from __future__ import annotations

import os
import shlex
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

from replay.errors import InputError, OutputError, UsageError
from replay.interrupts import put_off
from replay.path_errors import path_errors

LOOPBACK = "127.0.0.1"
INSTEAD_OF_LIVE = "leave --view out, and look at the recording elsewhere when it is written"

RRD_MAGIC = b"RRF"
_MCAP_MAGIC = b"\x89MCAP0\r\n"
_HEAD_BYTES = 16
_START_S = 30.0
_END_S = 5.0
_POLL_S = 0.05
_LIBRARY_LOG = "RUST_LOG"
_NOBODY = f"http://{LOOPBACK}:9"  # nothing listens there


def program() -> Path:
    """Return where the viewer is. The command ``rerun`` is a wrapper whose child outlives it.

    Raises
    ------
    UsageError
        If it is not installed.
    """
    spec = find_spec("rerun_cli")
    if spec is None or spec.origin is None:
        raise UsageError("Rerun's viewer is not installed; it comes with the package rerun-sdk")
    return Path(spec.origin).with_name("rerun.exe" if os.name == "nt" else "rerun")


def environment() -> dict[str, str]:
    """Return the environment in which the viewer tells nobody that it runs.

    By itself it sends usage data, asks whether there is a newer release, and loads examples. A person's settings of it
    hold, as they are in the home folder.
    """
    # no flag switches the question for a release off
    return {**os.environ, "CI": "1", "HTTPS_PROXY": _NOBODY, "https_proxy": _NOBODY, "NO_PROXY": LOOPBACK}


def refuse_without_screen(instead: str, variables: Mapping[str, str] = os.environ) -> None:
    """Refuse to open a window where there can be none.

    Parameters
    ----------
    instead
        What to do there.
    variables
        Of the environment.

    Raises
    ------
    UsageError
        If there is no screen.
    """
    if sys.platform == "linux" and not (variables.get("DISPLAY") or variables.get("WAYLAND_DISPLAY")):
        raise UsageError(f"there is no screen here (neither DISPLAY nor WAYLAND_DISPLAY is set); {instead}")


def _command() -> str:
    """Return how the viewer is called in a shell: by its name, or where it was installed if that is not searched."""
    return "rerun" if shutil.which("rerun") else shlex.quote(str(Path(sys.executable).with_name("rerun")))


def view(paths: Sequence[Path]) -> None:
    """Open recordings in a window, and wait until it is closed.

    Raises
    ------
    ReplayError
        If one cannot be read, there is no screen, or the viewer fails.
    """
    for path in paths:
        _refuse_unreadable(path)
    names = shlex.join(map(str, paths))
    in_browser = f"{_command()} {names} --web-viewer --bind {LOOPBACK}"
    refuse_without_screen(f"copy {names} to where there is one, or look at it in a browser: {in_browser}")
    arguments = [*(str(path.resolve()) for path in paths), "--port", "auto"]
    with tempfile.TemporaryFile() as log, _running(arguments, log.fileno(), is_apart=False) as process:
        status = process.wait()
        if status != 0:
            log.seek(0)
            raise OutputError(f"the viewer ended with status {status}: {_last_words(log.read())}")


def open_live() -> str:
    """Open a window that waits for a run, and return the address that takes what is to be shown.

    The window stays when the program ends.

    Raises
    ------
    ReplayError
        If there is no screen, or the viewer does not start.
    """
    refuse_without_screen(INSTEAD_OF_LIVE)
    with socket.socket() as free:
        free.bind((LOOPBACK, 0))
        port = free.getsockname()[1]
    arguments = ["--port", str(port), "--hide-welcome-screen", "--expect-data-soon"]
    with tempfile.TemporaryFile() as log, _running(arguments, log.fileno(), is_apart=True) as process:
        deadline = time.monotonic() + _START_S
        while time.monotonic() < deadline and process.poll() is None:
            if _listens(port):
                return live_address(port)
            time.sleep(_POLL_S)
        log.seek(0)
        raise OutputError(f"the viewer does not start: {_last_words(log.read())}")


def import_silently() -> None:
    """Import the library, if nobody did yet, so that it does not print on its own that its viewer was closed.

    It asks the environment only as it is imported, which is then as it was.
    """
    is_said = _LIBRARY_LOG in os.environ
    os.environ.setdefault(_LIBRARY_LOG, "off")
    try:
        import rerun  # noqa: F401 - for those who import it next
    finally:
        if not is_said:
            del os.environ[_LIBRARY_LOG]


def live_address(port: int) -> str:
    """Return the address of a viewer on this machine."""
    return f"rerun+http://{LOOPBACK}:{port}/proxy"


@contextmanager
def _running(arguments: Sequence[str], log: int, *, is_apart: bool) -> Iterator[subprocess.Popen[bytes]]:
    """Start the viewer; what is raised within this ends it, an interrupt too."""
    process = None
    try:
        with put_off():
            process = _started(arguments, log, is_apart=is_apart)
        yield process
    except BaseException:
        if process is not None:
            _end(process)
        raise


def _end(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(_END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _started(arguments: Sequence[str], log: int, *, is_apart: bool) -> subprocess.Popen[bytes]:
    command = [str(program()), "--bind", LOOPBACK, *arguments]
    try:
        return subprocess.Popen(  # noqa: S603 - a program of our own, and paths
            command,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            env=environment(),
            start_new_session=is_apart,  # so that what interrupts the run does not close the window
        )
    except OSError as error:
        raise OutputError(f"{command[0]}: the viewer cannot be started: {error.strerror}") from error


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        probe.settimeout(_POLL_S)
        return probe.connect_ex((LOOPBACK, port)) == 0


def _refuse_unreadable(path: Path) -> None:
    with path_errors(path, InputError):
        if not path.exists():
            raise InputError(f"{path}: it does not exist; expected a Rerun recording, OUT.rrd of `replay merge`")
        if not path.is_file():
            raise InputError(f"{path}: this is no file; expected a Rerun recording, OUT.rrd of `replay merge`")
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
    if not head.startswith((RRD_MAGIC, _MCAP_MAGIC)):
        raise InputError(
            f"{path}: this is neither a Rerun recording nor an MCAP; expected OUT.rrd of `replay merge`, which makes "
            "one of other recordings"
        )


def _last_words(log: bytes) -> str:
    """Return the last line that says what failed."""
    lines = [line.strip() for line in log.decode(errors="replace").splitlines() if line.strip()]
    errors = [line for line in lines if "error" in line.lower() or "panicked" in line]
    return (errors or lines or ["it said nothing"])[-1]
