"""Lines of text: tables whose rows are printed as they are measured, and targets."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Table:
    """Columns of fixed width, the first one to the left and all others to the right.

    Parameters
    ----------
    first_width
        Of the first column, in characters.
    titles
        Of all columns; each is as wide as its title and two characters more, or ten.
    """

    first_width: int
    titles: tuple[str, ...]

    @property
    def header(self) -> str:
        """The first line."""
        return self.row(*self.titles)

    def row(self, *values: str) -> str:
        """Return one line."""
        first, *others = values
        widths = [max(len(title) + 2, 10) for title in self.titles[1:]]
        aligned = [f"{value:>{width}}" for value, width in zip(others, widths, strict=True)]
        return "".join([f"{first:<{self.first_width}}", *aligned])


def seconds(value: float) -> str:
    """Return a duration with its unit."""
    return f"{value * 1e3:.1f} ms" if value < 0.1 else f"{value * 1e3:.0f} ms" if value < 10.0 else f"{value:.1f} s"


def ratio(value: float) -> str:
    """Return a ratio."""
    return f"{value:.2f}"


def mebibytes(value: float) -> str:
    """Return a number of bytes with its unit."""
    return f"{value / 2**20:.0f} MiB"


def at_most(what: str, found: float, limit: float) -> str:
    """Return whether a target holds: something is at most so much."""
    return f"{'holds' if found <= limit else 'FAILS'}  {what}, at most {limit:.4g}: {found:.2f}"
