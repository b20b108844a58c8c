"""How Sphinx makes a site of the repository's pages and of the Python package's docstrings: `make site`."""

import inspect
import pathlib
import re
import sys

from sphinx.ext.autodoc.mock import mock

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "python"))

project = "oted"
version = release = re.search(r"project\(oted VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text())[1]
copyright = "the OTED authors, Apache-2.0"  # noqa: A001  (Sphinx's name)

# Pages stay where they are in the repository, so links between them are those that a reader of the repository follows.
root_doc = "README"
include_patterns = ["*.md", "docs/*.md", "docs/*.rst", "benchmarks/README.md", "examples/README.md", "examples/real/README.md"]
exclude_patterns = [".*", "build", "dist", "runs"]
extensions = ["myst_parser", "sphinx.ext.autodoc"]
myst_heading_anchors = 4
myst_enable_extensions = ["attrs_block"]
nitpicky = False
highlight_language = "none"

# Docstrings are read where the compiled module is not.
autodoc_mock_imports = ["h5py", "oted._engine", "stable_baselines3"]
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
default_role = "code"

html_theme = "furo"
html_title = f"oted {version}"
html_show_sphinx = False
html_copy_source = False
html_theme_options = {"navigation_with_keys": True}

SECTION = re.compile(r"^\*\*(.+)\*\*$")
ANCHOR = re.compile(r'^<a name="([\w-]+)"></a>$', re.M)
BESIDE = {"docs/your_own_robot": "examples/real/README\n", "docs/python": "docs/python_api\n"}  # pages that no index names
PAGE = re.compile(r"^- \[.*\]\((.+)\.(?:md|rst)\)")


def contents():
    """The site's contents, in the order of docs/index.md: that page is the one list of pages."""
    text = ""
    for line in (ROOT / "docs/index.md").read_text().splitlines():
        if section := SECTION.match(line):
            text += "```\n" * bool(text) + f"\n```{{toctree}}\n:hidden:\n:caption: {section[1]}\n\n"
            text += "All pages <docs/index>\n" if text.count("{toctree}") == 1 else ""
        elif page := PAGE.match(line):
            place = (ROOT / "docs" / page[1]).resolve().relative_to(ROOT)
            text += f"{place}\n" + BESIDE.get(str(place), "")
    return text + "CHANGELOG\nTHIRD_PARTY_NOTICES\n```\n"


def public_names():
    """What oted.__all__ names: functions and classes first, then errors, then modules."""
    import oted

    groups = {"class": "", "function": "", "exception": "", "module": ""}
    for name in sorted(oted.__all__):
        found = getattr(oted, name)
        is_error = inspect.isclass(found) and issubclass(found, Exception)
        kind = ("exception" if is_error else "class" if inspect.isclass(found) else
                "module" if inspect.ismodule(found) else "function")
        groups[kind] += f".. auto{kind}:: oted.{name}\n" + "   :members:\n" * (kind != "function") + "\n"
    return groups["function"] + groups["class"] + groups["exception"] + groups["module"]


def prepare(app, docname, source):
    """Anchors are HTML in the pages, as GitHub wants them; MyST has words of its own for them."""
    source[0] = ANCHOR.sub(r"{#\1}", source[0])
    if docname == root_doc:
        source[0] += "\n" + contents()
    if docname == "docs/python_api":
        with mock(app.config.autodoc_mock_imports):
            source[0] += public_names()


def indent_is_code(app, what, name, obj, options, lines):
    """An indented block of a docstring is code, as in Markdown."""
    for i in range(len(lines) - 1, 0, -1):
        if lines[i].startswith("    ") and lines[i - 1] == "":
            if i < 2 or not lines[i - 2].startswith("    "):
                lines[i - 1:i] = ["", ".. code-block:: python", ""]


def setup(app):
    app.connect("source-read", prepare)
    app.connect("autodoc-process-docstring", indent_is_code)
