"""Disks that take no more."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest


@contextmanager
def files_up_to(size_bytes: int) -> Iterator[None]:
    """Let no file grow larger than this, as on a disk that is full."""
    resource = pytest.importorskip("resource", reason="no limit on the size of files there")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@contextmanager
def small_disk(folder: Path, size_bytes: int) -> Iterator[Path]:
    """Make the folder a disk of its own, of this size; skip the test where that is not allowed."""
    folder.mkdir()
    try:
        mounted = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", f"size={size_bytes}", "tmpfs", folder], capture_output=True, check=False
        ).returncode
    except FileNotFoundError:
        mounted = 1
    if mounted:
        pytest.skip("a disk of a given size takes rights to mount one")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", folder], check=True)


@contextmanager
def read_only(folder: Path) -> Iterator[None]:
    """Let nobody change what a folder holds, not even root, whom its rights do not keep from it."""
    if sys.platform == "win32":
        pytest.skip("folders there take no such rights")
    is_root = os.geteuid() == 0
    lock, unlock = (["chattr", "+i"], ["chattr", "-i"]) if is_root else (["chmod", "a-w"], ["chmod", "u+w"])
    try:
        done = subprocess.run([*lock, folder], capture_output=True).returncode
    except FileNotFoundError:
        done = 1
    if done:
        pytest.skip("this file system keeps nothing from root")
    try:
        yield
    finally:
        subprocess.run([*unlock, folder], check=True)
