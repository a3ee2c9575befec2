# SPDX-License-Identifier: Apache-2.0
"""The energy used: closed integrals, orders, the twin, and all that must not count twice."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest
import warp as wp
from scipy import integrate

import lgvi_warp as lw
from lgvi_kernels.law import add, dot, mul  # noqa: F401
from lgvi_warp.methods.method import PROGRAMS
from lgvi_warp.methods.tableaux import RK4
from lgvi_warp.reference import advance, explicit
from lgvi_warp.reference.submaps import start
from lgvi_warp.reference.terms.energy_use import EnergyUse
from tests.laws.case import Case
from tests.laws.test_device_code import POWERED
from tests.laws.test_parity import STATE, VEHICLE, body_of, scene_of
from tests.support.tools import one, slope

HOTEL = 5.0
ACCOUNT = lw.terms.EnergyUse(hotel=HOTEL)
SAVE = lw.SaveAt(fields=("position", "energy_used"))
# Two thrusters abreast; knots of a table of watts, of which those below 0 differ.
PAIR = dict(position=[[-0.5, 0.2, 0.0], [-0.5, -0.2, 0.0]], direction=[[1.0, 0.0, 0.0]] * 2, coefficient=20.0)
COMMANDS, WATTS = (-1.0, -0.5, 0.0, 0.5, 1.0), (80.0, 25.0, 0.0, 20.0, 100.0)
TABLE = dict(power_commands=COMMANDS, power=WATTS)


def watts(command):
    """The table, written independently."""
    return np.interp(command, COMMANDS, WATTS)


def used(*terms, method="rk4", h=0.1, t1=2.0, account=ACCOUNT, **settings):
    """The energy used at the end [J] by a scene with these terms, of one member."""
    scene = lw.Scene.named("torpedo", terms=[account, *terms], start={"velocity": [0.5, 0.1, 0.0]})
    result = lw.solve(scene, method, h=h, t1=t1, save=SAVE, threads=1, **settings)
    assert result.status.counts() == {"ok": 1}
    return float(result.energy_used[-1, 0])


def thrusters(**numbers):
    """Two thrusters with these commands, and a table of watts."""
    return lw.terms.Thrusters(**PAIR | TABLE | numbers)


METHODS = ["psi_s", "rk4", *(pytest.param(name, marks=pytest.mark.slow) for name in
           ("psi_x", "psi_w", "psi_1", "phi", "psi", "tj4(psi_s)", "bm4(psi_x)", "rk8", "rkmk4", "cg3", "rkw3"))]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_held_commands_and_a_hotel_load_use_power_times_time(method):
    # Between knots of the table, and ahead beside astern: exact, to the round-off of a sum of 20 steps.
    total = HOTEL + watts(0.4) + watts(-0.7)
    assert used(thrusters(command=[0.4, -0.7]), method=method) == pytest.approx(2.0 * total, rel=1e-13)
    assert used(method=method) == pytest.approx(2.0 * HOTEL, rel=1e-13)


@pytest.mark.ci
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_a_linear_schedule_of_power_is_integrated_exactly(method):
    # Each within one segment of the table, so that the power goes straight: the trapezoid of its ends.
    ramps = thrusters(times=[0.0, 2.0], command_schedule=[[0.6, -1.0], [1.0, -0.6]])
    means = sum(0.5 * (watts(a) + watts(b)) for a, b in ((0.6, 1.0), (-1.0, -0.6)))
    assert used(ramps, method=method) == pytest.approx(2.0 * (HOTEL + means), rel=1e-13)
    # A turn of the schedule between two steps.
    turning = thrusters(times=[0.0, 0.7, 2.0], command_schedule=[[0.6, 0.5], [1.0, 0.5], [0.5, 0.5]])
    path = 0.7 * 0.5 * (watts(0.6) + watts(1.0)) + 1.3 * 0.5 * (watts(1.0) + watts(0.5)) + 2.0 * watts(0.5)
    assert used(turning, method=method) == pytest.approx(2.0 * HOTEL + path, rel=1e-13)


@pytest.mark.ci
def test_a_dead_band_a_limit_and_the_ends_of_the_table_count():
    # Commands beyond the limit of 0.7; within the band the table's 0; the band is taken off before the look-up.
    inside = thrusters(command=[0.9, 0.1], limit=0.7, dead_band=0.2)
    assert used(inside) == pytest.approx(2.0 * (HOTEL + watts(0.5) + watts(0.0)), rel=1e-13)
    beyond = thrusters(command=[3.0, -4.0])
    assert used(beyond) == pytest.approx(2.0 * (HOTEL + watts(1.0) + watts(-1.0)), rel=1e-13)


@pytest.mark.parametrize("hand", [1.0, -1.0])
def test_a_shaft_takes_its_torque_times_its_speed_over_the_efficiency(hand):
    numbers = dict(torque_coefficient=[0.02 * hand, -0.02 * hand], shaft_speed=10.0, efficiency=0.5, power=None)
    total = sum(10.0 * abs(n) * 0.02 * n**2 / 0.5 for n in (0.4, -0.7))
    shafts = thrusters(command=[0.4, -0.7], power_commands=None, **numbers)
    assert used(shafts) == pytest.approx(2.0 * (HOTEL + total), rel=1e-13)


# A lag from 0.5 towards 0.9 and from 0.9 to 0.3: the command changes in a step of the schedule so short that it is a jump.
TAU, JUMP = 0.4, 1e-9


def lagging(**numbers):
    return lw.terms.Thrusters(**PAIR | numbers, times=[0.0, JUMP], command_schedule=[[0.5, 0.9], [0.9, 0.3]],
                              time_constant=TAU)  # fmt: skip


def place(begin, end, t):
    return end + (begin - end) * np.exp(-t / TAU)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "order", "steps"), [("rk4", 4, (0.2, 0.1)), ("psi_s", 2, (0.1, 0.05))])
def test_a_lag_is_integrated_with_the_order_of_the_method(method, order, steps):
    # The cube of an exponential approach, in closed form by its expansion.
    law = lagging(torque_coefficient=0.02, shaft_speed=10.0)

    def cube(begin, end):
        d = begin - end
        parts = [(end**3, None), (3.0 * end**2 * d, 1), (3.0 * end * d**2, 2), (d**3, 3)]
        return sum(c * (2.0 if n is None else TAU / n * (1.0 - np.exp(-2.0 * n / TAU))) for c, n in parts)

    exact = 2.0 * HOTEL + 0.2 * (cube(0.5, 0.9) + cube(0.9, 0.3))
    errors = [abs(used(law, method=method, h=h) - exact) for h in steps]
    assert slope(steps, errors) == pytest.approx(order, abs=0.3)
    assert errors[-1] < 1e-3 * exact


@pytest.mark.slow
def test_a_lag_through_a_table_agrees_with_quadrature():
    # Kinks of the table, of which the places pass one: the error of such a step is of order h^2.
    exact = 2.0 * HOTEL
    for begin, end in ((0.5, 0.9), (0.9, 0.3)):
        exact += integrate.quad(lambda t, a=begin, b=end: watts(place(a, b, t)), 0.0, 2.0, points=[0.44])[0]
    errors = [abs(used(lagging(**TABLE), h=h) - exact) for h in (0.1, 0.01)]
    assert errors[0] < 0.05
    assert errors[1] < 5e-4


@pytest.mark.slow
def test_power_that_falls_with_the_speed_is_that_of_the_recorded_motion():
    # By Simpson's rule of the recorded speed through still water: an error of order h^4.
    law = lw.terms.Thrusters(position=[[-0.5, 0.0, 0.1]], direction=[[1.0, 0.0, 0.0]], coefficient=20.0, command=[0.8],
                             advance_loss=4.0, torque_coefficient=0.5, torque_loss=0.2, shaft_speed=12.0)  # fmt: skip
    scene = lw.Scene.named("torpedo", terms=[ACCOUNT, law])
    save = lw.SaveAt(every=0.002, fields=("velocity", "angular_velocity", "energy_used"))
    result = lw.solve(scene, "rk4", h=0.002, t1=2.0, save=save, threads=1)
    ahead = result.velocity[:, 0, 0] + 0.1 * result.angular_velocity[:, 0, 1]
    power = HOTEL + 12.0 * 0.8 * (0.5 * 0.8**2 - 0.2 * 0.8 * ahead)
    assert np.ptp(power) > 0.5
    assert result.energy_used[-1, 0] == pytest.approx(integrate.simpson(power, x=result.time), rel=1e-10)
    # Coarse steps of a method of order 2 see the same.
    coarse = lw.solve(scene, "psi_s", h=0.02, t1=2.0, save=SAVE, threads=1)
    assert coarse.energy_used[-1, 0] == pytest.approx(result.energy_used[-1, 0], rel=1e-4)


@pytest.mark.ci
def test_a_propeller_that_the_water_drives_gives_nothing_back():
    law = lw.terms.Thrusters(position=[[-0.5, 0.0, 0.0]], direction=[[1.0, 0.0, 0.0]], coefficient=0.0, command=[0.1],
                             torque_coefficient=0.5, torque_loss=0.2, shaft_speed=12.0)  # fmt: skip
    assert used(law, t1=0.5) == pytest.approx(0.5 * HOTEL, rel=1e-13)


@pytest.mark.ci
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
@pytest.mark.parametrize(
    "name", [pytest.param("propellers, shaft"), pytest.param("lagging, watts", marks=pytest.mark.slow)]
)
def test_the_kernel_uses_what_its_twin_uses(name, method):
    # A hundred steps of round-off.
    (term,), (law,) = POWERED[name].terms, POWERED[name].laws
    case = Case((ACCOUNT, term), (EnergyUse(hotel=HOTEL), law))
    result = lw.solve(one(scene_of(case), **STATE), method, h=0.02, t1=2.0, save=SAVE)
    body = body_of(case)
    b, R, nu, Om = (np.array(value) for value in STATE.values())
    x = start(body, b, R, body.M @ nu, body.J @ Om)
    if method == "rk4":
        x = explicit.advance(explicit.stepper(RK4), x, body, 0.02, 100)
    else:
        x = advance.advance(x, body, PROGRAMS[method], 0.02, 100)
    assert result.energy_used[-1, 0] == pytest.approx(x.used, rel=1e-12)


@pytest.mark.slow
def test_the_motion_keeps_its_bits_beside_an_account():
    law = thrusters(command=[0.4, -0.7])
    with_account, without = (
        lw.solve(lw.Scene(VEHICLE, terms=[law, *more]), "psi_s", h=0.05, t1=1.0, threads=1) for more in ([ACCOUNT], [])
    )
    np.testing.assert_array_equal(with_account.position, without.position)


@pytest.mark.ci
def test_the_law_of_powered_thrusters_passes_its_check():
    for term in (ACCOUNT, replace(POWERED["propellers, shaft"].terms[0])):
        report = lw.laws.check_law(term)
        assert report.ok, str(report)
        assert any(check.name.startswith("power") for check in report.checks)


@wp.func
def pump_power(watts: Any, view: Any, p: Any):
    """Power of a pump that works against the pressure at a point of the body."""
    depth = view.b.z + dot(view.down, p.outlet)
    return watts + p.rate * depth


class PumpDevice:
    """Power alone."""

    power = pump_power


@dataclass(frozen=True, eq=False, kw_only=True)
class Pump(lw.laws.Term):
    """A law of a user's own."""

    type: ClassVar[str] = "pump_of_a_test"
    device: ClassVar[Any] = PumpDevice

    rate: Any = lw.laws.number((), "W/m")
    outlet: Any = lw.laws.number((3,), "m", (0.0, 0.0, 0.0), axes="point")


@pytest.mark.ci
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_a_law_of_ones_own_may_take_power(method):
    pump = Pump(rate=3.0, outlet=(0.2, 0.0, 0.1))
    assert lw.laws.check_law(pump).ok
    start = lw.Start(position=[0.0, 0.0, 5.0], velocity=[0.5, 0.2, 0.3], angular_velocity=[0.1, 0.4, 0.2])
    scene = lw.Scene(VEHICLE, terms=[ACCOUNT, pump], start=start)
    save = lw.SaveAt(every=0.005, fields=("position", "attitude", "energy_used"))
    result = lw.solve(scene, method, h=0.005, t1=2.0, save=save, threads=1)
    depth = result.position[:, 0, 2] + result.attitude[:, 0, 2] @ np.array((0.2, 0.0, 0.1))
    exact = integrate.simpson(HOTEL + 3.0 * depth, x=result.time)
    # Of rk4 the error is that of Simpson's rule; of psi_s h^2 times a curvature of the depth of order 1.
    assert result.energy_used[-1, 0] == pytest.approx(exact, rel=1e-10 if method == "rk4" else 1e-5)
    assert np.ptp(depth) > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_slopes_of_the_energy_used(method):
    # 2 s, and 2 s times the slope of the table beyond the command 0.5.
    scene = lw.Scene.named("torpedo", terms=[ACCOUNT, thrusters(command=[0.6, 0.0])])
    by = ["energy_use.hotel", "thrusters.command[0]"]
    result = lw.solve(scene, method, h=0.1, t1=2.0, save=SAVE, tangents=by, threads=1)
    np.testing.assert_allclose(result.jacobian["energy_used"][-1, 0], [2.0, 2.0 * 160.0], rtol=1e-9)


@wp.func
def cubic_power(watts: Any, view: Any, p: Any):
    """Power that grows with the cube of the time."""
    return watts + (view.t * view.t * view.t) * p.rate


class CubicDevice:
    """Power alone, which looks at the time."""

    power = cubic_power


@dataclass(frozen=True, eq=False, kw_only=True)
class Cubic(lw.laws.Term):
    """Power of the time."""

    type: ClassVar[str] = "cubic_of_a_test"
    device: ClassVar[Any] = CubicDevice
    timed: ClassVar[bool] = True

    rate: Any = lw.laws.number((), "W/s3")


@pytest.mark.slow
def test_compositions_keep_their_order():
    # The midpoint rule's h^2 / 24 times the change of the slope; of a cubic the fourth order has no error at all.
    scene = lw.Scene(VEHICLE, terms=[ACCOUNT, Cubic(rate=2.0)])
    exact = 3.0 * HOTEL + 2.0 * 3.0**4 / 4.0
    for method, error in (("psi_s", 0.3**2 / 24.0 * 6.0 * 3.0**2), ("tj4(psi_s)", 0.0)):
        result = lw.solve(scene, method, h=0.3, t1=3.0, save=SAVE, threads=1)
        assert exact - result.energy_used[-1, 0] == pytest.approx(error, abs=1e-11)
