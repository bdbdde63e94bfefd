"""The site, by Sphinx: `make site`. Its pages are the documents as they are in the repository: links hold in both."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from replay import __version__  # noqa: E402 - found through the path above

project = "replay"
author = "the authors of replay"
copyright = author  # noqa: A001 - the name that Sphinx asks for
version = release = __version__

extensions = ["sphinx.ext.autodoc", "sphinx.ext.autosummary", "numpydoc", "myst_parser"]
root_doc = "docs/index"
include_patterns = ["*.md", "docs/**.md", "examples/README.md", "samples/README.md"]
templates_path = ["_templates"]
html_theme = "furo"
html_title = f"replay {release}"
html_additional_pages = {"index": "to_index.html"}
html_copy_source = False
html_show_copyright = False
# the same input gives the same pages
html_last_updated_fmt = None

myst_heading_anchors = 3
myst_enable_extensions = ["fieldlist"]

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_type_aliases = {"Event": "replay.events.Event", "Report": "replay.events.Report"}
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
add_module_names = False
python_use_unqualified_type_names = True
maximum_signature_line_length = 90
default_role = "code"

nitpicky = True
# No list of another project's pages is fetched, so that the site is built without a network: types of the standard
# library and of numpy have no page to lead to.
nitpick_ignore_regex = [
    ("py:.*", r"(numpy|np|collections|typing|datetime|pathlib|os|enum|dataclasses)\..*|NDArray"),
]


def setup(app: Sphinx) -> None:
    """Say of a default that a function makes ``...``: as dataclasses have it, a signature would be no Python.

    Of a number with limits, the type alone is said.
    """

    def made(*told: object) -> tuple[str | None, object]:
        signature, returned = told[-2:]
        if not isinstance(signature, str):
            return None, returned
        plain = re.sub(r"~typing\.Annotated\[(\w+), ~[\w.]+\([^)]*\)\]", r"\1", signature)
        return plain.replace("<factory>", "..."), returned

    app.connect("autodoc-process-signature", made)
