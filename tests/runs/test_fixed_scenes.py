# SPDX-License-Identifier: Apache-2.0
"""Forty fixed runs keep the bits that are recorded of them: a change of structure changes no number."""

import pytest

from tests.support import fixed_scenes
from tests.support.fixed_scenes import RUNS, machine, recorded

# Of each kind of run one; other quick tests need the same kernels, but for that of kl6.
QUICK = ("method psi_s float32", "method rk4", "method kl6(psi_s)", "statistics, sobol", "store with statistics")


@pytest.mark.guard
@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in RUNS]
)
def test_the_bits_are_those_recorded(name):
    known = recorded()
    if name not in known:
        pytest.skip(f"nothing is recorded for {machine()}: python -m tests.support.fixed_scenes --write")
    assert RUNS[name]() == known[name]


def test_there_are_forty():
    assert len(RUNS) >= 40


def test_two_trees_are_compared_by_name(monkeypatch):
    bits = {True: {"a": "1", "b": "2", "new": "4"}, False: {"a": "1", "b": "3", "old": "5"}}
    monkeypatch.setattr(fixed_scenes, "given_by", lambda root, pattern: bits[root == fixed_scenes.ROOT])
    monkeypatch.setattr(fixed_scenes.subprocess, "run", lambda *words, **settings: None)
    assert fixed_scenes.compared("HEAD") == (["new", "old"], {"a": True, "b": False})
