"""Configure the documentation site: make docs builds it offline into build/site."""

from __future__ import annotations

import sys
import warnings
from importlib import metadata
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "pretouch"
author = "The pretouch developers"
copyright = "The pretouch developers, Apache-2.0"  # noqa: A001 - the name that Sphinx reads
release = metadata.version("pretouch")
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "api_pages",
    "live_figures",
    "narrow_figures",
    "page_figures",
]
exclude_patterns = [
    *("**/sg_execution_times.*", "sg_execution_times.*", "_ext", "gallery", "make_pages.py", "**.ipynb_checkpoints"),
    *(f"auto_gallery/*.{ending}" for ending in ("ipynb", "py", "zip", "json", "md5")),
]
nitpicky = True
# types in signatures that have no page: Python, NumPy, Matplotlib and internal classes
nitpick_ignore_regex = [
    ("py:.*", r"(?!pretouch\.).*"),
    ("py:.*", r"pretouch\..*"),
]
smartquotes = False  # quotes and dashes stay as a reader types them: "auto", --json, l'
default_role = "literal"  # single backticks in docstrings are code
suppress_warnings = ["config.cache", "myst.header"]

# --- pages
myst_enable_extensions = ["colon_fence", "deflist", "attrs_inline"]
myst_heading_anchors = 4
nb_execution_mode = "cache"
nb_execution_timeout = 120
nb_execution_raise_on_error = True
nb_merge_streams = True
nb_ipywidgets_js = {}  # no script from elsewhere

# --- reference
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_type_aliases = {"ArrayLike": "ArrayLike"}  # the name, not the long union behind it
toc_object_entries_show_parents = "hide"
napoleon_google_docstring = True
napoleon_numpy_docstring = False

# --- gallery
warnings.filterwarnings("ignore", message="FigureCanvasAgg is non-interactive")
sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "auto_gallery",
    "filename_pattern": r"/plot_",
    "image_scrapers": ("figure_scraper.save_figure",),
    "show_memory": False,
    "write_computation_times": False,
    "min_reported_time": 3600,
    "reset_modules": (),
    "show_signature": False,
    "download_all_examples": False,
    "remove_config_comments": True,
    "within_subsection_order": "FileNameSortKey",
    "capture_repr": (),
    "abort_on_example_error": True,
    "plot_gallery": "True",
}

# --- look: system fonts, nothing from elsewhere
html_theme = "furo"
html_title = f"pretouch {release}"
html_static_path = ["_static"]
templates_path = ["_templates"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_search_scorer = str(Path(__file__).parent / "_static/search_scorer.js")
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#00538a", "color-brand-content": "#00538a"},
    "dark_css_variables": {"color-brand-primary": "#6cb8f0", "color-brand-content": "#6cb8f0"},
    "navigation_with_keys": True,
}
