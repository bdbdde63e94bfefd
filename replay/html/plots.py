"""Values over time: a step line for each robot where its map is merged, points where a placement was refused."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mapmerge.match import CALIBRATED
from mapmerge.rounding import rounded_down
from replay.html.axes import Axis, axis
from replay.html.roster import Member
from replay.html.series import Sample
from replay.html.story import Story
from replay.options import NS_PER_S

WIDTH, HEIGHT = 1000, 300
"""Of the drawing, in its own units: it is stretched to the page, its lines are not."""

_LEAST_STEP_M, _LEAST_STEP_DEG = 0.25, 1.0

Getter = Callable[[Sample], float | None]


@dataclass(frozen=True, slots=True)
class Quantity:
    """What a plot is of.

    Parameters
    ----------
    key
        Its name in the page's data.
    title
        What it is, with its unit.
    get
        Takes it from a sample.
    digits
        How many are shown.
    is_share
        Whether 1 is the most there can be.
    is_rounded_down
        Whether it says never more than is so.
    """

    key: str
    title: str
    get: Getter
    digits: int
    is_share: bool
    is_rounded_down: bool


QUANTITIES = (
    Quantity("confidence", "Confidence", lambda item: item.confidence, 4, is_share=True, is_rounded_down=True),
    Quantity("acceptance", "Acceptance index", lambda item: item.acceptance, 3, is_share=True, is_rounded_down=True),
    Quantity("overlap", "Overlap, m²", lambda item: item.overlap_m2, 1, is_share=False, is_rounded_down=True),
    Quantity("x", "Placement x, m", lambda item: item.x_m, 2, is_share=False, is_rounded_down=False),
    Quantity("y", "Placement y, m", lambda item: item.y_m, 2, is_share=False, is_rounded_down=False),
    Quantity("yaw", "Placement yaw, °", lambda item: item.yaw_deg, 1, is_share=False, is_rounded_down=False),
)


@dataclass(frozen=True, slots=True)
class Line:
    """One robot in one plot, as paths of SVG; empty where there is nothing."""

    member: Member
    placed: str
    refused: str


@dataclass(frozen=True, slots=True)
class Mark:
    """A mark of an axis: words, and where in percent."""

    words: str
    at: float


@dataclass(frozen=True, slots=True)
class Plot:
    """One plot."""

    quantity: Quantity
    lines: tuple[Line, ...]
    marks: tuple[Mark, ...]
    limit: Mark | None


@dataclass(frozen=True, slots=True)
class Plots:
    """All plots, over one axis of time.

    Parameters
    ----------
    plots
        The plots that have values.
    times
        Marks of the axis of time, in seconds.
    data
        What the page's script shows at a time: times, and each quantity of each robot.
    ticks, shown
        How many ticks there were, and of how many values are shown.
    """

    plots: tuple[Plot, ...]
    times: tuple[Mark, ...]
    data: Mapping[str, Any]
    ticks: int
    shown: int


def plots(story: Story) -> Plots | None:
    """Return the plots; None if there was no tick."""
    stamps_ns = story.series.stamps_ns
    if not stamps_ns:
        return None
    times_s = [(stamp_ns - story.first_ns) / NS_PER_S for stamp_ns in stamps_ns]
    over = time_axis(story)
    samples = [story.series.of(member.index) for member in story.roster.values()]
    drawn = [_plot(story, quantity, over, times_s, samples) for quantity in QUANTITIES]
    shown = tuple(plot for plot in drawn if plot is not None)
    data = {
        "t": [round(time_s, 3) for time_s in times_s],
        "span": [over.low, over.high],
        "robots": [member.name for member in story.roster.values()],
        "values": {plot.quantity.key: [_values(plot.quantity, each) for each in samples] for plot in shown},
        "digits": {plot.quantity.key: plot.quantity.digits for plot in shown},
        "placed": ["".join("1" if item.is_placed else "0" for item in each) for each in samples],
    }
    return Plots(shown, time_marks(over), data, story.series.ticks, len(stamps_ns))


def time_axis(story: Story) -> Axis:
    """Return the axis of time, in seconds since the first tick."""
    span_s = (story.last_ns - story.first_ns) / NS_PER_S
    return axis(0.0, span_s if span_s > 0 else 1.0, 5, widen=False)


def time_marks(over: Axis) -> tuple[Mark, ...]:
    """Return the marks of the axis of time."""
    return tuple(Mark(f"{over.label(tick)} s", _percent(over.share(tick))) for tick in over.ticks)


def _plot(
    story: Story, quantity: Quantity, over: Axis, times_s: Sequence[float], samples: Sequence[Sequence[Sample]]
) -> Plot | None:
    found = [value for each in samples for item in each if (value := quantity.get(item)) is not None]
    if not found:
        return None
    limit = _limit(story, quantity)
    up = _axis(quantity, found, limit)
    lines = []
    for member, each in zip(story.roster.values(), samples, strict=True):
        points = [
            (_x(over.share(time_s)), None if (value := quantity.get(item)) is None else _y(up, value), item.is_placed)
            for time_s, item in zip(times_s, each, strict=True)
        ]
        lines.append(Line(member, _steps(points), _dots(points)))
    marks = tuple(Mark(up.label(tick), _percent(1.0 - up.share(tick))) for tick in up.ticks)
    shown = None if limit is None else Mark(f"least accepted: {limit:g}", _percent(1.0 - up.share(limit)))
    return Plot(quantity, tuple(lines), marks, shown)


def _limit(story: Story, quantity: Quantity) -> float | None:
    """Return how much a placement needs, in the plot of what it is accepted by."""
    merge = story.settings["merge"]
    if quantity.key != ("confidence" if merge["method"] in CALIBRATED else "acceptance"):
        return None
    return float(merge["verify"][f"min_{quantity.key}"])


def _axis(quantity: Quantity, found: Sequence[float], limit: float | None) -> Axis:
    values = [*found, *([] if limit is None else [limit])]
    if quantity.is_share:
        return axis(min(0.9, *values), 1.0)
    if quantity.key == "overlap":
        return axis(0.0, max(1.0, *values))
    # differences that no map can tell are not blown up
    return axis(min(values), max(values), least_step=_LEAST_STEP_DEG if quantity.key == "yaw" else _LEAST_STEP_M)


Point = tuple[int, int | None, bool]


def _steps(points: Sequence[Point]) -> str:
    """Return the step line of the points that are of a merged map, with gaps where there are none."""
    parts: list[str] = []
    before: int | None = None
    for x, y, is_placed in points:
        if y is None or not is_placed:
            if before is not None:
                parts.append(f"H{x}")
            before = None
        elif before is None:
            parts.append(f"M{x} {y}")
            before = y
        elif y != before:
            parts.append(f"H{x}V{y}")
            before = y
    if before is not None:
        parts.append(f"H{max(points[-1][0], points[0][0] + 4)}")
    return "".join(parts)


def _dots(points: Sequence[Point]) -> str:
    """Return a dot, as a line without length, at each point that is of a refused placement."""
    placed = dict.fromkeys((x, y) for x, y, is_placed in points if y is not None and not is_placed)
    return "".join(f"M{x} {y}h0" for x, y in placed)


def _x(share: float) -> int:
    return round(share * WIDTH)


def _y(up: Axis, value: float) -> int:
    return round((1.0 - up.share(value)) * HEIGHT)


def _percent(share: float) -> float:
    return round(share * 100.0, 2)


def _values(quantity: Quantity, samples: Sequence[Sample]) -> list[float | None]:
    return list(_rounded(quantity, samples))


def _rounded(quantity: Quantity, samples: Sequence[Sample]) -> Iterator[float | None]:
    for item in samples:
        value = quantity.get(item)
        if value is None:
            yield None
        else:
            digits = quantity.digits
            yield rounded_down(value, digits) if quantity.is_rounded_down else round(value, digits) + 0.0
