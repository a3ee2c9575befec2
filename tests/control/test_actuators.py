# SPDX-License-Identifier: Apache-2.0
"""Closed loops with actuators as vehicles have them, and their allocation: the kernel against the twin's loop."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.reference.control.bounded_least_squares import BoundedLeastSquares
from lgvi_warp.reference.control.depth_pid import DepthPID
from lgvi_warp.reference.control.heading_pid import HeadingPID
from lgvi_warp.reference.control.loop import Fault, Loop
from lgvi_warp.reference.control.pseudo_inverse import PseudoInverse
from lgvi_warp.reference.control.set_point import SetPoint
from lgvi_warp.reference.terms import View
from lgvi_warp.reference.terms.drag import Drag
from lgvi_warp.reference.terms.driven import DrivenThrusters
from lgvi_warp.reference.terms.driven_fins import DrivenFins
from lgvi_warp.reference.terms.wrench import Wrench
from tests.control.test_loop import (
    DEPTH,
    EVERY,
    GRAVITY,
    HEADING,
    LINEAR,
    QUADRATIC,
    STATE,
    VEHICLE,
    WANTED,
    H,
    controller,
)
from tests.support.loops import twin_body, twin_run
from tests.support.tools import one

pytestmark = pytest.mark.ci

SPEED, DENSITY = 1.5, 1025.0
AHEAD = (15.0, 0.0, 0.0)
# The laws ask for M and N.
ASKED = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 1.0])[:, None]
# Gains of the members.
STIFF = np.array([12.0, 9.0])

# Four thrusters that turn the body about the vertical, three that pitch and roll it. The fifth dies, and the loop knows, at
# times of the members' own; the first loses half of its command, and the loop does not know.
THRUSTERS = dict(
    position=((0.4, 0.2, 0.0), (0.4, -0.2, 0.0), (-0.4, 0.2, 0.1), (-0.4, -0.2, 0.0),
              (0.3, 0.1, 0.0), (-0.3, 0.1, 0.0), (-0.3, -0.2, 0.0)),
    direction=((0.8, -0.6, 0.0), (0.8, 0.6, 0.0), (0.6, 0.8, 0.0), (0.6, -0.8, 0.0), *((0.0, 0.0, 1.0),) * 3),
    limit=(1.0, 1.0, 0.9, 0.9, 1.0, 0.8, 1.0),
    dead_band=(0.02, 0.0, 0.03, 0.0, 0.05, 0.0, 0.01),
    time_constant=(0.1, 0.1, 0.2, 0.2, 0.0, 0.1, 0.1),
    rate_limit=(3.0,) * 7,
    advance_loss=(2.0, 2.0, 1.0, 0.0, 3.0, 3.0, 3.0),
    advance_loss_astern=(0.0, 1.0, 1.0, 0.0, 3.0, 3.0, 2.0),
    torque_coefficient=(0.2, -0.2, 0.2, -0.2, 0.1, 0.1, -0.1),
    torque_loss=(0.02, -0.02, 0.0, 0.0, 0.0, 0.0, 0.0),
)  # fmt: skip
# The second turns at 0.972, below the limit.
CURVES = dict(polynomial=(3.0, 10.0, -2.0), polynomial_astern=(0.89, 0.0, 17.6, 0.0, -40.41, 0.0, 38.99, 0.0, -14.03))
COEFFICIENTS = (1.0, 0.9, 1.1, 1.0, 1.2, 1.0, 1.0), (0.8, 0.9, 0.7, 0.8, 1.0, 1.0, 1.0)
WEIGHTS = (1.0, 1.0, 2.0, 1.0, 1.0, 3.0, 1.0)
LOST = np.array([0.7, 1.5])
WEAK = dict(channel=0, time=1.1, gain=0.5, offset=0.05)

# A rudder and stern planes that stall, then two thrusters that help where these are at their limits.
FINS = dict(
    position=((-0.6, 0.0, 0.0), (-0.6, 0.0, 0.0)), chord=((1.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
    normal=((0.0, 1.0, 0.0), (0.0, 0.0, -1.0)), area=(0.013, 0.013), lift_slope=(1.4, 1.6), drag=(0.01, 0.01),
    drag_normal=(0.5, 0.5), limit=(0.35, 0.3), rate_limit=(1.0, 1e6), time_constant=(0.1, 0.2),
    lift_angles=(0.0, 0.25, 0.4, 1.6), lift_coefficients=(0.0, 0.25, 0.2, 0.0),
)  # fmt: skip
PAIR = dict(
    position=((-0.5, 0.3, 0.0), (-0.5, -0.3, 0.0)), direction=((1.0, 0.0, 0.0), (1.0, 0.0, 0.0)), dead_band=(0.0, 0.02),
    limit=(1.0, 1.0), rate_limit=(4.0, 5.0), time_constant=(0.0, 0.1), table_commands=(-1.0, -0.5, -0.1, 0.1, 0.4, 1.0),
    table_thrusts=((-9.0, -8.0), (-2.0, -3.0), (0.0, 0.0), (0.0, 0.0), (5.0, 3.0), (20.0, 12.0)),
    advance_loss=(2.0, 1.0),
)  # fmt: skip


def arrays(numbers):
    return {key: np.array(value) for key, value in numbers.items()}


def effect_of(law):
    """(6, channels): what a small command makes, by differences of the twin's own forces at a speed ahead."""
    columns = []
    for i in range(len(law.limit)):
        pushes = []
        for size in (1e-4, -1e-4):
            law.held = size * np.eye(len(law.limit))[i]
            view = View(np.eye(3), np.zeros(3), np.array([SPEED, 0.0, 0.0]), np.zeros(3), memory=law.held)
            pushes.append(-law.damping(view) @ np.array([SPEED, 0.0, 0.0, 0.0, 0.0, 0.0]))
        columns.append((pushes[0] - pushes[1]) / 2e-4)
    return np.array(columns).T


def rov(lost, Allocation=PseudoInverse):
    """The twin of a vehicle with thrusters alone: laws, allocation and faults."""
    thrusters = DrivenThrusters(
        **arrays(THRUSTERS), **CURVES, forward=np.array(COEFFICIENTS[0]), backward=np.array(COEFFICIENTS[1])
    )
    wrenches = ASKED * np.hstack([thrusters.direction, np.cross(thrusters.position, thrusters.direction)]).T
    allocation = [Allocation(to="thrusters", effect=wrenches, weights=WEIGHTS, losses=((4, lost),))]
    faults = [Fault("thrusters", 4, lost), Fault("thrusters", **WEAK)]
    return {"thrusters": thrusters}, allocation, faults


def weak_rov(lost):
    """The same with another allocation."""
    return rov(lost, BoundedLeastSquares)


def auv(lost):
    """The twin of a vehicle with fins and a pair of thrusters."""
    fins = DrivenFins(**arrays(FINS | {"rate_limit": (1.0, np.inf)}), density=DENSITY)
    pair = DrivenThrusters(
        **arrays(PAIR), advance_loss_astern=np.array(PAIR["advance_loss"]), forward=np.ones(2), backward=np.ones(2)
    )
    wrenches = ASKED * np.hstack([pair.direction, np.cross(pair.position, pair.direction)]).T
    allocation = [
        PseudoInverse(to="control_fins", effect=ASKED * effect_of(fins)),
        PseudoInverse(to="thrusters", effect=wrenches),
    ]
    return {"control_fins": fins, "thrusters": pair}, allocation, []


ROV = [lw.terms.Thrusters(**THRUSTERS, **CURVES, coefficient=COEFFICIENTS[0], coefficient_astern=COEFFICIENTS[1])]
FAULTS = [
    lw.control.Fault(name="dead", of="thrusters", channel=4, time=LOST[0], known=True),
    lw.control.Fault(name="weak", of="thrusters", **WEAK),
]
SCENES = {
    "rov": (rov, ROV, [lw.control.PseudoInverse(to="thrusters", weights=WEIGHTS)], FAULTS),
    "rov within": (weak_rov, ROV, [lw.control.BoundedLeastSquares(to="thrusters", weights=WEIGHTS)], FAULTS),
    "auv": (
        auv,
        [lw.terms.ControlFins(**FINS), lw.terms.Thrusters(**PAIR)],
        [
            lw.control.PseudoInverse(name="fins", to="control_fins", speed=SPEED),
            lw.control.PseudoInverse(name="pair", to="thrusters"),
        ],
        [],
    ),
}


class Recorder(Loop):
    """A loop that keeps what was not delivered at each tick."""

    def begin(self):
        super().begin()
        self.rests = []

    def tick(self, x, body, h):
        super().tick(x, body, h)
        self.rests.append(self.unmet)


def twin(name, method, i, steps):
    """Positions at the ticks, and what these did not deliver, of the twin's loop of member i."""
    actuators, allocation, faults = SCENES[name][0](LOST[i])
    laws = (
        Drag(linear=np.array(LINEAR), quadratic=np.array(QUADRATIC)),
        *actuators.values(),
        Wrench(force=np.array(AHEAD), torque=np.zeros(3)),
    )
    parts = [SetPoint(**WANTED), DepthPID(**DEPTH), HeadingPID(**HEADING | {"kp": STIFF[i]}), *allocation]
    loop = Recorder(parts, actuators, EVERY, 0, faults)
    state = dict(b=STATE["position"], nu=STATE["velocity"], Om=STATE["angular_velocity"])
    positions, _ = twin_run(twin_body(VEHICLE, GRAVITY, laws), loop, method, H, steps, **state)
    return positions[::EVERY], np.array(loop.rests)


def solved(name, method, h, steps, every):
    """The result of members that differ in a gain and in the time of the fault that the loop knows."""
    _, terms, allocation, faults = SCENES[name]
    water = lw.Environment(gravity=GRAVITY, water_density=DENSITY)
    terms = [lw.terms.Drag(linear=LINEAR, quadratic=QUADRATIC), *terms, lw.terms.Wrench(force=AHEAD)]
    scene = lw.Scene(VEHICLE, water, terms, lw.Start(**STATE), controller(allocation, faults))
    varied = {"heading_pid.kp": STIFF} | ({"dead.time": LOST} if faults else {})
    fleet = one(scene, STATE["position"], None, STATE["velocity"], STATE["angular_velocity"], varied)
    result = lw.solve(fleet, method, h=h, t1=steps * h, save=lw.SaveAt(every=every * h))
    assert result.status.counts() == {"ok": len(STIFF)}
    return result.position


# Round-off of 1e-15 a step, of loops that damp it. Near the turn of the polynomial a command is known to half of its digits:
# its thrust to all, its torque and its losses to 1e-8.
ROUND_OFF = {"rov": 1e-8, "rov within": 1e-8, "auv": 1e-9}


@pytest.mark.slow_but("*-psi_s-100")
@pytest.mark.parametrize("steps", [100, 1000])
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
@pytest.mark.parametrize("name", SCENES)
def test_the_loop_is_the_twins(name, method, steps):
    kernel = solved(name, method, H, steps, EVERY)
    for i in range(len(STIFF)):
        positions, rests = twin(name, method, i, steps)
        assert np.abs(kernel[:, i] - positions).max() < ROUND_OFF[name]
        assert np.any(rests[:, 5] != 0.0), "the limits are not reached"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rov", "auv"])
def test_psi_x_meets_other_methods(name):
    # Not of "rov within": what it tells back begins at a threshold, and so integrals wait by a tick more or less.
    # In axes of its own. Its error falls by 4 with half of the step; steps in which a fin meets its command blur that.
    truth = solved(name, "rk4", H / 8, 3200, 3200)[-1]
    errors = [
        np.abs(solved(name, "psi_x", h, round(8.0 / h), round(8.0 / h))[-1] - truth).max() for h in (H, H / 2, H / 4)
    ]
    assert errors[0] < 0.05
    assert 2.5 < errors[0] / errors[1] < 6.0
    assert 2.5 < errors[1] / errors[2] < 6.0


def test_what_a_lost_channel_made_is_not_delivered():
    # One thruster ahead, one to the side at the stern: alone the second makes a moment.
    terms = [
        lw.terms.Drag(linear=LINEAR),
        lw.terms.Thrusters(position=((0.0,) * 3, (-1.0, 0.0, 0.0)), direction=np.eye(3)[:2], coefficient=(9.0, 9.0)),
    ]
    loop = lw.Controller(
        period=0.1,
        guidance=[lw.control.SetPoint(heading=0.5)],
        laws=[lw.control.HeadingPID(kp=1.0, kd=0.5)],
        allocation=[lw.control.PseudoInverse(to="thrusters")],
        faults=[lw.control.Fault(of="thrusters", channel=1, time=1.0, known=True)],
    )
    scene = lw.Scene(VEHICLE, lw.Environment(gravity=GRAVITY), terms, lw.Start(**STATE), loop)
    result = lw.solve(scene, h=0.05, t1=2.0, save=lw.SaveAt(every=0.1, fields=("demand", "unmet", "command")))
    demand, unmet, command = (result.samples[name][:, 0] for name in ("demand", "unmet", "command"))
    early, late = result.time < 1.0 - 1e-9, result.time > 1.0 - 1e-9
    assert np.abs(demand[:, 5]).min() > 1e-3
    np.testing.assert_allclose(unmet[early], 0.0, atol=1e-12)
    np.testing.assert_allclose(command[early, 1], -np.sign(demand[early, 5]) * np.sqrt(np.abs(demand[early, 5]) / 9.0))
    np.testing.assert_allclose(unmet[late, 5], demand[late, 5], rtol=1e-12)
    np.testing.assert_array_equal(command[late], 0.0)
