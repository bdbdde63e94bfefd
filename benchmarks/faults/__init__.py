"""What becomes of damaged, hostile and unlucky input: ``python -m benchmarks.faults``.

A small world is recorded in every format, each recording is damaged in every way of a table, and the program replays
what is left, in a process with little memory and little time. What came of it is held against the undamaged recording.

::

    world, messages            what is recorded: maps of a flat, of which the truth is known, as bytes
    formats, real              in which formats; recordings that are there already
    table                      the faults, one row each
    bytes_, mcap_, bag_, db3_, folder_, message_damage, degenerate_maps, bombs, mcap_layout
                               what they do
    cases                      which variants are tried, each with a name
    runner, remembered         one replay, with all that is to be judged
    placement, pieces, oracle  where maps truly lie, also those of which cells were moved; the verdict
    worker, pool               processes with limits
    kills, whole_runs          misfortunes of whole runs
    printed                    the table of verdicts

docs/reliability.md has the figures, and what the program promises.
"""
