# SPDX-License-Identifier: Apache-2.0
"""The order of the site, by `docs/pages.md`, and its first page: `docs/index.md` with the sections that are links as cards."""

import re
from pathlib import Path

DOCS = Path(__file__).parents[1]
# A page that stands elsewhere -> its copy in the site.
COPIES = {"../CHANGELOG": "reference/built/changelog"}
# A line for those who read the pages without the site and its side bar.
ON_GITHUB = re.compile(r"^\[All pages.*\]\((?:\.\./)*pages\.md\)\n", re.MULTILINE)
# Words that a reader looks for and that the text of a page does not say in this way.
WORDS = re.compile(r"^<!-- search: (.+?) -->\n", re.MULTILINE)
CARD = re.compile(
    r"^## \[(.+?)\]\((.+?)\.md\)\n\n!\[(.+?)\]\((.+?)\)\n\n(.+?)\n(?=\n(?:#|\[)|\Z)", re.MULTILINE | re.DOTALL
)


def captions(text: str) -> dict[str, list[tuple[str, str, str]]]:
    """Caption -> its pages, in order: indentation, text of the link, page without its suffix."""
    found = {}
    for part in text.split("\n## ")[1:]:
        rows = re.findall(r"^( *)\* \[(.+?)\]\((.+?)\.(?:md|ipynb)\)$", part, re.MULTILINE)
        found[part.partition("\n")[0]] = [(indent, title, COPIES.get(page, page)) for indent, title, page in rows]
    return found


def side_bar(text: str) -> str:
    """The tables of contents of the root: by caption, without the pages that stand below another."""
    return "".join(
        _table([f"{title} </{page}>" for indent, title, page in rows if not indent], caption)
        for caption, rows in captions(text).items()
    )


def below(text: str) -> dict[str, list[str]]:
    """Page -> the entries of the pages below it."""
    found: dict[str, list[str]] = {}
    for rows in captions(text).values():
        upper = ""
        for indent, title, page in rows:
            if indent:
                found.setdefault(upper, []).append(f"{title} </{page}>")
            else:
                upper = page
    return found


def contents(entries: list[str]) -> str:
    """The table of contents of a page that has pages below it."""
    return _table(entries) if entries else ""


def landing(text: str) -> str:
    """The first page of the site: its sections whose titles are links as cards in a grid."""
    cards = list(CARD.finditer(text))
    head, tail = text[: cards[0].start()], text[cards[-1].end() :]
    grid = "\n".join(map(_card, cards))
    return f"{head}`````{{grid}} 1 1 2 2\n:gutter: 3\n:class-container: landing\n\n{grid}`````\n{tail}"


def indexed(text: str) -> str:
    """A page whose words to search for are entries of the index, below its title."""
    words = [word.strip() for line in WORDS.findall(text) for word in line.split(",")]
    title, rest = WORDS.sub("", text).split("\n", 1)
    entries = "".join(f"\n```{{index}} ! {word}\n```\n" for word in words)
    return f"{title}\n{entries}{rest}" if words else text


def _card(section: re.Match[str]) -> str:
    title, page, alt, picture, text = section.groups()
    options = f":link: {page}\n:link-type: doc\n:img-top: {picture}\n:img-alt: {alt}\n"
    return f"````{{grid-item-card}} {title}\n{options}\n{text}\n````\n"


def _table(entries: list[str], caption: str = "") -> str:
    head = f":caption: {caption}\n" if caption else ""
    return "\n\n```{toctree}\n:hidden:\n" + head + "\n" + "\n".join(entries) + "\n```\n"
