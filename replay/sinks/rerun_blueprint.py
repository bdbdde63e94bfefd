"""What the Rerun viewer shows when the recording is opened: the final state, from above."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import rerun as rr
import rerun.blueprint as rrb

from replay.sinks.rerun_entities import ABOUT, DECISIONS, MERGED, PLOTS, ROBOTS, EntityPath, RobotEntities
from replay.sinks.rerun_layout import Box, eye
from replay.sinks.rerun_plots import STEP_TIME, TITLES
from replay.sinks.rerun_stream import TIMELINE

Part = rrb.Container | rrb.View
Span = tuple[int, int]

_LEGEND_SHARE = 0.25


def blueprint(
    robots: Sequence[RobotEntities], steps: Mapping[str, Sequence[str]], extent: Box | None, span: Span | None
) -> rrb.Blueprint:
    """Return the layout of the viewer.

    Parameters
    ----------
    robots
        The robots, the reference first.
    steps
        Steps of which there are pictures, for each robot that has any.
    extent
        What the maps cover in the end.
    span
        First and last time.
    """
    left = rrb.Vertical(_maps(extent), _words(), row_shares=[3, 1])
    pictured = [entities for entities in robots if steps.get(entities.robot)]
    pictures = [rrb.Tabs(*(_pictures(item, steps[item.robot]) for item in pictured))] if pictured else []
    plots = _tabs(("acceptance", "confidence"), span), _tabs(("overlap_m2", "overlap_fraction", STEP_TIME), span)
    right = rrb.Vertical(*pictures, *plots, row_shares=[5] * len(pictures) + [4, 4])
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[11, 9]),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_layout=False,
        auto_views=False,
    )


def _maps(extent: Box | None) -> rrb.View:
    controls = None
    if extent is not None:
        position, target = eye(extent)
        controls = rrb.EyeControls3D(position=position, look_target=target, eye_up=(0.0, 1.0, 0.0))
    return rrb.Spatial3DView(name="Maps", origin=_path(MERGED), eye_controls=controls, line_grid=False)


def _words() -> Part:
    columns = rrb.TextLogColumns(text_log_columns=["LogLevel", "Body"])
    return rrb.Tabs(
        rrb.TextLogView(name="Decisions", origin=_path(DECISIONS), columns=columns),
        rrb.TextDocumentView(name="Robots", origin=_path(ROBOTS)),
        rrb.TextDocumentView(name="About", origin=_path(ABOUT)),
    )


def _pictures(entities: RobotEntities, steps: Sequence[str]) -> Part:
    """Show the last step large, as it is the outcome, and those before it beside it."""
    views = [rrb.Spatial2DView(name=step.replace("_", " "), origin=_path([*entities.evidence, step])) for step in steps]
    name = f"Match of {entities.label_text}"
    if len(views) == 1:
        return rrb.Vertical(*views, name=name)
    before = rrb.Grid(*views[:-1], grid_columns=1 + (len(views) - 1) // 4)
    return rrb.Horizontal(views[-1], before, column_shares=[1, 1], name=name)


def _plot(quantity: str, span: Span | None) -> rrb.View:
    return rrb.TimeSeriesView(
        name=TITLES[quantity],
        origin=_path([*PLOTS, quantity]),
        axis_x=_time_axis(span),
        plot_legend=rrb.Corner2D.RightBottom,
    )


def _tabs(quantities: Sequence[str], span: Span | None) -> Part:
    return rrb.Tabs(*(_plot(quantity, span) for quantity in quantities))


def _time_axis(span: Span | None) -> rrb.TimeAxis | None:
    """Show the whole run, with room for the legend at its right; without this, a minute around the cursor is shown."""
    if span is None or span[0] == span[1]:
        return None
    stop_ns = span[1] + int((span[1] - span[0]) * _LEGEND_SHARE)
    boundary = rr.TimeRangeBoundary.absolute
    return rrb.TimeAxis(view_range=rrb.TimeRange(boundary(nanos=span[0]), boundary(nanos=stop_ns)))


def _path(parts: EntityPath) -> str:
    return rr.new_entity_path(parts)
