"""Measurements of placements against known truth, of time and of memory; docs/ says of what.

::

    truth                                 the command
    recordings                            (a) recordings of real buildings, tick by tick
    cases ── simulated                    (b) simulated pairs
    published, exhaustive ── merged_sets  (c) published maps, and their truth
    methods ── recipes, hough             what is measured: matchers, and recipes to compare
    verdicts, criteria, reliability       what is right, what must hold, what a confidence is worth
    distribution                          whether simulated maps are as messy as real ones
    tables, reports                       what is printed

    speed/                                the command for time and memory, one module a section
    profile                               where the time of a replay goes
    large, long_mission, huge_mission     what speed is measured on
"""
