"""Topics of the MCAP that a run writes."""

from __future__ import annotations

MAP_TOPIC = "/merged/map"
REPORT_TOPIC = "/merged/report"
IMAGE_TOPICS = "/merged/images"
