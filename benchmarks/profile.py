"""Where the time of a replay goes: ``python -m benchmarks.profile RECORDING --output flame.svg``.

`py-spy` samples the program a hundred times a second and writes the flame graph, which any browser shows. The table of
parts is of the same samples: each belongs to the innermost function on its stack that `PARTS` knows, but all below one
of a part in `WHOLE` to that. Work of libraries goes to whoever called them. Samples are wall time while Python
or what it called was running, in one thread (``--jobs 1``).
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import sysconfig
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree as ET

from benchmarks.flags import new_file

_SCRIPT = "import sys; from replay.cli import main; sys.exit(main())"
_SVG, _INFERNO = "{http://www.w3.org/2000/svg}", "{http://github.com/jonhoo/inferno}"
REST, PREPARING, RERUN, IMAGES = "rest", "preparing maps", "writing .rrd", "images"
WHOLE = frozenset({PREPARING, RERUN, IMAGES})
PARTS: Mapping[str, str] = {
    r"<frozen importlib": "starting",
    r"\bcount \(replay/feeds\.py": "digests of the input",
    r"\(replay/sources/": "reading",
    r"\(replay/(codec/de|assemble|arrivals|feeds|message_times|timeline)": "decoding, putting in order",
    r"\bprepare \(mapmerge/|\(mapmerge/(prepare|walls)\.py": PREPARING,
    r"\(mapmerge/(match/|pairs|jump|watch|align|polish|score|verify|graph|unite)": "matching",
    r"\(mapmerge/(fuse|odds|warp)": "fusing",
    r"\(mapmerge/merger": "rest of the merger",
    r"\(mapmerge/outcome|\(replay/report|\(json/": "report",
    r"\(replay/gallery|\(mapmerge/render": IMAGES,
    r"\(replay/sinks/rerun": RERUN,
    r"\(replay/(sinks/|codec/en)": "writing",
}


@dataclass(frozen=True, slots=True)
class Frame:
    """One box of a flame graph: a function, and the samples in which it was on the stack at this depth.

    Parameters
    ----------
    name
        As ``function (file:line)``.
    depth
        Grows from the program to what it calls, in any unit.
    first, count
        Its samples lie side by side.
    """

    name: str
    depth: float
    first: int
    count: int


def frames(flame_graph: Path) -> Iterator[Frame]:
    """Yield the boxes of a flame graph as `py-spy` writes it, with the callers on top."""
    for group in ET.parse(flame_graph).getroot().iter(f"{_SVG}g"):  # noqa: S314 - a file of our own
        title, box = group.find(f"{_SVG}title"), group.find(f"{_SVG}rect")
        if title is None or box is None or title.text is None:
            continue
        name = re.sub(r" \(\d[\d,]* samples, [\d.]+%\)$", "", title.text)
        first, count = (int(box.attrib[f"{_INFERNO}{key}"]) for key in ("x", "w"))
        yield Frame(name, float(box.attrib["y"]), first, count)


def shares(boxes: Sequence[Frame]) -> dict[str, float]:
    """Return the share of the samples that each part has, the largest first."""
    parts = [REST] * max(box.first + box.count for box in boxes)
    for box in sorted(boxes, key=lambda item: item.depth):
        part = part_of(box.name)
        for sample in range(box.first, box.first + box.count):
            if part is not None and parts[sample] not in WHOLE:
                parts[sample] = part
    return {part: count / len(parts) for part, count in Counter(parts).most_common()}


def part_of(name: str) -> str | None:
    """Return the part that a function belongs to; None if it works for whoever called it."""
    return next((part for pattern, part in PARTS.items() if re.search(pattern, name)), None)


def sample(recording: Path, flame_graph: Path, flags: Sequence[str]) -> None:
    """Replay a recording with these flags and write the flame graph.

    Raises
    ------
    RuntimeError
        If the replay, or the sampling of it, fails.
    """
    program = Path(sysconfig.get_path("scripts")) / "py-spy"
    with TemporaryDirectory() as folder:
        replay = [
            sys.executable,
            "-c",
            _SCRIPT,
            "merge",
            str(recording),
            "-o",
            f"{folder}/out.mcap",
            "--jobs",
            "1",
            *flags,
        ]
        command = [str(program), "record", "--format", "flamegraph", "--output", str(flame_graph), "--", *replay]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if not Path(folder, "out.mcap").exists() or not flame_graph.exists():
            said = done.stderr.strip().splitlines() or ["it said nothing"]
            errors = [line for line in said if "error" in line.lower()]
            raise RuntimeError(f"{recording} cannot be sampled: {(errors or said)[-1].strip()}")


def lines(found: Mapping[str, float]) -> list[str]:
    """Return the table of parts."""
    return [f"{part:<28}{share:>7.1%}" for part, share in found.items()]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(
        description="Write a flame graph of a replay, and print what share of the time each part takes.",
        epilog="All other flags are those of replay merge, such as --no-rrd --images none.",
    )
    parser.add_argument("recording", type=Path, metavar="RUN")
    parser.add_argument("--output", type=new_file, required=True, help="the flame graph, an .svg")
    options, flags = parser.parse_known_args(arguments)
    try:
        sample(options.recording, options.output, flags)
    except RuntimeError as error:
        parser.error(str(error))
    print("\n".join(lines(shares(list(frames(options.output))))))


if __name__ == "__main__":
    main()
