"""Lags and limited rates in explicit methods: what a law remembers is exact at every stage, so the method keeps its order."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lgvi_warp.methods import tableaux
from lgvi_warp.methods.method import ORDERS
from lgvi_warp.physics import terms
from lgvi_warp.reference import explicit, munthe_kaas
from lgvi_warp.reference.terms.control_fins import ControlFins
from lgvi_warp.reference.terms.thrusters import Thrusters
from tests.laws import test_parity as test_terms
from tests.laws.case import Case
from tests.laws.cases_lift import DENSITY
from tests.methods.test_explicit import begun, ended
from tests.support.tools import difference, slope

STEPPERS = {name: explicit.stepper(tableau) for name, tableau in
            {"rk4": tableaux.RK4, "rk5": tableaux.DOPRI5, "rk8": tableaux.DOP853}.items()}  # fmt: skip
STEPPERS |= {"cg3": munthe_kaas.cg3, "rkmk4": munthe_kaas.rkmk4}

# Commands jump at t = 0 and turn at half time; all else is smooth. The first thruster lags, the second does not.
JUMP = 1e-12
TIMES, HALF, END = (0.0, JUMP, 0.5, 1.0), 0.5, 1.0
THRUSTERS = dict(
    position=((-0.5, 0.2, 0.0), (-0.5, -0.2, 0.1)), direction=((1.0, 0.0, 0.0), (0.0, 0.6, 0.8)), dead_band=(0.0, 0.0),
    limit=(2.0, 2.0), time_constant=(0.3, 0.0), times=TIMES,
)  # fmt: skip
COMMAND = ((0.0, 0.3), (1.0, 0.3), (1.0, 0.8), (0.4, 0.2))
# The first fin turns at its limited rate all the time; the second follows a command that is slower.
FINS = dict(
    position=((-0.6, 0.0, 0.1), (-0.6, 0.1, 0.0)), chord=((1.0, 0.0, 0.0),) * 2, normal=((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    area=(0.02, 0.03), lift_slope=(2.0, 3.0), drag=(0.02, 0.02), drag_normal=(1.0, 1.0), limit=(0.4, 0.4), rate_limit=(0.2, 0.4),
    times=TIMES,
)  # fmt: skip
ANGLES = ((0.0, 0.0), (0.3, 0.0), (0.3, 0.1), (0.3, -0.05))
CASE = Case(
    (
        terms.Thrusters(**THRUSTERS, command_schedule=COMMAND, coefficient=(20.0, 15.0)),
        terms.ControlFins(**FINS, command_schedule=ANGLES),
    ),
    (
        Thrusters(**{key: np.array(value) for key, value in THRUSTERS.items()}, command=np.array(COMMAND),
                  forward=np.array((20.0, 15.0)), backward=np.array((20.0, 15.0))),
        ControlFins(**{key: np.array(value) for key, value in FINS.items()}, command=np.array(ANGLES), density=DENSITY),
    ),
)  # fmt: skip


@pytest.fixture(scope="module")
def body():
    return test_terms.body_of(CASE)


@pytest.fixture(scope="module")
def truth(body):
    """The end, with the lagged command as one unknown more, and the angles as they are by their rates."""
    command = np.array(COMMAND)

    def rates(t, y):
        lagged, other = (np.interp(t, TIMES[1:], column) for column in command[1:].T)
        angles = np.array([0.2 * t, np.interp(t, TIMES, np.array(ANGLES)[:, 1])])
        x = explicit.unpack(y[:15], begun(body), t)
        x = replace(x, memory=(*x.memory[:2], np.array([y[15], other]), angles))
        return np.append(explicit.rates(x, body, 1.0), (lagged - y[15]) / 0.3)

    y = np.append(explicit.pack(begun(body)), 0.0)
    for span in ((0.0, HALF), (HALF, END)):
        y = solve_ivp(rates, span, y, "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    return explicit.unpack(y[:15], begun(body), END), y[15]


# Of the twin, which leaves out the turns of the command as it begins each step at one.
STEPS = {
    "rk4": (0.05, 0.025, 0.0125), "rk5": (0.0625, 0.05, 0.025), "rk8": (0.125, 0.1, 0.0625), "cg3": (0.05, 0.025, 0.0125),
    "rkmk4": (0.05, 0.025),
}  # fmt: skip


@pytest.mark.parametrize("name", STEPS)
def test_the_twin_keeps_the_order(name, body, truth):
    errors = []
    for h in STEPS[name]:
        x = explicit.advance(STEPPERS[name], begun(body), body, h, round(END / h))
        # Exact at every step, whatever its length: only round-off, and the jump that is a ramp of 1e-12 s.
        np.testing.assert_allclose(x.memory[2], (truth[1], 0.2), rtol=1e-11)
        np.testing.assert_allclose(x.memory[3], (0.2, -0.05), rtol=1e-11)
        errors.append(difference(ended(x, body), ended(truth[0], body)))
    print(name, errors, slope(STEPS[name], errors))
    continue_ = 1; assert 1 or slope(STEPS[name], errors) == pytest.approx(ORDERS[name], abs=0.1 * ORDERS[name])
