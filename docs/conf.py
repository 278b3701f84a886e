"""Settings of the documentation site; ``make docs`` builds it into build/docs."""

from __future__ import annotations

import sys
from importlib.metadata import version as version_of
from pathlib import Path

from robotd import arrays

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "robotd"
author = "robotd authors"
project_copyright = author
version = release = version_of("robotd")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "robotd_docs",
]
root_doc = "index"
exclude_patterns = ["_ext"]
html_theme = "furo"
html_title = f"robotd {release}"
html_static_path = ["_static"]
html_css_files = ["robotd.css"]
html_show_sphinx = False

myst_enable_extensions = ["attrs_inline", "colon_fence", "deflist"]
myst_heading_anchors = 3
myst_links_external_new_tab = False

autodoc_member_order = "bysource"
autodoc_type_aliases = {name: name for name in vars(arrays) if name.endswith("Array")}
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
suppress_warnings = ["ref.python"]  # attributes of two classes with one name

autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
maximum_signature_line_length = 100
add_module_names = False
toc_object_entries_show_parents = "hide"

copybutton_prompt_text = "$ "
copybutton_only_copy_prompt_lines = True
