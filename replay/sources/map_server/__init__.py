"""Saved maps: `saved_map` reads what the ``map_server`` of ROS writes."""
