"""Damage to bytes wherever they are, as disks, transfers and crashes do it."""

from __future__ import annotations

from samples.world import Rng


def truncated(data: bytes, rng: Rng) -> bytes:
    """End early."""
    return data[: _place(data, rng)]


def bit_flipped(data: bytes, rng: Rng) -> bytes:
    """Flip one bit."""
    return _flipped(data, rng, 1)


def bits_flipped(data: bytes, rng: Rng) -> bytes:
    """Flip some bits anywhere."""
    return _flipped(data, rng, int(rng.integers(2, 20)))


def bits_flipped_in_head(data: bytes, rng: Rng) -> bytes:
    """Flip some bits near the beginning, where formats say what they are."""
    size = min(len(data), 512)
    return _flipped(data[:size], rng, int(rng.integers(1, 4))) + data[size:]


def bits_flipped_in_tail(data: bytes, rng: Rng) -> bytes:
    """Flip some bits near the end, where formats have their index."""
    size = min(len(data), 1500)
    return data[:-size] + _flipped(data[-size:], rng, int(rng.integers(1, 4)))


def zeroed(data: bytes, rng: Rng) -> bytes:
    """Make a block zeros."""
    begin, end = _block(data, rng)
    return data[:begin] + bytes(end - begin) + data[end:]


def made_random(data: bytes, rng: Rng) -> bytes:
    """Make a block random."""
    begin, end = _block(data, rng)
    return data[:begin] + rng.bytes(end - begin) + data[end:]


def tail_zeroed(data: bytes, rng: Rng) -> bytes:
    """Make all from a byte on zeros, as what was reserved and never written."""
    begin = _place(data, rng)
    return data[:begin] + bytes(len(data) - begin)


def block_removed(data: bytes, rng: Rng) -> bytes:
    """Leave a block out."""
    begin, end = _block(data, rng)
    return data[:begin] + data[end:]


def block_doubled(data: bytes, rng: Rng) -> bytes:
    """Write a block twice."""
    begin, end = _block(data, rng)
    return data[:end] + data[begin:]


def blocks_swapped(data: bytes, rng: Rng) -> bytes:
    """Exchange two blocks of the same size."""
    size = min(int(2 ** rng.uniform(4, 12)), len(data) // 2)
    first = int(rng.integers(0, len(data) - 2 * size + 1))
    second = int(rng.integers(first + size, len(data) - size + 1))
    one, other = data[first : first + size], data[second : second + size]
    return data[:first] + other + data[first + size : second] + one + data[second + size :]


def inserted(data: bytes, rng: Rng) -> bytes:
    """Write random bytes in between."""
    begin = _place(data, rng)
    return data[:begin] + rng.bytes(int(rng.integers(1, 64))) + data[begin:]


def zeros_appended(data: bytes, rng: Rng) -> bytes:
    """Append zeros."""
    return data + bytes(int(2 ** rng.uniform(0, 14)))


def random_appended(data: bytes, rng: Rng) -> bytes:
    """Append random bytes."""
    return data + rng.bytes(int(2 ** rng.uniform(0, 12)))


def random_in_front(data: bytes, rng: Rng) -> bytes:
    """Write random bytes in front."""
    return rng.bytes(int(2 ** rng.uniform(0, 8))) + data


def all_random(data: bytes, rng: Rng) -> bytes:
    """Keep the magic bytes and nothing else."""
    kept = int(rng.integers(4, 64))
    return data[:kept] + rng.bytes(len(data) - kept)


def emptied(data: bytes, rng: Rng) -> bytes:
    """Keep nothing, or a few bytes."""
    return data[: int(rng.integers(0, 16))]


def with_crlf(data: bytes, rng: Rng) -> bytes:
    """Convert line endings to those of Windows."""
    del rng
    return data.replace(b"\n", b"\r\n")


def with_lf(data: bytes, rng: Rng) -> bytes:
    """Convert line endings to those of Unix."""
    del rng
    return data.replace(b"\r\n", b"\n")


def as_text(data: bytes, rng: Rng) -> bytes:
    """Replace what is no text, as a transfer through an editor does."""
    del rng
    return data.decode("utf-8", "replace").encode()


def twice(data: bytes, rng: Rng) -> bytes:
    """Write the whole file twice."""
    del rng
    return data + data


def _place(data: bytes, rng: Rng) -> int:
    return int(rng.integers(0, len(data)))


def _block(data: bytes, rng: Rng) -> tuple[int, int]:
    begin = _place(data, rng)
    return begin, min(len(data), begin + int(2 ** rng.uniform(0, 12)))


def _flipped(data: bytes, rng: Rng, count: int) -> bytes:
    changed = bytearray(data)
    for _ in range(count):
        changed[_place(data, rng)] ^= 1 << int(rng.integers(8))
    return bytes(changed)
