"""What is lost of an MCAP file: what a pass through it met and could not use, with its messages and their times.

A chunk that cannot be used costs the messages in it, a damaged record those up to the next sound one, and the end of a
file that was cut off what would have come after it. Each is named. Where a sound summary counts just as many messages
as were found, nothing is lost, whatever else is damaged.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from replay.skip_cause import SkipCause
from replay.sources.boundary import COPY_AGAIN
from replay.sources.lapses import AT_END, Place, Written
from replay.sources.losses import Loss
from replay.sources.mcap.channels import Channel
from replay.sources.mcap.index import NO_CHUNK
from replay.sources.mcap.record_file import RecordFile, indexed_counts
from replay.sources.mcap.records import HEADER, MAGIC, BadPart
from replay.sources.mcap.summary import Contents, Summary, statistics_between
from replay.sources.mcap.walk import Walk
from replay.words import counted

_MOST_NAMED = 3


@dataclass(slots=True)
class Unusable:
    """What a pass through a file has met so far that cannot be used.

    Parameters
    ----------
    summary
        What it counts says how much is lost or, if it is checked, that nothing is.
    named
        What needs nothing else to be named.
    bad_chunks
        Chunks of which nothing is used: where they begin, why, and how many messages of each channel are in them, if
        that is known.
    doubtful
        Messages that are left out though they may be right.
    """

    file: RecordFile
    summary: Summary | None
    named: list[Loss] = field(default_factory=list)
    bad_chunks: list[tuple[int, BadPart, Counter[int] | None]] = field(default_factory=list)
    doubtful: list[Place] = field(default_factory=list)

    def losses(self, walk: Walk, contents: Contents, written: Written) -> list[Loss]:
        """Return all that is lost, once the file was passed through.

        Parameters
        ----------
        contents
            What was found.
        written
            When what was found was recorded; nothing is asked of it if nothing was met that cannot be used.
        """
        unknown = list(unknown_types(contents))
        counted_all = self.summary.statistics if self.summary and self.summary.is_checked else None
        found = {key: count for key, count in contents.counts.items() if count}
        if counted_all is not None and found == {
            key: count for key, count in counted_all.channel_message_counts.items() if count
        }:
            return unknown
        losses = [*self.named]
        for place in self.doubtful:
            lapse = written.between(place, (place[0] + 1, NO_CHUNK))
            losses.append(replace(_doubtful_end(place[0]), lapse=lapse))
        for start, error, lost in self.bad_chunks:
            # whatever of a chunk that was cut off is there comes before what is not
            lapse = AT_END if start == walk.cut_chunk else written.between((start, NO_CHUNK), (start + 1, NO_CHUNK))
            losses.append(replace(chunk_loss(start, error, lost, contents.channels), lapse=lapse))
        losses += self._gap_losses(walk, contents, written, sum(each.messages or 0 for each in losses))
        if walk.ends_early is not None:
            losses.append(_ends_early(walk.ends_early, self.file))
        if not losses:
            losses += _missing(self._said_counts(walk), contents)
        return [*losses, *self._after_the_end(walk), *unknown]

    def _said_counts(self, walk: Walk) -> Mapping[int, int]:
        """Return how many messages of each channel the file says that it has; nothing if it does not say."""
        said = self.summary.statistics if self.summary else None
        if said is None and walk.data_end is not None and walk.footer is not None:
            # What comes before the summary may have become shorter or longer, so that it is not where it should be.
            said = statistics_between(self.file, walk.data_end.end, walk.footer.start)
        return said.channel_message_counts if said else {}

    def _gap_losses(self, walk: Walk, contents: Contents, written: Written, named: int) -> list[Loss]:
        """Return what is lost in gaps, beside what was named.

        The indexes that follow a gap are those of the last chunk in it, and there may have been others: what they count
        is believed if what the summary counts says so, too.
        """
        counts = [indexed_counts(self.file, gap.stop) for gap in walk.gaps]
        totals = [count.total() if count else None for count in counts]
        said = self._said_counts(walk)
        short = sum(max(0, count - contents.counts.get(key, 0)) for key, count in said.items())
        is_all = bool(said) and short <= named + sum(total or 0 for total in totals)
        losses = []
        for gap, total in zip(walk.gaps, totals, strict=True):
            detail = f"what should be a record there, of type {gap.opcode}, is none that can be read"
            loss = damaged(gap.start, gap.stop, detail, total if is_all else None)
            losses.append(replace(loss, lapse=written.between((gap.start, NO_CHUNK), (gap.stop, NO_CHUNK))))
        return losses

    def _after_the_end(self, walk: Walk) -> list[Loss]:
        """Return what is lost if files were put together end to end."""
        if walk.footer is None:
            return []
        end = walk.footer.end + len(MAGIC)
        self.file.file.seek(end)
        if self.file.file.read(len(MAGIC) + 1) != MAGIC + bytes([HEADER]):
            return []
        loss = damaged(end, self.file.size, "another recording begins there, after the end of this one: split them")
        return [replace(loss, lapse=AT_END)]


def _doubtful_end(start: int) -> Loss:
    detail = "it has no checksum, and not what should follow it, so that bytes of its last message may be missing"
    return Loss(SkipCause.DAMAGED, f"the chunk at byte {start}", detail, 1)


def damaged(start: int, stop: int, detail: str, messages: int | None = None) -> Loss:
    """Return what is lost with these bytes of a file."""
    return Loss(SkipCause.DAMAGED, f"bytes {start} to {stop}", detail, messages)


def _ends_early(end: int, file: RecordFile) -> Loss:
    name = file.path.name
    # what a run of ours left is the only one
    remedy = f"finish it with `replay recover {name}`" if name.endswith(".partial") else COPY_AGAIN
    detail = (
        f"the last whole record ends there, {counted(file.size - end, 'byte')} before the end of the file, and nothing "
        f"closes the recording, as when recording or copying was cut off; {remedy}"
    )
    return Loss(SkipCause.ENDS_EARLY, f"byte {end}", detail, lapse=AT_END)


def chunk_loss(start: int, error: BadPart, lost: Counter[int] | None, channels: Mapping[int, Channel]) -> Loss:
    """Return what is lost with a chunk."""
    place = f"the chunk at byte {start}"
    if not lost:
        return Loss(error.cause, place, error.detail)
    topics: Counter[str] = Counter()
    for key, count in lost.items():
        topics[channels[key].topic if key in channels else f"channel {key}"] += count
    named = ", ".join(f"{count} of {topic}" for topic, count in topics.most_common(_MOST_NAMED))
    more = " and others" if len(topics) > _MOST_NAMED else ""
    return Loss(
        error.cause,
        place,
        f"{error.detail}; in it are {named}{more}",
        lost.total(),
        next(iter(topics)) if len(topics) == 1 and lost.keys() <= channels.keys() else "",
        tuple(topics) if lost.keys() <= channels.keys() else (),
    )


def unknown_types(contents: Contents) -> list[Loss]:
    """Return which messages are there and cannot be used, because of what is known of their channels."""
    losses = []
    for key, count in sorted(contents.counts.items()):
        channel = contents.channels.get(key)
        if not count:
            continue
        if channel is None:
            losses.append(
                Loss(SkipCause.UNKNOWN_TYPE, f"channel {key}", "no record of the file describes this channel", count)
            )
        elif channel.problem:
            losses.append(Loss(SkipCause.UNKNOWN_TYPE, f"topic {channel.topic}", channel.problem, count, channel.topic))
    return losses


def _missing(counts: Mapping[int, int], contents: Contents) -> list[Loss]:
    """Return of which channels there are fewer messages than the summary counts."""
    losses = []
    for key, count in sorted(counts.items()):
        short = count - contents.counts.get(key, 0)
        topic = contents.channels[key].topic if key in contents.channels else ""
        if short > 0:
            # named, as two channels of which nothing else is known would be taken for one
            whose = "" if topic else f" of channel {key}"
            detail = f"the summary counts {counted(count, 'message')}{whose}, and {count - short} are there"
            losses.append(Loss(SkipCause.DAMAGED, "the data section", detail, short, topic))
    return losses
