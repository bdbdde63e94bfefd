"""What is lost of a SQLite file whose pages are damaged or missing, and when its messages were recorded."""

from __future__ import annotations

from replay.skip_cause import SkipCause
from replay.sources.lapses import LATEST, Lapse, Written
from replay.sources.losses import Loss
from replay.sources.sqlite3.header import Header
from replay.sources.sqlite3.pages import Gap, Leaves
from replay.sources.sqlite3.places import Places


def lost_messages(leaves: Leaves, count: int) -> int | None:
    """Return how many messages are lost, as their keys are counted up from 1; None if the last one is not known."""
    if any(gap.high is None for gap in leaves.gaps):
        return None
    last = max([leaves.last_key] + [gap.high or 0 for gap in leaves.gaps])
    return max(0, last - count)


def key_lapse(written: Written, first: int, last: int | None = None) -> Lapse:
    """Return the lapse of the messages with these keys."""
    return written.between((first, 0), ((first if last is None else last) + 1, 0))


def gap_lapse(written: Written, gap: Gap) -> Lapse:
    """Return the lapse of the messages that are lost because of a page."""
    return key_lapse(written, gap.low + 1, LATEST if gap.high is None else gap.high)


def page_loss(gap: Gap, what: str) -> Loss:
    """Return what is lost because of a page of ``what``: "messages", or what the page is of."""
    messages = None if gap.high is None or what != "messages" else gap.high - gap.low
    return Loss(SkipCause.DAMAGED, f"page {gap.page}", f"{what} cannot be read: the page is damaged", messages)


def early_end(size: int, missing: int, header: Header) -> Loss:
    """Return what is wrong with a file of which the last pages are missing."""
    detail = f"the file ends early: {missing} of its {header.pages} pages are missing"
    return Loss(SkipCause.ENDS_EARLY, f"byte {size}", detail)


def displacement(places: Places) -> Loss:
    """Return what is wrong with a file whose pages are not where their numbers say."""
    until = f"page {places.resumed}" if places.resumed <= places.there else "the end"
    detail = f"bytes are missing or too many between page {places.kept} and {until}: what is there cannot be told"
    return Loss(SkipCause.DAMAGED, f"page {places.kept + 1}", detail)
