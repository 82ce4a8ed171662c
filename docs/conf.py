"""Settings of the documentation site: ``python -m sphinx -W docs OUT``.

Nothing is fetched: no inventories of other projects, no scripts or fonts of a content network. Formulas become
MathML, which browsers set themselves (``_ext/mathml.py``).
"""

from __future__ import annotations

import os
import sys
from importlib import import_module
from importlib.resources import files
from pathlib import Path

HERE = Path(__file__).parent
MATH_FONT = Path(str(files("ziamath") / "fonts" / "STIXTwoMath-Regular.ttf"))
"""Set by browsers that have no mathematical font of their own; under the SIL Open Font License."""

sys.path[:0] = [str(HERE.parent), str(HERE / "_ext")]  # the packages of this clone, and the extensions below
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

project = "strainfmu"
author = "strainfmu developers"
copyright = author
version = release = import_module("strainfmu").__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "can_frames",
    "command_line",
    "docstrings",
    "map_arrays",
    "fmu_variables",
    "gallery_results",
    "mathml",
    "public_names",
    "vehicle_entries",
]
exclude_patterns = ["_build", "_ext", "gallery_src", "**/README.txt"]
suppress_warnings = [
    "config.cache",  # the gallery's settings hold what cannot be pickled
    "ref.python",  # a type named in short in an annotation, such as Resolution, may stand in two modules
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
nitpicky = False

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "attrs_block"]
myst_heading_anchors = 3
html_math_renderer = "mathml"
math_numfig = False
math_eqref_format = "({number})"

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_use_type_comments = False
autodoc_default_options = {"members": True}
autodoc_type_aliases = {name: name for name in ("ArrayLike", "BoolArray", "FloatArray", "IntArray")}
autodoc_typehints_format = "short"
maximum_signature_line_length = 88
napoleon_numpy_docstring = True
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
napoleon_attr_annotations = False

html_theme = "pydata_sphinx_theme"
html_title = f"strainfmu {release}"
html_static_path = ["_static", str(MATH_FONT)]
html_css_files = ["site.css"]
html_favicon = "_static/logo.svg"
html_show_sourcelink = html_copy_source = True  # the text of every page, in the site itself
html_theme_options = {
    "logo": {"text": html_title, "image_light": "_static/logo.svg", "image_dark": "_static/logo.svg"},
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "show_prev_next": True,
    "header_links_before_dropdown": 7,
    "footer_start": ["copyright"],
    "footer_end": ["sourcelink"],
    "secondary_sidebar_items": {"**": ["page-toc"], "index": [], "gallery/index": []},
}
html_sidebars = {"index": []}

copybutton_exclude = ".linenos, .gp, .go"

sphinx_gallery_conf = {
    "examples_dirs": [str(HERE / "gallery_src")],
    "gallery_dirs": ["gallery"],
    "filename_pattern": r"[/\\]plot_",
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "remove_config_comments": True,
    "matplotlib_animations": False,
    "image_srcset": ["2x"],
    "image_scrapers": ("gallery_figures.checked_figures",),
    "plot_gallery": "True",
    "abort_on_example_error": True,
    "copyfile_regex": r".*\.toml",
    "min_reported_time": 1000,
    "write_computation_times": False,  # its page loads scripts from content networks
}
