"""Flags that several commands share: a module each for what is read, how maps are placed, what is written, and rules.

Each offers ``add``, which says which flags there are, and a function that returns the options they stand for.
"""
