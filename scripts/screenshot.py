"""Take a picture of what the Rerun viewer shows of a recording, without a screen.

    python scripts/screenshot.py RUN.rrd OUT.png [--tab Method] [--at 0.5] [--size 1400x900]
    python scripts/screenshot.py RUN.rrd 'RUN_{}.png' --at 0 --at 0.5 --at 1

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
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from itertools import product
from pathlib import Path

import numpy as np
from PIL import Image
from rerun.experimental import ViewerClient

from replay.sinks.rerun_stream import ELAPSED
from replay.viewer import RRD_MAGIC, environment, live_address, program

_START_S = 30.0
_NOTICES_S = 5.0
SETTLE_S = 1.5
"""How long it takes to draw what is shown anew."""
_COLOURS = 256
_BAR_PX = 37


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


def show(client: ViewerClient, recording: Path) -> None:
    """Open a recording and wait until all of it is there."""
    client.open(str(recording.resolve()))
    while (state := client.get_state()).loading or not state.recordings:
        time.sleep(0.1)
    time.sleep(SETTLE_S)


def seek(client: ViewerClient, time_fraction: float) -> None:
    """Show the state at a time, from 0 (the start) to 1 (the end)."""
    timelines = client.get_state().recordings[0].timelines
    timeline = next((item for item in timelines if item.name == ELAPSED), None)
    if timeline is not None and timeline.start is not None and timeline.end is not None:
        since_ns = timeline.start + int((timeline.end - timeline.start) * time_fraction)
        client.set_time(ELAPSED, duration=np.timedelta64(since_ns, "ns"), play_state="paused")
        time.sleep(SETTLE_S)


def tabs(client: ViewerClient) -> list[str]:
    """Return the names of the outermost tabs."""
    layout = client.get_blueprint().blueprint
    held = {child for parts in layout.values() for child in _contents(parts)}
    root = next(path for path, parts in layout.items() if "ContainerBlueprint" in parts and path not in held)
    return [str(layout[child]["ContainerBlueprint"]["display_name"]) for child in _contents(layout[root])]


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
        time.sleep(SETTLE_S)
        return
    raise LookupError(f"there is no tab {name!r}; there are: {', '.join(tabs(client))}")


def _contents(parts: dict[str, dict[str, object]]) -> list[str]:
    """Return what a container holds; of one thing alone, it stands there by itself."""
    held = parts.get("ContainerBlueprint", {}).get("contents", [])
    found = [held] if isinstance(held, str) else held if isinstance(held, list) else []
    return [f"/{str(each).lstrip('/')}" for each in found]


def hide_menu(client: ViewerClient) -> None:
    """Leave out the viewer's own bar, which says how it draws here."""
    found = client.get_blueprint()
    found.blueprint["/top_panel"] = {"PanelBlueprint": {"state": "Hidden"}}
    client.set_blueprint(found.blueprint, store_id=found.store_id)


def complaints(client: ViewerClient) -> list[str]:
    """Return the warnings and errors of the views that are shown."""
    return [
        f"{view.name}: {report.severity}: {report.summary}"
        for view in client.get_state().views
        for report in view.reports
    ]


def main() -> int:
    """Take the pictures that the command line asks for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("recording", type=Path, metavar="RUN.rrd")
    parser.add_argument("picture", type=Path, metavar="OUT.png", help="{} in its name stands for the time, or the tab")
    parser.add_argument("--at", type=float, action="append", help="0 for the start to 1 for the end; may be repeated")
    parser.add_argument("--tab", action="append", help="which tab is shown; may be repeated (default: as it opens)")
    parser.add_argument("--size", default="1400x900", help="of the window (default: %(default)s)")
    arguments = parser.parse_args()
    if not arguments.recording.is_file():
        parser.error(f"{arguments.recording}: there is no such file")
    with arguments.recording.open("rb") as file:
        if file.read(len(RRD_MAGIC)) != RRD_MAGIC:
            parser.error(f"{arguments.recording}: this is no Rerun recording")
    times, names = arguments.at or [None], arguments.tab or [None]
    try:
        found = taken(arguments.recording, arguments.picture, times, names, arguments.size)
    except LookupError as error:
        parser.error(str(error))
    for complaint in found:
        print(complaint, file=sys.stderr)
    return 1 if found else 0


def taken(
    recording: Path, picture: Path, times: Sequence[float | None], names: Sequence[str | None], size: str
) -> list[str]:
    """Take a picture of each tab at each time, and return what views complain of."""
    found: list[str] = []
    with viewer(size) as client:
        show(client, recording)
        hide_menu(client)
        time.sleep(_NOTICES_S)  # until the viewer's own notices are gone
        for name, at in product(names, times):
            if at is not None:
                seek(client, at)
            if name is not None:
                show_tab(client, name)
            of = ["" if name is None else name.lower().replace(" ", "_"), "" if at is None else f"{100 * at:03.0f}"]
            save(client, picture.with_name(picture.name.replace("{}", "_".join(filter(None, of)))))
            found += complaints(client)
    return found


def save(client: ViewerClient, path: Path) -> None:
    """Save what is shown, without the bar that is hidden, in as many colours as it needs: half as large as with all."""
    image = Image.open(BytesIO(client.take_screenshot())).convert("RGB")
    image = image.crop((0, _BAR_PX, *image.size))
    image.quantize(_COLOURS, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).save(path, optimize=True)


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


if __name__ == "__main__":
    sys.exit(main())
