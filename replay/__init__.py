"""Offline replay of recorded occupancy grid maps: reads them, merges them step by step, writes what came of it."""

__version__ = "0.1.0"
