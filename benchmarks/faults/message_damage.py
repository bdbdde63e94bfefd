"""Messages that no robot should send, in recordings that are whole: each takes what is recorded and changes some."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from benchmarks.faults.messages import MapContent, Message, UpdateContent
from benchmarks.faults.world import SECOND_NS, changed, indices_of_maps
from samples.world import Rng

Messages = Sequence[Message]

_NAMES = (
    b"",
    b"../../../tmp/x",
    b"a\x00b",
    b"\x1b[31mred\x1b[0m",
    b"line\nbreak\r",
    b"\xff\xfe\xfd",
    b"x" * 100_000,
    b"%s%n{0}",
    "frame\u202egnp".encode(),
    b"merged",
)


def resolution_wrong(recorded: Messages, rng: Rng) -> Messages:
    """Let a map's cells have a side that is no length, or an absurd one."""
    values = (math.nan, math.inf, -math.inf, 0.0, -0.05, 1e-45, 1e-30, 1e-6, 1e30, 3e38, 1e6)
    return _one_map(recorded, rng, resolution_m=values[int(rng.integers(len(values)))])


def size_wrong(recorded: Messages, rng: Rng) -> Messages:
    """Let a map say other sides than it has cells for, also such whose product overflows."""
    sizes = (
        (2**31, 2),
        (65536, 65536),
        (2**32 - 1, 2**32 - 1),
        (0, 0),
        (0, 80),
        (81, 66),
        (80, 65),
        (5280, 1),
        (66, 80),
        (2**16, 2**17),
    )
    width, height = sizes[int(rng.integers(len(sizes)))]
    return _one_map(recorded, rng, width=width, height=height)


def length_wrong(recorded: Messages, rng: Rng) -> Messages:
    """Let a map say another number of cells than follow."""
    lengths = (0, 1, 5279, 5281, 2**31 - 1, 2**31, 2**32 - 1)
    return _one_map(recorded, rng, told_length=lengths[int(rng.integers(len(lengths)))])


def huge_side(recorded: Messages, rng: Rng) -> Messages:
    """Let a map be one line of very many cells."""
    count = (99_999, 100_001, 1_000_000)[int(rng.integers(3))]
    sides = (count, 1) if rng.uniform() < 0.5 else (1, count)
    return _one_map(recorded, rng, width=sides[0], height=sides[1], cells=bytes(count))


def origin_wrong(recorded: Messages, rng: Rng) -> Messages:
    """Let a map's corner lie nowhere, far away, or tilted."""
    values = (math.nan, math.inf, -math.inf, 1e300, -1e18, 1e9, 2.0**53)
    at = int(rng.integers(7))
    value = values[int(rng.integers(len(values)))]

    def moved(content: MapContent) -> MapContent:
        pose = content.pose
        return replace(content, pose=(*pose[:at], value, *pose[at + 1 :]))  # type: ignore[arg-type]

    return _maps(recorded, rng, moved)


def turn_unset(recorded: Messages, rng: Rng) -> Messages:
    """Let all maps have a quaternion of zeros."""
    del rng
    return [
        changed(each, pose=(*each.content.pose[:3], 0.0, 0.0, 0.0, 0.0))
        if isinstance(each.content, MapContent)
        else each
        for each in recorded
    ]


def stamp_wrong(recorded: Messages, rng: Rng) -> Messages:
    """Let a header's time be zero, far before or far after, or have too many nanoseconds."""
    stamps = (0, 1, SECOND_NS, (2**32 - 1) * SECOND_NS, 2**31 * SECOND_NS, 4_000_000_000 * SECOND_NS + 5)
    return _one_map(recorded, rng, stamp_ns=stamps[int(rng.integers(len(stamps)))])


def stamps_wrong(recorded: Messages, rng: Rng) -> Messages:
    """Let the times of all headers of a robot be off: zero, all the same, backwards, or far."""
    robot = f"/r{int(rng.integers(1, 3))}/"
    of: list[Callable[[int], int]] = [
        lambda _: 0,
        lambda _: 5 * SECOND_NS,
        lambda stamp_ns: 3_400_000_000 * SECOND_NS - stamp_ns,
        lambda stamp_ns: stamp_ns + 10**9 * SECOND_NS,
        lambda stamp_ns: stamp_ns % SECOND_NS,
    ]
    stamp = of[int(rng.integers(len(of)))]
    return [
        changed(each, stamp_ns=stamp(each.content.stamp_ns))
        if each.topic.startswith(robot) and not isinstance(each.content, bytes)
        else each
        for each in recorded
    ]


def log_time_wrong(recorded: Messages, rng: Rng) -> Messages:
    """Let a message be recorded at no time, or far from the others."""
    index = int(rng.integers(len(recorded)))
    times_ns = (0, 1, 2**31 * SECOND_NS, (2**32 - 1) * SECOND_NS, recorded[index].log_time_ns + 10**8 * SECOND_NS)
    other = replace(recorded[index], log_time_ns=times_ns[int(rng.integers(len(times_ns)))])
    return [*recorded[:index], other, *recorded[index + 1 :]]


def out_of_order(recorded: Messages, rng: Rng) -> Messages:
    """Write the messages in any order."""
    return [recorded[index] for index in rng.permutation(len(recorded))]


def at_one_time(recorded: Messages, rng: Rng) -> Messages:
    """Record all but the first of each topic at one time."""
    del rng
    time_ns = recorded[-1].log_time_ns
    seen: set[str] = set()
    result = []
    for index, each in enumerate(recorded):
        # nanoseconds apart, so that messages can be told from each other
        result.append(replace(each, log_time_ns=time_ns + index) if each.topic in seen else each)
        seen.add(each.topic)
    return result


def frame_wrong(recorded: Messages, rng: Rng) -> Messages:
    """Let a map's frame have a name that no path, terminal or text can take."""
    return _one_map(recorded, rng, frame_id=_NAMES[int(rng.integers(len(_NAMES)))])


def topic_wrong(recorded: Messages, rng: Rng) -> Messages:
    """Let a robot's topic have such a name."""
    names = (
        "/../../x/map",
        "/r2\x1b[31m/map",
        "/r2\nr3/map",
        "/" + "r" * 3000 + "/map",
        "//map",
        "r2 map",
        "/%s{0}/map",
    )
    name, old = names[int(rng.integers(len(names)))], f"/r{int(rng.integers(1, 4))}/map"
    return [replace(each, topic=name) if each.topic == old else each for each in recorded]


def cells_wrong(recorded: Messages, rng: Rng) -> Messages:
    """Let cells have values that mean nothing."""
    return _maps(recorded, rng, lambda content: replace(content, cells=_sprinkled(content.cells, rng)))


def cells_random(recorded: Messages, rng: Rng) -> Messages:
    """Let all cells of a map be random."""
    return _maps(recorded, rng, lambda content: replace(content, cells=rng.bytes(len(content.cells))))


def cut(recorded: Messages, rng: Rng) -> Messages:
    """Let a message's end be missing, or all of it."""
    index = int(rng.integers(len(recorded)))
    whole = len(recorded[index].data("cdr"))
    missing = whole if rng.uniform() < 0.1 else int(rng.integers(1, whole))
    return [*recorded[:index], replace(recorded[index], cut_bytes=missing), *recorded[index + 1 :]]


def nothing_known(recorded: Messages, rng: Rng) -> Messages:
    """Let a map have no cell that is known."""
    return _maps(recorded, rng, lambda content: replace(content, cells=b"\xff" * len(content.cells)))


def all_walls(recorded: Messages, rng: Rng) -> Messages:
    """Let a map be one wall."""
    return _maps(recorded, rng, lambda content: replace(content, cells=b"\x64" * len(content.cells)))


def update_wrong(recorded: Messages, rng: Rng) -> Messages:
    """Let a part of a map lie outside of it, where sums overflow."""
    fields: tuple[Mapping[str, int], ...] = (
        {"x": -1},
        {"y": 2**31 - 1},
        {"x": -(2**31)},
        {"x": 75},
        {"width": 2**32 - 1, "height": 2**32 - 1},
        {"width": 0, "height": 0},
        {"width": 8, "height": 10},
    )
    index = next(index for index, each in enumerate(recorded) if isinstance(each.content, UpdateContent))
    other = changed(recorded[index], **fields[int(rng.integers(len(fields)))])
    return [*recorded[:index], other, *recorded[index + 1 :]]


def updates_first(recorded: Messages, rng: Rng) -> Messages:
    """Record parts of a map before any full map."""
    del rng
    first_ns = recorded[0].log_time_ns
    updates = [each for each in recorded if isinstance(each.content, UpdateContent)]
    early = [
        replace(changed(each, stamp_ns=first_ns - 500 + index), log_time_ns=first_ns - 500 + index)
        for index, each in enumerate(updates)
    ]
    return [*early, *(each for each in recorded if each not in updates)]


def float_noise(recorded: Messages, rng: Rng) -> Messages:
    """Let numbers be the next ones of their kind."""
    return _maps(
        recorded,
        rng,
        lambda content: replace(
            content, resolution_m=struct.unpack("<f", struct.pack("<f", content.resolution_m))[0] * (1 + 1e-7)
        ),
    )


def _sprinkled(cells: bytes, rng: Rng) -> bytes:
    found = bytearray(cells)
    for at in rng.integers(0, len(found), 60):
        found[at] = int(rng.integers(101, 255))
    return bytes(found)


def _one_map(recorded: Messages, rng: Rng, **fields: object) -> Messages:
    return _maps(recorded, rng, lambda content: replace(content, **fields))  # type: ignore[arg-type]


def _maps(recorded: Messages, rng: Rng, change: Callable[[MapContent], MapContent]) -> Messages:
    """Change one map, or all maps of one robot."""
    indices = indices_of_maps(recorded)
    index = indices[int(rng.integers(len(indices)))]
    chosen = (
        {index} if rng.uniform() < 0.5 else {each for each in indices if recorded[each].topic == recorded[index].topic}
    )
    return [
        replace(each, content=change(each.content)) if at in chosen and isinstance(each.content, MapContent) else each
        for at, each in enumerate(recorded)
    ]
