"""``metadata.yaml`` of ROS 2 bag folders: which files are the parts of a recording."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PureWindowsPath
from typing import Any

from replay.errors import InputError
from replay.skip_cause import SkipCause
from replay.sources.losses import Loss, Losses
from replay.sources.yaml_text import load_yaml

METADATA = "metadata.yaml"

_KEY = "rosbag2_bagfile_information"

# as recorders number parts: without leading zeros
_NUMBERED = re.compile(r"(.*)_(0|[1-9]\d{0,4})((?:\.[a-z0-9]+)+)")


@dataclass(frozen=True, slots=True)
class Parts:
    """The files of a bag that are there, and of each missing one the loss and how many files come before it."""

    paths: Sequence[Path]
    missing: Sequence[tuple[int, Loss]] = ()


def listed_parts(path: Path, losses: Losses) -> Parts:
    """Return the files that the metadata of a bag lists, and name metadata that lists none.

    Returns
    -------
    Parts
        Empty if there is no metadata, or none that lists files: then it says nothing of the recording that its files
        do not say themselves.

    Raises
    ------
    InputError
        If all files that it lists are missing, or their compression is not read.
    """
    metadata, problem = _metadata(path / METADATA)
    mode = str(metadata.get("compression_mode") or "none").lower()
    kind = metadata.get("compression_format")
    if mode != "none" and kind != "zstd":
        raise InputError(
            f"{path}: the bag is compressed with '{kind}'; zstd is read: convert it with `ros2 bag convert`"
        )
    listed = metadata.get("relative_file_paths")
    if problem or (metadata and not (listed and isinstance(listed, list))):
        detail = f"{problem or 'it lists no files'}; all bag files of the folder are taken for parts of the recording"
        losses.add(Loss(SkipCause.DAMAGED, METADATA, detail, 0))
    # Before Foxy the names had the folder in front.
    names = dict.fromkeys(PureWindowsPath(str(each)).name for each in listed) if isinstance(listed, list) else {}
    found = {name: _present(path, name) for name in names}
    missing = [name for name, part in found.items() if part is None]
    if names and len(missing) == len(names):
        shown = f"{', '.join(missing[:3])}{', …' if len(missing) > 3 else ''}"
        raise InputError(
            f"{path}: all {len(names)} parts that {METADATA} lists are missing: {shown}; copy them here as well"
        )
    counts = _message_counts(metadata)
    detail = f"{METADATA} lists it, and it is not there: copy it here as well"
    parts: dict[Path, None] = {}
    lost: list[tuple[int, Loss]] = []
    for name, part in found.items():
        if part is None:
            lost.append((len(parts), Loss(SkipCause.MISSING_PART, name, detail, counts.get(name))))
        else:
            parts[part] = None
    return Parts(list(parts), lost)


def numbered_parts(paths: Sequence[Path]) -> Parts:
    """Return these files with those that are missing as their numbers tell, where nothing lists them.

    Files with numbers far apart are not numbered as parts.
    """
    numbers: dict[tuple[str, str], dict[int, int]] = {}
    for index, part in enumerate(paths):
        match = _NUMBERED.fullmatch(part.name)
        if match:
            numbers.setdefault((match[1], match[3]), {})[int(match[2])] = index
    detail = "parts before and after it are there: copy it here as well"
    lost: list[tuple[int, Loss]] = []
    for (stem, suffix), present in numbers.items():
        missing = sorted(set(range(min(present), max(present))) - set(present))
        if len(missing) < len(present):
            for number in missing:
                before = 1 + max(index for other, index in present.items() if other < number)
                lost.append((before, Loss(SkipCause.MISSING_PART, f"{stem}_{number}{suffix}", detail)))
    return Parts(paths, lost)


def _present(path: Path, name: str) -> Path | None:
    """Return the part of this name; a recorder that was stopped leaves a part that it has not compressed yet."""
    for candidate in (path / name, path / name.removesuffix(".zstd"), path / f"{name}.zstd"):
        if name and candidate.is_file():
            return candidate
    return None


def _message_counts(metadata: Mapping[str, Any]) -> dict[str, int]:
    """Return how many messages each part has, where the metadata says so."""
    files = metadata.get("files")
    counts = {}
    for each in files if isinstance(files, list) else ():
        if isinstance(each, dict) and isinstance(each.get("message_count"), int):
            counts[PureWindowsPath(str(each.get("path"))).name] = each["message_count"]
    return counts


def _metadata(path: Path) -> tuple[dict[str, Any], str]:
    """Return what the metadata says; nothing, and why, if it is damaged or that of something else."""
    if not path.exists():
        return {}, ""
    try:
        document = load_yaml(path)
    except InputError as error:
        # what cannot be opened at all, others may be able to open
        if isinstance(error.__cause__, OSError):
            raise
        return {}, str(error).removeprefix(f"{path}: ")
    metadata = document.get(_KEY) if isinstance(document, dict) else None
    if not isinstance(metadata, dict) or not metadata:
        return {}, f"it has no '{_KEY}' with values below it, as that of a bag has"
    return metadata, ""
