"""What of a recording cannot be used though the rest can: nothing is left out in silence."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, field, replace

from replay.skip_cause import SkipCause
from replay.sources.lapses import Lapse, Lapses
from replay.words import counted


@dataclass(frozen=True, slots=True)
class Loss:
    """A part of a recording that cannot be used.

    Parameters
    ----------
    cause
        Why.
    place
        Where it is in the recording, such as "the chunk at byte 4117".
    detail
        What was found and, where it helps, what was expected or what to do.
    messages
        How many messages are lost; None if that cannot be told.
    topic
        Whose they are, if they are of one topic; "" if not, or if that cannot be told.
    maybe_of
        If they are of several topics, of which, if that can be told.
    lapse
        When they were recorded, as far as that can be told.
    """

    cause: SkipCause
    place: str
    detail: str
    messages: int | None = None
    topic: str = ""
    maybe_of: tuple[str, ...] = field(default=(), compare=False)
    lapse: Lapse = field(default=Lapse(), compare=False)


MOST_PLACES = 20
"""Of one cause and topic, so many places are listed; a recording may be damaged at each of its messages."""

MOST_LISTED = 100
"""Of one cause, so many places are listed, whatever their topics: of those there may be as many as messages."""

OTHER_PLACES = "other places"
"""What stands for the places that are not listed."""


def place_in(part: str, place: str) -> str:
    """Return where something is in a recording that consists of several files."""
    return f"{part}: {place}"


def part_of(place: str) -> str:
    """Return the file that a place names; "" if the recording is one file."""
    return place.rpartition(": ")[0]


class Listing:
    """Chooses the places that are listed: the first few of each topic, and of all topics of one kind of loss."""

    def __init__(self) -> None:
        self._listed: Counter[Hashable] = Counter()
        self._places: dict[tuple[Hashable, str], set[str]] = {}

    def at(self, kind: Hashable, topic: str, place: str) -> tuple[str, str]:
        """Return the topic and the place to list a loss under."""
        places = self._places.get((kind, topic), set())
        if place in places:
            return topic, place
        if len(places) >= MOST_PLACES:
            return topic, OTHER_PLACES
        if self._listed[kind] >= MOST_LISTED:
            return "", OTHER_PLACES
        self._listed[kind] += 1
        self._places.setdefault((kind, topic), places).add(place)
        return topic, place


class Losses:
    """The losses of one recording, each once, in the order in which they were met.

    They are met when the recording is opened, and while its messages are read; who reads asks from time to time which
    are new.
    """

    def __init__(self) -> None:
        # their hashes alone, because there may be one for each message
        self._met: set[int] = set()
        self._listed: list[Loss] = []
        self._listing = Listing()
        self._others: dict[tuple[SkipCause, str], Loss] = {}
        self._new: list[Loss] = []
        self._lapses: dict[str, Lapses] = {}
        self._new_lapses: list[tuple[str, Lapse]] = []

    def add(self, loss: Loss) -> None:
        """Take in a loss, unless it is known."""
        if loss.messages != 0:
            # that of a loss that is known may differ, if it was met while other topics were read
            for topic in loss.maybe_of or (loss.topic,):
                self.add_lapse(topic, loss.lapse)
        if hash(loss) in self._met:
            return
        self._met.add(hash(loss))
        self._new.append(loss)
        topic, place = self._listing.at(loss.cause, loss.topic, f"{loss.place}: {loss.detail}")
        if place != OTHER_PLACES:
            self._listed.append(loss)
            return
        kind = loss.cause, topic
        others = self._others.get(kind, replace(loss, topic=topic, place=OTHER_PLACES, messages=0))
        is_known = others.messages is not None and loss.messages is not None
        messages = (others.messages or 0) + (loss.messages or 0) if is_known else None
        self._others[kind] = replace(others, messages=messages)

    def add_lapse(self, topic: str, lapse: Lapse) -> None:
        """Take in when messages of a topic may be lost; of any topic with "" for it."""
        self._lapses.setdefault(topic, Lapses()).add(lapse)
        self._new_lapses.append((topic, lapse))

    def part(self, topic: str, map_ns: int, update_ns: int) -> bool:
        """Tell whether a full map of a topic may be lost between one and an update, of these log times."""
        return any(self._lapses[each].part(map_ns, update_ns) for each in {topic, ""} & self._lapses.keys())

    def new(self) -> tuple[Loss, ...]:
        """Return the losses that were met since this was asked last."""
        found, self._new = tuple(self._new), []
        return found

    def new_lapses(self) -> tuple[tuple[str, Lapse], ...]:
        """Return when messages of which topics may be lost, as far as it was met since this was asked last."""
        found, self._new_lapses = tuple(self._new_lapses), []
        return found

    @property
    def all(self) -> tuple[Loss, ...]:
        """All that were met so far; those at other places than the first few are added up."""
        return (*self._listed, *self._others.values())


def summed_up(losses: Iterable[tuple[str, Loss]]) -> str:
    """Return in words how many messages are lost, by cause, and where the first are; "" if none are.

    Parameters
    ----------
    losses
        Each with the name of its recording.
    """
    costly = [(name, loss) for name, loss in losses if loss.messages != 0]
    if not costly:
        return ""
    numbers: dict[SkipCause, list[int | None]] = {}
    for _, loss in costly:
        numbers.setdefault(loss.cause, []).append(loss.messages)
    causes = ", ".join(f"{_number(each)} ({cause})" for cause, each in numbers.items())
    name, first = costly[0]
    return f"lost are {causes}, first {name}, {first.place}: {first.detail}"


def _number(messages: Sequence[int | None]) -> str:
    known = sum(1 if each is None else each for each in messages)
    return f"{'at least ' if None in messages else ''}{counted(known, 'message')}"
