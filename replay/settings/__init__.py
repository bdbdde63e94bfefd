"""Settings of a run from a file or ``--set``: the flags of a command, and all fields of `mapmerge.config.MergeConfig`.

A flag becomes a setting by being in a group that `keys.SECTIONS` knows; a field by being there.
"""
