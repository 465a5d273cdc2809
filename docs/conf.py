"""Settings of the site, which ``make docs`` builds: pages, reference and gallery.

Nothing in the site is fetched from a network: mathematics is MathML, fonts are those of the system.
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS / "extensions"))

from gallery import settings  # noqa: E402

project = "piezotrack"
author = "The piezotrack developers"
copyright = author
version = release = tomllib.loads((DOCS.parent / "Cargo.toml").read_text("utf-8"))["workspace"][
    "package"
]["version"]

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
    "mathml",
    "names",
    "offline",
    "reference_pages",
]
exclude_patterns = [
    "_build",
    "extensions",
    "gallery/backreferences",
    "gallery/*.ipynb",
    "gallery/*.py",
]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

sphinx_gallery_conf = settings()
# It means the path of the repository, in which a space breaks no link.
suppress_warnings = ["sphinx_gallery.space_in_filename"]

# Docstrings: a name in single quotes is a link where it is a public one, else code.
default_role = "py:obj"
autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_custom_sections = [("Attributes", "params_style")]
napoleon_use_rtype = False
toc_object_entries_show_parents = "hide"
python_maximum_signature_line_length = 80
html_math_renderer = "mathml"

html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_title = f"piezotrack {release}"
html_show_sphinx = False
html_show_copyright = False
html_copy_source = False
html_show_sourcelink = False
