"""Whether the viewer can draw here."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from tests.viewers import require


def needs_renderer() -> None:
    """Skip the test where nothing can be drawn."""
    require(renderer_missing())


def renderer_missing() -> str | None:
    """Return why nothing can be drawn here, or None."""
    if sys.platform != "linux":
        return None
    drivers = [Path(folder) / "vulkan" / "icd.d" for folder in ("/usr/share", "/etc", "/usr/local/share")]
    if os.environ.get("VK_ICD_FILENAMES") or any(any(folder.glob("*.json")) for folder in drivers):
        return None
    return "there is no Vulkan driver; a software one is in mesa-vulkan-drivers"
