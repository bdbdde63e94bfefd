"""A process that runs cases one after the other, within limits: ``python -m benchmarks.faults.worker``.

Once it is ready it says so, with a pickled `READY`. It takes pickled `Task`s from its input and answers each with a
pickled `Judged`; None for a case that cannot be made.
"""

from __future__ import annotations

import os
import pickle
import resource
import sys
import warnings
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import BinaryIO

from benchmarks.faults.cases import Case, Task
from benchmarks.faults.formats import FORMATS, undamaged
from benchmarks.faults.oracle import Expected, Judged, judge
from benchmarks.faults.placement import misplaced
from benchmarks.faults.runner import Misplaced, Ran, Used, run
from benchmarks.faults.table import FAULTS, Variant
from benchmarks.faults.world import FLOOR_FROM_MAP, messages
from replay.sources.base import GRID_TYPE, UPDATE_TYPE, RawMessage

MEMORY_BYTES = 3 << 30
FILE_BYTES = 1 << 30
READY = "ready"


def main() -> None:
    """Answer tasks until there are no more."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_FSIZE, (FILE_BYTES, FILE_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # What libraries say must not get among the answers.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    _warm_up()
    pickle.dump(READY, answers)
    answers.flush()
    while (task := next_task(sys.stdin.buffer)) is not None:
        pickle.dump(answer(task), answers)
        answers.flush()


def next_task(stream: BinaryIO) -> Task | None:
    """Return the next task; None at the end."""
    try:
        task = pickle.load(stream)  # noqa: S301 - from the process that started this one
    except EOFError:
        return None
    if not isinstance(task, Task):
        raise TypeError(f"{task!r} is no task")
    return task


def answer(task: Task) -> Judged | None:
    """Make a variant, run it, and judge what came of it."""
    variant = task.case.variant()
    if variant is None:
        return None
    if task.folder is not None:
        return _run_in(task.folder, variant, task)
    with TemporaryDirectory(prefix="faults-") as folder:
        return _run_in(Path(folder), variant, task)


def expected_of(case: Case, variant: Variant) -> Expected:
    """Return what is right for a variant."""
    kind, fault = FORMATS[case.format], FAULTS[case.fault]
    is_told = variant.told is not None
    recorded = messages() if variant.told is None else variant.told
    maps, topics = _told_messages(case.format) if variant.told is None else _messages(kind.raw(recorded))
    return Expected(
        maps,
        undamaged_run(case.format).merged if variant.told is None else None,
        variant.recording.main,
        tuple(FLOOR_FROM_MAP),
        is_checked=(kind.is_checked or is_told) and not fault.is_rewritten,
        are_names_checked=(kind.are_names_checked or is_told) and not fault.is_rewritten,
        topics=topics,
        leaves_no_trace=case.format in fault.silent_in,
    )


@cache
def undamaged_run(name: str) -> Ran:
    """Return what comes of the undamaged recording in a format."""
    with TemporaryDirectory(prefix="faults-") as folder:
        ran = run(undamaged(name).write(Path(folder)), misplaced=_misplaced(name))
    if ran.error or ran.crash or ran.named or ran.misplaced or not {"r1", "r2"} < set(ran.merged):
        raise AssertionError(f"the undamaged recording in {name} is not merged as it should be: {ran}")
    return ran


def _misplaced(name: str) -> Misplaced:
    """Return what tells where maps of a format lie."""
    real = FORMATS[name].real
    return misplaced if real is None else real.misplaced


@cache
def _told_messages(name: str) -> tuple[frozenset[Used], frozenset[tuple[str, str]]]:
    return _messages(FORMATS[name].raw(messages()))


def _messages(found: Sequence[RawMessage]) -> tuple[frozenset[Used], frozenset[tuple[str, str]]]:
    """Return the maps among messages, and all their topics."""
    maps = frozenset(Used.of(raw) for raw in found if raw.msgtype in {GRID_TYPE, UPDATE_TYPE})
    return maps, frozenset((raw.topic, raw.msgtype) for raw in found)


def _run_in(folder: Path, variant: Variant, task: Task) -> Judged:
    path = variant.recording.write(folder)
    before = {each: each.read_bytes() for each in _files(path)}
    ran = run(
        path,
        program=task.program,
        max_memory_bytes=variant.max_memory_bytes,
        misplaced=_misplaced(task.case.format),
    )
    judged = judge(ran, expected_of(task.case, variant))
    if before != {each: each.read_bytes() for each in _files(path)}:
        raise AssertionError("the recording was changed")
    return judged


def _files(path: Path) -> list[Path]:
    """Return all files of a recording, and whatever appeared beside it."""
    return sorted(each for each in path.parent.rglob("*") if each.is_file() and "merged_by_program" not in each.name)


def _warm_up() -> None:
    """Import what is used, and see that what is undamaged is replayed as it should be."""
    import cv2

    warnings.simplefilter("ignore")
    cv2.setNumThreads(1)
    for name, kind in FORMATS.items():
        if kind.real is None:
            undamaged_run(name)


if __name__ == "__main__":
    main()
