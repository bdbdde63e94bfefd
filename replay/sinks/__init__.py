"""Sinks: each shows or writes the events of a run. A new one is a file here and a row in `SINKS`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

from replay.options import OutputOptions
from replay.sinks.base import Sink
from replay.sinks.partial_file import PartialFile

__all__ = ["SINKS", "Sink", "open_sinks", "output_paths"]

SINKS: dict[str, str] = {
    "mcap": "replay.sinks.mcap_file:McapSink",
    "rrd": "replay.sinks.rerun_file:RerunSink",
    "json": "replay.sinks.json_file:JsonSink",
}


def output_paths(options: OutputOptions) -> dict[str, Path]:
    """Return the file that each sink writes."""
    return {name: options.mcap.with_suffix(f".{name}") for name in SINKS if name != "rrd" or options.rrd}


@contextmanager
def open_sinks(options: OutputOptions, extra: Sequence[Sink] = ()) -> Iterator[tuple[Sink, ...]]:
    """Open the sinks that were asked for; publish what they wrote if all went well, else remove it."""
    sinks: list[Sink] = []
    paths = output_paths(options)
    try:
        for name, path in paths.items():
            module, _, attribute = SINKS[name].partition(":")
            sinks.append(getattr(import_module(module), attribute)(path, options))
        sinks.extend(extra)
        yield tuple(sinks)
        for sink in sinks:
            sink.finish()
        for sink in sinks:
            sink.publish()
    except BaseException:
        for sink in sinks:
            sink.discard()
        for path in paths.values():  # of a sink that was interrupted while it was opened
            PartialFile(path).discard()
        raise
