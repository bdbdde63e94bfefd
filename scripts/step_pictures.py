"""Write the last picture of each step of the method, as a run's MCAP holds them, as PNG files.

python scripts/step_pictures.py OUT.mcap ROBOT FOLDER [--prefix NAME]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np
from rosbags.highlevel import AnyReader, AnyReaderError

from replay.topics import IMAGE_TOPICS


def main() -> int:
    """Write the pictures of one robot."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("mcap", type=Path, metavar="OUT.mcap")
    parser.add_argument("robot")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--prefix", default="", help="what the files' names begin with")
    arguments = parser.parse_args()
    if not arguments.mcap.exists():
        parser.error(f"{arguments.mcap}: it does not exist")
    try:
        found = pictures(arguments.mcap, f"{IMAGE_TOPICS}/{arguments.robot}/")
        arguments.folder.mkdir(parents=True, exist_ok=True)
    except (AnyReaderError, OSError) as error:
        parser.error(f"{arguments.mcap}: {' '.join(str(error).split())}")
    if not found:
        parser.error(f"{arguments.mcap}: there are no pictures of {arguments.robot}")
    for step, pixels in found.items():
        path = arguments.folder / f"{arguments.prefix}{step}.png"
        cv2.imwrite(str(path), cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_PNG_COMPRESSION, 9])
    return 0


def pictures(mcap: Path, topics: str) -> dict[str, np.ndarray]:
    """Return the last picture of each topic below some name, by the rest of its name."""
    last: dict[str, np.ndarray] = {}
    with AnyReader([mcap]) as reader:
        wanted = [item for item in reader.connections if item.topic.startswith(topics)]
        for connection, _, data in reader.messages(wanted) if wanted else ():  # of no connections it reads all
            message = reader.deserialize(data, connection.msgtype)
            pixels = np.asarray(message.data).reshape(message.height, message.width, 3)
            last[connection.topic.removeprefix(topics)] = pixels
    return last


if __name__ == "__main__":
    sys.exit(main())
