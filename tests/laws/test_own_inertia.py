# SPDX-License-Identifier: Apache-2.0
"""Laws of a user that change mass and inertia in time: water that is taken in, a wheel, and what is refused."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
import warp as wp

import lgvi_warp as lw
from lgvi_kernels.law import add, add_drag_at, cross, lane, lane3, mul, ones, struct, sub  # noqa: F401
from tests.support.tools import one


@wp.func
def taken_inertia(D: Any, view: Any, p: Any):
    return add_drag_at(D, view.t * p.rate, p.tank)


class IntakeDevice:
    carried_inertia = taken_inertia


@dataclass(frozen=True, eq=False, kw_only=True)
class Intake(lw.laws.Term):
    """Still water that flows into a tank: mass and inertia grow, the momenta stay."""

    type: ClassVar[str] = "intake_of_tests"
    device: ClassVar[Any] = IntakeDevice
    timed: ClassVar[bool] = True
    carried: ClassVar[bool] = True
    rate: Any = lw.laws.number((), "kg/s", least=0.0)
    tank: Any = lw.laws.number((3,), "m", (0.0, 0.0, 0.0), axes="point")


@wp.func
def no_inertia(D: Any, view: Any, p: Any):
    return D


@wp.func
def wheel_momentum(w: Any, view: Any, p: Any):
    w.torque = w.torque + p.spin
    return w


class WheelDevice:
    carried_inertia = no_inertia
    carried_momentum = wheel_momentum


@dataclass(frozen=True, eq=False, kw_only=True)
class Wheel(lw.laws.Term):
    """A wheel that turns at a rate held in the vehicle, whose inertia includes it."""

    type: ClassVar[str] = "wheel_of_tests"
    device: ClassVar[Any] = WheelDevice
    carried: ClassVar[bool] = True
    spin: Any = lw.laws.number((3,), "N m s", axes="vector")


VEHICLE = lw.Vehicle(10.0, inertia=(1.0, 2.0, 2.5), buoyancy=0.0)


def scene(*terms, vehicle=VEHICLE):
    return lw.Scene(vehicle, lw.Environment(gravity=0.0), terms=list(terms))


@pytest.mark.ci
def test_they_are_right():
    for law in (Intake(rate=0.3, tank=[0.2, -0.1, 0.4]), Wheel(spin=[1.0, 2.0, -0.5])):
        report = lw.laws.check_law(law)
        assert report.ok, str(report)
    mass = lw.terms.MovingMass(mass=9.0, times=[0.0, 12.0], places=[[0.0, 0.1, 0.0], [0.4, 0.0, 0.2]], inertia=True)
    report = lw.laws.check_law(mass)
    assert report.ok, str(report)
    assert any(check.name == "carried_momentum: any axes" for check in report.checks)


@pytest.mark.ci
def test_water_that_is_taken_in():
    # (M + q t) v = M v0 in a tank at the center, and the rates as before: v and the way by hand.
    fleet = one(scene(Intake(rate=0.5)), nu=(1.5, 0.0, 0.0))
    result = lw.solve(fleet, "rk4", h=0.05, t1=4.0, save=lw.SaveAt(every=1.0))
    np.testing.assert_allclose(result.velocity[:, 0, 0], 15.0 / (10.0 + 0.5 * result.time), rtol=1e-13)
    np.testing.assert_allclose(result.position[:, 0, 0], 30.0 * np.log1p(0.05 * result.time), rtol=1e-8)


@pytest.mark.ci
@pytest.mark.parametrize("method", ["rk4", pytest.param("rk8", marks=pytest.mark.slow)])
def test_a_gyrostat(method):
    # About its axis of symmetry with a wheel on that axis: J1 w' = (J1 - J3) w3 w2 - s w2 and so on, a turn at a steady rate.
    round_body = lw.Vehicle(10.0, inertia=(2.0, 2.0, 1.0), buoyancy=0.0)
    spin, w = 3.0, np.array([0.4, 0.0, 0.7])
    fleet = one(scene(Wheel(spin=[0.0, 0.0, spin]), vehicle=round_body), Om=w)
    result = lw.solve(fleet, method, h=0.02, t1=2.0, save=lw.SaveAt(every=0.5))
    rate = ((1.0 - 2.0) * w[2] + spin) / 2.0
    turned = [0.4 * np.cos(rate * result.time), 0.4 * np.sin(rate * result.time), np.full(5, 0.7)]
    assert np.abs(result.angular_velocity[:, 0] - np.transpose(turned)).max() < {"rk4": 1e-7, "rk8": 1e-13}[method]


def device_with(**roles):
    return type("Device", (), roles)


@pytest.mark.parametrize(
    ("device", "carried", "match"),
    [
        (device_with(carried_inertia=no_inertia), False, "its device code has carried_inertia. Write carried = True in Own"),
        (device_with(law=wheel_momentum), True, "its device code has no carried_inertia. Write carried = False in Own"),
        (device_with(law=wheel_momentum, carried_momentum=wheel_momentum), False, "carried_momentum or depart and no"),
    ],
)  # fmt: skip
def test_refusals(device, carried, match):
    class Own(lw.laws.Term):
        type = "own_inertia_of_tests"
        spin: Any = lw.laws.number((3,), "N m s", (0.0, 0.0, 0.0))

    Own.device, Own.carried = device, carried
    with pytest.raises(lw.SceneError, match=match):
        lw.laws.check_law(dataclass(frozen=True, eq=False, kw_only=True)(Own)())
