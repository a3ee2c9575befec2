"""Every term alone, and all together: the kernel against its twin, in several methods and both precisions."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.methods.method import FORCED, PROGRAMS
from lgvi_warp.reference import advance
from lgvi_warp.reference.submaps import Body, look, start, water
from lgvi_warp.reference.terms.current import Current
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.weight import Weight
from tests.laws.cases import CASES
from tests.support.tools import difference, from_state, last, one, slope

GRAVITY = 9.8
VEHICLE = lw.Vehicle(20.0, (1.5, 4.0, 4.5), (5.0, 22.0, 25.0), 21.5 * GRAVITY, (0.01, 0.005, -0.02))
STATE = {"b": (0.4, -0.3, 8.0), "R": lw.notation.matrix_from_rotation_vector(np.array([0.3, -0.4, 0.8])),
         "nu": (1.2, 0.3, -0.2), "Om": (0.3, -0.4, 0.5)}  # fmt: skip


def scene_of(case):
    """The vehicle with the terms of a case."""
    return lw.Scene(VEHICLE, lw.Environment(gravity=GRAVITY), terms=list(case.terms))


def body_of(case):
    """The same for the twin."""
    v = VEHICLE
    laws = (Weight(net=v.mass * GRAVITY - v.buoyancy), Restoring(moment=v.buoyancy * v.center_of_buoyancy), *case.laws)
    excess = v.buoyancy / GRAVITY - v.mass
    lever = v.buoyancy / GRAVITY * v.center_of_buoyancy
    return Body(v.mass_matrix, v.inertia, laws, excess, lever)


def both(case, method, h, steps, dtype="float64", **named):
    """The state after so many steps by the kernel and by the twin."""
    result = lw.solve(one(scene_of(case), **STATE), method, h=h, t1=steps * h, dtype=dtype, **named)
    body = body_of(case)
    b, R, nu, Om = (np.array(value) for value in STATE.values())
    x = start(body, b, R, np.zeros(3), np.zeros(3))
    nu = nu - R.T @ water(look(x, body, h), body).velocity
    x = start(body, b, R, body.M @ nu, body.J @ Om)
    forced = method in FORCED and any(not law.potential_force and not isinstance(law, Current) for law in case.laws)
    x = advance.advance(x, body, (FORCED if forced else PROGRAMS)[method], h, steps)
    assert result.status.counts() == {"ok": 1}
    b, R, nu, Om = from_state(body, x)
    return last(result), (b, R, nu + R.T @ water(look(x, body, h), body).velocity, Om)


@pytest.mark.slow_for("control fins", "two wrench*")
@pytest.mark.parametrize("name", CASES)
def test_one_step(name):
    kernel, twin = both(CASES[name], "psi_s", 0.02, 1)
    assert difference(kernel, twin) < 1e-13


@pytest.mark.slow_for("control fins", "two wrench*")
@pytest.mark.parametrize("name", CASES)
def test_a_hundred_steps(name):
    # 100 steps of round-off 1e-15 and little growth.
    kernel, twin = both(CASES[name], "psi_s", 0.02, 100)
    assert difference(kernel, twin) < 2e-12


# psi, which holds both of its halves, with every law; the halves alone in test-long.
@pytest.mark.slow_for(
    "body lift*",
    "control fins*",
    "cross-flow*",
    "current harmonics*",
    "current-*",
    "stratification*",
    "waves*",
    "wrench-*",
)
@pytest.mark.parametrize(
    "method", ["psi", *(pytest.param(name, marks=pytest.mark.slow) for name in ("phi", "phi_adjoint"))]
)
@pytest.mark.parametrize(
    "name", [name for name in CASES if not any(word in name for word in ("noise", "Gauss", "all"))]
)
def test_the_papers_forces(name, method):
    # Phi* is iterated to 1e-14 of the momenta; a contraction by 1/10 or better leaves about 1e-15 of that, each step.
    kernel, twin = both(CASES[name], method, 0.01, 5)
    assert difference(kernel, twin) < 2e-13


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.smooth])
def test_order_two(name):
    # Against the same kernel at a step 8 times shorter: an error of order 2 there is 1/64 of the shortest one's here.
    fleet = one(scene_of(CASES[name]), **STATE)
    steps = np.array([0.04, 0.02, 0.01])
    truth = last(lw.solve(fleet, "psi_s", h=0.00125, t1=0.8))
    errors = [difference(last(lw.solve(fleet, "psi_s", h=h, t1=0.8)), truth) for h in steps]
    # A slope over a factor 4 in the step shows the next term of the error, and the truth's own 1/64.
    assert slope(steps, errors) == pytest.approx(2.0, abs=0.12)


@pytest.mark.slow_but("current profile", "drag", "wrench")
@pytest.mark.parametrize("name", CASES)
def test_float32(name):
    # Round-off 6e-8 of each of 20 steps' few operations on numbers of order 1 to 10, added up as a random walk.
    kernel, twin = both(CASES[name], "psi_s", 0.02, 20, "float32")
    assert difference(kernel, twin) < 5e-6
