# SPDX-License-Identifier: Apache-2.0
"""Vehicles, states and steps drawn at random over the whole range: invariants hold, or the status says why they do not.

Each example draws a whole ensemble, so that one launch of one kernel tries many members.
"""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import lgvi_warp as lw
from lgvi_warp.common.status import Status
from lgvi_warp.physics import energy as invariants
from lgvi_warp.reference import rotation
from tests.extremes import extended
from tests.extremes.cases import UNIT, Case, Group, ensemble, twin

MEMBERS, H, STEPS = 32, 0.1, 40
EXAMPLES = pytest.mark.parametrize("examples", [6, pytest.param(300, marks=pytest.mark.slow)])
NUMBERS = 20
WHY = Status.STEP_TOO_LARGE, Status.NOT_CONVERGED, Status.NON_FINITE, Status.ENERGY_GREW
# A few members as hypothesis wants them, at the corners of the range and simple where they fail; the others at random.
CHOSEN = hnp.arrays(np.float64, (4, NUMBERS), elements=st.floats(-1.0, 1.0, width=32), fill=st.nothing())
UNIFORM = st.builds(
    lambda seed, some: np.concatenate([some, np.random.default_rng(seed).uniform(-1.0, 1.0, (MEMBERS - 4, NUMBERS))]),
    st.integers(0, 2**32 - 1),
    CHOSEN,
)
HARD = HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example


def searched(examples):
    """Hypothesis's settings: the fast run is the same every time, the long one is not."""
    return settings(
        max_examples=examples, deadline=None, derandomize=examples < 100, suppress_health_check=HARD, database=None
    )


def unit(v):
    """A direction, e1 for zero."""
    return v / np.linalg.norm(v) if np.linalg.norm(v) > 1e-3 else np.array([1.0, 0.0, 0.0])


def free(u):
    """Free bodies: mass 1e-6 to 1e9 kg, added mass to 100 times, inertia ratios to 1e4, h |Om| 1e-8 to 5."""
    mass = 10.0 ** (1.5 + 7.5 * u[0])
    size = (mass / 1000.0) ** (1.0 / 3.0)
    second = 10.0 ** (-2.0 + 2.0 * u[1:3])  # second moments along the axes: any three are a body's
    J = mass * size**2 * np.array([second[0] + second[1], 1.0 + second[1], 1.0 + second[0]])
    M = mass * (1.0 + 10.0 ** (2.0 * u[3:6]))
    x = 10.0 ** (-3.65 + 4.35 * u[6])
    R = lw.notation.matrix_from_rotation_vector(3.0 * u[7:10])
    Om, nu = x / H * unit(u[10:13]), 10.0 ** (2.0 * u[13] - 2.0) * size * unit(u[14:17])
    return Case("", M=M, J=J, Om=Om, nu=nu, R=R, b=size * u[17:20])


def drawn(u):
    return Group("free", H, STEPS, tuple(free(row) for row in u))


@pytest.mark.ci
@EXAMPLES
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("method", ["psi_s", "psi_x"])
def test_momenta_are_kept_or_the_status_says_why(method, dtype, examples):
    tried = {"ok": 0, "flagged": 0}

    @searched(examples)
    @given(UNIFORM)
    def check(u):
        group = drawn(u)
        fleet = ensemble(group)
        result = lw.solve(fleet, method, h=H, t1=H * STEPS, save=lw.SaveAt(every=H * STEPS / 4), dtype=dtype)
        well = np.asarray(result.status) == Status.OK
        tried["ok"] += well.sum()
        tried["flagged"] += (~well).sum()
        assert set(np.unique(result.status)) <= {Status.OK, *WHY}
        # Of a free body only the Munk moment can blow up: where its oscillation turns by more than a right angle a step.
        grew = np.asarray(result.status) == Status.ENERGY_GREW
        assert (munk_numbers(group)[grew] > 0.5 * np.pi).all()
        assert (result.failure_value[grew] > 100.0).all()
        R, P, L = result.attitude.astype(float), invariants.linear_momentum(result), invariants.angular_momentum(result)
        # A walk of STEPS steps with a dozen roundings each, and the rounding of samples: mathematics.md, section 5. psi_x
        # turns by shears of up to 4/3, 1 + t^2 a turn.
        bound = UNIT[dtype] * (20.0 * np.sqrt(12.0 * STEPS) + 40.0)
        assert np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3))[:, well].max(initial=0.0) < bound
        size = np.linalg.norm(P, axis=-1)
        spin = np.linalg.norm(L, axis=-1)
        weight = np.abs(result.position.astype(float)).max(axis=(0, 2)) * size.max(axis=0)
        largest = np.linalg.norm(np.stack([case.J * case.Om for case in group.cases]), axis=1)
        assert (np.abs(P - P[:1]).max(axis=(0, 2)) <= bound * size.max(axis=0))[well].all()
        net = fleet_residual(fleet) * H * STEPS
        way = np.abs(result.position).max(axis=(0, 2)) + 1.0
        assert (np.abs(L - L[:1]).max(axis=(0, 2)) <= bound * (spin.max(axis=0) + 4.0 * weight + largest) + net * way)[
            well
        ].all()

    check()
    assert tried["ok"] > 0.3 * MEMBERS * examples
    assert tried["flagged"] > 0.03 * MEMBERS * examples


def munk_numbers(group):
    """h w (n,) of the start, w^2 = |p|^2 (1 / M_min - 1 / M_max) / J_min."""
    M, J, nu = (np.stack([getattr(case, name) for case in group.cases]) for name in ("M", "J", "nu"))
    steep = (1.0 / M.min(axis=1) - 1.0 / M.max(axis=1)) / J.min(axis=1)
    return H * np.linalg.norm(M * nu, axis=1) * np.sqrt(steep)


def fleet_residual(fleet):
    """Remainder of m g - B for bodies meant to be weightless [N]: the round-off of the scene."""
    p = fleet.parameters(0, fleet.members)
    return np.abs(p["vehicle.mass"] * p["environment.gravity"] - p["vehicle.buoyancy"])


@pytest.mark.ci
@pytest.mark.parametrize("examples", [6, pytest.param(60, marks=pytest.mark.slow)])
def test_kernel_and_twin_agree_on_the_status(examples):
    # psi_s in extended precision tells whether every |J^-1 a| stayed below 1. Within a billionth of it either may be right,
    # and so after errors have grown to the size of the state.
    both = {True: 0, False: 0}

    @searched(examples)
    @given(UNIFORM)
    def check(u):
        group = drawn(u)
        body, x = twin(group)
        with np.errstate(all="ignore"):
            x, growth, _, _ = extended.with_growth(x, body, H, STEPS)
        result = lw.solve(ensemble(group), "psi_s", h=H, t1=H * STEPS)
        status = np.asarray(result.status)
        for i in range(MEMBERS):
            if growth[i] > 1e7 or status[i] == Status.NOT_CONVERGED or abs(result.failure_value[i] - 1.0) < 1e-9:
                continue
            both[bool(x.solvable[i])] += 1
            assert (status[i] == Status.OK) == bool(x.solvable[i]), group.cases[i]

    check()
    assert min(both.values()) > MEMBERS * examples // 50


def energy(case, p, pi):
    """Energy of a body without forces [J]."""
    return 0.5 * (p @ (p / case.M) + pi @ (pi / case.J))


@pytest.mark.ci
@EXAMPLES
def test_what_the_kernel_flags_at_once_has_no_sure_solution(examples):
    # One step: the reference's solver of (24), by Newton on the exponential map, against the kernel's on the first solve.
    @searched(examples)
    @given(UNIFORM)
    def check(u):
        group = drawn(u)
        result = lw.solve(ensemble(group), lw.Method("psi_1", "cayley"), h=H, t1=H)
        status = np.asarray(result.status)
        for i, case in enumerate(group.cases):
            # psi_1 drifts first: the Munk moment of half a step turns pi before it is solved for.
            p, R = case.M * case.nu, case.R
            pi = case.J * case.Om + 0.5 * H * np.cross(p, case.nu)
            reach = np.linalg.norm(H * pi / case.J)
            if abs(reach - 1.0) < 1e-9:
                continue
            if reach < 1.0:
                assert status[i] in (Status.OK, Status.NOT_CONVERGED, Status.ENERGY_GREW), (reach, case)
                if reach < 0.9:
                    F = rotation.cayley(H * pi, np.diag(case.J))
                    # The second half of the Munk moment, with the momentum as the turned body sees it.
                    p = F.T @ p
                    after = F.T @ pi + 0.5 * H * np.cross(p, p / case.M)
                    start = energy(case, case.M * case.nu, case.J * case.Om)
                    created = (energy(case, p, after) - start) / start
                    if abs(created - 100.0) > 1e-6:
                        assert (status[i] == Status.ENERGY_GREW) == (created > 100.0), (created, case)
                    if status[i] == Status.OK:
                        assert np.abs(result.attitude[-1, i] - R @ F).max() < 1e-11
                    else:
                        assert status[i] == Status.ENERGY_GREW
            else:
                assert status[i] == Status.STEP_TOO_LARGE

    check()
