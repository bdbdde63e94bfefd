from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

from replay.sources import open_source
from tests import bags
from tests.replay.test_sources_open import refused


def test_messages_left_in_a_wal_are_not_lost(tmp_path: Path) -> None:
    whole = bags.write_bare_db3(tmp_path / "a.db3")
    # As a recorder leaves its files when it is killed: the last message is in the -wal only.
    with closing(sqlite3.connect(whole)) as database:
        database.execute("PRAGMA journal_mode=WAL")
        database.execute("INSERT INTO messages (topic_id, timestamp, data) SELECT topic_id, 1, data FROM messages")
        database.commit()
        crashed = tmp_path / "crashed.db3"
        for suffix in ("", "-wal"):
            shutil.copy(f"{whole}{suffix}", f"{crashed}{suffix}")
    refused(crashed, "crashed.db3-wal", "PRAGMA wal_checkpoint(TRUNCATE)")


def test_a_wal_is_looked_for_beside_the_file_that_a_link_names(tmp_path: Path) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3")
    (tmp_path / "a.db3-wal").write_bytes(b"rows")
    (tmp_path / "sub").mkdir()
    link = tmp_path / "sub" / "link.db3"
    link.symlink_to(path)
    refused(link, "a.db3-wal")


def test_an_empty_wal_is_no_harm(tmp_path: Path) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3")
    (tmp_path / "a.db3-wal").touch()
    with open_source(path) as source:
        assert len(list(source.messages(["/r1/map"]))) == 3


def test_another_serialisation(tmp_path: Path) -> None:
    refused(bags.write_bare_db3(tmp_path / "a.db3", serialization_format="json"), "'json'", "cdr", "ros2 bag convert")


def test_other_topics_may_be_serialised_otherwise(tmp_path: Path) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3")
    with closing(sqlite3.connect(path)) as database:
        database.execute("UPDATE topics SET serialization_format = 'json' WHERE name = '/chatter'")
        database.commit()
    with open_source(path) as source:
        assert len(list(source.messages(["/r1/map"]))) == 3
        assert ("/chatter", "std_msgs/msg/String (json)") in {(t.name, t.msgtype) for t in source.info.topics}
    refused(path, "/chatter", "'json'")


def test_database_that_is_no_bag(tmp_path: Path) -> None:
    path = tmp_path / "a.db3"
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE topics (id INTEGER)")
        database.commit()
    refused(path, "no ROS 2 bag", "'messages'")


def test_truncated_says_where(tmp_path: Path) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3")
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    refused(path, f"ends early at byte {len(data) // 2}", f"{len(data)} bytes")


def test_every_truncation_is_one_line(tmp_path: Path) -> None:
    data = bags.write_bare_db3(tmp_path / "whole.db3").read_bytes()
    for length in [*range(1, 200, 13), *range(200, len(data), 4099)]:
        path = tmp_path / "cut.db3"
        path.write_bytes(data[:length])
        refused(path)


def test_damaged_pages(tmp_path: Path) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3")
    data = bytearray(path.read_bytes())
    data[4096 : len(data)] = b"\xff" * (len(data) - 4096)
    path.write_bytes(data)
    refused(path, "cannot be read")


def test_without_an_index_on_time(tmp_path: Path) -> None:
    path = bags.write_bare_db3(tmp_path / "a.db3")
    with closing(sqlite3.connect(path)) as database:
        database.execute("DROP INDEX timestamp_idx")
        database.commit()
    topics = {each.topic for each in bags.SAMPLE}
    expected = [(each.topic, each.log_time_ns) for each in bags.in_order(bags.SAMPLE, topics)]
    with open_source(path) as source:
        assert [(each.topic, each.log_time_ns) for each in source.messages(topics)] == expected


def test_database_without_messages(tmp_path: Path) -> None:
    with open_source(bags.write_bare_db3(tmp_path / "a.db3", [])) as source:
        assert (source.info.start_ns, source.info.topics) == (None, ())
