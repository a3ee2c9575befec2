# SPDX-License-Identifier: Apache-2.0
"""Places where docstrings, names and pages are hard to read: `python -m tests.house.words [FOLDER]` prints them.

Rules: a docstring begins with a noun or a verb and has sentences of at most 30 words; a name says what it holds; a page has
sentences of at most 25 words, in lines of at most 160 characters.
"""

import ast
import re
import sys
from collections import Counter

from tests.house.graph import ROOT

PRONOUNS = {"what", "which", "how", "where", "those", "as", "of", "that", "who", "when", "there", "it"}
RIDDLES = {"told", "made", "found", "asked", "given", "together", "pieces", "looks", "then", "there", "other", "own", "whole",
           "left", "seen", "said", "known", "each", "one"}  # fmt: skip
WORDS_OF_A_DOCSTRING, WORDS_OF_A_PAGE, CHARACTERS = 30, 25, 160
FOLDERS = ("lgvi_warp", "kernels", "tests", "examples", "benchmarks", "docs")
# A message is two sentences, the problem and the remedy: lgvi_warp/common/sentences.py.
ONE_SENTENCE = re.compile(r"; (give|leave|write|use|did you mean) |^: (is|are|has|have|does) ")
DEFINITIONS = (ast.FunctionDef, ast.ClassDef, ast.Module)


def sentences(text):
    """The sentences of a text, code and formulas as one word each."""
    plain = re.sub(r"`[^`]*`|\$[^$]*\$", "x", text)
    return [sentence for sentence in re.split(r"(?<=[.!?:;])\s+", plain) if sentence]


def of_docstring(text):
    """Faults of a docstring."""
    first = text.split(None, 1)[0].strip("`(\"'").lower().rstrip(",:")
    if first in PRONOUNS:
        yield f"docstring begins with '{first}'"
    summary = re.split(r"\n\s*\n|Args:", text)[0]
    longest = max((len(sentence.split()) for sentence in sentences(summary)), default=0)
    if longest > WORDS_OF_A_DOCSTRING:
        yield f"docstring with a sentence of {longest} words"


def of_python(text):
    """(line, fault) of a source file."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, DEFINITIONS):
            yield from ((node.body[0].lineno, fault) for fault in of_docstring(ast.get_docstring(node) or "x"))
            if getattr(node, "name", "").strip("_") in RIDDLES:
                yield node.lineno, f"name that says little: {node.name}"
        texts = [getattr(each, "value", "") for each in node.values] if isinstance(node, ast.JoinedStr) else []
        if any(ONE_SENTENCE.search(str(text)) for text in texts):
            yield node.lineno, "message that is no sentence"
        if isinstance(node, ast.arg) and node.arg in RIDDLES:
            yield node.lineno, f"argument that says little: {node.arg}"


def of_page(text):
    """(line, fault) of a page; code, tables and titles are left out."""
    code = False
    for number, row in enumerate(text.splitlines(), 1):
        code ^= row.startswith("```")
        if code or row.startswith(("    ", "|", "#", "<", "!", "```")) or not row.strip():
            continue
        if len(row) > CHARACTERS:
            yield number, f"line of {len(row)} characters"
        for sentence in sentences(re.sub(r"\]\([^)]*\)", "]", row)):
            if len(sentence.split()) > WORDS_OF_A_PAGE:
                yield number, f"sentence of {len(sentence.split())} words"


def places(folder):
    """(path, line, fault) of all sources and pages below a folder, but for notebooks and the pages that a build writes."""
    for path in sorted((ROOT / folder).rglob("*")):
        if path.suffix in (".py", ".md") and not {"notebooks", "built"} & set(path.parts):
            reader = of_python if path.suffix == ".py" else of_page
            yield from ((path.relative_to(ROOT).as_posix(), *fault) for fault in reader(path.read_text()))


if __name__ == "__main__":
    rows = [row for folder in sys.argv[1:] or FOLDERS for row in places(folder)]
    print(*(f"{path}:{line}: {fault}" for path, line, fault in rows), sep="\n")
    print(len(rows), dict(Counter(path.split("/")[0] for path, _, _ in rows)))
