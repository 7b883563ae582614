"""How `make docs` makes the site: Markdown pages, executed notebooks, reference from docstrings."""

import sys
from hashlib import sha256
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE / "extensions")]

from jupyter_client.manager import KernelManager  # noqa: E402

import ngcontact  # noqa: E402 - found by the second line

project = "ngcontact"
author = "The ngcontact developers"
copyright = f"2026, {author}"
version = release = ngcontact.__version__
language = "en"
smartquotes = False  # messages and names are quoted as they are

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_design",
    "mathml",
    "docstrings",
    "downloads",
    "source_lines",
    "thumbnails",
]
exclude_patterns = ["extensions"]

# Pages.
myst_enable_extensions = ["attrs_inline", "colon_fence", "deflist", "dollarmath", "fieldlist"]
myst_heading_anchors = 3
myst_links_external_new_tab = False

# Notebooks: every one is executed, an error in one is an error of the build. Results are kept as
# long as neither the notebook nor the package changes.
SOURCES = [*HERE.parent.glob("ngcontact/**/*.py"), *HERE.parent.glob("geometries/*.py")]
STATE = sha256(b"".join(path.read_bytes() for path in sorted(SOURCES))).hexdigest()[:16]
if hasattr(KernelManager, "transport_encryption"):  # else kernels warn that others could listen
    KernelManager.transport_encryption.default_value = "auto"
nb_execution_mode = "cache"
nb_execution_cache_path = str(HERE.parent / "build" / "notebooks" / STATE)
nb_execution_in_temp = True
nb_execution_timeout = 1800  # seconds of a cell; a busy machine may need many times its usual ones
nb_execution_raise_on_error = True
nb_merge_streams = True

# Reference. A name in single backticks is looked up, and stands as code where there is none.
default_role = "py:obj"
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented_params"
autodoc_class_signature = "mixed"
autodoc_type_aliases = dict.fromkeys(["Array", "Index", "Mask"], "ndarray")
napoleon_google_docstring = False
napoleon_use_ivar = True
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88
nitpick_ignore_regex = [("py:obj", ".*"), ("py:.*", r"(?!ngcontact\.).*")]
nitpick_ignore = [  # in signatures, but of the inside
    ("py:class", "ngcontact.fem.boundary.BoundaryTrace"),
    ("py:class", "ngcontact.contact.state.Transitions"),
]

# Look.
html_theme = "furo"
html_title = f"ngcontact {version}"
html_static_path = ["_static"]
html_css_files = ["ngcontact.css"]
html_copy_source = False
html_show_sphinx = False
html_theme_options = {"navigation_with_keys": True}
copybutton_exclude = ".linenos, .gp, .go"
