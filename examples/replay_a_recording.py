"""Replay a recording: events as they happen, the report at the end, and the files that `replay merge` writes."""

# %% A run is an iterator over what happens in it. Keywords are called as the settings of a file are.
import sys
import tempfile
from datetime import UTC, datetime
from pathlib import Path

import replay

SAMPLE = Path(__file__).resolve().parents[1] / "samples" / "two_robots.mcap"

for event in replay.merge(SAMPLE, robots=["r1", "r2"], stop=200.0):
    match event:
        case replay.Started():
            print("merging", ", ".join(f"{item.robot} from {item.topic}" for item in event.robots))
        case replay.Merged():
            placed = ", ".join(event.result.poses) or "nobody yet"
            clock = datetime.fromtimestamp(event.stamp_ns / 1e9, UTC).strftime("%H:%M:%S")
            print(f"{clock}: {event.done} of {event.total} messages; placed: {placed}")
        case replay.Skipped() | replay.Noted():
            print(event)
        case replay.Finished():
            print("r2 is", event.report["robots"]["r2"]["status"])

# %% The whole of it, with a hint where r2 started, in three numbers: metres, metres, radians.
report = replay.merge(SAMPLE, init_poses={"r2": (28.0, 1.0, 2.2)}).finish()
for name, robot in report["robots"].items():
    print(f"{name}: {robot['status']}: {robot['reason']['message']}")

# %% Write what the command line would: MCAP, Rerun recording and report.
folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
replay.merge(SAMPLE, images="none").write(folder / "merged.mcap", rrd=False)
again = replay.read_report(folder / "merged.json")
print("wrote", ", ".join(sorted(path.name for path in folder.iterdir())), "of", again["updates"], "maps")

# %% What is wrong is said in one line.
try:
    replay.merge(SAMPLE, robots=["r1", "r3"]).finish()
except replay.ReplayError as error:
    print("refused:", error)
