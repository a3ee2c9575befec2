# SPDX-License-Identifier: Apache-2.0
"""A default is the same in the signature, in its docstring, in the command and its help, and in what lies below."""

import argparse
import ast
import inspect
import re

import numpy as np
import pytest

from lgvi_warp.cli.arguments import parser
from tests.house.graph import ROOT
from tests.support.public import NAMED

ENTRY = re.compile(r"^    (\w+): (.*(?:\n {8}.*)*)", re.MULTILINE)
# A number before a unit of its own, "10 MB", is not compared.
LITERAL = r'(-?[\d][\d,._]*(?:e-?\d+)?(?! MB)|"[^"]*"|True|False|None|\((?:[^()]*)\))'
SAID = (
    re.compile(rf"(?:^|[;,:.] |, of)\s*(?:by default|default) {LITERAL}(?=[,;.\s]|$)"),
    re.compile(rf"[;,.] {LITERAL}(?:,)? by default"),
    re.compile(rf"\(default:? {LITERAL}\)"),
)
# Rooms in which a folder belongs to one question.
ROOMS_OF_FOLDERS = ("measuring", "uncertainty", "robustness", "accuracy")


def value_of(text):
    """The value that a text names."""
    bare = text.rstrip(".,")
    return ast.literal_eval(bare.replace(",", "") if bare[0].isdigit() or bare[0] == "-" else bare)


def said(text):
    """Defaults that a text names."""
    return [value_of(found) for pattern in SAID for found in pattern.findall(" ".join(text.split()))]


def parameters(thing):
    """{name: default} of the arguments that have one."""
    try:
        found = inspect.signature(thing).parameters
    except (TypeError, ValueError):
        return {}
    return {name: one.default for name, one in found.items() if one.default is not inspect.Parameter.empty}


def same(first, second):
    """Whether two defaults are the same value; a number stands for an array of it, None for one that is chosen later."""
    if first is None or second is None or first == () or second == ():
        return True
    if isinstance(first, str) or isinstance(second, str):
        return first == second
    return isinstance(first, bool) == isinstance(second, bool) and bool(np.all(np.asarray(first) == np.asarray(second)))


def docstrings():
    """(name, argument, default of the signature, default of the docstring) of all public things and their methods."""
    for name, thing in NAMED.items():
        methods = (
            [member for key, member in vars(thing).items() if not key.startswith("_") and inspect.isfunction(member)]
            if isinstance(thing, type)
            else []
        )
        for one in (thing, *methods):
            defaults = parameters(one)
            for argument, text in ENTRY.findall(inspect.getdoc(one) or ""):
                for told in said(text):
                    if argument in defaults:
                        yield f"{name}.{getattr(one, '__name__', '')}", argument, defaults[argument], told


def actions():
    """(verb, action) of the command."""
    verbs = next(one for one in parser()._actions if isinstance(one, argparse._SubParsersAction))
    return [(verb, action) for verb, sub in verbs.choices.items() for action in sub._actions]


@pytest.mark.parametrize(("text", "expected"), [
    ("Relative error; 0.1 by default.", [0.1]), ("members, from 10,000; 1,000,000 by default. A pilot", [1_000_000]),
    ('"chains", the default', []), ('Ways; by default "los".', ["los"]), ("levels; by default (0.05, 0.5).", [(0.05, 0.5)]),
    ("points (default 24)", [24]), ("nothing here", []), ("by default the origin", []), ("False by default", []),
    ("or not; False by default.", [False]),
])  # fmt: skip
def test_the_reader_finds_a_default(text, expected):
    assert said(text) == expected


def test_docstrings_name_the_defaults_of_signatures():
    found = list(docstrings())
    assert len(found) > 150
    wrong = [one for one in found if not same(*one[2:])]
    assert wrong == []


def test_helps_name_the_defaults_of_options():
    wrong = [
        (verb, action.dest, action.default, told)
        for verb, action in actions()
        for told in said(action.help or "")
        if action.default is not None and not same(action.default, told)
    ]
    assert wrong == []


def folder_definitions(folder):
    """(file, definition, {argument or field: default}) below a folder."""
    for path in sorted(folder.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef):
                a = node.args
                plain = list(
                    zip([*a.posonlyargs, *a.args][-len(a.defaults) :] if a.defaults else [], a.defaults, strict=True)
                )
                keyed = [
                    (arg, default)
                    for arg, default in zip(a.kwonlyargs, a.kw_defaults, strict=True)
                    if default is not None
                ]
                yield path, node.name, {arg.arg: default for arg, default in plain + keyed}
            if isinstance(node, ast.ClassDef):
                yield path, node.name, {one.target.id: one.value for one in node.body if isinstance(one, ast.AnnAssign)
                                        and one.value is not None and isinstance(one.target, ast.Name)}  # fmt: skip


def test_what_lies_below_a_function_has_its_defaults():
    wrong, public = [], {getattr(one, "__name__", "") for one in NAMED.values()}
    for function in (one for one in NAMED.values() if inspect.isfunction(one)):
        defaults, home = parameters(function), ROOT.joinpath(*function.__module__.split(".")[:-1])
        if home.parent.name not in ROOMS_OF_FOLDERS:
            continue
        for path, name, below in folder_definitions(home):
            wrong += [
                (function.__name__, path.name, name, argument, node.value, defaults[argument])
                for argument, node in below.items()
                if name not in public and argument in defaults and isinstance(node, ast.Constant)
                if not same(node.value, defaults[argument])
            ]
    assert wrong == []
