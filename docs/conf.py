"""How the pages become a site: `sphinx-build -W docs out/site` (see docs/README.md)."""

from typing import Any

import usdhand

project = "usdhand"
author = "the usdhand authors"
release = usdhand.__version__
extensions = ["myst_parser", "sphinx_click", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["README.md"]
html_theme = "furo"
html_title = "usdhand"
myst_heading_anchors = 3
# Pages link to source files and samples as they lie in the repository. Fields of different types
# share names; a name in a docstring that several have leads to none.
suppress_warnings = ["myst.xref_missing", "ref.python"]
linkcheck_ignore = [r"http://localhost"]
autodoc_typehints = "description"
autodoc_member_order = "groupwise"


def _escaped(_app: Any, _context: Any, lines: list[str]) -> None:
    """Wildcards in the examples of `--help` are no emphasis."""
    lines[:] = [line.replace("*", r"\*") for line in lines]


def _help_escaped(
    _app: Any, _what: str, name: str, _value: Any, _options: Any, lines: list[str]
) -> None:
    """The docstrings of requests are help texts as well."""
    if name.endswith("Request"):
        _escaped(_app, None, lines)


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", _help_escaped)
    app.connect("sphinx-click-process-description", _escaped)
