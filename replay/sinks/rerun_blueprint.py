"""What the Rerun viewer shows when the recording is opened: four tabs, the first one with the outcome."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import rerun as rr
import rerun.blueprint as rrb

from replay.sinks.rerun_entities import (
    ABOUT,
    DECISIONS,
    GROUND,
    LEGEND,
    MERGED,
    PLOTS,
    ROBOTS,
    SKIPPED,
    STATUS,
    SUMMARY,
    EntityPath,
    RobotEntities,
)
from replay.sinks.rerun_layout import Box, eye
from replay.sinks.rerun_plots import POSE, STEP_TIME, TITLES
from replay.sinks.rerun_stream import ELAPSED

Part = rrb.Container | rrb.View

_LEGEND_SHARE = 0.25
_FIGURES = ("acceptance", "confidence", "overlap_m2", "overlap_fraction")
_MOST_ACROSS = 3
_STRIP_SHARE = 0.06
_MOST_STRIPS = 5


def blueprint(
    robots: Sequence[RobotEntities], steps: Mapping[str, Sequence[str]], extent: Box | None, span_ns: int
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
    span_ns
        From the first tick to the last one.
    """
    tabs = [_merged(extent, len(robots), span_ns), *_method(robots, steps), _over_time(span_ns), _decisions()]
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.TimePanel(state="collapsed", timeline=ELAPSED, play_state="following"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_layout=False,
        auto_views=False,
    )


def _merged(extent: Box | None, robots: int, span_ns: int) -> Part:
    controls = None
    if extent is not None:
        position, target = eye(extent)
        controls = rrb.EyeControls3D(position=position, look_target=target, eye_up=(0.0, 1.0, 0.0))
    maps = rrb.Spatial3DView(
        name="Maps",
        origin=_path(MERGED),
        eye_controls=controls,
        background=rrb.Background(color=GROUND),
        line_grid=False,
    )
    words = rrb.Vertical(
        rrb.TextDocumentView(name="Outcome", origin=_path(SUMMARY)),
        rrb.TextDocumentView(name="How to read the map", origin=_path(LEGEND)),
        row_shares=[4, 1],
    )
    strips = rrb.StateTimelineView(name="What each robot is", origin=_path(STATUS), time_view=_time_axis(span_ns, 0.0))
    share = _STRIP_SHARE * (1 + min(robots, _MOST_STRIPS))
    return rrb.Vertical(
        rrb.Horizontal(maps, words, column_shares=[62, 38]), strips, row_shares=[1.0 - share, share], name="Merged"
    )


def _method(robots: Sequence[RobotEntities], steps: Mapping[str, Sequence[str]]) -> list[Part]:
    """Show for each robot the steps of the method in order, and what came of them; nothing without pictures."""
    pictured = [_matched(item, steps[item.robot]) for item in robots if steps.get(item.robot)]
    return [rrb.Tabs(*pictured, name="Method")] if pictured else []


def _matched(entities: RobotEntities, steps: Sequence[str]) -> Part:
    views = [rrb.Spatial2DView(name=_title(step), origin=_path([*entities.evidence, step])) for step in steps]
    found = rrb.TextDocumentView(name="Candidates", origin=_path(entities.candidates))
    if len(views) <= _MOST_ACROSS:
        return rrb.Vertical(rrb.Horizontal(*views), found, row_shares=[13, 7], name=entities.label_text)
    grid = rrb.Grid(*views, grid_columns=_MOST_ACROSS)
    return rrb.Horizontal(grid, found, column_shares=[7, 3], name=entities.label_text)


def _title(step: str) -> str:
    return step.replace("_", " ").capitalize()


def _over_time(span_ns: int) -> Part:
    plots = [_plot([*PLOTS, quantity], TITLES[quantity], span_ns) for quantity in _FIGURES]
    plots += [_plot([*PLOTS, "pose", part], TITLES[part], span_ns) for part in POSE]
    plots.append(_plot([*PLOTS, STEP_TIME], TITLES[STEP_TIME], span_ns))
    return rrb.Grid(*plots, grid_columns=4, name="Over time")


def _plot(path: EntityPath, title: str, span_ns: int) -> rrb.View:
    return rrb.TimeSeriesView(
        name=title, origin=_path(path), axis_x=_time_axis(span_ns, _LEGEND_SHARE), plot_legend=rrb.Corner2D.RightBottom
    )


def _time_axis(span_ns: int, more: float) -> rrb.TimeAxis | None:
    """Show the whole run and more, as where legends are; without this, a minute around the cursor is shown."""
    if span_ns == 0:
        return None
    boundary = rr.TimeRangeBoundary.absolute
    return rrb.TimeAxis(view_range=rrb.TimeRange(boundary(nanos=0), boundary(nanos=span_ns + int(span_ns * more))))


def _decisions() -> Part:
    # Such a view shows all entries at any time, whatever range of time it is given: so its name says so. The column of
    # times is too narrow for a time, and is in its own units: entries begin with theirs.
    hidden = [rrb.encodings.TimelineColumn(ELAPSED, visible=False)]
    columns = rrb.TextLogColumns(timeline_columns=hidden, text_log_columns=["LogLevel", "Body"])
    return rrb.Vertical(
        rrb.TextLogView(name="What was decided in the whole run, and why", origin=_path(DECISIONS), columns=columns),
        rrb.Horizontal(
            rrb.TextDocumentView(name="Robots at this time", origin=_path(ROBOTS)),
            rrb.TextDocumentView(name="Skipped until this time", origin=_path(SKIPPED)),
            rrb.TextDocumentView(name="Inputs and settings", origin=_path(ABOUT)),
            column_shares=[5, 4, 4],
        ),
        row_shares=[2, 3],
        name="Decisions",
    )


def _path(parts: EntityPath) -> str:
    return rr.new_entity_path(parts)
