"""The faults: one row each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from benchmarks.faults import bag_damage as bag
from benchmarks.faults import bombs
from benchmarks.faults import bytes_damage as raw
from benchmarks.faults import db3_damage as db3
from benchmarks.faults import degenerate_maps as odd
from benchmarks.faults import folder_damage as folder
from benchmarks.faults import mcap_damage as mcap
from benchmarks.faults import message_damage as told
from benchmarks.faults.formats import FORMATS, Container, Format, Recording, undamaged
from benchmarks.faults.messages import Message
from benchmarks.faults.world import messages
from samples.world import Rng


@dataclass(frozen=True, slots=True)
class Variant:
    """A recording with a fault.

    Parameters
    ----------
    told
        What was recorded, where the messages are the fault; None if they are those of the undamaged recording.
    max_memory_bytes
        What the program is told that a map may take; None for nothing.
    """

    recording: Recording
    told: tuple[Message, ...] | None = None
    max_memory_bytes: int | None = None


_MEMORY_BYTES = 20_000_000
_NOBODY_COUNTS = {"mcap_no_summary": "nothing in the file counts its messages"}

Change = Callable[[str, Rng], Variant | None]


@dataclass(frozen=True, slots=True)
class Fault:
    """One way in which a recording can be at fault.

    Parameters
    ----------
    change
        Makes a variant of the recording in a format, by name; None if there is none.
    fits
        Whether a format can have it.
    silent_in
        Formats in which nothing that is left tells that messages are missing, and why that is so.
    is_rewritten
        Whether checksums are made right for what is changed, so that they tell nothing.
    """

    change: Change
    fits: Callable[[Format], bool]
    silent_in: Mapping[str, str]
    is_rewritten: bool = False


def _bytes(
    change: Callable[[bytes, Rng], bytes | None],
    container: Container | None = None,
    silent_in: Mapping[str, str] | None = None,
    *,
    is_rewritten: bool = False,
) -> Fault:
    """Return a fault of the bytes of one file; of a container's own structure only where it is not compressed."""

    def varied(name: str, rng: Rng) -> Variant | None:
        recording = undamaged(name)
        names = recording.data_names()
        chosen = names[int(rng.integers(len(names)))]
        data = change(recording.files[chosen], rng)
        return None if data is None else Variant(Recording({**recording.files, chosen: data}, recording.main))

    def fits(kind: Format) -> bool:
        return container in {None, "" if kind.is_compressed else kind.container}

    return Fault(varied, fits, silent_in or {}, is_rewritten)


def _renamed(change: Callable[[bytes, Rng], bytes], name: str) -> Fault:
    """Return a fault of the bytes of a ROS 1 bag that has another name, too."""

    def varied(kind: str, rng: Rng) -> Variant:
        (data,) = undamaged(kind).files.values()
        return Variant(Recording({name: change(data, rng)}, name))

    return Fault(varied, lambda kind: kind.container == "bag", {})


def _beside(change: Callable[[str, bytes, Rng], Mapping[str, bytes]]) -> Fault:
    """Return a fault that leaves a file beside a database."""

    def varied(name: str, rng: Rng) -> Variant:
        recording = undamaged(name)
        names = recording.data_names()
        chosen = names[int(rng.integers(len(names)))]
        return Variant(Recording({**recording.files, **change(chosen, recording.files[chosen], rng)}, recording.main))

    return Fault(varied, lambda kind: kind.container == "db3" and not kind.is_compressed, {})


def _folder(
    change: Callable[[Recording, Rng], Recording],
    *,
    only_split: bool = False,
    silent_in: Mapping[str, str] | None = None,
) -> Fault:
    """Return a fault of a folder."""

    def varied(name: str, rng: Rng) -> Variant:
        return Variant(change(undamaged(name), rng))

    return Fault(varied, lambda kind: kind.is_folder and (kind.is_split or not only_split), silent_in or {})


def _compressed() -> Fault:
    """Return the fault of compressed data that grows beyond all measure."""

    def varied(name: str, rng: Rng) -> Variant:
        recording = undamaged(name)
        names = recording.data_names()
        chosen = names[int(rng.integers(len(names)))]
        data = bombs.planted(FORMATS[name], recording.files[chosen], rng)
        return Variant(Recording({**recording.files, chosen: data}, recording.main))

    return Fault(varied, lambda kind: bool(kind.compression), {}, is_rewritten=True)


def _messages(
    change: Callable[[Sequence[Message], Rng], Sequence[Message]], max_memory_bytes: int | None = None
) -> Fault:
    """Return a fault of the messages in a recording that is whole."""

    def varied(name: str, rng: Rng) -> Variant:
        recorded = tuple(change(messages(), rng))
        return Variant(FORMATS[name].recorded(recorded), recorded, max_memory_bytes)

    return Fault(varied, lambda kind: kind.real is None, {})


FAULTS: Mapping[str, Fault] = {
    # bytes of any file
    "truncated": _bytes(raw.truncated),
    "bit_flipped": _bytes(raw.bit_flipped),
    "bits_flipped": _bytes(raw.bits_flipped),
    "bits_flipped_in_head": _bytes(raw.bits_flipped_in_head),
    "bits_flipped_in_tail": _bytes(raw.bits_flipped_in_tail),
    "zeroed": _bytes(raw.zeroed),
    "made_random": _bytes(raw.made_random),
    "tail_zeroed": _bytes(raw.tail_zeroed),
    "block_removed": _bytes(raw.block_removed),
    "block_doubled": _bytes(raw.block_doubled),
    "blocks_swapped": _bytes(raw.blocks_swapped),
    "inserted": _bytes(raw.inserted),
    "zeros_appended": _bytes(raw.zeros_appended),
    "random_appended": _bytes(raw.random_appended),
    "random_in_front": _bytes(raw.random_in_front),
    "all_random": _bytes(raw.all_random),
    "emptied": _bytes(raw.emptied),
    "with_crlf": _bytes(raw.with_crlf),
    "with_lf": _bytes(raw.with_lf),
    "as_text": _bytes(raw.as_text),
    "twice": _bytes(raw.twice),
    "bomb": _compressed(),
    # records of MCAP files
    "mcap_records_swapped": _bytes(mcap.records_swapped, "mcap", _NOBODY_COUNTS),
    "mcap_record_doubled": _bytes(mcap.record_doubled, "mcap"),
    "mcap_record_removed": _bytes(mcap.record_removed, "mcap", _NOBODY_COUNTS),
    "mcap_cut_between_records": _bytes(mcap.cut_between_records, "mcap"),
    "mcap_length_inflated": _bytes(mcap.length_inflated, "mcap"),
    "mcap_opcode_changed": _bytes(mcap.opcode_changed, "mcap", _NOBODY_COUNTS),
    "mcap_summary_removed": _bytes(mcap.summary_removed, "mcap"),
    "mcap_indexes_removed": _bytes(mcap.indexes_removed, "mcap"),
    "mcap_chunk_damaged": _bytes(mcap.chunk_damaged, "mcap"),
    "mcap_chunk_crc_wrong": _bytes(mcap.chunk_crc_wrong, "mcap"),
    "mcap_chunk_size_wrong": _bytes(mcap.chunk_size_wrong, "mcap"),
    "mcap_chunk_compression_wrong": _bytes(mcap.chunk_compression_wrong, "mcap"),
    "mcap_inner_length_inflated": _bytes(mcap.inner_length_inflated, "mcap", _NOBODY_COUNTS, is_rewritten=True),
    "mcap_inner_record_removed": _bytes(mcap.inner_record_removed, "mcap", _NOBODY_COUNTS, is_rewritten=True),
    "mcap_summary_crc_wrong": _bytes(mcap.summary_crc_wrong, "mcap"),
    "mcap_summary_falsified": _bytes(mcap.summary_falsified, "mcap", is_rewritten=True),
    "mcap_message_index_falsified": _bytes(mcap.message_index_falsified, "mcap"),
    "mcap_schema_removed": _bytes(mcap.schema_removed, "mcap"),
    "mcap_schema_emptied": _bytes(mcap.schema_emptied, "mcap"),
    "mcap_schema_altered": _bytes(mcap.schema_altered, "mcap"),
    "mcap_schema_encoding_changed": _bytes(mcap.schema_encoding_changed, "mcap"),
    "mcap_channel_encoding_changed": _bytes(mcap.channel_encoding_changed, "mcap"),
    "mcap_data_end_wrong": _bytes(mcap.data_end_wrong, "mcap"),
    "mcap_footer_wrong": _bytes(mcap.footer_wrong, "mcap"),
    # records of ROS 1 bags
    "bag_records_swapped": _bytes(bag.records_swapped, "bag"),
    "bag_record_doubled": _bytes(bag.record_doubled, "bag"),
    "bag_record_removed": _bytes(bag.record_removed, "bag"),
    "bag_cut_between_records": _bytes(bag.cut_between_records, "bag"),
    "bag_length_inflated": _bytes(bag.length_inflated, "bag"),
    "bag_without_index": _bytes(bag.without_index, "bag"),
    "bag_active": _renamed(bag.without_index, "run.bag.active"),
    "bag_header_wrong": _bytes(bag.header_wrong, "bag"),
    "bag_chunk_damaged": _bytes(bag.chunk_damaged, "bag"),
    "bag_chunk_size_wrong": _bytes(bag.chunk_size_wrong, "bag"),
    "bag_chunk_compression_wrong": _bytes(bag.chunk_compression_wrong, "bag"),
    "bag_index_falsified": _bytes(bag.index_falsified, "bag"),
    "bag_index_header_falsified": _bytes(bag.index_header_falsified, "bag"),
    "bag_schema_removed": _bytes(bag.schema_removed, "bag"),
    "bag_schema_emptied": _bytes(bag.schema_emptied, "bag"),
    "bag_schema_altered": _bytes(bag.schema_altered, "bag"),
    "bag_field_removed": _bytes(bag.field_removed, "bag"),
    # rows and pages of databases
    "db3_row_data_wrong": _bytes(db3.row_data_wrong, "db3"),
    "db3_row_time_wrong": _bytes(db3.row_time_wrong, "db3"),
    "db3_row_topic_wrong": _bytes(db3.row_topic_wrong, "db3"),
    "db3_row_doubled": _bytes(db3.row_doubled, "db3"),
    "db3_topic_wrong": _bytes(db3.topic_wrong, "db3"),
    "db3_topic_removed": _bytes(db3.topic_removed, "db3"),
    "db3_table_wrong": _bytes(db3.table_wrong, "db3"),
    "db3_schema_wrong": _bytes(db3.schema_wrong, "db3"),
    "db3_index_removed": _bytes(db3.index_removed, "db3"),
    "db3_page_zeroed": _bytes(db3.page_zeroed, "db3"),
    "db3_pages_swapped": _bytes(db3.pages_swapped, "db3"),
    "db3_cut_at_page": _bytes(db3.cut_at_page, "db3"),
    "db3_wal_left": _beside(db3.wal_left),
    "db3_wal_damaged": _beside(db3.wal_damaged),
    "db3_journal_left": _beside(db3.journal_left),
    # folders
    "folder_metadata_missing": _folder(folder.metadata_missing),
    "folder_metadata_damaged": _folder(folder.metadata_damaged),
    "folder_metadata_wrong": _folder(folder.metadata_wrong),
    "folder_part_missing": _folder(folder.part_missing),
    "folder_part_emptied": _folder(folder.part_emptied),
    "folder_part_doubled": _folder(folder.part_doubled),
    "folder_parts_swapped": _folder(folder.parts_swapped, only_split=True),
    # messages
    "message_resolution_wrong": _messages(told.resolution_wrong),
    "message_size_wrong": _messages(told.size_wrong),
    "message_length_wrong": _messages(told.length_wrong),
    "message_huge_side": _messages(told.huge_side),
    "message_origin_wrong": _messages(told.origin_wrong),
    "message_turn_unset": _messages(told.turn_unset),
    "message_stamp_wrong": _messages(told.stamp_wrong),
    "message_stamps_wrong": _messages(told.stamps_wrong),
    "message_log_time_wrong": _messages(told.log_time_wrong),
    "message_out_of_order": _messages(told.out_of_order),
    "message_at_one_time": _messages(told.at_one_time),
    "message_frame_wrong": _messages(told.frame_wrong),
    "message_topic_wrong": _messages(told.topic_wrong),
    "message_cells_wrong": _messages(told.cells_wrong),
    "message_cells_random": _messages(told.cells_random),
    "message_cut": _messages(told.cut),
    "message_nothing_known": _messages(told.nothing_known),
    "message_all_walls": _messages(told.all_walls),
    "message_update_wrong": _messages(told.update_wrong),
    "message_updates_first": _messages(told.updates_first),
    "message_float_noise": _messages(told.float_noise),
    "message_over_memory": _messages(odd.over_memory, _MEMORY_BYTES),
    # maps that tell nothing, or the wrong thing
    "maps_all_free": _messages(odd.all_free),
    "maps_of_one_cell": _messages(odd.one_cell),
    "maps_of_one_row": _messages(odd.one_row),
    "maps_of_one_wall": _messages(odd.one_wall),
    "maps_symmetric": _messages(odd.symmetric),
    "maps_identical": _messages(odd.identical),
    "maps_mirrored": _messages(odd.mirrored),
}
