# SPDX-License-Identifier: Apache-2.0
"""Every relative link of README, changelog, community files and docs leads to a file, and every anchor to a heading."""

import re

import pytest

from tests.conftest import ROOT

COMMUNITY = (ROOT / ".github").glob("[A-Z]*.md")
PAGES = sorted(
    [*ROOT.glob("*.md"), *COMMUNITY, *(page for page in (ROOT / "docs").rglob("*.md") if page.parent.name != "built")]
)
LINK = re.compile(r"\]\(([^)\s]+)\)")


def without_code(page):
    """The text of a page without its code blocks and code spans, which may hold brackets."""
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    return re.sub(r"`[^`\n]*`", "", "\n".join(line for line in text.splitlines() if not line.startswith("    ")))


def relative_links(page):
    """The targets of a page's links that lead to no other site."""
    return [target for target in LINK.findall(without_code(page)) if not re.match(r"[a-z]+:", target)]


def anchors(page):
    """The anchors of a page's headings, as GitHub writes them: small letters, digits, hyphens."""
    headings = re.findall(r"^#+ +(.*?) *$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def name(page):
    """The path of a page from the root."""
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_resolve(page):
    for target in relative_links(page):
        path, _, anchor = target.partition("#")
        goal = (page.parent / path).resolve() if path else page
        assert goal.is_relative_to(ROOT), f"{name(page)}: {target} is not there"
        assert goal.exists(), f"{name(page)}: {target} is not there"
        if anchor:
            assert anchor in anchors(goal), f"{name(page)}: {target} is not a heading of {name(goal)}"


def test_every_page_is_linked():
    linked = {(page.parent / target.partition("#")[0]).resolve() for page in PAGES for target in relative_links(page)}
    assert [name(page) for page in PAGES if page.parent != ROOT and page.resolve() not in linked] == []
    assert len(linked) > 30


def test_every_picture_is_shown():
    shown = {(page.parent / target).resolve() for page in PAGES for target in relative_links(page)}
    assert [name(picture) for picture in (ROOT / "docs").rglob("*.png") if picture not in shown] == []
