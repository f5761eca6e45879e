"""Settings of Sphinx for the site; `tools/docs/site/build.py` runs it on a staged copy of the pages."""

from __future__ import annotations

import re
from importlib.metadata import version as installed_version
from pathlib import Path
from typing import Any

from docutils.nodes import SkipNode
from docutils.utils.math import latex2mathml
from sphinx.addnodes import index as index_node

project = "tripwatt"
author = "The tripwatt authors"
project_copyright = "The tripwatt authors, Apache-2.0"
release = version = installed_version("tripwatt")

extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc"]
exclude_patterns: list[str] = []
source_suffix = {".md": "markdown"}
default_role = "literal"  # docstrings write names between single backticks
nitpicky = True
nitpick_ignore_regex = [
    ("py:.*", r"(?!tripwatt\.).*"),  # other projects: their sites are not asked for addresses
    ("py:class", r"tripwatt(\.\w+){3,}"),  # types in signatures that a room keeps to itself
]
suppress_warnings = ["myst.header"]  # a page may begin its first level after a list or a table

myst_enable_extensions = ["dollarmath", "html_image"]
myst_heading_anchors = 4
myst_links_external_new_tab = False

toc_object_entries = False  # the headings are the names; methods would make every page's navigation long
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_class_signature = "mixed"
autosummary_generate = False  # numpydoc loads the extension; the tables are those of tools/docs/site/build.py
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 80
numpydoc_show_class_members = False
numpydoc_attributes_as_param_list = True

smartquotes_action = "qe"  # two hyphens stay: they begin an option

html_theme = "furo"
html_title = f"tripwatt {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_js_files = ["search.js"]
html_favicon = "static/icon.svg"
html_copy_source = False
html_use_index = False  # no page links to it; the words of the search would be among the names
html_show_sourcelink = False
html_show_sphinx = False
html_theme_options: dict[str, list[str]] = {"top_of_page_buttons": []}
html_math_renderer = "mathml"
templates_path: list[str] = []
pygments_style = "a11y-high-contrast-light"
pygments_dark_style = "a11y-high-contrast-dark"

_LINK = re.compile(r"\]\(([^):#\s]+\.md)[^)]*\)")


def contents(index: str) -> str:
    """The table of contents of the site: the pages that each section below the entrances links to, in its order.

    Parameters
    ----------
    index : str
        The Markdown of the first page.

    Returns
    -------
    str
        One hidden `toctree` for each section with links, to be appended to the page.
    """
    seen: set[str] = set()
    trees = []
    lists = re.split(r"^## Where .*$", index, flags=re.MULTILINE)[
        -1
    ]  # entrances link to pages of the other sections
    for section in re.split(r"^## ", lists, flags=re.MULTILINE)[1:]:
        title, _, text = section.partition("\n")
        linked = (page for page in _LINK.findall(text) if page not in seen)
        pages = [page.removesuffix(".md") for page in linked if not re.match("gallery/(?!index)", page)]
        seen |= {f"{page}.md" for page in pages}
        if pages:
            trees += [
                "",
                "```{toctree}",
                ":hidden:",
                ":titlesonly:",
                f":caption: {title}",
                "",
                *dict.fromkeys(pages),
                "```",
            ]
    return "\n".join([*trees, ""])


def _add_contents(app: Any, docname: str, source: list[str]) -> None:
    if docname in ("index", "decisions/index", "gallery/index"):
        source[0] += contents(source[0])


def _lead_to_pages(app: Any, doctree: Any) -> None:
    """Words of the search lead to a page, not to a place in it, so that the search lists the page once."""
    for node in doctree.findall(index_node):
        node["entries"] = [
            (kind, word, "" if main else to, main, key) for kind, word, to, main, key in node["entries"]
        ]


def _skip_member(app: Any, what: str, name: str, thing: Any, skip: bool, options: Any) -> bool | None:
    """Methods that scikit-learn adds to each estimator are described by scikit-learn."""
    return True if re.fullmatch(r"set_\w+_request|get_metadata_routing", name) else None


def _fold_navigation(app: Any, pagename: str, template: str, context: dict[str, Any], doctree: Any) -> None:
    """Show in the navigation only pages below the open one: else each page links to all 150, which is a third of the build."""
    if toctree := context.get("toctree"):
        context["toctree"] = lambda **options: toctree(**{**options, "collapse": True})


def _inline(self: Any, node: Any) -> None:
    self.body.append(latex2mathml.tex2mathml(node.astext(), as_block=False))
    raise SkipNode


def _display(self: Any, node: Any) -> None:
    self.body.append(f'<div class="math">{latex2mathml.tex2mathml(node.astext(), as_block=True)}</div>')
    raise SkipNode


def setup(app: Any) -> dict[str, bool]:
    """Connect the contents and the formulas: MathML, which browsers draw without a script.

    Parameters
    ----------
    app : sphinx.application.Sphinx
        The application.

    Returns
    -------
    dict
        What Sphinx wants to know of an extension.
    """
    app.connect("source-read", _add_contents)
    app.connect("doctree-read", _lead_to_pages)
    app.connect("autodoc-skip-member", _skip_member)
    app.connect("html-page-context", _fold_navigation, priority=100)  # before the theme draws it
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
    return {"parallel_read_safe": True}


if not (Path(__file__).parent / "static").is_dir():
    raise FileNotFoundError("tools/docs/site/static")
