"""Runs in which no map can be used: an error that says what became of them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, NoReturn

from replay.codec import decode
from replay.errors import BadMessage, InputError
from replay.events import Report
from replay.plain_text import listed
from replay.skip_cause import SkipCause
from replay.sources.base import Source
from replay.sources.losses import Loss, Losses, summed_up


def refuse_mapless(sources: Sequence[Source], topics: Collection[str]) -> NoReturn:
    """Refuse recordings of which no map can be used, whatever is asked of them.

    Parameters
    ----------
    topics
        Those of the maps.

    Raises
    ------
    InputError
        Which says how many messages are lost, by cause, and where the first one is.
    """
    found = [(source.path.name, loss) for source in sources for loss in _losses(source, topics)]
    raise none_used([str(source.path) for source in sources], topics, found)


def none_used(paths: Sequence[str], topics: Collection[str], losses: Iterable[tuple[str, Loss]]) -> InputError:
    """Return the error of a run in which no map could be used.

    Parameters
    ----------
    losses
        What is lost, each with the name of its recording.
    """
    why, advice = summed_up(losses), "give a whole copy, or other maps with --topic"
    if not why:
        why, advice = "there is none at these times", "give other maps with --topic, or another --start or --stop"
    return InputError(f"{', '.join(paths)}: no map of {listed(sorted(topics))} can be used; {why}; {advice}")


def losses_of(report: Report) -> list[tuple[str, Loss]]:
    """Return what a report says was skipped."""
    return [(each["input"], _loss(each)) for each in report["skipped_at"]]


def _loss(item: Mapping[str, Any]) -> Loss:
    place = item["place"] or f"{item['topic']} at {item['first_log_time_ns']} ns"
    return Loss(SkipCause(item["cause"]), place, item["detail"], item["messages"])


def _losses(source: Source, topics: Collection[str]) -> tuple[Loss, ...]:
    """Return what of a recording is lost, with the messages on these topics that are no maps."""
    refused = Losses()
    there = [topic.name for topic in source.info.topics if topic.name in topics]
    for raw in source.messages(there):
        try:
            decode(raw)
        except BadMessage as error:
            place = f"{raw.topic} at {raw.log_time_ns} ns"
            refused.add(Loss(SkipCause(error.cause), place, error.detail, 1))
    # after the messages were read
    return (*source.losses.all, *refused.all)
