"""Files beside recordings that are made to do harm: each is refused in one line, before it costs much."""

from __future__ import annotations

import shutil
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from replay.sources import open_source, yaml_text
from replay.sources.map_server import image_file, saved_map
from replay.sources.map_server.image_file import header_of
from tests.bags import SAMPLE, write_rosbag2, write_saved_map
from tests.replay.test_sources_open import refused

BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{level}: &a{level} [{', '.join([f'*a{level - 1}'] * 9)}]\n" for level in range(1, 30)
)
DEEP = "a: " + "[" * 5000 + "]" * 5000 + "\n"
HOSTILE_YAML = {
    BOMB + "image: *a29\n": "refers to another value",
    "image: &a [*a]\n": "refers to another value",
    "base: &b {image: x}\n<<: *b\n": "refers to another value",
    DEEP: "nested more than 40 deep",
    "a:\n" + "".join(f"{' ' * level}a:\n" for level in range(1, 200)): "nested more than 40 deep",
    "image: !!python/object/apply:os.system [echo]\n": "cannot be read",
    "image: !!python/name:os.system\n": "cannot be read",
    "image: a\nimage: b\n": "cannot be read",
    "image: \x00\n": "cannot be read",
}
WALL = np.zeros((30, 40), np.uint8)


@pytest.mark.parametrize(("text", "found"), HOSTILE_YAML.items())
def test_yaml(tmp_path: Path, text: str, found: str) -> None:
    path = tmp_path / "map.yaml"
    path.write_text(text)
    refused(path, path.name, found)


@pytest.mark.parametrize("text", HOSTILE_YAML)
def test_metadata_that_cannot_be_used_is_as_good_as_none(tmp_path: Path, text: str) -> None:
    bag = write_rosbag2(tmp_path / "bag", SAMPLE)
    with open_source(bag) as source:
        topics = source.info.topics
    (bag / "metadata.yaml").write_text(f"rosbag2_bagfile_information:\n  relative_file_paths: [a.db3]\n{text}")
    with open_source(bag) as source:
        assert source.info.topics == topics


def test_yaml_of_any_size(tmp_path: Path) -> None:
    path = tmp_path / "map.yaml"
    with path.open("wb") as file:
        file.write(b"image: x\n")
        file.truncate(yaml_text.MOST_BYTES + 1)
    refused(path, f"{yaml_text.MOST_BYTES} bytes at most")


@pytest.mark.parametrize(
    "listed",
    [
        "../secret.db3",
        "../../secret.db3",
        "{folder}/secret.db3",
        "..\\secret.db3",
        "C:\\secret.db3",
        "\\\\host\\share\\secret.db3",
    ],
)
def test_a_part_is_never_read_from_outside_its_folder(tmp_path: Path, listed: str) -> None:
    bag = write_rosbag2(tmp_path / "bag", SAMPLE)
    (part,) = bag.glob("*.db3")
    shutil.copy(part, tmp_path / "secret.db3")
    metadata = bag / "metadata.yaml"
    text = metadata.read_text().replace(part.name, listed.format(folder=tmp_path))
    assert "secret.db3" in text
    metadata.write_text(text)
    refused(bag, "secret.db3", "missing")
    # The name alone counts, as of bags that were recorded elsewhere.
    part.rename(bag / "secret.db3")
    with open_source(bag) as source:
        assert source.info.topics


@pytest.mark.parametrize("listed", ["..", ".", "/", "''", "bag/..", "{}", "[[]]"])
def test_a_part_that_is_no_file(tmp_path: Path, listed: str) -> None:
    bag = write_rosbag2(tmp_path / "bag", SAMPLE)
    (part,) = bag.glob("*.db3")
    metadata = bag / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace(part.name, listed))
    refused(bag, "metadata.yaml")


# --- images


def png(width: int, height: int, pixels: bytes) -> bytes:
    """Return a PNG that says it is so large, whatever pixels it has."""
    parts = [(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)), (b"IDAT", zlib.compress(pixels, 9))]
    chunks = [
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in [*parts, (b"IEND", b"")]
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def bmp(width: int, height: int) -> bytes:
    return b"BM" + struct.pack("<IIIIiiHHIIiiII", 54, 0, 54, 40, width, height, 1, 24, 0, 0, 0, 0, 0, 0)


def saved_with(tmp_path: Path, content: bytes, image: str = "map.pgm") -> Path:
    path = write_saved_map(tmp_path / "map.yaml", WALL, image=image)
    (tmp_path / image).write_bytes(content)
    return path


@pytest.mark.parametrize(
    "content",
    [
        png(100_000, 100_000, bytes(10_000_000)),
        b"P5\n100000 100000\n255\n",
        b"P6 # a comment\n# another\n99999 99999 255\n",
        b"P2\n999999999 999999999\n255\n0 0",
        bmp(100_000, 100_000),
        bmp(2_000_000_000, -2_000_000_000),
    ],
    ids=["png", "pgm", "ppm", "text", "bmp", "bmp upside down"],
)
def test_an_image_of_any_size_is_not_decoded(tmp_path: Path, content: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cv2, "imdecode", None)
    refused(saved_with(tmp_path, content), "pixels; at most", "cut it")


@pytest.mark.parametrize("image", ["map.pgm", "map.png", "map.bmp", "map.ppm"])
@pytest.mark.parametrize("share", [0.6, 0.999])
def test_an_image_that_ends_early_is_refused(
    tmp_path: Path, image: str, share: float, capfd: pytest.CaptureFixture[str]
) -> None:
    path = saved_with(tmp_path, b"", image)
    pixels = np.random.default_rng(1).integers(0, 256, (300, 400, 3)).astype(np.uint8)
    cv2.imwrite(str(tmp_path / image), pixels if image != "map.pgm" else pixels[..., 0])
    content = (tmp_path / image).read_bytes()
    (tmp_path / image).write_bytes(content[: int(len(content) * share)])
    capfd.readouterr()
    refused(path, "ends early", image)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("content", [b"P2\n3 2\n255\n0 0 0 0 0", b"P5\n3 2\n65535\n" + bytes(11), b"P5\n3 2\n255\n"])
def test_an_image_that_promises_more_than_is_there(tmp_path: Path, content: bytes) -> None:
    refused(saved_with(tmp_path, content), "ends early")


def test_a_png_whose_checksum_is_wrong_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = write_saved_map(tmp_path / "map.yaml", WALL, image="map.png")
    content = bytearray((tmp_path / "map.png").read_bytes())
    content[len(content) - 20] ^= 1
    (tmp_path / "map.png").write_bytes(content)
    refused(path, "checksum (CRC)")
    assert capfd.readouterr().err == ""


def test_an_image_file_of_any_size_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(image_file, "MOST_BYTES", 100)
    refused(saved_with(tmp_path, b"P5\n40 30\n255\n" + bytes(1200)), "at most 100 are read")


def test_images_that_are_lossy_are_refused(tmp_path: Path) -> None:
    path = write_saved_map(tmp_path / "map.yaml", WALL, image="map.jpg")
    refused(path, "expected PGM, PPM, PNG or BMP")


@pytest.mark.parametrize("extension", [".pgm", ".ppm", ".png", ".bmp"])
@pytest.mark.parametrize("shape", [(1, 1), (7, 13), (13, 7)])
def test_the_size_of_an_image_is_told_from_its_header(extension: str, shape: tuple[int, ...]) -> None:
    pixels = np.full(shape if extension == ".pgm" else (*shape, 3), 7, np.uint8)
    header = header_of(cv2.imencode(extension, pixels)[1].tobytes())
    assert header is not None
    assert (header.height, header.width, header.missing) == (*shape, "")


@pytest.mark.parametrize(
    ("image", "is_elsewhere"),
    [
        ("\\\\host\\share\\map.pgm", True),
        ("//host/share/map.pgm", True),
        ("\\\\?\\UNC\\host\\share\\map.pgm", True),
        ("C:\\maps\\map.pgm", False),
        ("..\\map.pgm", False),
        ("/maps/map.pgm", False),
        ("map.pgm", False),
    ],
)
def test_paths_by_which_windows_would_ask_another_machine(image: str, is_elsewhere: bool) -> None:
    assert saved_map._names_another_machine(image) == is_elsewhere
