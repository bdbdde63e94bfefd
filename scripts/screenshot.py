"""Take a picture of what the Rerun viewer shows of a recording, without a screen.

    python scripts/screenshot.py RUN.rrd OUT.png [--time-fraction 0.5] [--size 1400x900]

Where there is no graphics card, a software renderer is needed, on Debian and Ubuntu:
``apt-get install --no-install-recommends mesa-vulkan-drivers libvulkan1``.
"""

from __future__ import annotations

import argparse
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from rerun.experimental import ViewerClient

from replay.viewer import environment, live_address, program

TIMELINE = "log_time"
_START_S = 30.0
_NOTICES_S = 5.0
_SETTLE_S = 1.5


@contextmanager
def viewer(size: str = "1400x900") -> Iterator[ViewerClient]:
    """Run a viewer without a window and yield a connection to it.

    Raises
    ------
    RuntimeError
        If it does not start, which is so where nothing can render.
    """
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    options = ["--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", size]
    with tempfile.TemporaryDirectory() as scratch, (Path(scratch) / "log").open("w+b") as log:
        process = subprocess.Popen(
            [str(program()), *options], stdout=log, stderr=subprocess.STDOUT, env=private_environment(scratch)
        )
        try:
            yield _connected(process, port, Path(log.name))
        finally:
            process.terminate()
            process.wait()


def private_environment(scratch: str) -> dict[str, str]:
    """Return the environment in which the viewer tells nobody that it runs, and leaves nothing behind."""
    folders = ("HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_CACHE_HOME", "XDG_RUNTIME_DIR")
    return {**environment(), **dict.fromkeys(folders, scratch)}


def show(client: ViewerClient, recording: Path, time_fraction: float | None = None) -> None:
    """Open a recording and wait until all of it is there.

    Parameters
    ----------
    time_fraction
        Which time is shown, from 0 (the start) to 1 (the end); None for what the recording opens on.
    """
    client.open(str(recording.resolve()))
    while (state := client.get_state()).loading or not state.recordings:
        time.sleep(0.1)
    if time_fraction is not None:
        timeline = next(item for item in state.recordings[0].timelines if item.name == TIMELINE)
        if timeline.start is not None and timeline.end is not None:
            stamp_ns = timeline.start + int((timeline.end - timeline.start) * time_fraction)
            client.set_time(TIMELINE, timestamp=_timestamp(stamp_ns), play_state="paused")
    time.sleep(_SETTLE_S)


def show_tab(client: ViewerClient, name: str) -> None:
    """Bring a tab to the front, and those within tabs that hold it.

    Raises
    ------
    LookupError
        If there is no tab of this name.
    """
    found = client.get_blueprint()
    layout = found.blueprint
    parents = {child: path for path, parts in layout.items() for child in _contents(parts)}
    for path, parts in layout.items():
        names = {own.get("display_name") for own in parts.values()}
        if name not in names or path not in parents:
            continue
        while path in parents:
            container = layout[parents[path]]["ContainerBlueprint"]
            if container["container_kind"] == "Tabs":
                container["active_tab"] = path
            path = parents[path]  # noqa: PLW2901
        client.set_blueprint(layout, store_id=found.store_id)
        time.sleep(_SETTLE_S)
        return
    raise LookupError(f"there is no tab {name!r}")


def _contents(parts: dict[str, dict[str, object]]) -> list[str]:
    """Return what a container holds; of one thing alone, it stands there by itself."""
    held = parts.get("ContainerBlueprint", {}).get("contents", [])
    found = [held] if isinstance(held, str) else held if isinstance(held, list) else []
    return [f"/{str(each).lstrip('/')}" for each in found]


def complaints(client: ViewerClient) -> list[str]:
    """Return the warnings and errors of the views that are shown."""
    return [
        f"{view.name}: {report.severity}: {report.summary}"
        for view in client.get_state().views
        for report in view.reports
    ]


def main() -> int:
    """Take the picture that the command line asks for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("recording", type=Path, metavar="RUN.rrd")
    parser.add_argument("picture", type=Path, metavar="OUT.png")
    parser.add_argument("--time-fraction", type=float, help="0 for the start to 1 for the end; default: as it opens")
    parser.add_argument("--tab", help="which tab is shown (default: the one that it opens on)")
    parser.add_argument("--size", default="1400x900", help="of the window (default: %(default)s)")
    arguments = parser.parse_args()
    if not arguments.recording.is_file():
        parser.error(f"{arguments.recording}: there is no such file")
    with viewer(arguments.size) as client:
        show(client, arguments.recording, arguments.time_fraction)
        if arguments.tab:
            show_tab(client, arguments.tab)
        time.sleep(_NOTICES_S)  # until the viewer's own notices are gone
        client.save_screenshot(str(arguments.picture.resolve()))
        found = complaints(client)
    for complaint in found:
        print(complaint, file=sys.stderr)
    return 1 if found else 0


def _connected(process: subprocess.Popen[bytes], port: int, log: Path) -> ViewerClient:
    deadline = time.monotonic() + _START_S
    while process.poll() is None and time.monotonic() < deadline:
        try:
            client = ViewerClient.connect(live_address(port))
            client.get_state()
        except Exception:  # noqa: BLE001 - whatever the library says while nobody listens yet
            time.sleep(0.1)
        else:
            return client
    raise RuntimeError(f"the viewer does not start: {log.read_text(errors='replace')[-2000:]}")


def _timestamp(stamp_ns: int) -> np.datetime64:
    return np.datetime64(stamp_ns, "ns")


if __name__ == "__main__":
    sys.exit(main())
