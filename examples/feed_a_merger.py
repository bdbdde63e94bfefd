"""Feed a merger with maps as they come: it keeps what it knows, and searches again only where that may tell more."""

# %% Maps of two robots, in order of time.
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rosbags.highlevel import AnyReader

from mapmerge import Grid, MergeConfig, Merger, Prior, Sim2, VerifyConfig

SAMPLE = Path(__file__).resolve().parents[1] / "samples" / "two_robots.mcap"


def maps() -> Iterator[tuple[float, str, Grid]]:
    """Yield seconds, robot and map."""
    with AnyReader([SAMPLE]) as reader:
        connections = [each for each in reader.connections if each.topic.endswith("/map")]
        for connection, time_ns, data in reader.messages(connections):
            message = reader.deserialize(data, connection.msgtype)
            cells = message.data.reshape(message.info.height, message.info.width)
            corner = message.info.origin.position
            grid = Grid(cells, message.info.resolution, Sim2(corner.x, corner.y))
            yield (time_ns - reader.start_time) / 1e9, connection.topic.split("/")[1], grid


# %% Each step takes what is new and returns all that is known then.
merger = Merger(["r1", "r2"])
for seconds, robot, grid in maps():
    result = merger.step({robot: grid})
    for pair, trigger in result.searched.items():
        print(f"+{seconds:5.1f} s: {' and '.join(pair)} were searched, as {trigger.words}")
    for change in result.changes:
        print(f"+{seconds:5.1f} s: {change.robot} {change.kind}: {change.reason.message}")

# %% The last step looks once more at what was only followed.
result = merger.step({}, is_last=True)
print(result)

# %% Thresholds are settings; what is believed beforehand is a prior.
strict = MergeConfig(verify=VerifyConfig(min_confidence=0.999, min_overlap_m2=20.0))
prior = Prior(Sim2(28.0, 1.0, np.deg2rad(125.0)), sigma_x_m=1.0, sigma_y_m=1.0, sigma_yaw_rad=np.deg2rad(10.0))
merger = Merger(["r1", "r2"], strict)
print(merger.step(result.grids, {"r2": prior}, is_last=True))
