"""How the pages become a site: `sphinx-build -W docs out/site` (see docs/README.md)."""

import re
from typing import Any

import usdhand
from usdhand.options import declared

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


def _described(
    _app: Any, _what: str, _name: str, value: Any, _options: Any, lines: list[str]
) -> None:
    """What stands behind a parameter's name describes it, and the examples of requests are shell.

    napoleon takes the words behind the colon for a type; the types are in the code. What the fields
    of a request are say its options.
    """
    found: list[str] = []
    section = ""
    for number, line in enumerate(lines):
        if number + 1 < len(lines) and re.fullmatch("-{3,}", lines[number + 1]):
            section = line
        named = re.fullmatch(r"(\w[\w, ]*) : (.*)", line)
        if section in ("Parameters", "Attributes") and named:
            found += [named[1], f"    {named[2]}"]
        elif re.fullmatch("Examples?:", line):
            found += [f"{line}:", ""]
        else:
            found.append(line.replace("\b", ""))
    if isinstance(value, type) and issubclass(value, usdhand.Request):
        helps = ((own.name, own.option.help.replace("*", r"\*")) for own in declared(value))
        found += ["", *(f":param {name}: {text}" for name, text in helps if text)]
    lines[:] = found


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.connect("sphinx-click-process-description", _escaped)
    app.connect("autodoc-process-docstring", _described, priority=400)  # before napoleon
