"""What is lost of a recording, each loss once, and not more of them listed than anybody reads."""

from __future__ import annotations

from dataclasses import replace

from replay.skip_cause import SkipCause
from replay.sources.losses import MOST_LISTED, MOST_PLACES, OTHER_PLACES, Loss, Losses, summed_up


def damaged(number: int, topic: str = "/tf", messages: int | None = 1) -> Loss:
    return Loss(SkipCause.DAMAGED, f"message {number}", f"it ends early: {number}", messages, topic)


def test_each_is_told_once() -> None:
    losses = Losses()
    for number in (1, 2, 1):
        losses.add(damaged(number))
    assert losses.new() == (damaged(1), damaged(2))
    losses.add(damaged(2))
    assert losses.new() == ()
    assert losses.all == (damaged(1), damaged(2))


def test_of_very_many_the_first_are_listed_and_the_others_added_up() -> None:
    losses = Losses()
    found = [damaged(number) for number in range(500)]
    for loss in [*found, *found]:
        losses.add(loss)
    losses.add(damaged(1, "/r1/map"))
    assert losses.new() == (*found, damaged(1, "/r1/map"))
    *listed, others = losses.all
    assert listed == [*found[:MOST_PLACES], damaged(1, "/r1/map")]
    assert (others.place, others.messages, others.topic) == (OTHER_PLACES, 500 - MOST_PLACES, "/tf")
    assert summed_up(("run", loss) for loss in losses.all).startswith(
        "lost are 501 messages (damaged), first run, mess"
    )


def test_of_very_many_topics_as_well() -> None:
    losses = Losses()
    for number in range(5000):
        losses.add(damaged(number, f"/{number}"))
    losses.add(replace(damaged(1), cause=SkipCause.UNKNOWN_TYPE))
    *listed, other_cause, others = losses.all
    assert listed == [damaged(number, f"/{number}") for number in range(MOST_LISTED)]
    assert other_cause.cause == SkipCause.UNKNOWN_TYPE
    assert (others.place, others.messages, others.topic) == (OTHER_PLACES, 5000 - MOST_LISTED, "")


def test_if_not_all_numbers_are_known_the_sum_is_not() -> None:
    losses = Losses()
    for number in range(MOST_PLACES + 3):
        losses.add(damaged(number, messages=None if number == MOST_PLACES + 1 else 1))
    assert losses.all[-1].messages is None
