"""Runs Python where nothing can be reached over a network: whoever tries is ended at once."""

from __future__ import annotations

import ctypes
import os
import platform
import signal
import socket
import struct
import subprocess
import sys
from pathlib import Path

from tests.data_paths import ROOT

# Of Python's own events (PEP 578): those that reach out, or start another program that could.
_EVENTS = (
    "socket.",
    "urllib.",
    "http.",
    "ftplib.",
    "smtplib.",
    "webbrowser.",
    "subprocess.",
    "os.system",
    "os.exec",
    "os.posix_spawn",
    "os.fork",
)
ENDED_BY_EVENT = 86
_SOCKET_CALL = {"x86_64": 41, "aarch64": 198}
_PR_SET_NO_NEW_PRIVS, _PR_SET_SECCOMP, _SECCOMP_MODE_FILTER = 38, 22, 2
_LOAD_WORD, _JUMP_IF_EQUAL, _RETURN = 0x20, 0x15, 0x06
_ALLOW, _KILL = 0x7FFF0000, 0x80000000
_CALL_AT, _FIRST_ARGUMENT_AT = 0, 16


def python(code: str, *arguments: object, folder: Path, sandbox: bool) -> subprocess.CompletedProcess[str]:
    """Run code in a process of its own, in a home of its own, without a network.

    Parameters
    ----------
    sandbox
        Whether libraries that are not Python are watched too, by the kernel; see `sandbox_missing`.
    """
    homes = ("HOME", "USERPROFILE", "APPDATA", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_CACHE_HOME")
    environment = {**os.environ, **dict.fromkeys((*homes, "TMPDIR", "TEMP", "TMP"), str(folder))}
    command = [sys.executable, "-c", f"{_CODE.format(sandbox=sandbox)}\n{code}", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment, cwd=ROOT)


def was_ended(done: subprocess.CompletedProcess[str]) -> bool:
    """Tell whether a process was ended because it tried to reach something."""
    return done.returncode == ENDED_BY_EVENT or (os.name == "posix" and done.returncode == -signal.SIGSYS)


def sandbox_missing() -> str | None:
    """Return why the kernel cannot be asked to watch, or None."""
    if sys.platform != "linux" or platform.machine() not in _SOCKET_CALL:
        return "the kernel is asked to watch on Linux alone"
    done = subprocess.run(
        [sys.executable, "-c", "from tests.forbidden import watch; watch()"], capture_output=True, cwd=ROOT
    )
    return None if done.returncode == 0 else "this kernel takes no filter of system calls"


_CODE = """import sys
from tests.forbidden import end_at_events, watch
if {sandbox}:
    watch()
else:
    end_at_events()
"""


def end_at_events() -> None:
    """End this process at the first of Python's events that reaches out."""

    def hook(event: str, _arguments: object) -> None:
        if event.startswith(_EVENTS):
            sys.stderr.write(f"forbidden: {event}\n")
            sys.stderr.flush()
            os._exit(ENDED_BY_EVENT)

    sys.addaudithook(hook)


def watch() -> None:
    """Have the kernel end this process as soon as anything in it opens a socket that could leave the machine."""
    # Sockets between processes of one machine stay allowed; names are resolved by the others.
    families = (socket.AF_INET, socket.AF_INET6, 16)  # 16: to the kernel's own network tables
    program = [(_LOAD_WORD, 0, 0, _CALL_AT), (_JUMP_IF_EQUAL, 0, len(families) + 1, _SOCKET_CALL[platform.machine()])]
    program.append((_LOAD_WORD, 0, 0, _FIRST_ARGUMENT_AT))
    program += [(_JUMP_IF_EQUAL, len(families) - at, 0, int(family)) for at, family in enumerate(families)]
    program += [(_RETURN, 0, 0, _ALLOW), (_RETURN, 0, 0, _KILL)]
    code = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *each) for each in program))
    described = ctypes.create_string_buffer(struct.pack("HP", len(program), ctypes.addressof(code)))
    library = ctypes.CDLL(None, use_errno=True)
    if library.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) or library.prctl(
        _PR_SET_SECCOMP, _SECCOMP_MODE_FILTER, described, 0, 0
    ):
        raise OSError(ctypes.get_errno(), "no filter")
