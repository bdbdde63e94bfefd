"""Merge two occupancy grids, as arrays: where the second one lies, and how sure that is."""

# %% Two maps, read with rosbags; any int8 arrays of -1 (unknown) and 0 to 100 will do.
from pathlib import Path

import numpy as np
from rosbags.highlevel import AnyReader

import mapmerge

SAMPLE = Path(__file__).resolve().parents[1] / "samples" / "two_robots.mcap"


def last_map(topic: str) -> mapmerge.Grid:
    """Return the last map of a topic."""
    with AnyReader([SAMPLE]) as reader:
        connections = [each for each in reader.connections if each.topic == topic]
        *_, (connection, _, data) = reader.messages(connections)
        message = reader.deserialize(data, connection.msgtype)
    info, corner = message.info, message.info.origin
    yaw_rad = 2.0 * np.arctan2(corner.orientation.z, corner.orientation.w)
    map_from_grid = mapmerge.Sim2(corner.position.x, corner.position.y, yaw_rad)
    return mapmerge.Grid(message.data.reshape(info.height, info.width), info.resolution, map_from_grid)


r1, r2 = last_map("/r1/map"), last_map("/r2/map")
print(r1)
print(r2)

# %% Merge them. The first is the reference: its frame is the merged frame.
result = mapmerge.merge({"r1": r1, "r2": r2})
print(result)

# %% Where it lies, as numbers: merged_from_map takes points of r2's map frame to the merged frame.
merged_from_map = result.poses["r2"]
print("the origin of r2's map lies at", merged_from_map.apply_point(0.0, 0.0))
print(merged_from_map.matrix.round(3))

# %% How sure that is, and what else was thought of.
match = result.pairs["r1", "r2"]
print(f"confidence {match.confidence:.4f}, {match.scores.overlap_m2:.0f} m² in common")
print(f"{match.scores.wall_agreement:.1%} of the walls there agree; placements that come near it: {len(match.rivals)}")

# %% The merged map is a grid like any other.
print(result.merged)
print(f"{result.merged.known_area_m2:.0f} m² known; {r1.known_area_m2:.0f} m² and {r2.known_area_m2:.0f} m² alone")

# %% Maps that show too little are refused, and why is said.
part = mapmerge.Grid(r2.cells[290:330, 230:280], r2.resolution_m, r2.map_from_grid)
print(mapmerge.merge([r1, part]))
