"""What other programs call what is called otherwise here, for errors that say what to type instead."""

from __future__ import annotations

from collections.abc import Mapping

FLAGS: Mapping[str, str] = {
    "--start-offset": "--start",
    "--start-time": "--start",
    "--begin": "--start",
    "--from": "--start",
    "--end-time": "--stop",
    "--end": "--stop",
    "--playback-until": "--stop",
    "--duration": "--stop",
    "--topics": "--topic",
    "--namespaces": "--robots",
    "--reference": "--robots",
    "-r": "--robots",
    "--initial-pose": "--init-pose",
    "--known-init-poses": "--init-pose",
    "--tf": "--use-tf",
    "--overwrite": "--force",
    "--yes": "--force",
    "-f": "--force",
    "-y": "--force",
    "--silent": "--quiet",
    "-s": "--quiet",
    "--debug": "--verbose",
    "--log-level": "--verbose",
    "--no-color": "--color",
    "--no-colour": "--color",
    "--threads": "--jobs",
    "-j": "--jobs",
    "--html": "--report",
    "--params-file": "--config",
}
"""Flags of ros2 bag, evo, rsync and others → ours."""

COMMANDS: Mapping[str, str] = {
    "version": "--version",
    "play": "merge",
    "run": "merge",
    "list": "info",
    "ls": "info",
    "show": "info",
    "inspect": "info",
    "diff": "compare",
    "convert": "export",
    "reindex": "recover",
    "repair": "recover",
    "settings": "config",
}
"""Commands of others → ours."""
