# SPDX-License-Identifier: Apache-2.0
"""psi_x, psi_x8 and psi_w with a full 6x6 inertia and every law: the kernel against the twin."""

from dataclasses import replace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.extensions.gliders.twin.stratification import Stratification
from lgvi_warp.extensions.gliders.twin.surface_buoyancy import SurfaceBuoyancy
from lgvi_warp.physics.notation import hat
from lgvi_warp.reference import coupled
from lgvi_warp.reference.submaps import Body, K, State, look, start, water
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.weight import Weight
from tests.laws.cases import CASES
from tests.support.tools import difference, last, one

GRAVITY = 9.8
MASS, CENTER, LIFT = 20.0, np.array([0.03, -0.02, 0.06]), np.array([0.01, 0.0, -0.02])
WEIGHT, BUOYANCY = 196.0, 198.0
INERTIA = np.array([
    [24, 0.3, -0.2, 0.1, 0.9, 0.6], [0.3, 42, 0.5, -0.8, 0.15, 1.8], [-0.2, 0.5, 48, -0.5, -1.5, 0.05],
    [0.1, -0.8, -0.5, 0.98, 0.032, -0.066], [0.9, 0.15, -1.5, 0.032, 3.59, 0.074], [0.6, 1.8, 0.05, -0.066, 0.074, 3.326],
])  # fmt: skip
RIGID = np.block([[MASS * np.eye(3), -MASS * hat(CENTER)], [MASS * hat(CENTER), np.diag([0.5, 2.5, 2.5])]])
STATE = {"b": (1.0, -2.0, 10.0), "R": coupled.cay(np.array([0.5, 0.25, -0.25])), "nu": (1.0, 0.2, -0.1),
         "Om": (0.3, -0.4, 0.5)}  # fmt: skip
PROGRAMS = {"psi_x": "x6", "psi_x8": "x8", "psi_w": "psi_w"}


def scene_of(terms):
    """The general body with these terms."""
    vehicle = lw.Vehicle(
        rigid_body_mass_matrix=RIGID, added_mass_matrix=INERTIA - RIGID, weight=WEIGHT, buoyancy=BUOYANCY,
        center_of_gravity=CENTER, center_of_buoyancy=LIFT,
    )  # fmt: skip
    return lw.Scene(vehicle, lw.Environment(gravity=GRAVITY), terms=list(terms))


def body_of(laws):
    """The same for the twin."""
    displaced = BUOYANCY / GRAVITY
    moment = BUOYANCY * LIFT - WEIGHT * CENTER
    M, C, J = coupled.blocks(INERTIA)
    # These laws' numbers are partly the vehicle's.
    own = {"buoyancy": BUOYANCY, "center_of_buoyancy": LIFT}
    of_vehicle = Stratification | SurfaceBuoyancy
    laws = tuple(type(law)(**vars(law) | own) if isinstance(law, of_vehicle) else law for law in laws)
    laws = (Weight(net=WEIGHT - BUOYANCY), Restoring(moment=moment), *laws)
    return Body(M, J, laws, displaced - MASS, displaced * LIFT - MASS * CENTER, MASS, MASS * CENTER, C=C)


def twin(laws, method, h, steps):
    """b, R, nu, Om of the twin after so many steps."""
    body, reduced = body_of(laws), coupled.reduce(INERTIA, PROGRAMS[method])
    b, R, nu, Om = (np.array(value) for value in STATE.values())
    keep = start(body, b, R, np.zeros(3), np.zeros(3))
    x = reduced.to_reduced(b, R, nu - R.T @ water(look(keep, body, h), body).velocity, Om)

    def kick(b, R, p, pi, k):
        nonlocal keep
        y = K(State(b, R, p, pi, keep.t + 0.5 * h, keep.step, keep.memory), body, k)
        keep = replace(keep, memory=y.memory)
        return y.b, y.R, y.p, y.pi

    for n in range(steps):
        keep = replace(keep, t=n * h, step=n)
        x = coupled.step(x, reduced, h, coupled.PROGRAMS[PROGRAMS[method]], None, kick=kick)
    b, R, nu, Om = reduced.from_reduced(x)
    at_end = replace(keep, b=b, R=R, t=steps * h)
    return b, R, nu + R.T @ water(look(at_end, body, h), body).velocity, Om


# Each method once: psi_w with one law of each other kind (damping, water, of place, of time, that remembers), psi_x with all
# laws together. Each law alone: test-long.
SEVERAL = {
    "in harmonics": ("drag", "current harmonics"),
    "in a profile": ("drag matrix", "current profile", "tether", "wrench schedule", "Gauss-Markov current"),
}
SHORT = ("psi_x-in harmonics", "psi_x8-None", "psi_w-in a profile")


@pytest.mark.ci
@pytest.mark.slow_but(*SHORT)
@pytest.mark.parametrize("name", [None, *SEVERAL, *CASES])
@pytest.mark.parametrize("method", PROGRAMS)
def test_a_few_steps(method, name):
    cases = [CASES[one_of] for one_of in SEVERAL.get(name, (name,)) if one_of]
    terms, laws = (sum((getattr(case, kind) for case in cases), ()) for kind in ("terms", "laws"))
    # One lane: more take long to compile.
    result = lw.solve(one(scene_of(terms), **STATE), method, h=0.02, t1=0.1, width=1)
    assert result.status.counts() == {"ok": 1}
    # Five steps of a few hundred operations.
    assert difference(last(result), twin(laws, method, 0.02, 5)) < 5e-13


@pytest.mark.ci
def test_a_fixed_number_of_newton_steps():
    # Two from a start of order 2 leave a residual below the tolerance at this step; with checks, each lane says so.
    fleet = one(scene_of(()), **STATE)
    to_tolerance, fixed = (
        lw.solve(fleet, lw.Method("psi_w", iterations=count), h=0.02, t1=0.1, width=1) for count in (None, 2)
    )
    assert fixed.status.counts() == {"ok": 1}
    assert difference(last(fixed), last(to_tolerance)) < 1e-13


@pytest.mark.ci
def test_turns_at_a_large_step():
    # Turns by 0.1 rad and more, where every digit of the series of the tangent counts.
    result = lw.solve(one(scene_of(()), **STATE), "psi_x8", h=0.2, t1=1.0, width=1)
    assert difference(last(result), twin((), "psi_x8", 0.2, 5)) < 5e-14
