"""The documentation's site: python -m sphinx -W -b html docs build/site."""

from __future__ import annotations

import gc
import sys
from pathlib import Path
from typing import Any

import latex2mathml.converter
from docutils import nodes
from jinja2 import PackageLoader
from jinja2.sandbox import SandboxedEnvironment
from numpydoc import docscrape_sphinx

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent), str(HERE.parent / "tests")]

import pages  # noqa: E402

import spacemap_vtk  # noqa: E402

gc.disable()  # the pages live to the end; collecting garbage would take a fifth of the time

project = "spacemap_vtk"
author = "The spacemap_vtk developers"
copyright = "2026, the spacemap_vtk developers"
version = release = spacemap_vtk.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc"]
exclude_patterns = ["made/*.txt"]

myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 4
# Only these are URL schemes; the word before the colon in "view.color: stress" is not.
myst_url_schemes = ("http", "https", "mailto")
suppress_warnings = ["myst.header"]

autodoc_typehints = "none"  # numpydoc has them, with shapes and units
autodoc_default_options = {"members": True, "show-inheritance": False}
numpydoc_show_class_members = False
# numpydoc would compile the same template for each docstring.
_templates = SandboxedEnvironment(loader=PackageLoader("numpydoc"))
docscrape_sphinx.SandboxedEnvironment = lambda loader: _templates

smartquotes = False  # "--set" must stay as it is typed
toc_object_entries = False

html_theme = "furo"
html_title = "spacemap_vtk"
html_copy_source = False
html_show_sourcelink = False
html_static_path = ["style"]
# The film of the first page, and its first picture.
html_extra_path = ["film.mp4", "film.jpg"]
html_css_files = ["site.css"]
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#1f5f8b", "color-brand-content": "#1f5f8b"},
    "dark_css_variables": {"color-brand-primary": "#8cc4ea", "color-brand-content": "#8cc4ea"},
    "navigation_with_keys": True,
}


def _write_formula(self: Any, node: nodes.Element) -> None:
    """Write a formula as MathML, which browsers show without a script or the network."""
    display = "block" if isinstance(node, nodes.math_block) else "inline"
    self.body.append(latex2mathml.converter.convert(node.astext(), display=display))
    raise nodes.SkipNode


def setup(app: Any) -> None:
    """Generate pages before any page is read."""
    app.connect("builder-inited", lambda _: pages.write(HERE / "made"))
    app.add_node(nodes.math, override=True, html=(_write_formula, None))
    app.add_node(nodes.math_block, override=True, html=(_write_formula, None))
