# SPDX-License-Identifier: Apache-2.0
"""The fenced snippets of the pages."""

import ast
import builtins
import re
import shutil
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


def reader(folder):
    """The folder, with what a reader has beside a script: `examples` of the source tree."""
    shutil.copytree(ROOT / "examples", folder / "examples")
    return folder


def missing_names(codes):
    """Names that blocks of code use and that neither they nor blocks before them have bound, by the block's number."""
    bound, missing = {*dir(builtins), "__name__"}, {}
    for number, code in enumerate(codes):
        nodes = list(ast.walk(ast.parse(code)))
        for node in nodes:
            if isinstance(node, ast.Name) and not isinstance(node.ctx, ast.Load):
                bound.add(node.id)
            elif isinstance(node, ast.FunctionDef | ast.ClassDef):
                bound.add(node.name)
            elif isinstance(node, ast.arg):
                bound.add(node.arg)
            elif isinstance(node, ast.Import | ast.ImportFrom):
                bound |= {(alias.asname or alias.name).split(".")[0] for alias in node.names}
        if wanting := {node.id for node in nodes if isinstance(node, ast.Name)} - bound:
            missing[number] = wanting
    return missing


def chains(code):
    """Chains of attributes of `lw` in code, such as ["distributions", "Normal"]."""
    found = []
    for node in ast.walk(ast.parse(code)):
        names = []
        while isinstance(node, ast.Attribute):
            names.append(node.attr)
            node = node.value
        if names and isinstance(node, ast.Name) and node.id == "lw":
            found.append(names[::-1])
    return found
