"""Sinks: each shows or writes the events of a run. A new one is a file here and a row in `SINKS`."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from importlib import import_module
from pathlib import Path

from replay.errors import OutputError, UsageError
from replay.html.own_page import is_begun_page, is_own_page
from replay.interrupts import held_off
from replay.options import OutputOptions
from replay.sinks.base import Sink
from replay.sinks.partial_file import PartialFile, partial_name, recovering_name
from replay.sinks.publication import aside_name, publish

__all__ = [
    "SINKS",
    "OutputsExistError",
    "Sink",
    "all_output_paths",
    "claim",
    "open_sinks",
    "output_paths",
    "refuse_existing",
    "remove_left_over",
    "reserved_paths",
]

SINKS: dict[str, str] = {
    "mcap": "replay.sinks.mcap_file:McapSink",
    "rrd": "replay.sinks.rerun_file:RerunSink",
    "html": "replay.sinks.html_file:HtmlSink",
    "json": "replay.sinks.json_file:JsonSink",
}
"""In the order in which they are published: where the last one is, the others are, of the same run."""


class OutputsExistError(UsageError):
    """Files would be replaced, which was not asked for.

    Parameters
    ----------
    existing
        Their names.
    force
        How to ask for it.
    """

    def __init__(self, existing: Sequence[str], force: str = "--force") -> None:
        super().__init__(f"there is already {', '.join(existing)}; give {force} to replace, or another name")
        self.existing = existing


def output_paths(options: OutputOptions) -> dict[str, Path]:
    """Return the file that each sink writes."""
    beside = {name: options.mcap.with_suffix(f".{name}") for name in SINKS if name != "html"}
    asked = {**beside, "rrd": beside["rrd"] if options.rrd else None, "html": options.html}
    return {name: path for name in SINKS if (path := asked[name]) is not None}


def all_output_paths(options: OutputOptions) -> list[Path]:
    """Return the files that belong together under this name, also those that are not written this time.

    A page beside the MCAP is one of them if an earlier run wrote it and files may be replaced; it may have been set
    aside already. Somebody else's page is none of them, and stays.
    """
    *others, report = output_paths(replace(options, rrd=True)).values()
    page = options.mcap.with_suffix(".html")
    there = page if os.path.lexists(page) else aside_name(page)
    older = [page] if options.force and page not in others and is_own_page(there) else []
    return [*others, *older, report]


def reserved_paths(options: OutputOptions) -> tuple[Path, ...]:
    """Return all that may be written or removed: final names, temporary ones, and those of what is replaced."""
    finals = all_output_paths(options)
    return *(name(path) for path in finals for name in (Path, partial_name, aside_name)), recovering_name(options.mcap)


def refuse_existing(options: OutputOptions) -> None:
    """Refuse to replace what is there, unless that was asked for."""
    # a link that leads nowhere is there, too
    existing = [str(path) for path in all_output_paths(options) if os.path.lexists(path)]
    if existing and not options.force:
        raise OutputsExistError(existing)


@contextmanager
def open_sinks(
    options: OutputOptions, extra: Sequence[Sink] = (), *, say: Callable[[str], object] = lambda _: None
) -> Iterator[tuple[Sink, ...]]:
    """Open the sinks that were asked for; publish what they wrote if all went well, else remove it.

    Parameters
    ----------
    extra
        Sinks that are open already.
    say
        Is told what an earlier run left and this one removes.
    """
    files = {name: PartialFile(path) for name, path in output_paths(options).items()}
    sinks: list[Sink] = []
    try:
        for file in files.values():
            claim(file, say)
        unwritten = [PartialFile(options.mcap.with_suffix(".rrd"))] if not options.rrd else []
        remove_left_over([*unwritten, PartialFile(options.mcap, recovering_name(options.mcap))], say)
        _remove_begun_page(options, say)
        refuse_existing(options)  # once more: another run may have published between the first time and the claim
        for name, file in files.items():
            module, _, attribute = SINKS[name].partition(":")
            sinks.append(getattr(import_module(module), attribute)(file, options))
        sinks.extend(extra)
        yield tuple(sinks)
        for sink in sinks:
            sink.finish()
        with held_off():
            refuse_existing(options)
            publish(sinks[: len(files)], list(files.values()), all_output_paths(options))
            for sink in extra:
                sink.publish()
    except BaseException:
        with held_off():
            for sink in sinks:
                sink.discard()
            for file in files.values():  # of a sink that was interrupted while it was opened
                file.discard()
        raise


def claim(file: PartialFile, say: Callable[[str], object]) -> None:
    """Claim a file; say so if an earlier run left something that is removed."""
    file.claim()
    if file.replaced_bytes:
        say(f"an earlier run was cut off and left {file.partial}; it is removed")


def remove_left_over(unwritten: Iterable[PartialFile], say: Callable[[str], object]) -> None:
    """Remove what an earlier run left of files that this one does not write."""
    for file in unwritten:
        if file.partial.exists():
            claim(file, say)
            file.discard()


def _remove_begun_page(options: OutputOptions, say: Callable[[str], object]) -> None:
    """Remove what an earlier run left of a page beside the MCAP, if this one writes none there.

    Another run may be writing a page of that name: it is no part of what this one writes, and stays.
    """
    page = PartialFile(options.mcap.with_suffix(".html"))
    if page.path != options.html and is_begun_page(page.partial):
        with suppress(OutputError):
            remove_left_over([page], say)
