"""The command line: thin over the library, and the one place that turns errors into a line and an exit status."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from replay import __version__, interrupts, standard_streams
from replay.arguments import parsed
from replay.commands import load
from replay.errors import ReplayError
from replay.exit_status import EXIT_BAD_INPUT, EXIT_FAILED, EXIT_INTERRUPTED
from replay.origins import naming_origins
from replay.plain_text import plain
from replay.standard_streams import printing, quiet_stderr, say


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program and return its exit status."""
    interrupts.listen()
    standard_streams.prepare()
    try:
        options = _parsed(arguments)
        with naming_origins(options):
            return load(options.command).run(options)
    except ReplayError as error:
        say(f"replay: error: {plain(str(error))}")
        return error.exit_code
    except KeyboardInterrupt:
        say("replay: interrupted; nothing was written")
        return EXIT_INTERRUPTED
    except MemoryError:
        say(
            "replay: error: there is not enough memory; close other programs, or leave out what needs too much with "
            "--max-memory SIZE (of merge and info)"
        )
        return EXIT_BAD_INPUT
    except SystemExit:
        raise
    except BaseException:  # noqa: BLE001 - a bug, or a panic of Rust below, must still end with a status and a word
        import traceback

        traceback.print_exc(file=quiet_stderr())
        say(f"replay: this is a bug in replay {__version__}; please report it with the lines above")
        return EXIT_FAILED


def _parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    try:
        return parsed(arguments)
    except SystemExit:
        quiet_stderr().flush()  # what was printed may wait still, and could not be written at exit
        with printing():
            pass
        raise


if __name__ == "__main__":
    sys.exit(main())
