"""Simulated recordings of several robots' maps, and the parts that make them.

::

    world ── floorplan ── furniture      what there is: rooms, doors, edges that stop a beam
    lidar, drive, mapping                what a robot does: see, move, map
    mission                              one robot's run, and the truth between two runs
    record                               runs as recordings: MCAP, ROS 1 bag, ROS 2 bag
    generate                             the recordings of this folder
"""
