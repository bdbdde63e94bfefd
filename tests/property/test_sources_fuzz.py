"""Whatever bytes a file holds, it is read, or refused in one line that names it."""

from __future__ import annotations

import tempfile
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from replay.errors import InputError, ReplayError
from replay.options import RunOptions
from replay.pipeline import merge
from replay.runs import RunPath
from replay.sources import open_source
from tests.bags import SAMPLE, write_bare_db3, write_mcap, write_rosbag1

MAGICS = {
    "none": b"",
    "rosbag1": b"#ROSBAG V2.0\n",
    "rosbag1_before_2_0": b"#ROSRECORD V1.2\n",
    "rosbag1_header": b"#ROSBAG V2.0\n\x45\x00\x00\x00\x04\x00\x00\x00op=\x03",
    "mcap": b"\x89MCAP0\r\n",
    "mcap_header": b"\x89MCAP0\r\n\x01\x08\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00",
    "mcap_in_text_mode": b"\x89MCAP0\n",
    "sqlite3": b"SQLite format 3\0",
    "sqlite3_header": b"SQLite format 3\0\x10\x00\x01\x01\x00\x40\x20\x20",
    "zstd": b"\x28\xb5\x2f\xfd",
    "saved_map": b"image: map.pgm\n",
    "image": b"P5 2 2 255\n",
}
METADATA = b"rosbag2_bagfile_information:\n"
WRITERS = {"run.bag": write_rosbag1, "run.mcap": write_mcap, "run.db3": write_bare_db3}

bytes_of_any_kind = st.binary(max_size=3000)
places = st.floats(0.0, 1.0, exclude_max=True)
damages = st.lists(st.tuples(places, st.binary(min_size=1, max_size=8)), min_size=1, max_size=6)


def read_or_refused(path: Path) -> None:
    """Read all that a recording holds; whatever is wrong with it is said in one line that names it."""
    found = refusal(path)
    assert found is None or (len(found.splitlines()) == 1 and path.name in found)


def refusal(path: Path) -> str | None:
    """Read all that a recording holds, and return the error that ends it, if there is one."""
    try:
        with open_source(path) as source:
            topics = source.info.topics
            assert all(topic.message_count >= 0 for topic in topics)
            for raw in source.messages([topic.name for topic in topics]):
                assert isinstance(raw.log_time_ns, int)
                bytes(raw.data)
            assert all(loss.detail for loss in source.losses.all)
    except InputError as error:
        return str(error)
    return None


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Recordings of each format, as bytes."""
    folder = tmp_path_factory.mktemp("written")
    return {name: write(folder / name, SAMPLE).read_bytes() for name, write in WRITERS.items()}


@pytest.mark.parametrize("magic", MAGICS)
@given(rest=bytes_of_any_kind)
def test_any_bytes_after_any_magic(magic, rest):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.any"
        path.write_bytes(MAGICS[magic] + rest)
        read_or_refused(path)


@pytest.mark.parametrize("suffix", [".yaml", ".db3", ".mcap", ".bag"])
@given(content=bytes_of_any_kind)
def test_any_bytes_under_any_name(suffix, content):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"run{suffix}"
        path.write_bytes(content)
        read_or_refused(path)


@given(metadata=bytes_of_any_kind, part=bytes_of_any_kind, magic=st.sampled_from(sorted(MAGICS)))
def test_any_bytes_in_a_folder(metadata, part, magic):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run"
        path.mkdir()
        (path / "metadata.yaml").write_bytes(METADATA + metadata)
        (path / "run.db3").write_bytes(MAGICS[magic] + part)
        read_or_refused(path)


@pytest.mark.parametrize("name", WRITERS)
@given(changes=damages, kept=st.floats(0.0, 1.0))
def test_any_bytes_within_a_recording(name, changes, kept, written):
    content = bytearray(written[name])
    for place, replacement in changes:
        at = int(place * len(content))
        content[at : at + len(replacement)] = replacement
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(content if kept > 0.5 else content[: int(2 * kept * len(content))])
        read_or_refused(path)
        with suppress(ReplayError):
            for _ in merge(RunOptions((RunPath(None, path),), images="none")):
                pass
