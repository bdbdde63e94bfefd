"""SQLite files of ROS 2 bags: `file` reads them by SQLite or, what that refuses, from their pages."""
