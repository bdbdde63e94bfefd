"""How long things take, against simpler work on the same data: ``python -m benchmarks.speed``.

One module a section, each a function of `options.Options` that yields lines as they are measured::

    cold, pairs                two maps matched from nothing: large ones; those of `benchmarks.truth`
    warm                       one more map, once the maps are merged
    replays                    whole recordings
    memory, startup, growth    how large, how soon, how it grows
    timing, child, printed     taking turns in one process; a process of its own; tables
    merging, replaying, alone  one place each for the merger, for the replay, and for reading and writing alone

Ratios say more than seconds, which differ from machine to machine: what is compared takes turns, in one process and
with one thread of OpenCV, or in processes of its own with one thread each. docs/performance.md has the figures.
"""
