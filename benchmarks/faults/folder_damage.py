"""Damage to the folders of ROS 2 bags: their metadata, and their parts."""

from __future__ import annotations

from benchmarks.faults.bytes_damage import bits_flipped, made_random, truncated
from benchmarks.faults.formats import Recording
from samples.world import Rng


def metadata_missing(recording: Recording, rng: Rng) -> Recording:
    """Leave out the metadata."""
    del rng
    return _without(recording, _metadata(recording))


def metadata_damaged(recording: Recording, rng: Rng) -> Recording:
    """Damage the bytes of the metadata."""
    damage = (truncated, bits_flipped, made_random)[int(rng.integers(3))]
    name = _metadata(recording)
    return _with(recording, name, damage(recording.files[name], rng))


def metadata_wrong(recording: Recording, rng: Rng) -> Recording:
    """Let the metadata say something else."""
    name = _metadata(recording)
    part = recording.data_names()[0].rpartition("/")[2].encode()
    texts = (
        b"",
        b"[]",
        b"rosbag2_bagfile_information: 5\n",
        b"rosbag2_bagfile_information:\n  relative_file_paths: 7\n",
        b"rosbag2_bagfile_information:\n  relative_file_paths: [[], {}, null]\n",
        b"a: &a [x, x, x, x]\nb: &b [*a, *a, *a, *a]\nc: [*b, *b, *b, *b]\n",
        b"rosbag2_bagfile_information: &a\n  relative_file_paths: *a\n",
        recording.files[name].replace(part, b"../" + part),
        recording.files[name].replace(part, b"/etc/passwd"),
        recording.files[name].replace(part, b"a\\x1b[31mb"),
        recording.files[name].replace(b"message_count: ", b"message_count: 9"),
        recording.files[name].replace(b"storage_identifier: ", b"storage_identifier: x"),
        b"\xff\xfe" + recording.files[name].decode().encode("utf-16-le"),
        recording.files[name] * 2,
    )
    return _with(recording, name, texts[int(rng.integers(len(texts)))])


def part_missing(recording: Recording, rng: Rng) -> Recording:
    """Leave out a part."""
    return _without(recording, _any_part(recording, rng))


def part_emptied(recording: Recording, rng: Rng) -> Recording:
    """Let a part have no bytes, or only zeros."""
    name = _any_part(recording, rng)
    return _with(recording, name, bytes(len(recording.files[name])) if rng.uniform() < 0.5 else b"")


def part_doubled(recording: Recording, rng: Rng) -> Recording:
    """Put a copy of a part beside it."""
    name = _any_part(recording, rng)
    stem, _, suffix = name.partition(".")
    return _with(recording, f"{stem}_copy.{suffix}", recording.files[name])


def parts_swapped(recording: Recording, rng: Rng) -> Recording:
    """Exchange the names of two parts."""
    one, other = _any_part(recording, rng), _any_part(recording, rng)
    return _with(_with(recording, one, recording.files[other]), other, recording.files[one])


def _metadata(recording: Recording) -> str:
    return next(name for name in recording.files if name.endswith("metadata.yaml"))


def _any_part(recording: Recording, rng: Rng) -> str:
    names = recording.data_names()
    return names[int(rng.integers(len(names)))]


def _with(recording: Recording, name: str, data: bytes) -> Recording:
    return Recording({**recording.files, name: data}, recording.main)


def _without(recording: Recording, left_out: str) -> Recording:
    return Recording({name: data for name, data in recording.files.items() if name != left_out}, recording.main)
