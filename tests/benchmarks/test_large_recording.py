"""The large recordings are what they say, whatever their size, and leave nothing behind."""

from pathlib import Path

import pytest

from benchmarks.large_recording import Large, growing_maps, main
from benchmarks.large_writers import WRITERS
from replay.sources import open_source
from replay.sources.base import GRID_TYPE


@pytest.fixture(scope="module")
def maps(tmp_path_factory):
    return growing_maps(300, tmp_path_factory.mktemp("maps"))


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("kind", ["others", "maps"])
def test_a_large_recording_is_as_large_as_asked_and_in_order(maps, tmp_path, name, kind):
    large = Large(kind, 20 << 20, small=1000)
    path = tmp_path / f"large.{name}"
    WRITERS[name](path, large.messages(maps))
    assert path.stat().st_size == pytest.approx(20 << 20, rel=0.3)
    with open_source(path) as source:
        counts = {item.name: item.message_count for item in source.info.topics}
        topics = [item.name for item in source.info.topics if item.msgtype == GRID_TYPE]
        times = [message.log_time_ns for message in source.messages(topics)]
    assert times == sorted(times)
    assert len(times) == counts["/r1/map"] + counts["/r2/map"] >= len(maps)
    assert (counts.get("/imu", 0) >= 900) == (kind == "others")


def test_what_is_measured_is_printed_and_removed(tmp_path: Path, monkeypatch, capsys):
    monkeypatch.setattr("benchmarks.large_recording.SIDES", {"others": 300, "maps": 300})
    main(["--work", str(tmp_path), "--gib", "0.01", "--small", "100", "--kinds", "others", "--formats", "mcap"])
    said = capsys.readouterr().out.splitlines()
    assert said[0].split()[:2] == ["recording", "size"]
    assert said[1].startswith("others, mcap, whole")
    assert said[2].startswith("others, mcap, cut off")
    assert list(tmp_path.iterdir()) == []
