"""MCAP files: `file` reads them by `index` or, where there is none that serves, by `scan`."""
