"""What the commands here take as values of flags; what is none ends with one line, before anything long begins."""

from __future__ import annotations

from argparse import ArgumentTypeError
from pathlib import Path


def count(text: str) -> int:
    """Return a number of things, 1 or more."""
    number = int(text)
    if number < 1:
        raise ArgumentTypeError(f"{text}: expected 1 or more")
    return number


def count_or_none(text: str) -> int:
    """Return a number of things, 0 or more."""
    number = int(text)
    if number < 0:
        raise ArgumentTypeError(f"{text}: expected 0 or more")
    return number


def size(text: str) -> float:
    """Return how much there is of something: a finite number above 0."""
    number = float(text)
    if not 0.0 < number < float("inf"):
        raise ArgumentTypeError(f"{text}: expected more than 0")
    return number


def share(text: str) -> float:
    """Return a share of something that is not none of it."""
    number = float(text)
    if not 0.0 < number <= 1.0:
        raise ArgumentTypeError(f"{text}: expected more than 0, and 1 at most")
    return number


def file(text: str) -> Path:
    """Return a file that is there."""
    path = Path(text)
    if not path.is_file():
        raise ArgumentTypeError(f"{text}: there is no such file")
    return path


def new_file(text: str) -> Path:
    """Return a file that can be written: its folder is there, and it is none."""
    path = Path(text)
    if path.is_dir():
        raise ArgumentTypeError(f"{text}: a folder has this name")
    if not path.absolute().parent.is_dir():
        raise ArgumentTypeError(f"{text}: there is no folder {path.absolute().parent}")
    return path


def folder(text: str) -> Path:
    """Return a folder that is there, or can be made."""
    path = Path(text)
    there = next(each for each in (path, *path.absolute().parents) if each.exists())
    if not there.is_dir():
        raise ArgumentTypeError(f"{text}: {there} is no folder")
    return path
