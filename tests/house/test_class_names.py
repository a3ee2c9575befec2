# SPDX-License-Identifier: Apache-2.0
"""One name, one class: no two classes of the host are called alike, but for a law and its twin or its device struct."""

import ast
from collections import defaultdict

from tests.conftest import ROOT


def host_classes():
    """(name, file) of each class, without the NumPy twins, and without the structs that Warp compiles."""
    for folder in ("lgvi_warp", "kernels/lgvi_kernels"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            if not (name.startswith("lgvi_warp/reference/") or "/twin/" in name):
                for node in ast.walk(ast.parse(path.read_text())):
                    if isinstance(node, ast.ClassDef) and "wp.struct" not in map(ast.unparse, node.decorator_list):
                        yield node.name, name


def test_no_class_name_stands_for_two_things():
    files = defaultdict(list)
    for name, file in host_classes():
        files[name].append(file)
    assert len(files) > 300
    assert {name: places for name, places in files.items() if len(places) > 1} == {}
