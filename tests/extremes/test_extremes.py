# SPDX-License-Identifier: Apache-2.0
"""Every extreme is accurate to the bound stated for it, or flagged; never silently wrong."""

import functools

import pytest

from lgvi_warp.common.status import Status
from tests.extremes import cases
from tests.extremes.cases import DTYPES, GROUPS, METHODS, OK

pytestmark = pytest.mark.ci

# A bound above this says nothing; of float32, whose error is 2^29 times as large, only the case's own growth decides.
TELLING = 1e-3


@functools.cache
def outcome(name, method, dtype):
    """The group and what came of it."""
    group = GROUPS[name]()
    return group, cases.measured(group, method, dtype, truth(name, method))


@functools.cache
def truth(name, method):
    return cases.extended_run(GROUPS[name](), method)


@pytest.mark.slow_for("forced-psi_x*", "forced-psi_s-float32", "turning-psi_x-float32", "steps of 1e-06*")
@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", GROUPS)
def test_accurate_or_flagged(name, method, dtype):
    group, found = outcome(name, method, dtype)
    faults = []
    for i, case in enumerate(group.cases):
        status = Status(int(found.status[i]))
        if status not in case.expected(method):
            faults.append(f"{case.name}: {status.name} at error {found.error[i]:.2g}")
        elif status == OK and not found.error[i] <= found.bound[i]:
            faults.append(f"{case.name}: error {found.error[i]:.2g}, bound {found.bound[i]:.2g}")
        elif status == OK and not found.position_error[i] <= found.position_bound[i]:
            faults.append(f"{case.name}: position {found.position_error[i]:.2g}, bound {found.position_bound[i]:.2g}")
        elif status == OK and dtype == "float64" and len(case.expected(method)) == 1 and found.bound[i] > TELLING:
            faults.append(f"{case.name}: a bound of {found.bound[i]:.2g} says nothing")
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize("dtype", ["float64", pytest.param("float32", marks=pytest.mark.slow)])
def test_cayley_solves_what_the_quartic_cannot(dtype):
    # Slender bodies at large steps: the quartic's root is lost among its fourth powers, Cayley's parameter is not.
    group = GROUPS["turning"]()
    quartic = outcome("turning", "psi_s", dtype)[1]
    cayley = cases.measured(group, "psi_s", dtype, truth("turning", "psi_s"), "cayley")
    lost = quartic.status == Status.NOT_CONVERGED
    assert lost.sum() >= 5
    assert (cayley.status[lost] != Status.NOT_CONVERGED).all()
    # Of a path that round-off alone moves as far as the motion goes, round-off decides whether (24) has a solution.
    certain = lost & (cayley.bound < 1.0)
    assert certain.sum() >= 3
    assert (cayley.status[certain] == OK).all()
    solved = lost & (cayley.status == OK)
    assert (cayley.error[solved] <= cayley.bound[solved]).all()
