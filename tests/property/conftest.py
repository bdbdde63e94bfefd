"""Hypothesis: the same examples in every run, or a long search with HYPOTHESIS_PROFILE=search."""

import os

from hypothesis import HealthCheck, settings

_QUIET = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("fixed", max_examples=60, derandomize=True, database=None, **_QUIET)
settings.register_profile("search", max_examples=2000, **_QUIET)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "fixed"))
