# SPDX-License-Identifier: Apache-2.0
"""Tests go through the doors: a file uses few names that no door has.

`python -m tests.house.test_internal_names` prints how many by folder.
"""

import ast
from collections import Counter, defaultdict

import lgvi_warp as lw
from tests.house.graph import ROOT, modules
from tests.support.public import DOORS

# The most names that a test file may use that no door has.
MOST = 25
# Those that have more: nobody adds to them.
MORE = {"unit/uncertainty/test_estimating.py": 37, "unit/cli/test_machine_verbs.py": 31,
        "unit/accuracy/test_stability_maps.py": 27, "unit/robustness/test_sweeps.py": 29}  # fmt: skip
FILES = sorted((ROOT / "tests").rglob("*.py"))


PUBLIC = {*lw.__all__, *DOORS}.union(*(door.__all__ for door in DOORS.values()))


def internal(path):
    """Names of the package that a file uses and no door has, those of an imported module one by one.

    The NumPy twin is written for tests, and does not count.
    """
    tree = ast.parse(path.read_text())
    asked = {alias.asname or alias.name: f"{node.module}.{alias.name}" for node in ast.walk(tree)
             if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("lgvi_warp")
             for alias in node.names}  # fmt: skip
    asked = {name: whole for name, whole in asked.items() if ".reference" not in whole}
    below = {name: whole for name, whole in asked.items() if whole in modules()}
    names = {whole for name, whole in asked.items() if name not in below and whole.rpartition(".")[2] not in PUBLIC}
    return names | {
        f"{below[node.value.id]}.{node.attr}" for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in below
        and node.attr not in PUBLIC
    }  # fmt: skip


def test_a_file_uses_few_names_that_no_door_has():
    counts = {str(path.relative_to(ROOT / "tests")): len(internal(path)) for path in FILES}
    over = {path: count for path, count in counts.items() if count > MORE.get(path, MOST)}
    assert over == {}, "go through a door: lw.solve, lw.tradeoff, lw.Scene.load, ..."


if __name__ == "__main__":
    by_folder, files = defaultdict(set), Counter()
    for path in FILES:
        by_folder[path.parent.relative_to(ROOT)].update(internal(path))
        files[path.relative_to(ROOT)] = len(internal(path))
    for folder, names in sorted(by_folder.items()):
        print(f"{len(names):5}  {folder}")
    print(f"{len(set().union(*by_folder.values())):5}  all together; files with the most:")
    print(*(f"{count:5}  {path}" for path, count in files.most_common(12)), sep="\n")
