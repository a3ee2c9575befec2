# SPDX-License-Identifier: Apache-2.0
"""The fenced snippets of the pages."""

import re
from typing import NamedTuple

from tests.conftest import ROOT

FENCE = re.compile(r"^```(\w+)\n(.*?)^```\n?(?:\n((?:    [^\n]*\n)+))?", re.DOTALL | re.MULTILINE)


class Snippet(NamedTuple):
    """One snippet: the line on which it begins, its code, and what the page says it prints, or ""."""

    line: int
    code: str
    printed: str


def snippets(page, language):
    """All snippets of a page, whose path is from the root, in a language."""
    text = (ROOT / page).read_text()
    return [
        Snippet(
            text[: found.start()].count("\n") + 1, found[2], re.sub(r"^    ", "", found[3] or "", flags=re.MULTILINE)
        )
        for found in FENCE.finditer(text)
        if found[1] == language
    ]


def blocks(page, language):
    """The code alone."""
    return [one.code for one in snippets(page, language)]
