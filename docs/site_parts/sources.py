# SPDX-License-Identifier: Apache-2.0
"""Pages of the site with the code that holds equations, each function with an anchor, and links back to its equations."""

import posixpath
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx

from . import equations


def page_of(file: Path) -> str:
    """The name of the site's page with the code of a file."""
    return f"sources/{file.relative_to(equations.ROOT).with_suffix('').as_posix()}"


def link_sources(name: str, tree: nodes.document) -> None:
    """Let links to code lead to the site's page of it, at the function that the link's text names."""
    for link in list(tree.findall(addnodes.download_reference)):
        named = re.fullmatch(r"[\w.]+", link.astext())
        if not link["reftarget"].endswith(".py") or not named:
            continue
        file, function = equations.holder(link["reftarget"], named[0])
        goal = posixpath.relpath(page_of(file), posixpath.dirname(name))
        link.replace_self(nodes.reference("", "", *link.children, refuri=f"{goal}.html#{function}", internal=True))


def source_pages(app: Sphinx) -> Iterator[tuple[str, dict[str, Any], str]]:
    """The pages, for Sphinx to write: name, what the template shows, template."""
    files = {holder.file for each in equations.equations() for holder in each.holders}
    for file in sorted(files):
        title, page = file.relative_to(equations.ROOT).as_posix(), page_of(file)
        body = f"<h1>{title}</h1>\n{shown(app, file.read_text(), posixpath.dirname(page))}"
        yield page, {"title": title, "body": body}, "page.html"


def shown(app: Sphinx, source: str, folder: str) -> str:
    """Code with colours, an anchor for each definition, and links for each equation that it names."""
    lines = app.builder.highlighter.highlight_block(source, "python").split("\n")  # type: ignore[attr-defined]
    for name, (first, _) in equations.definitions(source).items():
        lines[first - 1] = f'<span id="{name}"></span>{lines[first - 1]}'

    def linked(back: re.Match[str]) -> str:
        goal = posixpath.relpath(f"theory/{back[1]}", folder)
        labels = equations.NUMBER.sub(rf'<a href="{goal}.html#equation-\1">(\1)</a>', back[2])
        return f'<a href="{goal}.html">docs/theory/{back[1]}.md</a>{labels}'

    return equations.BACK.sub(linked, "\n".join(lines))
