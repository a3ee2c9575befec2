# SPDX-License-Identifier: Apache-2.0
"""Thousands of broken scene files and --set arguments: accepted or refused by name, never anything else."""

from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import pytest

import lgvi_warp as lw
from lgvi_warp.control.base import SECTIONS
from tests.extremes.fuzz import CONTROLLED, GOOD, outcomes

SLOW = pytest.mark.slow


@pytest.mark.ci
@pytest.mark.parametrize(("kind", "cases", "kernels"), [
    ("files", 300, 0), ("set", 50, 0), ("controllers", 150, 0), pytest.param("files", 10_000, 4, marks=SLOW),
    pytest.param("set", 4000, 4, marks=SLOW), pytest.param("controllers", 5000, 4, marks=SLOW),
])  # fmt: skip
def test_broken_input(kind, cases, kernels):
    # The long run draws cases of its own, beyond those of the short one.
    first = 0 if not kernels else 100_000
    processes = 2 if kernels else 1
    edges = [first + cases * i // processes for i in range(processes + 1)]
    with ThreadPoolExecutor(processes) as pool:
        parts = list(pool.map(lambda ends: outcomes(kind, *ends, kernels), zip(edges, edges[1:])))
    found = {seed: outcome for part in parts for seed, outcome in part.items()}
    faults = [f"{kind} {seed}: {outcome}: {detail}" for seed, (outcome, detail) in found.items() if outcome not in GOOD]
    counts = Counter(outcome for outcome, _ in found.values())
    assert not faults, "\n".join(faults[:20])
    # What is drawn must try both ways out, and the kernel.
    assert len(found) == cases
    assert counts["refused"] > cases // 2
    # The short run builds no kernel but the paper's, which has no controller.
    assert (counts["ran"] if kernels or kind != "controllers" else counts["accepted"]) > cases // 200


def test_all_parts_of_controllers_are_among_what_is_broken(tmp_path):
    whole, seen = tmp_path / "whole.toml", set()
    for rest, section in CONTROLLED:
        whole.write_text(rest + section)
        seen |= {part.type for part in lw.Scene.load(whole).controller.parts}
    # A policy reads a file, and a callback is Python's: a scene file alone has neither.
    built_in = {
        word
        for base in SECTIONS.values()
        for word, kind in base.kinds.items()
        if kind.__module__.startswith("lgvi_warp.")
    }
    assert seen == built_in - {"policy", "callback"}
