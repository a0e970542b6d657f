"""Sphinx configuration. `make docs` builds the site in docs/_build/html, without a network."""

import os
import sys
from datetime import UTC, datetime
from importlib.metadata import version as version_of
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
sys.path.insert(0, str(HERE / "_extensions"))

project = "ncti-sweep"
author = "the ncti-sweep developers"
project_copyright = f"{datetime.now(UTC):%Y}, {author}"
version = release = version_of("ncti-sweep")

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "numpydoc",
    "myst_nb",
    "api_pages",  # these and those below: docs/_extensions
    "mathml",
    "names",
    "offline",
    "tutorials",
]
exclude_patterns = ["_build", "_extensions"]
nitpicky = True
# Types in signatures and docstrings that no page here describes; there is no network to look them
# up in the documentation of other projects.
nitpick_ignore_regex = [(r"py:.*", r".*")]
suppress_warnings = ["config.cache"]

# Pages -------------------------------------------------------------------------------------------
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "fieldlist"]
myst_heading_anchors = 4
nb_execution_mode = "force"
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True

# API ---------------------------------------------------------------------------------------------
autodoc_typehints = "none"  # the docstrings have types with shapes
autodoc_member_order = "bysource"
autosummary_generate = False
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
numpydoc_xref_param_type = False
default_role = "py:obj"  # single backticks in docstrings link to what they name

# Appearance --------------------------------------------------------------------------------------
html_theme = "pydata_sphinx_theme"
html_title = f"ncti-sweep {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"
html_copy_source = False
html_show_sourcelink = False
html_context = {"default_mode": "auto"}
html_theme_options = {
    "logo": {"text": "ncti-sweep"},
    "navigation_with_keys": False,
    "show_toc_level": 2,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": ["theme-version"],
    "header_links_before_dropdown": 6,
}

os.environ.setdefault("MPLBACKEND", "Agg")
