"""The recording for the Rerun viewer: everything that happens in a run, to look at."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import asdict
from uuid import NAMESPACE_URL, UUID, uuid5

import rerun as rr
from rerun.blueprint import Blueprint

from mapmerge.config import CellConfig
from mapmerge.match import CALIBRATED
from replay.decisions import Entry, decisions
from replay.errors import OutputError
from replay.events import Event, Finished, Merged, Noted, Report, RobotPicture, Skipped, Started
from replay.options import NS_PER_S, OutputOptions
from replay.plain_text import plain
from replay.sinks import rerun_text as text
from replay.sinks.partial_file import PartialFile
from replay.sinks.rerun_blueprint import blueprint
from replay.sinks.rerun_candidates import candidates
from replay.sinks.rerun_entities import ABOUT, DECISIONS, LEGEND, ROBOTS, SKIPPED, SUMMARY, EntityPath, RobotEntities
from replay.sinks.rerun_errors import rerun_errors
from replay.sinks.rerun_live import LiveStream
from replay.sinks.rerun_maps import MapScene
from replay.sinks.rerun_paths import PathScene
from replay.sinks.rerun_plots import Plots
from replay.sinks.rerun_status import Statuses
from replay.sinks.rerun_stream import APPLICATION, RrdStream
from replay.sinks.rerun_summary import Said, Setbacks, legend, summary

_MARKDOWN = rr.MediaType.MARKDOWN


class RerunSink:
    """Writes the maps, pictures, numbers and decisions of a run, and what the viewer shows of them."""

    def __init__(self, file: PartialFile, options: OutputOptions) -> None:
        self._file = file
        self._live_url = options.live_url
        self._stream: RrdStream | None = None
        self._writer: _Writer | None = None

    def take(self, event: Event) -> None:
        """Log what happened; the library writes it to the file in the meantime."""
        with rerun_errors(self._file.path):
            if isinstance(event, Started):
                number = _recording_id(event)
                live = None if self._live_url is None else LiveStream(self._live_url, APPLICATION, number)
                self._stream = RrdStream(self._file, number, live)
                self._writer = _Writer(self._stream, event)
            elif self._writer is not None:
                self._writer.take(event)

    def finish(self) -> None:
        """Make the file whole."""
        with rerun_errors(self._file.path):
            if self._writer is not None:
                self._writer.finish()
        self._file.sync()

    def publish(self) -> None:
        """Give the recording its final name."""
        self._file.publish()

    def discard(self) -> None:
        """Remove the recording."""
        with suppress(OutputError), rerun_errors(self._file.path):
            if self._stream is not None:
                self._stream.close()
        self._file.discard()


class _Writer:
    """Logs a run whose robots are known."""

    def __init__(self, stream: RrdStream, started: Started) -> None:
        merge = started.settings["merge"]
        robots = [RobotEntities(item.robot, index) for index, item in enumerate(started.robots)]
        self.stream = stream
        self._robots = {entities.robot: entities for entities in robots}
        cells = CellConfig(**merge["cells"])
        self._maps = MapScene(self.stream, robots, cells, merge["verify"]["tolerance_m"])
        self._paths = PathScene(self.stream, robots)
        limit_of = "confidence" if merge["method"] in CALIBRATED else "acceptance"
        self._plots = Plots(self.stream, robots, limit_of, merge["verify"][f"min_{limit_of}"])
        self._statuses = Statuses(self.stream, robots)
        self._steps: dict[str, list[str]] = {}
        self._waiting: list[Entry] = []
        self._said: list[Said] = []
        self._setbacks = Setbacks()
        self._pages: dict[tuple[str, ...], str] = {}
        self._start_ns: int | None = None
        self._stamp_ns = 0
        self._laid_out = (-1, False)
        self._has_ways = False
        self._show_legend()

    def take(self, event: Event) -> None:
        """Log an event."""
        match event:
            case Skipped():
                # A message is skipped before its tick is there, and only that has the time of the recording.
                self._waiting.append(text.skipped(event))
            case Noted():
                self._waiting.append(text.noted(event))
            case Merged():
                self._take_merged(event)
            case Finished():
                self._take_finished(event)

    def finish(self) -> None:
        """Write the layout of the viewer and all that makes the file whole."""
        self.stream.send(self._layout(self._since_ns))
        self.stream.finish()

    def _layout(self, span_ns: int) -> Blueprint:
        return blueprint(list(self._robots.values()), self._steps, self._maps.extent, span_ns)

    def _lay_out_live(self) -> None:
        """Lay the viewer out where there is something new to lay out: that sets back what a person chose."""
        seen = sum(map(len, self._steps.values())), self._maps.extent is not None
        if self.stream.is_live and seen != self._laid_out:
            self._laid_out = seen
            self.stream.send(self._layout(0), live_only=True)

    @property
    def _since_ns(self) -> int:
        """How long after the first tick it is; 0 without any."""
        return 0 if self._start_ns is None else self._stamp_ns - self._start_ns

    def _take_merged(self, event: Merged) -> None:
        self.stream.at(event.stamp_ns)
        self._start_ns = event.stamp_ns if self._start_ns is None else self._start_ns
        self._stamp_ns = event.stamp_ns
        self._maps.show(event.result)
        self._paths.show(event.moved, self._maps.shown)
        if event.moved and not self._has_ways:
            self._has_ways = True
            self._show_legend()
        for item in event.pictures:
            self._show_picture(item)
        self._show_candidates(event)
        self._plots.show(event.report, event.timing)
        self._statuses.show(event.report)
        self._say_waiting()
        for entry in (*decisions(event.result), *text.remarks(event)):
            self._say(entry)
        self._setbacks.take(event.report)
        self._show_pages(event.report)
        self._lay_out_live()

    def _take_finished(self, event: Finished) -> None:
        self._say_waiting()
        for entry in text.outcome(event.report):
            self._say(entry)
        self._show_pages(event.report, is_last=True)
        self.stream.log(ABOUT, rr.TextDocument(text.about(event.report), media_type=_MARKDOWN), static=True)

    def _show_legend(self) -> None:
        page = rr.TextDocument(legend(has_ways=self._has_ways), media_type=_MARKDOWN)
        self.stream.log(LEGEND, page, static=True)

    def _show_picture(self, item: RobotPicture) -> None:
        steps = self._steps.setdefault(item.robot, [])
        if item.picture.step not in steps:
            steps.append(item.picture.step)
        self.stream.log([*self._robots[item.robot].evidence, item.picture.step], rr.Image(item.picture.rgb))

    def _show_candidates(self, event: Merged) -> None:
        for robot in self._steps:
            pair = event.result.robots[robot].shown_pair
            if pair is not None:
                self._show_page(self._robots[robot].candidates, candidates(event.report, pair))

    def _show_pages(self, report: Report, *, is_last: bool = False) -> None:
        robots = list(self._robots.values())
        self._show_page(SUMMARY, summary(report, robots, self._said, self._setbacks, is_last=is_last))
        self._show_page(ROBOTS, text.robots_table(report))
        self._show_page(SKIPPED, text.skipped_table(report))

    def _show_page(self, path: EntityPath, page: str) -> None:
        """Log a page, if it differs from the one before."""
        if self._pages.get(tuple(path)) != page:
            self._pages[tuple(path)] = page
            self.stream.log(path, rr.TextDocument(page, media_type=_MARKDOWN), static=self._start_ns is None)

    def _say_waiting(self) -> None:
        for entry in self._waiting:
            self._say(entry)
        self._waiting.clear()

    def _say(self, entry: Entry) -> None:
        level, words = entry[0], plain(entry[1])
        said = Said(self._since_ns / NS_PER_S, words)
        self._said.append(said)
        line = words if self._start_ns is None else f"{said.since}  {words}"
        self.stream.log(DECISIONS, rr.TextLog(line, level=level), static=self._start_ns is None)


def _recording_id(started: Started) -> UUID:
    """Return an id that is the same for the same input and settings."""
    said = [[asdict(item) for item in started.robots], started.settings, [dict(item) for item in started.inputs]]
    return uuid5(NAMESPACE_URL, json.dumps(said, sort_keys=True, default=str))
