from __future__ import annotations

import errno
import hashlib
import shutil
import sqlite3
import struct
import tempfile
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path

import pytest

from replay.errors import InputError
from replay.sources import open_source
from replay.sources.base import GRID_TYPE
from replay.sources.losses import Loss
from replay.sources.sqlite3.record import BadPageError, layout_of
from tests import bags
from tests.replay.test_sources_open import refused

Message = tuple[str, int, bytes]

_JOURNAL_MAGIC = b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7"


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


# --- what a recorder leaves beside its file when it is killed


def _read(path: Path) -> tuple[list[Message], tuple[Loss, ...]]:
    """Return all messages of a file and what is lost of it; the folder must stay as it is."""
    before = _digests(path.parent)
    with open_source(path) as source:
        assert _digests(path.parent) == before
        found = [
            (each.topic, each.log_time_ns, bytes(each.data))
            for each in source.messages([topic.name for topic in source.info.topics])
        ]
        losses = source.losses.all
    assert _digests(path.parent) == before
    return found, losses


def _digests(folder: Path) -> dict[str, str]:
    files = sorted(each for each in folder.rglob("*") if each.is_file())
    return {str(each): hashlib.sha256(each.read_bytes()).hexdigest() for each in files}


def _recorded(messages: Iterable[bags.Recorded]) -> list[Message]:
    ordered = sorted(messages, key=lambda each: each.log_time_ns)
    return [(each.topic, each.log_time_ns, bags.as_cdr(each)) for each in ordered]


def _killed(folder: Path, journal_mode: str, *, is_committed: bool) -> Path:
    """Leave a file as a recorder does that is killed while it writes: one more of each message."""
    folder.mkdir()
    whole = bags.write_bare_db3(folder.parent / "a.db3")
    with closing(sqlite3.connect(whole, isolation_level=None)) as database:
        database.execute(f"PRAGMA journal_mode={journal_mode}")
        # so that unfinished changes reach the file
        database.execute("PRAGMA cache_size=1")
        database.execute("BEGIN")
        database.execute(
            "INSERT INTO messages (topic_id, timestamp, data) SELECT topic_id, timestamp + 1, data FROM messages"
        )
        if is_committed:
            database.execute("COMMIT")
        for suffix in ("", "-wal", "-journal"):
            if Path(f"{whole}{suffix}").exists():
                shutil.copy(f"{whole}{suffix}", folder / f"killed.db3{suffix}")
    return folder / "killed.db3"


def _twice() -> list[Message]:
    """Return what is recorded with one more of each message, whose bytes are those of the first."""
    again = [(topic, log_time_ns + 1, data) for topic, log_time_ns, data in _recorded(bags.SAMPLE)]
    return sorted([*_recorded(bags.SAMPLE), *again], key=lambda each: each[1])


def test_messages_left_in_a_wal_are_read(tmp_path: Path, temporary: Path) -> None:
    path = _killed(tmp_path / "killed", "WAL", is_committed=True)
    assert path.with_name("killed.db3-wal").stat().st_size > 0
    found, losses = _read(path)
    assert found == _twice()
    assert losses == ()
    assert list(temporary.iterdir()) == []


def test_an_unfinished_change_in_a_wal_was_never_there(tmp_path: Path) -> None:
    path = _killed(tmp_path / "killed", "WAL", is_committed=False)
    assert path.with_name("killed.db3-wal").stat().st_size > 0
    assert _read(path) == (_recorded(bags.SAMPLE), ())


def test_an_unfinished_change_in_the_file_is_undone(tmp_path: Path, temporary: Path) -> None:
    path = _killed(tmp_path / "killed", "DELETE", is_committed=False)
    assert path.with_name("killed.db3-journal").stat().st_size > 0
    # without the journal there is more, or less that can be read
    found, losses = _read(path)
    assert (found, losses) == (_recorded(bags.SAMPLE), ())
    assert list(temporary.iterdir()) == []


def test_a_journal_that_cannot_be_applied_is_named(tmp_path: Path) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3")
    (tmp_path / "a.db3-journal").write_bytes(b"something else")
    found, losses = _read(path)
    assert found == _recorded(bags.SAMPLE)
    assert [(each.cause, each.place) for each in losses] == [("damaged", "a.db3-journal")]


def test_a_journal_that_was_ended_by_erasing_its_beginning(tmp_path: Path) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3")
    (tmp_path / "a.db3-journal").write_bytes(bytes(600))
    assert _read(path) == (_recorded(bags.SAMPLE), ())


@pytest.mark.parametrize("count", [0, 0xFFFFFFFF], ids=["none", "uncounted"])
def test_a_journal_that_names_another_deletes_nothing(tmp_path: Path, count: int) -> None:
    """SQLite would take the file that it names for a journal of several files, and delete it."""
    path = bags.write_bare_db3(tmp_path / "a.db3")
    victim = tmp_path / "victim.txt"
    victim.write_text("mine")
    name, pages = str(victim).encode(), path.stat().st_size // 4096
    head = struct.pack(">8sIIIII", _JOURNAL_MAGIC, count, 1, pages, 512, 4096).ljust(512, b"\0")
    numbers = struct.pack(">II", len(name), sum(name))
    trailer = struct.pack(">I", 0x40000000 // 4096 + 1) + name + numbers + _JOURNAL_MAGIC
    (tmp_path / "a.db3-journal").write_bytes(head + trailer)
    found, losses = _read(path)
    assert victim.read_text() == "mine"
    assert found == _recorded(bags.SAMPLE)
    assert [(str(each.cause), each.place) for each in losses] == [("damaged", "a.db3-journal")]
    assert "names another journal" in losses[0].detail


def test_a_journal_with_a_wrong_checksum_gives_nothing_that_was_not_recorded(tmp_path: Path) -> None:
    path = _killed(tmp_path / "killed", "DELETE", is_committed=False)
    journal = path.with_name("killed.db3-journal")
    data = bytearray(journal.read_bytes())
    data[512 + 4 + 96] ^= 1
    journal.write_bytes(data)
    found, losses = _read(path)
    assert set(found) <= set(_twice())
    assert {each.place for each in losses} >= {"killed.db3-journal"}
    assert "the checksum of the page at byte" in losses[0].detail


def test_pages_of_another_length_beside_a_file_are_not_used(tmp_path: Path) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3")
    page = bytes(1024)
    record = struct.pack(">I", 1) + page + struct.pack(">I", 1)
    head = struct.pack(">8sIIIII", _JOURNAL_MAGIC, 1, 1, 10, 512, 1024).ljust(512, b"\0")
    (tmp_path / "a.db3-journal").write_bytes(head + record)
    found, losses = _read(path)
    assert found == _recorded(bags.SAMPLE)
    assert [each.place for each in losses] == ["a.db3-journal"]


def test_a_wal_that_was_written_where_numbers_are_stored_the_other_way(tmp_path: Path) -> None:
    path = _killed(tmp_path / "killed", "WAL", is_committed=True)
    wal = path.with_name("killed.db3-wal")
    data = bytearray(wal.read_bytes())
    (page_bytes,) = struct.unpack_from(">I", data, 8)
    data[:4] = struct.pack(">I", struct.unpack_from(">I", data)[0] ^ 1)
    sums = _wal_sums(bytes(data[:24]), 0, 0)
    data[24:32] = struct.pack(">II", *sums)
    for start in range(32, len(data), 24 + page_bytes):
        sums = _wal_sums(bytes(data[start : start + 8] + data[start + 24 : start + 24 + page_bytes]), *sums)
        data[start + 16 : start + 24] = struct.pack(">II", *sums)
    wal.write_bytes(data)
    assert _read(path) == (_twice(), ())


def _wal_sums(data: bytes, first: int, second: int) -> tuple[int, int]:
    """Return the checksums as the description of the format has them."""
    for one, other in struct.iter_unpack(">II", data):
        first = (first + one + second) & 0xFFFFFFFF
        second = (second + other + first) & 0xFFFFFFFF
    return first, second


def test_a_damaged_wal_is_used_up_to_the_damage(tmp_path: Path) -> None:
    path = _killed(tmp_path / "killed", "WAL", is_committed=True)
    wal = path.with_name("killed.db3-wal")
    data = bytearray(wal.read_bytes())
    data[len(data) // 2] ^= 1
    wal.write_bytes(data)
    found, losses = _read(path)
    assert found == _recorded(bags.SAMPLE)
    assert [(each.cause, each.place) for each in losses] == [("wrong_checksum", "killed.db3-wal")]


def test_a_wal_that_ends_early(tmp_path: Path) -> None:
    path = _killed(tmp_path / "killed", "WAL", is_committed=True)
    wal = path.with_name("killed.db3-wal")
    wal.write_bytes(wal.read_bytes()[:-100])
    found, losses = _read(path)
    assert found == _recorded(bags.SAMPLE)
    assert [(each.cause, each.place) for each in losses] == [("ends_early", "killed.db3-wal")]


def test_a_wal_is_looked_for_beside_the_file_that_a_link_names(tmp_path: Path) -> None:
    path = _killed(tmp_path / "killed", "WAL", is_committed=True)
    (tmp_path / "sub").mkdir()
    link = tmp_path / "sub" / "link.db3"
    link.symlink_to(path)
    assert _read(link) == (_twice(), ())


def _with_a_wal(folder: Path) -> Path:
    """Leave a file of eight maps as a recorder does that is killed after it wrote each again into the ``-wal``."""
    folder.mkdir()
    messages = [bags.recorded_map("/r1/map", bags.START + each, seed=each, rows=400) for each in range(8)]
    whole = bags.write_bare_db3(folder.parent / "a.db3", messages)
    shutil.copy(whole, folder / "killed.db3")
    with closing(sqlite3.connect(whole, isolation_level=None)) as database:
        database.execute("PRAGMA journal_mode=WAL")
        database.execute("PRAGMA wal_autocheckpoint=0")
        database.execute("INSERT INTO messages (topic_id, timestamp, data) SELECT 1, timestamp + 9, data FROM messages")
        shutil.copy(f"{whole}-wal", folder / "killed.db3-wal")
    return folder / "killed.db3"


@pytest.mark.parametrize("suffix", ["-wal", "-journal"])
def test_a_file_that_ends_early_is_read_with_what_is_beside_it(tmp_path: Path, suffix: str) -> None:
    path = _with_a_wal(tmp_path / "killed")
    whole = path.read_bytes()
    if suffix == "-journal":
        path.with_name("killed.db3-wal").unlink()
        head = struct.pack(">8sIIIII", _JOURNAL_MAGIC, 0, 1, len(whole) // 4096, 512, 4096)
        path.with_name("killed.db3-journal").write_bytes(head.ljust(512, b"\0"))
    recorded = _recorded(bags.recorded_map("/r1/map", bags.START + each, seed=each, rows=400) for each in range(8))
    datas = {each[2] for each in recorded}
    counts = set()
    for length in range(20_000, len(whole), 20_011):
        path.write_bytes(whole[:length])
        found, losses = _read(path)
        assert {each[2] for each in found} <= datas
        assert "ends_early" in {str(each.cause) for each in losses}
        path_alone = tmp_path / "alone.db3"
        path_alone.write_bytes(path.read_bytes())
        if _can_be_opened(path_alone):
            assert set(_read(path_alone)[0]) <= set(found)
            counts.add(len(found))
    assert counts >= {2, 4, 6}


def test_of_a_file_that_ends_early_the_wal_has_the_pages_that_are_missing(tmp_path: Path) -> None:
    """As if it was cut off while they were moved from the one into the other."""
    path = _with_a_wal(tmp_path / "killed")
    with path.open("ab") as file:
        file.write(b"\xff" * 5000)
    found, losses = _read(path)
    assert (len(found), losses) == (16, ())


def test_an_empty_wal_is_no_harm(tmp_path: Path) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3")
    (tmp_path / "a.db3-wal").touch()
    assert _read(path) == (_recorded(bags.SAMPLE), ())


def test_no_room_for_the_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = _killed(tmp_path / "killed", "WAL", is_committed=True)

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(shutil, "copyfile", full)
    refused(path, "No space left", "TMPDIR")


# --- topics


def test_maps_in_another_serialisation_are_named(tmp_path: Path) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3", serialization_format="json")
    with open_source(path) as source:
        assert GRID_TYPE not in {each.msgtype for each in source.info.topics}
        named = {each.topic: (str(each.cause), each.messages) for each in source.losses.all}
        assert named == {
            "/r1/map": ("unknown_type", 3),
            "/r2/map": ("unknown_type", 3),
            "/r1/map_updates": ("unknown_type", 1),
        }
        assert all("'json'; cdr is read" in each.detail for each in source.losses.all)
        assert list(source.messages(["/r1/map"])) == []


def test_other_topics_may_be_serialised_otherwise(tmp_path: Path) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3")
    _execute(path, "UPDATE topics SET serialization_format = 'json' WHERE name = '/chatter'")
    with open_source(path) as source:
        assert len(list(source.messages(["/r1/map"]))) == 3
        assert ("/chatter", "std_msgs/msg/String (json)") in {(t.name, t.msgtype) for t in source.info.topics}
        assert source.losses.all == ()
    refused(path, "/chatter", "'json'")


def test_maps_with_another_definition_are_no_maps(tmp_path: Path) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3")
    _execute(
        path,
        "UPDATE message_definitions SET encoded_message_definition = "
        "replace(encoded_message_definition, 'uint32 width', 'uint64 width') "
        "WHERE topic_type = 'nav_msgs/msg/OccupancyGrid'",
    )
    with open_source(path) as source:
        assert GRID_TYPE not in {each.msgtype for each in source.info.topics}
        assert [(str(each.cause), each.topic, each.messages) for each in source.losses.all] == [
            ("unknown_type", "/r1/map", 3),
            ("unknown_type", "/r2/map", 3),
        ]
        assert "width" in source.losses.all[0].detail


def test_messages_of_a_topic_that_is_not_there(tmp_path: Path) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3")
    _execute(path, "DELETE FROM topics WHERE name = '/r1/map'")
    found, losses = _read(path)
    assert found == [each for each in _recorded(bags.SAMPLE) if each[0] != "/r1/map"]
    assert [(str(each.cause), each.messages) for each in losses] == [("unknown_type", 3)]


def test_database_that_is_no_bag(tmp_path: Path) -> None:
    path = tmp_path / "a.db3"
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE topics (id INTEGER)")
        database.commit()
    refused(path, "no ROS 2 bag", "'messages'")


def _execute(path: Path, statement: str) -> None:
    with closing(sqlite3.connect(path)) as database:
        database.execute(statement)
        database.commit()


# --- files that end early


def _last_bytes(whole: bytes) -> dict[bytes, int]:
    """Return where the page ends that has the last bytes of each message, told by the bytes themselves."""
    page_bytes = int.from_bytes(whole[16:18], "big")
    ends = {}
    for _, _, data in _recorded(bags.SAMPLE):
        pieces = [data[start : start + 24] for start in range(0, len(data) - 24, 200)] + [data[-24:]]
        # of repeated text the first place would be found, whatever piece it is
        places = [whole.index(piece) for piece in pieces if whole.count(piece) == 1]
        ends[data] = (max(places) // page_bytes + 1) * page_bytes if places else len(whole)
    return ends


def test_of_a_truncated_file_every_message_is_read_whose_pages_are_there(tmp_path: Path) -> None:
    messages = [each for each in bags.SAMPLE if each.topic != "/chatter"]
    whole = bags.write_bare_db3(tmp_path / "a.db3", messages).read_bytes()
    ends = {data: end for data, end in _last_bytes(whole).items() if data in {bags.as_cdr(each) for each in messages}}
    (tmp_path / "cut").mkdir()
    path = tmp_path / "cut" / "cut.db3"
    counts = set()
    for length in [*range(1, 200, 13), *range(200, len(whole), 1023), len(whole) - 1]:
        path.write_bytes(whole[:length])
        if not _can_be_opened(path):
            refused(path)
            assert not any(end <= length for end in ends.values())
            continue
        found, losses = _read(path)
        assert found == [each for each in _recorded(messages) if ends[each[2]] <= length]
        assert [(str(each.cause), each.place) for each in losses] == [("ends_early", f"byte {length}")]
        assert losses[0].messages in {None, len(messages) - len(found)}
        counts.add(len(found))
    # the smallest message lies in one page with another's end
    assert counts == set(range(len(messages))) - {3}


def test_of_a_long_truncated_file_rows_are_found_though_what_points_to_their_pages_is_lost(tmp_path: Path) -> None:
    """Pages that point to others are written late: of so many rows there are two levels of them."""
    small = [bags.Recorded("/chatter", bags.TEXT_TYPE, bags.START + each, {"data": "x" * 700}) for each in range(4000)]
    whole = bags.write_bare_db3(tmp_path / "a.db3", small).read_bytes()
    (tmp_path / "cut").mkdir()
    path = tmp_path / "cut" / "cut.db3"
    path.write_bytes(whole[: len(whole) // 2])
    found, losses = _read(path)
    assert [each[1] - bags.START for each in found] == list(range(len(found)))
    assert 1900 < len(found) < 2100
    assert [str(each.cause) for each in losses] == ["ends_early"]


def _can_be_opened(path: Path) -> bool:
    try:
        open_source(path).close()
    except InputError:
        return False
    return True


# --- damaged files


def test_overwritten_pages_are_left_out_and_named(tmp_path: Path) -> None:
    whole = bags.write_bare_db3(tmp_path / "whole.db3").read_bytes()
    recorded = _recorded(bags.SAMPLE)
    (tmp_path / "broken").mkdir()
    path = tmp_path / "broken" / "broken.db3"
    read, refusals = 0, 0
    for page in range(1, len(whole) // 4096):
        for filling in (b"\xff", b"\x00"):
            path.write_bytes(whole[: page * 4096] + filling * 4096 + whole[(page + 1) * 4096 :])
            if not _can_be_opened(path):
                refused(path, "none of this SQLite file")
                refusals += 1
                continue
            found, losses = _read(path)
            read += 1
            # What is in the middle of a message nothing protects, nor its last page.
            sound = [each for each in found if each in recorded]
            changed = [each for each in found if each not in recorded]
            assert len(changed) <= 1
            assert all(each[:2] in {known[:2] for known in recorded} for each in changed)
            if len(sound) + len(changed) < len(recorded):
                assert losses
    assert read > 20
    assert refusals < 8


def test_damaged_pages(tmp_path: Path) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3")
    data = bytearray(path.read_bytes())
    data[4096 : len(data)] = b"\xff" * (len(data) - 4096)
    path.write_bytes(data)
    refused(path, "none of this SQLite file", "copy it again")


@pytest.mark.parametrize("change", ["removed", "added"])
def test_bytes_that_are_removed_or_added_displace_all_behind_them(tmp_path: Path, change: str) -> None:
    """As by a transfer that converts line endings. The row that it happens in is not sound either."""
    messages = [bags.recorded_map("/r1/map", bags.START + each, seed=each, rows=300) for each in range(8)]
    whole = bags.write_bare_db3(tmp_path / "a.db3", messages).read_bytes()
    recorded = _recorded(messages)
    (tmp_path / "broken").mkdir()
    path = tmp_path / "broken" / "broken.db3"
    counts = set()
    for at in range(30_000, len(whole) - 5000, 3001):
        path.write_bytes(whole[:at] + (whole[at + 1 :] if change == "removed" else b"\r" + whole[at:]))
        found, losses = _read(path)
        assert [each for each in found if each not in recorded] == []
        assert len(found) < len(recorded)
        assert losses != ()
        counts.add(len(found))
    assert counts >= {0, 3, 5, 7}


@pytest.mark.parametrize("rows", [340, 400, 480, 540])
@pytest.mark.parametrize("change", ["removed", "two removed", "doubled", "zeros added"])
def test_whole_pages_that_are_missing_or_too_many_cost_no_more_than_what_is_around_them(
    tmp_path: Path, change: str, rows: int
) -> None:
    """The pages behind them say themselves what their numbers are, which are those that others know them by."""
    messages = [bags.recorded_map("/r1/map", bags.START + each, seed=each, rows=rows) for each in range(8)]
    whole = bags.write_bare_db3(tmp_path / "a.db3", messages).read_bytes()
    recorded = _recorded(messages)
    (tmp_path / "broken").mkdir()
    path = tmp_path / "broken" / "broken.db3"
    found_behind = 0
    for at in range(4096 * 5, len(whole), 4096):
        after = {"removed": at + 4096, "two removed": at + 8192, "doubled": at - 4096, "zeros added": at}[change]
        path.write_bytes(whole[:at] + bytes(4096 if change == "zeros added" else 0) + whole[after:])
        if not _can_be_opened(path):
            continue
        found, losses = _read(path)
        assert set(found) <= set(recorded)
        assert losses != ()
        found_behind += len(found) > at // (rows * 60) and recorded[-2] in found
    assert found_behind > len(whole) // 4096 // 2


@pytest.mark.parametrize("pages", [(2 << 24) - 2, (1 << 32) - 1])
def test_a_number_of_pages_that_cannot_be_takes_no_memory(tmp_path: Path, pages: int) -> None:
    """The last page agrees with it, so that it looks displaced by that many."""
    messages = [bags.recorded_map("/r1/map", bags.START + each, seed=each, rows=400) for each in range(4)]
    path = bags.write_bare_db3(tmp_path / "a.db3", messages)
    data = bytearray(path.read_bytes())
    data[28:32] = pages.to_bytes(4, "big")
    data[-8192:-8188] = pages.to_bytes(4, "big")
    data[-4096:-4092] = bytes(4)
    path.write_bytes(data)
    resource = pytest.importorskip("resource")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    found, losses = _read(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000
    assert set(found) < set(_recorded(messages))
    assert losses != ()


def test_pages_that_are_missing_at_two_places(tmp_path: Path) -> None:
    messages = [bags.recorded_map("/r1/map", bags.START + each, seed=each, rows=400) for each in range(12)]
    whole = bags.write_bare_db3(tmp_path / "a.db3", messages).read_bytes()
    (tmp_path / "broken").mkdir()
    path = tmp_path / "broken" / "broken.db3"
    counts = set()
    for first in range(6, 60, 5):
        for second in range(first + 1, len(whole) // 4096, 7):
            pages = [whole[start : start + 4096] for start in range(0, len(whole), 4096)]
            del pages[second], pages[first]
            path.write_bytes(b"".join(pages))
            if _can_be_opened(path):
                found, losses = _read(path)
                assert set(found) <= set(_recorded(messages))
                assert losses != ()
                counts.add(len(found))
    assert max(counts) > 9


def test_what_was_written_behind_the_end_by_a_change_that_was_not_finished(tmp_path: Path) -> None:
    """As by a recorder that keeps its journal in memory and is killed."""
    path = _killed(tmp_path / "killed", "MEMORY", is_committed=False)
    assert not path.with_name("killed.db3-journal").exists()
    found, _ = _read(path)
    assert set(found) <= set(_twice())
    assert len(found) >= len(bags.SAMPLE) - 1


def test_a_row_without_bytes_is_named(tmp_path: Path) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3")
    _execute(path, "UPDATE messages SET data = 'text' WHERE id = 2")
    found, losses = _read(path)
    missing = bags.SAMPLE[1]
    assert len(found) == len(bags.SAMPLE) - 1
    assert missing.log_time_ns in {each.log_time_ns for each in bags.SAMPLE}
    assert [(str(each.cause), each.place, each.topic, each.messages) for each in losses] == [
        ("damaged", "message 2", missing.topic, 1)
    ]


def test_the_chain_of_a_row_that_leads_into_another_row_is_not_followed(tmp_path: Path) -> None:
    """SQLite would return the bytes of the other one without a word; here, where the file ends early, nothing does."""
    messages = [bags.recorded_map(f"/r{each}/map", bags.START + each, seed=each, rows=400) for each in range(3)]
    whole = bytearray(bags.write_bare_db3(tmp_path / "a.db3", messages).read_bytes())
    places = [_page_of(whole, bags.as_cdr(each)) for each in messages]
    pointer = whole[places[0] : places[0] + 4]
    assert int.from_bytes(pointer, "big") * 4096 == places[0] + 2 * 4096 or pointer
    whole[places[1] : places[1] + 4] = pointer
    (tmp_path / "cut").mkdir()
    path = tmp_path / "cut" / "cut.db3"
    path.write_bytes(whole[:-4096])
    found, losses = _read(path)
    assert found == []
    assert [str(each.cause) for each in losses] == ["damaged"]


def _page_of(whole: bytes, data: bytes) -> int:
    """Return where an overflow page from the middle of a message begins."""
    middle = len(data) // 2
    return whole.index(data[middle : middle + 32]) // 4096 * 4096


# --- whole files


@pytest.mark.parametrize("compression", ["none", "message"])
@pytest.mark.parametrize("is_cut", [False, True], ids=["whole", "cut off"])
def test_a_message_that_is_larger_than_is_read_is_named(tmp_path: Path, compression: str, is_cut: bool) -> None:
    messages = [bags.recorded_map("/r1/map", bags.START + number, seed=number) for number in range(6)]
    messages[2] = bags.recorded_map("/r1/map", bags.START + 2, seed=2, rows=400)
    path = bags.write_bare_db3(tmp_path / "a.db3", messages, compression=compression)
    if is_cut:
        path.write_bytes(path.read_bytes()[:-100])
    with open_source(path, most_bytes=10_000) as source:
        found = [each.log_time_ns - bags.START for each in source.messages(["/r1/map"])]
        losses = [each for each in source.losses.all if each.cause == "over_memory"]
    assert 2 not in found
    assert {0, 1, 3} < set(found)
    (loss,) = losses
    assert (loss.messages, loss.topic, loss.place) == (1, "/r1/map", "message 3")
    assert loss.detail.startswith("it has more than 10000 bytes")


def test_without_an_index_on_time(tmp_path: Path) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3")
    with closing(sqlite3.connect(path)) as database:
        database.execute("DROP INDEX timestamp_idx")
        database.commit()
    topics = {each.topic for each in bags.SAMPLE}
    expected = [(each.topic, each.log_time_ns) for each in bags.in_order(bags.SAMPLE, topics)]
    with open_source(path) as source:
        assert [(each.topic, each.log_time_ns) for each in source.messages(topics)] == expected


@pytest.mark.parametrize("bit", [2, 20, 43])
def test_what_the_index_on_time_says_changes_nothing(tmp_path: Path, bit: int) -> None:
    """Nothing protects it: with another time in it a message would come late, or not be there."""
    messages = [bags.recorded_map("/r1/map", bags.START + each * bags.SECOND, seed=each) for each in range(6)]
    path = bags.write_bare_db3(tmp_path / "a.db3", messages)
    data = bytearray(path.read_bytes())
    (entry,) = _index_entries(data, messages[2].log_time_ns)
    data[entry + 7 - bit // 8] ^= 1 << bit % 8
    path.write_bytes(data)
    assert _read(path) == (_recorded(messages), ())


def _index_entries(whole: bytes, log_time_ns: int) -> list[int]:
    """Return where a time is in pages of an index."""
    time = log_time_ns.to_bytes(8, "big")
    starts = [start for start in range(0, len(whole), 4096) if whole[start] == 0x0A]
    return [start + at for start in starts if (at := whole[start : start + 4096].find(time)) >= 0]


@pytest.mark.parametrize("key", ["1", "NULL"])
def test_messages_of_which_ids_do_not_tell_them_apart(tmp_path: Path, key: str) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3")
    _execute(path, "ALTER TABLE messages RENAME TO before")
    _execute(path, "CREATE TABLE messages (id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB)")
    _execute(path, "INSERT INTO messages SELECT KEY, topic_id, timestamp, data FROM before".replace("KEY", key))
    assert _read(path) == (_recorded(bags.SAMPLE), ())
    _execute(path, "UPDATE messages SET data = 'text' WHERE topic_id = 1")
    losses = _read(path)[1]
    assert sum(each.messages or 0 for each in losses) == len(losses) == 3


def test_messages_that_are_computed_when_they_are_read_take_no_more_than_the_file(tmp_path: Path) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3")
    _execute(path, "ALTER TABLE messages RENAME TO before")
    _execute(
        path,
        "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, "
        "data BLOB AS (CAST(hex(zeroblob(200000000)) AS BLOB)))",
    )
    _execute(path, "INSERT INTO messages (topic_id, timestamp) SELECT topic_id, timestamp FROM before")
    resource = pytest.importorskip("resource")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    found, losses = _read(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000
    assert found == []
    assert {str(each.cause) for each in losses} == {"damaged"}
    assert "too big" in losses[0].detail


def test_database_without_messages(tmp_path: Path) -> None:
    with open_source(bags.write_bare_db3(tmp_path / "a.db3", [])) as source:
        assert (source.info.start_ns, source.info.topics) == (None, ())


# --- the layout of a row


def test_values_of_the_beginning_of_a_record() -> None:
    # kinds: none, a number of 1 byte, one of 8 bytes
    record = bytes([4, 0, 1, 6]) + b"\x07" + (9).to_bytes(8, "big")
    layout = layout_of(record[:9], 13)
    assert layout.kinds == (0, 1, 6)
    assert (layout.value(record[:9], 0), layout.value(record[:9], 1)) == (None, 7)
    assert layout.value(record, 2) == 9
    for index in (2, 3):
        with pytest.raises(BadPageError):
            layout.value(record[:9], index)


@pytest.mark.parametrize(
    ("record", "size"),
    [
        (bytes([4, 0, 1, 6]), 12),  # values of another length
        (bytes([0, 0, 1, 6]), 13),  # no header
        (bytes([9, 0, 1, 6]), 13),  # a header that is not all there
        (bytes([3, 0, 0x81, 6]), 3),  # one that ends within a number
        (bytes([3, 0, 10]), 3),  # a value of no kind
    ],
)
def test_what_is_no_record(record: bytes, size: int) -> None:
    with pytest.raises(BadPageError):
        layout_of(record, size)
