"""The files that findings are written to: JUnit XML, and a summary that they are appended to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from replay.checks.findings import Finding
from replay.checks.junit import junit_error_xml, junit_xml
from replay.checks.words import error_summary, summary
from replay.errors import OutputError, ReplayError, UsageError
from replay.path_errors import path_errors
from replay.plain_text import plain
from replay.sinks.partial_file import one_line, output_errors
from replay.standard_streams import say
from replay.written_files import write_files

_NOT_ENDED = "the check was cut off: nothing is known of this run"


@dataclass(frozen=True, slots=True)
class ToldFiles:
    """Where findings are written; nowhere if neither is named.

    Parameters
    ----------
    junit
        Is replaced.
    summary
        Is appended to.
    title
        What was checked.
    """

    junit: Path | None
    summary: Path | None
    title: str

    @contextmanager
    def telling_errors(self) -> Iterator[None]:
        """Say there why there are no findings, whatever ends this; from the beginning no earlier findings are there.

        Raises
        ------
        OutputError
            If the JUnit XML cannot be written, before anything begins.
        """
        self._replace(junit_error_xml(_NOT_ENDED, self.title))
        try:
            yield
        except BaseException as error:
            self._tell_error(_why(error))
            raise

    def write(self, found: Sequence[Finding]) -> None:
        """Write the findings; each file also if the other one cannot be written.

        Raises
        ------
        OutputError
            If one cannot be written.
        """
        try:
            self._replace(junit_xml(found, self.title))
        finally:
            self._append(summary(found, self.title))

    def _tell_error(self, message: str) -> None:
        """Say why there are no findings; where that cannot be said, the error itself counts."""
        try:
            try:
                self._replace(junit_error_xml(message, self.title))
            finally:
                self._append(error_summary(message, self.title))
        except ReplayError as error:
            say(f"replay: {plain(str(error))}")

    def _replace(self, content: bytes) -> None:
        if self.junit is not None:
            write_files({self.junit: content}, force=True)

    def _append(self, text: str) -> None:
        if self.summary is None:
            return
        refuse_unappendable(self.summary)
        with output_errors(self.summary), self.summary.open("a", encoding="utf-8") as file:
            file.write(text)


def refuse_unappendable(path: Path) -> None:
    """Refuse what is no file: to open a pipe is to wait for whoever reads it. A link to a file is followed.

    Raises
    ------
    ReplayError
        With what to do.
    """
    with path_errors(path, OutputError):
        is_other = path.exists() and not path.is_file()
    if is_other:
        raise UsageError(f"{path}: this is no regular file; give the name of one, and print that afterwards")


def _why(error: BaseException) -> str:
    if isinstance(error, ReplayError):
        return str(error)
    if isinstance(error, KeyboardInterrupt):
        return "the check was interrupted"
    if isinstance(error, MemoryError):
        return "there is not enough memory"
    return f"this is a bug in replay: {type(error).__name__}: {one_line(error)}"
