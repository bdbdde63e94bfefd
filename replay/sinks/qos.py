"""Quality of service that the written topics offer, in the form that rosbag2 keeps it in."""

from __future__ import annotations

from typing import Final

_PROFILE = """\
- history: 1
  depth: 1
  reliability: 1
  durability: {durability}
  deadline:
    sec: 2147483647
    nsec: 4294967295
  lifespan:
    sec: 2147483647
    nsec: 4294967295
  liveliness: 1
  liveliness_lease_duration:
    sec: 2147483647
    nsec: 4294967295
  avoid_ros_namespace_conventions: false"""

LATCHED: Final = _PROFILE.format(durability=1)
"""Reliable and transient local: what map_server offers, and what RViz and Nav2 ask for on a map topic."""

VOLATILE: Final = _PROFILE.format(durability=2)
"""Reliable and volatile: what most publishers offer."""
