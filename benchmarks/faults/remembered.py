"""A merger that remembers: most variants of a recording say what others have said, and merging takes longest.

A step's result is a value that depends on nothing but the steps before it, so that the same steps have it again.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from mapmerge.config import MergeConfig
from mapmerge.evidence import Evidence
from mapmerge.grid import Grid
from mapmerge.merger import Merger
from mapmerge.outcome import Pair
from mapmerge.prior import Prior
from mapmerge.result import MergeResult

_MOST_BYTES = 300 << 20
# of placements, reasons and the like
_OTHER_BYTES = 20_000


class Known:
    """Results by the steps that lead to them; those asked for longest ago are forgotten when they become too many."""

    def __init__(self) -> None:
        self._results: OrderedDict[bytes, MergeResult] = OrderedDict()
        self._held_bytes = 0

    def find(self, key: bytes) -> MergeResult | None:
        """Return what is known; None if nothing is."""
        if key in self._results:
            self._results.move_to_end(key)
        return self._results.get(key)

    def keep(self, key: bytes, result: MergeResult) -> None:
        """Take in a result that is not known."""
        self._results[key] = result
        self._held_bytes += _held_bytes(result)
        while self._held_bytes > _MOST_BYTES:
            _, forgotten = self._results.popitem(last=False)
            self._held_bytes -= _held_bytes(forgotten)


_known = Known()


class RememberingMerger:
    """Stands in for `Merger` in a run: computes only what no run before it in this process has computed."""

    def __init__(self, robots: Sequence[str], config: MergeConfig, mapped: Callable[..., Iterable[Any]] = map) -> None:
        self._new: Callable[[], Merger] = lambda: Merger(robots, config, mapped)
        self._merger: Merger | None = None
        self._steps: list[tuple[Mapping[str, Grid], Mapping[str, Prior], bool]] = []
        self._key = hashlib.sha256(repr((tuple(robots), config)).encode())
        self._result: MergeResult | None = None
        self._last: MergeResult
        self.latest: dict[str, Grid] = {}
        """The last map of each robot."""

    @property
    def result(self) -> MergeResult:
        """All that is known after the last step."""
        return self._new().result if self._result is None else self._result

    def explain(self, pair: Pair) -> tuple[Evidence, ...]:
        """Return what the merger saw of a pair."""
        return self._computed().explain(pair)

    def step(
        self, grids: Mapping[str, Grid], priors: Mapping[str, Prior] | None = None, *, is_last: bool = False
    ) -> MergeResult:
        """Take in new maps, as `Merger.step`."""
        self.latest.update(grids)
        self._steps.append((grids, dict(priors or {}), is_last))
        self._key.update(_text(grids, priors or {}, is_last=is_last))
        key = self._key.digest()
        self._result = _known.find(key)
        if self._result is None:
            self._computed()
            self._result = self._last
            _known.keep(key, self._result)
        return self._result

    def _computed(self) -> Merger:
        """Return a merger that has taken all steps so far."""
        if self._merger is None:
            self._merger = self._new()
            self._last = self._merger.result
        steps, self._steps = self._steps, []
        for grids, priors, is_last in steps:
            self._last = self._merger.step(grids, priors, is_last=is_last)
        return self._merger


def _held_bytes(result: MergeResult) -> int:
    grids = (*result.grids.values(), *((result.merged,) if result.merged else ()))
    return sum(int(grid.cells.nbytes) for grid in grids) + _OTHER_BYTES


def _text(grids: Mapping[str, Grid], priors: Mapping[str, Prior], *, is_last: bool) -> bytes:
    parts = [repr((is_last, sorted(priors.items()))).encode()]
    for robot, grid in grids.items():
        head = (robot, grid.cells.shape, grid.resolution_m, grid.map_from_grid)
        parts += [repr(head).encode(), hashlib.sha256(grid.cells.tobytes()).digest()]
    return b"\n".join(parts)
