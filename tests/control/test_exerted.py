# SPDX-License-Identifier: Apache-2.0
"""The wrench that actuators exert, beside that of their twins, and the mechanical energy that follows from it."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.reference.terms import View
from lgvi_warp.reference.terms.control_fins import ControlFins
from lgvi_warp.reference.terms.thrusters import Thrusters
from tests.laws.cases import PROPELLERS, THRUSTERS
from tests.laws.cases_lift import FINS, arrays

pytestmark = pytest.mark.ci

CURRENT = np.array([0.3, -0.2, 0.1])
# Mass off the origin, and axes of inertia that are not the body's: the kernel's axes and origins are others.
MASS, CENTER = 20.0, np.array([0.05, 0.02, 0.04])
OFF = MASS * np.cross(np.eye(3), CENTER)
RIGID = np.block([[MASS * np.eye(3), OFF.T], [OFF, np.array([[1.5, 0.1, 0.2], [0.1, 1.2, -0.1], [0.2, -0.1, 1.8]])]])
BODY = lw.Vehicle(
    rigid_body_mass_matrix=RIGID, added_mass_matrix=np.diag([5.0, 12.0, 15.0, 0.3, 0.4, 0.5]), buoyancy=MASS * 9.81,
    center_of_gravity=CENTER,
)  # fmt: skip
STALLED = {"limit": (0.35, 0.2, 0.5), "time_constant": (0.1, 0.3, 0.2)}
PUSHED = lw.terms.Thrusters(**THRUSTERS, **PROPELLERS, coefficient=(2.0, 3.0, 1.0), coefficient_astern=(1.5, 2.5, 0.5))
TURNED = lw.terms.ControlFins(**FINS, **STALLED)


def loop(*allocation, faults=()):
    return lw.Controller(
        period=0.1, delay=0.02, guidance=[lw.control.SetPoint(position=(3.0, 1.0, 12.0), heading=0.4)],
        laws=[lw.control.PosePID(kp=(2.0,) * 3, kd=(1.0,) * 3, kr=(0.5,) * 3, kw=(0.3,) * 3)],
        allocation=list(allocation), faults=list(faults),
    )  # fmt: skip


@pytest.mark.kernel
@pytest.mark.slow_for("psi_w")
@pytest.mark.parametrize("method", ["psi_x", "rk4", "psi_w"])
def test_the_wrench_is_that_of_the_twins(method):
    start = lw.Start(
        [0.0, 0.0, 10.0], euler_deg=[10.0, -5.0, 40.0], velocity=[1.2, 0.2, -0.3], angular_velocity=[0.2, 0.1, -0.3]
    )
    controller = loop(
        lw.control.PseudoInverse(to="thrusters"), lw.control.PseudoInverse(to="control_fins", name="to_fins"),
        faults=[lw.control.Fault(of="thrusters", channel=1, time=0.3, gain=0.5, offset=0.2),
                lw.control.Fault(of="control_fins", channel=0, time=0.2, offset=0.1, name="stuck")],
    )  # fmt: skip
    terms = [lw.terms.Current(velocity=CURRENT), PUSHED, TURNED]

    scene = lw.Scene(BODY, lw.Environment(9.81, 1000.0), terms=terms, start=start, controller=controller)
    saved = ("position", "attitude", "velocity", "angular_velocity", "actuator", "exerted")
    found = lw.solve(scene, method, h=0.02, t1=1.0, save=lw.SaveAt(every=0.02, fields=saved))
    laws = (
        Thrusters(
            **arrays(THRUSTERS | PROPELLERS),
            forward=np.array((2.0, 3.0, 1.0)), backward=np.array((1.5, 2.5, 0.5)),
        ),
        ControlFins(**arrays(FINS | STALLED), density=1000.0),
    )  # fmt: skip
    for law in laws:
        law.driven, law.rate_limit = True, np.full(3, np.inf)
    for k in range(len(found.time)):
        b, R, nu, Om = (found.samples[name][k, 0] for name in saved[:4])
        expected, through = np.zeros(6), nu - R.T @ CURRENT
        for law, places in zip(laws, (found.actuator[k, 0, :3], found.actuator[k, 0, 3:]), strict=True):
            view = View(R, b, through, Om, found.time[k], 0.02, k, 0, places)
            expected += np.concatenate(law.wrench(view)) - law.damping(view) @ np.concatenate([through, Om])
        np.testing.assert_allclose(found.exerted[k, 0], expected, rtol=0.0, atol=1e-10)
    assert np.abs(found.exerted).max() > 1.0


def swinging(method="psi_x", known=False, faults=(), **settings):
    """BlueROV2 heavy that dives 10 m and swings there."""
    law = lw.control.PosePID(kp=(40.0, 40.0, 30.0), kd=(60.0,) * 3, kr=(20.0,) * 3, kw=(6.0,) * 3)
    faults = [lw.control.Fault(of="thrusters", known=known, name=f"f{i}", **fault) for i, fault in enumerate(faults)]
    controller = lw.Controller(
        period=0.1, guidance=[lw.control.SetPoint(position=(0.0, 0.0, 20.0), heading=0.0)], laws=[law], faults=faults
    )
    scene = lw.Scene.named("bluerov2_heavy", start={"position": (0.0, 0.0, 10.0)}, controller=controller)
    energy = lw.metrics.ActuatorEnergy(then=[lw.statistics.MemberValues()])
    return scene, lw.solve(scene, method, **{"h": 0.02, "t1": 20.0, "statistics": [energy]} | settings)


FAULTS = {
    "none": (),
    "one dead": ({"channel": 4},),
    "two dead": ({"channel": 4}, {"channel": 7}),
    "weak": ({"channel": 4, "gain": 0.4},),
    "stuck": ({"channel": 5, "offset": 0.3},),
    "biased": ({"channel": 6, "gain": 1.0, "offset": 0.1},),
}


@pytest.mark.kernel
@pytest.mark.parametrize("is_known", [False, True], ids=["unknown", "known"])
@pytest.mark.parametrize("name", FAULTS)
def test_energy_is_that_of_the_true_thrust(name, is_known):
    fields = ("velocity", "angular_velocity", "actuator")
    scene, found = swinging(known=is_known, faults=FAULTS[name], save=lw.SaveAt(every=0.02, fields=fields))
    (thrusters,) = (term for term in scene.terms if term.type == "thrusters")
    lever = np.cross(thrusters.position, thrusters.direction)
    places = found.actuator[:, 0]
    thrust = np.sign(places) * np.polynomial.polynomial.polyval(np.abs(places), [0.0, *thrusters.polynomial])
    wrench = thrust @ np.hstack([thrusters.direction, lever])
    power = np.sum(wrench * np.hstack([found.velocity[:, 0], found.angular_velocity[:, 0]]), axis=1)
    (metric,) = found.statistics.values()
    # The trapezoidal rule between ticks, five steps apart; it is off by 2 % at most, where the loop chatters.
    np.testing.assert_allclose(metric.value.item(), np.trapezoid(np.abs(power[::5]), dx=0.1), rtol=1e-9)
    np.testing.assert_allclose(metric.value.item(), np.trapezoid(np.abs(power), dx=0.02), rtol=3e-2)
