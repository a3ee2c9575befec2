# SPDX-License-Identifier: Apache-2.0
"""The sweep of benchmarks/cases/sweep_peers is one sweep, whichever way it is written, and its lines are counted fairly."""

import importlib

import numpy as np
import pytest

from benchmarks.cases.sweep_peers import case

SOURCE = '''"""A docstring
of two lines."""

import os  # this counts

# this does not


def name(x):
    """Nor does this."""
    text = """but
this does"""
    return (text,
            x)
'''


def test_lines_of_code_are_counted_without_comments_and_docstrings():
    assert case.code_lines(SOURCE, ".py") == 6
    assert case.code_lines("# a comment\n\n[run]  # a table\nstep = 0.02\n", ".toml") == 2


def test_what_differs_by_more_than_methods_err_is_named():
    fine, coarse = {"iae position": (3e-3, 1.5e-3)}, {"iae position": (3e-3, 1e-3), "rms attitude": (0.0, 0.0)}
    assert (case.disagreements(fine, 1), case.disagreements(coarse, 1)) == ([], ["iae position"])
    assert case.disagreements({"settling_time depth": (np.inf, 0.1)}, 4) == ["settling_time depth"]


# A kernel is compiled, and both programs step member by member or in NumPy.
@pytest.mark.slow
@pytest.mark.parametrize("way", case.PEERS)
def test_programs_say_the_same_of_each_member(way):
    module, order, _, count = case.PEERS[way]
    if way == "auv_sim_bench":
        pytest.importorskip("auv_sim_bench")
    program = importlib.import_module(f"benchmarks.cases.sweep_peers.{module}")
    sweep = case.our_sweep(16)
    some = case.numbers_of(sweep, min(count, 16))
    cells, (success, _) = program.sweep(some)
    apart = case.differences(sweep, cells, program.sweep(some, 2)[0])
    assert case.disagreements(apart, order) == []
    # Members differ, and so do cells: what agrees is not a constant.
    assert np.ptp(cells["stiff", 0.2]["iae position"]) > 0.1
    assert not np.array_equal(cells["stiff", 0.2]["iae position"], cells["stiff", 0.0]["iae position"])
    if way == "NumPy":
        for cell in sweep.cells:
            at = cell.case.name, cell.point["controller.delay"]
            assert success[at] == pytest.approx(tuple(sweep.success(cell.case.name, cell.point)), abs=1e-12)
