"""Folders of ROS 2 bags: `folder` reads the parts that `metadata` lists."""
