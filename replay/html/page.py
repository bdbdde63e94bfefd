"""The page: all sections in one file that needs nothing else."""

from __future__ import annotations

import base64
import hashlib
import shlex
from collections.abc import Iterator
from importlib import resources
from typing import TYPE_CHECKING

from mapmerge.outcome import Status
from replay.figures import percent, share
from replay.html import course, losses, maps, pairs, pictures, plots, provenance, robots, verdict
from replay.html.story import Story
from replay.plain_text import brief, escaped, listed, plain
from replay.words import counted

if TYPE_CHECKING:
    from jinja2 import Environment


def page(story: Story) -> str:
    """Return the report of a run that has ended, as HTML."""
    style, script = (_static(name) for name in ("report.css", "report.js"))
    found = _environment().get_template("page.html")
    text = found.render(
        title=_title(story),
        names=listed([brief(str(item["name"])) for item in story.report["inputs"]]),
        style=style,
        script=script,
        script_hash=_hash(script),
        verdict=verdict.verdict(story),
        key_figures=list(_key_figures(story)),
        robots=robots.rows(story),
        is_scaled=story.settings["merge"]["scale"] == "free",
        stack=maps.merged_stack(story),
        apart=maps.apart(story),
        pairs=pairs.pairs(story),
        legend=pairs.legend,
        tint_legend=pictures.TINT_LEGEND,
        refused=pairs.refused(story),
        course=course.course(story),
        plots=plots.plots(story),
        drawing=(plots.WIDTH, plots.HEIGHT),
        losses=losses.losses(story),
        provenance=provenance.provenance(story),
        story=story,
    )
    return f"{text}\n"


def _title(story: Story) -> str:
    return f"{_merged(story)} of {counted(len(story.robots), 'map')} merged"


def _merged(story: Story) -> int:
    """Return how many maps are in one merged map; none if there is but one."""
    placed = sum(values["merged_from_map"] is not None for values in story.report["robots"].values())
    return placed if placed > 1 else 0


def _key_figures(story: Story) -> Iterator[tuple[str, str]]:
    report = story.report
    robots_said = report["robots"].values()
    if len(story.robots) > 1:
        yield "maps merged", f"{_merged(story)} of {len(story.robots)}"
    merged = [values for values in robots_said if values["status"] == Status.MERGED]
    sure = [values["confidence"] for values in merged if values["confidence"] is not None]
    agreeing = [values["acceptance"] for values in merged if values["acceptance"] is not None]
    if sure:
        yield "least confidence", percent(min(sure))
    if agreeing:
        yield "least acceptance", share(min(agreeing))
    yield "map updates", f"{report['updates']:,}"
    if story.series.ticks:
        yield "of recording", f"{(story.last_ns - story.first_ns) / 1e9:,.0f} s"
    at_least = any(item["messages"] is None for item in report["skipped_at"])
    yield "messages skipped", f"{'≥ ' if at_least else ''}{sum(report['skipped'].values()):,}"


def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    found = Environment(
        loader=PackageLoader("replay.html"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters.update(plain=plain, brief=brief, escaped=escaped, code=code_parts, flag=pose_flag)
    return found


def code_parts(text: str) -> list[tuple[bool, str]]:
    """Return text in parts, and of each whether it stands between backquotes."""
    return [(bool(number % 2), part) for number, part in enumerate(text.split("`")) if part]


def pose_flag(value: str) -> str:
    """Return a placement as it is typed in a shell."""
    return escaped(f"--init-pose {shlex.quote(value)}")


def _static(name: str) -> str:
    return resources.files("replay.html").joinpath("static", name).read_text(encoding="utf-8")


def _hash(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
