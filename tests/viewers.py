"""What tests need that show outputs as users see them: a browser, or something that can draw."""

from __future__ import annotations

import os

import pytest


def require(missing: str | None) -> None:
    """Skip a test, saying why, where something is missing; fail it where `REPLAY_REQUIRE_VIEWERS` forbids that."""
    if missing is None:
        return
    if os.environ.get("REPLAY_REQUIRE_VIEWERS") == "1":
        pytest.fail(f"{missing} (REPLAY_REQUIRE_VIEWERS=1 forbids to skip)")
    pytest.skip(missing)
