# SPDX-License-Identifier: Apache-2.0
"""Equations of docs/theory/: which functions hold them, and how the site shows them, as MathML that browsers draw themselves.

A page has each equation in a fence of the language math, which GitHub draws. What has a number, by a tag, has below it a
line "Code:" with links to files, whose texts name the functions. A docstring names the page and the number in return.
"""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from docutils import nodes
from docutils.utils.math import latex2mathml

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "theory"
FENCE = re.compile(r"^```math\n(.*?)^```\n+(Code: (?:[^\n]+\n)+)?", re.DOTALL | re.MULTILINE)
TAG = re.compile(r"\\tag\{(\w+)\}")
LINK = re.compile(r"\[`([\w.]+)`\]\(([^)]+)\)")
# In a docstring or comment: docs/theory/integrator.md, (13), (14)
BACK = re.compile(r"docs/theory/(\w+)\.md((?:,\s+(?:#\s+)?\(\w+\))+)")
NUMBER = re.compile(r"(?<![\w)])\((\d{1,2}|[A-Z]\d{1,2})\)")
# Of what docutils writes: a hat over more than a letter grows by the accent alone, pairs in angle brackets stay small,
# functions need a space.
REPAIRS = (
    (
        r'<mover accent="false">(\s*<mi[^>]*>[^<]*</mi>\s*)<mo accent="true">\^</mo>',
        r'<mover accent="true">\1<mo stretchy="false">^</mo>',
    ),
    (r'<mo accent="true">\^</mo>', '<mo accent="true" stretchy="true">&#x302;</mo>'),
    (r'<mo class="mathopen">', '<mo class="mathopen" form="prefix">'),
    (r"<mo>\|</mo>", '<mo form="postfix">|</mo>'),
    (r"<mo>([⟨⟩])</mo>", r'<mo stretchy="false">\1</mo>'),
    (r"(</(?:mi|msub|msup|msubsup)>)(\s*<mi>(?:sin|cos|tan|arctan|exp)</mi>)", r'\1<mspace width="0.17em"></mspace>\2'),
    (
        r'<mo>&ApplyFunction;</mo>(?=\s*<(?:mi|mn|msub|msup|mfrac|mo class="mathopen"))',
        '<mspace width="0.17em"></mspace>',
    ),
)


class Holder(NamedTuple):
    """A function that holds an equation: its file, and its name there."""

    file: Path
    name: str


class Equation(NamedTuple):
    """An equation of a page; label: its number, "" for a step of a derivation; holders: what the line below it links to."""

    page: str
    label: str
    tex: str
    holders: tuple[Holder, ...]


def pages() -> list[Path]:
    """The pages with equations."""
    return sorted(FOLDER.glob("*.md"))


def equations_of(page: str, text: str) -> list[Equation]:
    """The equations of a page, in order."""
    found = []
    for tex, code in FENCE.findall(text):
        label = TAG.search(tex)
        links = tuple(holder(target, name) for name, target in LINK.findall(code))
        found.append(Equation(page, label[1] if label else "", TAG.sub("", tex).strip(), links))
    return found


def holder(target: str, name: str) -> Holder:
    """What a link stands for: the text begins with the name of the module, or of the package."""
    file = (FOLDER / target).resolve()
    module = file.parent.name if file.stem == "__init__" else file.stem
    return Holder(file, name.removeprefix(f"{module}.") if name.startswith(f"{module}.") else f"?{name}")


@cache
def equations() -> tuple[Equation, ...]:
    """All equations of all pages."""
    return tuple(each for page in pages() for each in equations_of(page.stem, page.read_text()))


@cache
def definitions(source: str) -> dict[str, tuple[int, int]]:
    """First and last line of each function, class and name that a module defines, methods as Class.method.

    Of a name without a docstring the comment above it counts.
    """
    lines, found = source.splitlines(), dict[str, tuple[int, int]]()

    def visit(body: list[ast.stmt], prefix: str) -> None:
        for node in body:
            last = node.end_lineno or node.lineno
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                first = min([node.lineno, *(each.lineno for each in node.decorator_list)])
                found[prefix + node.name] = first, last
                if isinstance(node, ast.ClassDef):
                    visit(node.body, f"{prefix}{node.name}.")
            elif isinstance(node, ast.Assign | ast.AnnAssign):
                first = node.lineno
                while first > 1 and lines[first - 2].lstrip().startswith("#"):
                    first -= 1
                for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                    if isinstance(target, ast.Name):
                        found[prefix + target.id] = first, last

    visit(ast.parse(source).body, "")
    return found


def named_back(text: str) -> Iterator[tuple[str, str]]:
    """(page, label) of each equation that a text names."""
    for page, labels in BACK.findall(text):
        for label in NUMBER.findall(labels):
            yield page, label


def mathml(tex: str, block: bool) -> str:
    """An equation as MathML, by the converter of docutils, which Sphinx brings."""
    text = str(latex2mathml.tex2mathml(tex, as_block=block))
    for pattern, put in REPAIRS:
        text = re.sub(pattern, put, text)
    return text


def show_inline(writer: nodes.NodeVisitor, node: nodes.math) -> None:
    """Write a formula within a line."""
    writer.body.append(mathml(node.astext(), False))  # type: ignore[attr-defined]
    raise nodes.SkipNode


def show_block(writer: nodes.NodeVisitor, node: nodes.math_block) -> None:
    """Write a formula on a line of its own, with its number and an anchor."""
    tex, number = node.astext(), TAG.search(node.astext())
    place, shown = "", ""
    if number:
        place = f' id="equation-{number[1]}"'
        shown = f'<a class="eqno" href="#equation-{number[1]}">({number[1]})</a>'
    body = mathml(TAG.sub("", tex).strip(), True)
    writer.body.append(f'<div class="math equation"{place}>{body}{shown}</div>\n')  # type: ignore[attr-defined]
    raise nodes.SkipNode


def link_numbers(page: str, tree: nodes.document) -> None:
    """Let each number in parentheses, such as (13), lead to its equation."""
    where = {each.label: each.page for each in equations() if each.label}
    for text in list(tree.findall(nodes.Text)):
        inside = text.parent
        if isinstance(inside, nodes.literal | nodes.reference | nodes.title | nodes.math | nodes.math_block):
            continue
        parts, at = list[nodes.Node](), 0
        for number in NUMBER.finditer(text):
            if number[1] in where:
                parts.append(nodes.Text(text[at : number.start()]))
                same = where[number[1]] == page
                goal = f"{'' if same else where[number[1]] + '.html'}#equation-{number[1]}"
                parts.append(nodes.reference("", number[0], refuri=goal, internal=True))
                at = number.end()
        if parts:
            inside.replace(text, [*parts, nodes.Text(text[at:])])
