# SPDX-License-Identifier: Apache-2.0
"""Steps with every term alone, and with all together: the kernel against its twin, in several methods and both precisions.

A kernel with one law alone shows no more than one with all, beside test_device_code.py: it is left to test-long.
"""

from dataclasses import replace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.methods.method import FORCED, PROGRAMS
from lgvi_warp.reference import advance
from lgvi_warp.reference.submaps import Body, look, start, water
from lgvi_warp.reference.terms.current import Current
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.weight import Weight
from tests.laws import cases
from tests.laws.case import Case, case, matrix
from tests.laws.cases import CASES, together
from tests.support.tools import TURN, difference, from_state, last, one, slope

GRAVITY = 9.8
VEHICLE = lw.Vehicle(
    20.0,
    inertia=(1.5, 4.0, 4.5),
    added_mass=(5.0, 22.0, 25.0),
    buoyancy=21.5 * GRAVITY,
    center_of_buoyancy=(0.01, 0.005, -0.02),
)
STATE = {"b": (0.4, -0.3, 8.0), "R": lw.notation.matrix_from_rotation_vector(np.array([0.3, -0.4, 0.8])),
         "nu": (1.2, 0.3, -0.2), "Om": (0.3, -0.4, 0.5)}  # fmt: skip


# Masses and moments of inertia about axes of their own, which are not those of drag.
BENT = replace(
    VEHICLE, inertia=TURN @ np.diag((1.5, 4.0, 4.5)) @ TURN.T, added_mass=TURN.T @ np.diag((5.0, 22.0, 25.0)) @ TURN
)


def scene_of(case, vehicle=VEHICLE):
    """The vehicle with the terms of a case."""
    return lw.Scene(vehicle, lw.Environment(gravity=GRAVITY), terms=list(case.terms))


def body_of(case, v=VEHICLE):
    """The same for the twin."""
    laws = (Weight(net=v.mass * GRAVITY - v.buoyancy), Restoring(moment=v.buoyancy * v.center_of_buoyancy), *case.laws)
    excess = v.buoyancy / GRAVITY - v.mass
    lever = v.buoyancy / GRAVITY * v.center_of_buoyancy
    return Body(v.mass_matrix, v.inertia, laws, excess, lever, v.mass)


def both(case, method, h, steps, dtype="float64", vehicle=VEHICLE, state=STATE):
    """The state after so many steps by the kernel and by the twin."""
    result = lw.solve(one(scene_of(case, vehicle), **state), method, h=h, t1=steps * h, dtype=dtype)
    body = body_of(case, vehicle)
    b, R, nu, Om = (np.array(value) for value in state.values())
    x = start(body, b, R, np.zeros(3), np.zeros(3))
    nu = nu - R.T @ water(look(x, body, h), body).velocity
    x = start(body, b, R, body.M @ nu, body.J @ Om)
    forced = method in FORCED and any(not law.potential_force and not isinstance(law, Current) for law in case.laws)
    x = advance.advance(x, body, (FORCED if forced else PROGRAMS)[method], h, steps)
    assert result.status.counts() == {"ok": 1}
    b, R, nu, Om = from_state(body, x)
    return last(result), (b, R, nu + R.T @ water(look(x, body, h), body).velocity, Om)


def test_all_together_has_every_type():
    types = {type(term) for case in CASES.values() for term in case.terms}
    assert {type(term) for term in CASES["all together"].terms} == types - {lw.terms.Drag}


# Drag along the axes, which has no matrix beside it, and one law of each type at once.
@pytest.mark.ci
@pytest.mark.slow_but("quadratic drag", "drag", "all together")
@pytest.mark.parametrize("name", CASES)
def test_one_step(name):
    kernel, twin = both(CASES[name], "psi_s", 0.02, 1)
    assert difference(kernel, twin) < 1e-13


@pytest.mark.ci
@pytest.mark.slow_but("quadratic drag", "drag", "all together")
@pytest.mark.parametrize("name", CASES)
def test_a_hundred_steps(name):
    # 100 steps of round-off 1e-15 and little growth.
    kernel, twin = both(CASES[name], "psi_s", 0.02, 100)
    assert difference(kernel, twin) < 2e-12


@pytest.mark.ci
def test_drag_along_axes_that_are_not_principal():
    # Strong in yaw and sway: each axis changes the velocities along all others.
    strong = case(lw.terms.Drag, linear=(8.0, 60.0, 5.0, 0.7, 0.4, 9.0), quadratic=(10.0, 30.0, 90.0, 1.0, 6.0, 3.0))
    kernel, twin = both(strong, "psi_s", 0.05, 10, vehicle=BENT)
    assert difference(kernel, twin) < 2e-13


def scaled(term, by):
    """Numbers times a factor, and the term with them; not a command, the first of its schedule, nor polynomials."""
    numbers = {key: by * value for key, value in term.parameters().items() if key not in FIXED}
    return numbers, replace(term, **numbers, **({"command": None} if "command" in term.parameters() else {}))


FIXED = ("scenario", "command", "polynomial", "polynomial_astern", "table_commands", "lift_angles")
# Packed the same for one member as for many, to the bit.
EXACT = ("current harmonics", "waves", "Gauss-Markov current", "wrench noise", "stratification")


@pytest.mark.ci
@pytest.mark.slow_but("quadratic drag")
@pytest.mark.parametrize("name", [name for name in CASES if name != "control fins"])
def test_every_number_may_vary(name):
    # Members with numbers of their own, in packets, go where a scene with their numbers takes them.
    scales, varied, scenes = (1.0, 0.7, 1.3), {}, []
    for by in scales:
        terms = []
        for term in CASES[name].terms:
            numbers, other = scaled(term, by)
            terms.append(other)
            for key, value in numbers.items():
                varied.setdefault(f"{term.key}.{key}", []).append(value)
        scenes.append(scene_of(Case(tuple(terms), ())))
    states = [np.broadcast_to(value, (3, *np.shape(value))) for value in STATE.values()]
    fleet = lw.Ensemble.from_states(
        scenes[0], *states, parameters={key: np.array(each) for key, each in varied.items()}
    )
    whole = lw.solve(fleet, "psi_s", h=0.02, t1=1.0)
    assert whole.status.counts() == {"ok": 3}
    for i, scene in enumerate(scenes):
        alone = lw.solve(lw.Ensemble.from_states(scene, *states).subset([i]), "psi_s", h=0.02, t1=1.0)
        assert difference(last(alone), last(whole, i)) <= (0.0 if name in EXACT else 1e-14)


# Each of the two wants that no law draws noise; drag, water that varies, tables, memory and a potential.
FORCED_CASES = {"several": together("drag matrix", "current profile", "wrench schedule", "thrusters", "tether")} | {
    name: case for name, case in CASES.items() if not any(word in name for word in ("noise", "Gauss", "all"))
}


# psi holds both of its halves, phi and phi_adjoint.
@pytest.mark.ci
@pytest.mark.slow_but("several-psi")
@pytest.mark.parametrize("method", ["psi", "phi", "phi_adjoint"])
@pytest.mark.parametrize("name", FORCED_CASES)
def test_the_papers_forces(name, method):
    # Phi* is iterated to 1e-14 of the momenta; a contraction by 1/10 or better leaves about 1e-15 of that, each step.
    kernel, twin = both(FORCED_CASES[name], method, 0.01, 5)
    assert difference(kernel, twin) < 2e-13


@pytest.mark.ci
def test_forces_that_turn_the_momenta():
    # From -3/4 to 1/4 of the impulse of a step: in both halves the impulse is more than the momenta that are left.
    force, h = np.array((1000.0, -300.0, 200.0)), 0.01
    calm = {
        "drag_matrix": {"linear": 0.01 * matrix(1), "quadratic": 0.01 * matrix(2)},
        "current_profile": {"velocities": ((-1e-3, 2e-3, -1e-3), (1e-3, -2e-3, 1e-3))},
        "wrench_schedule": {"force": (tuple(force),) * 4, "torque": ((0.02, -0.02, 0.01),) * 4},
    }
    terms = tuple(replace(term, **calm.get(term.type, {})) for term in FORCED_CASES["several"].terms)
    velocity = -0.75 * h * np.linalg.solve(VEHICLE.mass_matrix, force)
    fleet = one(scene_of(Case(terms, ())), **STATE | {"nu": velocity, "Om": (0.003, -0.004, 0.005)})
    assert lw.solve(fleet, "psi", h=h, t1=h).status.counts() == {"ok": 1}


# Velocities at the nodes of a field that are linear in place and time, so that no slope jumps between two cells.
LINEAR_FIELD = 0.1 * np.moveaxis(np.indices((2, 3, 5, 4, 3)), 0, -1) @ np.random.default_rng(9).normal(size=(5, 3))
# Numbers for which nothing of "all together" jumps: schedules that stay, noise too small to be seen, a hull of one part.
HELD = {
    "current_field": {"velocities": LINEAR_FIELD},
    "wrench_schedule": {"force": ((5.0, -2.0, 1.0),) * 4, "torque": ((0.2, -0.2, 0.1),) * 4},
    "thrusters": {"command": None, "command_schedule": ((0.3, 0.8, -0.7),) * 3},
    "control_fins": {"command": None, "command_schedule": ((0.1, 0.15, -0.2),) * 4},
    "wrench_noise": {"force": (1e-30,) * 3, "torque": (1e-30,) * 3},
    "gauss_markov_current": {"standard_deviation": (1e-30,) * 3},
    **cases.HELD,
}
SMOOTH = {name: case.terms for name, case in CASES.items() if case.smooth} | {
    "all together": tuple(replace(term, **HELD.get(term.type, {})) for term in CASES["all together"].terms)
}


@pytest.mark.ci
@pytest.mark.slow_but("drag", "all together")
@pytest.mark.parametrize("name", SMOOTH)
def test_order_two(name):
    # Against the same kernel at a step 8 times shorter: an error of order 2 there is 1/64 of the shortest one's here.
    scene = lw.Scene(VEHICLE, lw.Environment(gravity=GRAVITY), terms=list(SMOOTH[name]))
    fleet = one(scene, **STATE)
    # All at once move it so much that only shorter steps are in the range of the leading error.
    steps = np.array([0.04, 0.02, 0.01]) * (0.25 if name == "all together" else 1.0)
    truth = last(lw.solve(fleet, "psi_s", h=steps[-1] / 8.0, t1=0.8))
    errors = [difference(last(lw.solve(fleet, "psi_s", h=h, t1=0.8)), truth) for h in steps]
    # A slope over a factor 4 in the step shows the next term of the error, and the truth's own 1/64.
    assert slope(steps, errors) == pytest.approx(2.0, abs=0.12)


SINGLE = {"several": together("drag matrix", "current profile", "wrench", "fins")} | CASES


@pytest.mark.ci
@pytest.mark.slow_but("several")
@pytest.mark.parametrize("name", SINGLE)
def test_float32(name):
    # Round-off 6e-8 of each of 20 steps' few operations on numbers of order 1 to 10, added up as a random walk.
    kernel, twin = both(SINGLE[name], "psi_s", 0.02, 20, "float32")
    assert difference(kernel, twin) < 5e-6
