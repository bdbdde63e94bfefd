"""The steps of Chen & Chan 2023, Sensors 23(16) 7303, one function each, as printed or as it must be meant.

`docs/method.md` lists where the paper is unclear or fails as printed, and what is done instead.
"""
