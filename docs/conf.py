"""Sphinx settings; `make docs` builds, and every warning is an error."""

import re
from typing import Any

import strapdown

project = "strapdown"
author = "the strapdown authors"
copyright = "the strapdown authors"
release = version = strapdown.__version__

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx.ext.viewcode",
]
exclude_patterns = ["_build", "tables"]  # tables are included by pages
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

suppress_warnings = ["ref.citation"]  # a source may be listed without being cited

autosummary_generate = True
autodoc_typehints = "none"  # the docstrings say shapes and units, which types cannot
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
default_role = "code"

html_theme = "pydata_sphinx_theme"
html_title = "strapdown"
html_show_sourcelink = False
html_theme_options = {"navigation_with_keys": False, "show_toc_level": 2}
templates_path = ["_templates"]
html_static_path: list[str] = []


def setup(app: Any) -> None:
    """Let functions cite the sources that their module lists; leave libraries' classes out."""
    app.connect("autodoc-process-docstring", _cite_module, priority=400)  # before numpydoc
    app.connect("autodoc-skip-member", _skip_imported)


def _cite_module(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Make ``[1]_`` plain text where the docstring itself has no such source."""
    own = set(re.findall(r"^\s*\.\. \[(\w+)\]", "\n".join(lines), re.MULTILINE))
    for row, line in enumerate(lines):
        lines[row] = re.sub(
            r"\[(\w+)\]_", lambda cited: cited[0] if cited[1] in own else cited[0][:-1], line
        )


def _skip_imported(
    app: Any, what: str, name: str, obj: Any, skip: bool, options: Any
) -> bool | None:
    """Skip what a module imported from a library."""
    home = str(getattr(obj, "__module__", None) or "strapdown")
    return None if home.startswith(("strapdown", "builtins")) else True
