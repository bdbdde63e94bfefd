"""Errors that this library raises.

::

    MapMergeError (ValueError)
    ├── GridError      a grid that no map can have: wrong shape, no resolution, no place
    └── ConfigError    a setting outside what it can be

A refused merge is not an error: it is a value with its reason, see `mapmerge.reasons`.
"""


class MapMergeError(ValueError):
    """Base of all errors of this library; its text says what was wrong and what was expected."""


class GridError(MapMergeError):
    """A grid that no map can have."""


class ConfigError(MapMergeError):
    """A setting outside of what it can be."""
