"""Simulated recordings of several robots' maps, pairs of maps with known truth, and the parts that make both.

::

    world, walls, floorplan                  what there is: rooms, doors, edges that stop a beam
    furniture ── pieces                      what stands in the rooms
    lidar, people, drive, slam, mapping      what a robot does: see, move, err, map
    mission                                  one robot's run, and the truth between two runs
    record                                   runs as recordings: MCAP, ROS 1 bag, ROS 2 bag
    generate                                 the recordings of this folder

    sites ── kinds                           buildings of many kinds, bent ones too, as different visitors find them
    mess                                     how messy a robot's map is
    explorers                                several robots on one site
    shared; likeness, rivals                 the truth between bent maps; what else might explain them
    pairs                                    random pairs, related or not, one by one or in bulk
"""
