# SPDX-License-Identifier: Apache-2.0
"""The documentation site: `make docs` builds it, without network, from the Markdown pages and the docstrings."""

import inspect
import os
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx

DOCS = Path(__file__).parent
sys.path[:0] = [str(DOCS), str(DOCS.parent), str(DOCS.parent / "kernels")]

from site_parts import equations, order, pages, sources  # noqa: E402

import lgvi_warp as lw  # noqa: E402

project = "lgvi_warp"
version = release = lw.__version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx_copybutton", "sphinx_design"]
# The side bar is this page.
exclude_patterns = ["pages.md"]
html_theme = "furo"
html_static_path = ["site_parts/static"]
html_css_files = ["site.css", "equations.css"]
html_search_scorer = str(DOCS / "site_parts/static/scorer.js")
templates_path = ["site_parts/templates"]
SOURCE = tomllib.loads((DOCS.parent / "pyproject.toml").read_text())["project"]["urls"]["Source"]
html_theme_options = {"source_repository": SOURCE, "source_branch": "main", "source_directory": "docs/"}
# Versions that are published beside this one, newest first: `LGVI_WARP_SITES="0.2.0 0.1.0" make docs`.
html_context = {"sites": os.environ.get("LGVI_WARP_SITES", "").split()}
html_sidebars = {"**": [
    "sidebar/brand.html", "versions.html", "sidebar/search.html", "sidebar/scroll-start.html", "sidebar/navigation.html",
    "sidebar/scroll-end.html", "sidebar/variant-selector.html",
]}  # fmt: skip
html_title = f"lgvi_warp {release}"
html_show_sphinx = html_show_copyright = False
html_copy_source = False
# What a copy button takes of a block with prompts: the lines that are typed, without their prompt.
copybutton_prompt_text = "$ "
add_module_names = False
autodoc_typehints = "none"
autodoc_member_order = "bysource"
maximum_signature_line_length = 100
myst_heading_anchors = 4
# $a$ in a line, and fences of the language math, as GitHub has them. Browsers draw MathML: no script and no font to fetch.
myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]
html_math_renderer = "mathml"
# The site shows the stored outputs of notebooks; `make docs` compares them with those of a fresh execution.
nb_execution_mode = "off"
highlight_language = "none"
smartquotes = False

DOORS = "|".join(name for name in lw.__all__ if inspect.ismodule(getattr(lw, name)))
PAGES = (DOCS / "pages.md").read_text()
# Page -> the pages below it: those of pages.md, and those that the build writes.
BELOW = order.below(PAGES) | {
    "guide/terms/README": [f"/guide/terms/{page.stem}" for page in sorted(DOCS.glob("guide/terms/[a-z]*.md"))],
    "reference/api": [f"/reference/built/{pages.slug(title)}" for title in pages.groups()],
    "start/scene_file": ["Key by key </reference/built/scene_file_keys>"],
    "start/cli": ["The command's own help </reference/built/command_help>"],
}


def fit_to_site(app: Sphinx, name: str, content: list[str]) -> None:
    """Lay out the first page, add index terms and tables of contents, and link to the site's copy of the changelog."""
    content[0] = order.ON_GITHUB.sub("", content[0])
    if name == app.config.root_doc:
        content[0] = order.landing(content[0]) + order.side_bar(PAGES)
    copy = "../" * name.count("/") + "reference/built/changelog.md"
    content[0] = order.indexed(re.sub(r"\]\((?:\.\./)+CHANGELOG\.md\)", f"]({copy})", content[0]))
    content[0] += order.contents(BELOW.get(name, []))


def document(app: Sphinx, what: str, name: str, subject: Any, options: Any, lines: list[str]) -> None:
    """Put the types and defaults of parameters into a docstring."""
    lines[:] = pages.fields(subject, "\n".join(lines))


def show_defaults(
    app: Sphinx, what: str, name: str, subject: Any, options: Any, signature: str | None, result: str | None
) -> Any:
    """Show every default in a signature."""
    return (pages.signature(subject, signature), result) if signature else None


def link_public_names(app: Sphinx, tree: nodes.document) -> None:
    """Let each `lw.Name` of the text lead to its entry in the reference."""
    for literal in list(tree.findall(nodes.literal)):
        found = re.match(rf"lw\.((?:(?:{DOORS})\.)?\w+)", literal.astext())
        if found and not isinstance(literal.parent, nodes.reference | nodes.title | addnodes.pending_xref):
            target = {"refdomain": "py", "reftype": "obj", "reftarget": f"lgvi_warp.{found[1]}"}
            link = addnodes.pending_xref("", refdoc=app.env.docname, refexplicit=True, **target)
            literal.replace_self(link)
            link += literal


def link_theory(app: Sphinx, tree: nodes.document) -> None:
    """Link the pages of the theory to the code, and numbers of equations to these."""
    if app.env.docname.startswith("theory/"):
        sources.link_sources(app.env.docname, tree)
        equations.link_numbers(app.env.docname.removeprefix("theory/"), tree)


def use_dashes(app: Sphinx, tree: nodes.document) -> None:
    """Put a dash between a parameter and its text, where Sphinx writes two hyphens."""
    for text in list(tree.findall(nodes.Text)):
        if text == " -- ":
            text.parent.replace(text, nodes.Text(" \N{EN DASH} "))


def setup(app: Sphinx) -> None:
    """Write the reference, then build."""
    pages.write(DOCS / "reference" / "built")
    app.connect("source-read", fit_to_site)
    app.connect("autodoc-process-docstring", document)
    app.connect("autodoc-process-signature", show_defaults)
    app.connect("doctree-read", link_public_names)
    app.connect("doctree-read", use_dashes)
    # Before Sphinx takes links to files for downloads.
    app.connect("doctree-read", link_theory, priority=400)
    app.add_html_math_renderer("mathml", (equations.show_inline, None), (equations.show_block, None))
    app.connect("html-collect-pages", sources.source_pages)
