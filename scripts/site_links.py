"""Check that every link within the site leads to a page that is there, and to a place on it.

    python scripts/site_links.py out/site

Links to other sites are counted, not followed: that needs a network, and says nothing of this project.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


@dataclass(slots=True)
class Page:
    """What a page links to, and which places it has."""

    links: list[str] = field(default_factory=list)
    places: set[str] = field(default_factory=set)


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.page = Page()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if value is None:
                continue
            if name == "id" or (tag == "a" and name == "name"):
                self.page.places.add(value)
            elif name in ("href", "src"):
                self.page.links.append(value)


def read_pages(site: Path) -> dict[Path, Page]:
    """Return the pages of a site, by their files."""
    pages: dict[Path, Page] = {}
    for path in sorted(site.rglob("*.html")):
        reader = _Reader()
        reader.feed(path.read_text(encoding="utf-8"))
        pages[path.resolve()] = reader.page
    return pages


def broken(site: Path, pages: dict[Path, Page]) -> Iterator[str]:
    """Yield each link that leads nowhere, with its page."""
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            target = target / "index.html" if target.is_dir() else target
            where = f"{path.relative_to(site.resolve())}: {link}"
            if not target.exists():
                yield f"{where}: there is no such file"
            elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].places:
                yield f"{where}: there is no such place on that page"


def main() -> int:
    """Print what is broken, and how many links there are."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("site", type=Path)
    site: Path = parser.parse_args().site
    pages = read_pages(site)
    if not pages:
        parser.error(f"{site}: there are no pages")
    found = list(dict.fromkeys(broken(site, pages)))
    for line in found:
        print(line, file=sys.stderr)
    links = [link for page in pages.values() for link in page.links]
    elsewhere = sum(bool(urlsplit(link).netloc) for link in links)
    inside = len(links) - elsewhere
    print(f"{len(pages)} pages, {inside} links within the site, {len(found)} broken; {elsewhere} lead elsewhere")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
