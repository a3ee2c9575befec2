# SPDX-License-Identifier: Apache-2.0
"""The work of a buoyancy engine's pump against the water's pressure, in the account of the energy used."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lgvi_warp as lw
from lgvi_warp.extensions.gliders.twin.buoyancy_engine import BuoyancyEngine
from lgvi_warp.methods.method import PROGRAMS
from lgvi_warp.methods.tableaux import RK4
from lgvi_warp.reference import advance, explicit
from lgvi_warp.reference.submaps import start
from lgvi_warp.reference.terms.energy_use import EnergyUse
from tests.extensions.gliders.cases import WATER
from tests.extensions.gliders.test_ballast import ADDED, DENSITY, GRAVITY, MASS, PUMP, WEIGHT, falling
from tests.laws.case import Case
from tests.laws.test_parity import STATE, body_of, scene_of
from tests.support.refusals import refused, says
from tests.support.tools import one, slope

HOTEL, EFFICIENCY = 3.0, 0.5
ACCOUNT = lw.terms.EnergyUse(hotel=HOTEL)
SAVE = lw.SaveAt(fields=("position", "energy_used"))
# So heavy that no pump moves it.
ANCHORED = lw.Vehicle(1e12, inertia=[1e12] * 3, added_mass=[0.0] * 3, buoyancy=1e12 * GRAVITY)


def engine(**numbers):
    depths = {"depth_top": 5.0, "depth_bottom": 12.0}
    return lw.terms.BuoyancyEngine(**PUMP | depths | {"efficiency": EFFICIENCY} | numbers)


def worked(scene, method, h, t1, **settings):
    """The energy used but for the hotel load [J], of all members."""
    result = lw.solve(scene, method, h=h, t1=t1, save=SAVE, threads=1, **settings)
    return result.energy_used[-1] - HOTEL * t1


RISE = PUMP["volume_up"] - PUMP["volume_down"]


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize("method", ["psi_s", "rk4", pytest.param("rk8", marks=pytest.mark.slow),
                                    pytest.param("rkmk4", marks=pytest.mark.slow)])  # fmt: skip
def test_at_a_held_depth_it_is_pressure_times_volume(method):
    # The point 0.3 m below the origin; the pump stops within a step, and what it lets in before takes nothing.
    deep = engine(first="up", volume_start=-1e-4, depth_top=-9.0, position=(0.0, 0.0, 0.3))
    exact = WEIGHT * 10.3 * RISE / EFFICIENCY
    assert worked(falling(ACCOUNT, deep, vehicle=ANCHORED), method, 0.4, 12.0)[0] == pytest.approx(exact, rel=1e-10)
    letting_in = engine(volume_start=2e-4, depth_bottom=20.0)
    assert worked(falling(ACCOUNT, letting_in, vehicle=ANCHORED), method, 0.4, 12.0)[0] == pytest.approx(0.0, abs=1e-11)


@pytest.mark.ci
@pytest.mark.kernel
def test_going_down_it_is_the_closed_integral():
    # From the bottom on at 0.31 m/s: p dV goes straight, and its mean is that of the middle of the 7.5 s.
    seconds = RISE / PUMP["pump_rate"]
    for efficiency in (0.5, 1.0):
        scene = falling(ACCOUNT, engine(efficiency=efficiency), vehicle=ANCHORED, speed=0.31)
        exact = WEIGHT * (12.0 + 0.31 * 0.5 * seconds) * RISE / efficiency
        assert worked(scene, "rk4", 0.1, 20.0)[0] == pytest.approx(exact, rel=1e-10)


@pytest.mark.ci
@pytest.mark.kernel
def test_in_denser_water_the_pressure_is_that_of_all_water_above():
    # By a sum over thin layers of water.
    gradient, reference = 0.05, 4.0
    edges = np.linspace(0.0, 10.0, 2001)
    layers = DENSITY * (1.0 + gradient * (0.5 * (edges[1:] + edges[:-1]) - reference)) * GRAVITY * np.diff(edges)
    dense = engine(first="up", volume_start=-1e-4, gradient=gradient, reference_depth=reference)
    exact = layers.sum() * RISE / EFFICIENCY
    assert worked(falling(ACCOUNT, dense, vehicle=ANCHORED), "rk4", 0.4, 12.0)[0] == pytest.approx(exact, rel=1e-10)


@pytest.mark.ci
@pytest.mark.kernel
def test_above_the_surface_it_takes_nothing():
    high = engine(first="up", volume_start=-1e-4, depth_top=-9.0)
    assert worked(falling(ACCOUNT, high, vehicle=ANCHORED, depth=-1.0), "rk4", 0.4, 12.0)[0] == pytest.approx(
        0.0, abs=1e-11
    )


def work_of_a_dive(begun, t1):
    """Work for a body that starts at rest: by DOP853, from the bottom to the full volume, each found as an event."""
    rate, full = PUMP["pump_rate"], PUMP["volume_up"]

    def motion(_, y, q):
        return [y[1], -WEIGHT * y[2] / (MASS + ADDED), q, max(q, 0.0) * WEIGHT * y[0] / EFFICIENCY]

    def bottom(_, y, q):
        return y[0] - 12.0

    def is_full(_, y, q):
        return full - y[2] if q else 1.0

    bottom.terminal = is_full.terminal = True
    settings = dict(method="DOP853", rtol=1e-12, atol=1e-13)
    dive = solve_ivp(motion, (0.0, t1), [begun, 0.0, PUMP["volume_down"], 0.0], events=bottom, args=(0.0,), **settings)
    climb = solve_ivp(motion, (dive.t[-1], t1), dive.y[:, -1], events=is_full, args=(rate,), **settings)
    assert climb.t[-1] < t1
    return climb.y[3, -1]


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_of_a_body_that_turns_it_has_order_2(method):
    # How far into a step it turns is another for each member and step: the worst of many counts.
    steps, begun = (0.4, 0.2, 0.1, 0.05), 10.0 + 0.037 * np.arange(16)
    truth = np.array([work_of_a_dive(depth, 30.0) for depth in begun])
    fleet = one(falling(ACCOUNT, engine()), b=[(0.0, 0.0, depth) for depth in begun])
    errors = [np.abs(worked(fleet, method, h, 30.0) - truth).max() for h in steps]
    assert slope(steps, errors) > 1.8
    assert errors[-1] < 1e-4 * truth.max()


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_the_kernel_uses_what_its_twin_uses(method):
    # The twin of rk4 looks once a step, the kernel at each stage: the pump fills within it, and the depth hardly curves.
    numbers = dict(pump_rate=2e-3, volume_down=-1e-3, volume_up=2e-3, depth_top=6.0, depth_bottom=12.0,
                   position=(0.3, 0.02, 0.1), volume_start=-2e-4, gradient=0.02, reference_depth=3.0,
                   efficiency=0.4, first="up")  # fmt: skip
    law = BuoyancyEngine(**{k: v if k == "first" else np.asarray(v) for k, v in numbers.items()}, **WATER)
    case = Case((ACCOUNT, lw.terms.BuoyancyEngine(**numbers)), (EnergyUse(hotel=HOTEL), law))
    scene, body = one(scene_of(case), **STATE), body_of(case)
    b, R, nu, Om = (np.array(value) for value in STATE.values())
    x = start(body, b, R, body.M @ nu, body.J @ Om)
    if method == "rk4":
        x = explicit.advance(explicit.stepper(RK4), x, body, 0.02, 100)
    else:
        x = advance.advance(x, body, PROGRAMS[method], 0.02, 100)
    used = worked(scene, method, 0.02, 2.0)[0] + 2.0 * HOTEL
    assert used > 2.0 * HOTEL + 100.0
    assert used == pytest.approx(x.used, rel=1e-12 if method == "psi_s" else 1e-4)


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_the_motion_keeps_its_bits_and_a_run_goes_on(method):
    scene = falling(ACCOUNT, engine())
    whole, plain = (lw.solve(s, method, h=0.1, t1=24.0, threads=1) for s in (scene, falling(engine(efficiency=None))))
    np.testing.assert_array_equal(whole.position, plain.position)
    whole = lw.solve(scene, method, h=0.1, t1=24.0, save=SAVE, threads=1)
    # While the pump works.
    first = lw.solve(scene, method, h=0.1, t1=15.0, save=SAVE, threads=1)
    rest = lw.solve(scene, method, h=0.1, t1=24.0, start=first.final, save=SAVE, threads=1)
    np.testing.assert_array_equal(rest.energy_used[-1], whole.energy_used[-1])
    assert HOTEL * 15.0 < first.energy_used[-1, 0] < whole.energy_used[-1, 0] - HOTEL * 9.0


@pytest.mark.ci
@pytest.mark.kernel
def test_without_an_efficiency_the_account_knows_nothing_of_it():
    assert worked(falling(ACCOUNT, engine(efficiency=None)), "rk4", 0.1, 24.0)[0] == pytest.approx(0.0, abs=1e-11)


@pytest.mark.slow
@pytest.mark.kernel
def test_members_have_efficiencies_of_their_own_and_two_engines_add_up():
    scene = falling(ACCOUNT, engine(first="up", volume_start=-1e-4), engine(first="up", volume_start=0.0, name="second"),
                    vehicle=ANCHORED)  # fmt: skip
    fleet = one(scene, b=(0.0, 0.0, 10.0), parameters={"buoyancy_engine.efficiency": np.array([0.25, 0.5, 1.0])})
    exact = WEIGHT * 10.0 * (RISE / np.array([0.25, 0.5, 1.0]) + PUMP["volume_up"] / EFFICIENCY)
    np.testing.assert_allclose(worked(fleet, "rk4", 0.4, 12.0), exact, rtol=1e-10)
    # In single precision the round-off of its steps.
    np.testing.assert_allclose(worked(fleet, "rk4", 0.4, 12.0, dtype="float32"), exact, rtol=1e-5)


@pytest.mark.slow
@pytest.mark.kernel
def test_a_battery_ends_in_the_middle_of_the_work():
    # Hotel load and pump at a held depth: both are constant.
    watts = HOTEL + WEIGHT * 10.0 * PUMP["pump_rate"] / EFFICIENCY
    scene = falling(ACCOUNT, engine(first="up", volume_start=-1e-4), vehicle=ANCHORED)
    scene = replace(scene, events=[lw.events.Battery(capacity=4.03 * watts)])
    result = lw.solve(scene, "rk4", h=0.4, t1=12.0, threads=1)
    assert result.status.counts() == {"battery": 1}
    assert result.failure_time[0] == pytest.approx(4.03, abs=1e-9)


def test_an_efficiency_is_above_0_and_at_most_1():
    for value in (0.0, -0.1, 1.2, np.nan):
        says(refused(engine, efficiency=value), "efficiency")


@pytest.mark.ci
def test_the_check_of_a_law_and_a_table_keep_the_pump():
    report = lw.laws.check_law(engine())
    assert report.ok, str(report)
    assert lw.Scene.from_dict(falling(ACCOUNT, engine()).to_dict()).terms[1].efficiency == EFFICIENCY


# Ballast ----------------------------------------------------------------------------------------------------------------

# Up in 4 s, down again, and up once more from 8 s to 12 s.
TIMES, VOLUMES = (0.0, 4.0, 8.0, 12.0), ((0.0, 1e-4), (2e-4, -1e-4), (-1e-4, -1e-4), (3e-4, 2e-4))
TANKS = ((0.4, 0.0, 0.2), (-0.4, 0.0, -0.1))


def tanks(**numbers):
    return lw.terms.Ballast(
        position=TANKS, **dict(times=TIMES, command_schedule=VOLUMES, efficiency=(0.5, 0.8)) | numbers
    )


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize("method", ["psi_s", "rk4", pytest.param("rk8", marks=pytest.mark.slow)])
def test_ballast_pumps_against_the_pressure_at_its_points(method):
    # At 0.25 m/s downward: p dV goes straight in each piece, so its mean is that of the middle.
    def pressure(t, below):
        return WEIGHT * (10.0 + 0.25 * t + below)

    exact = pressure(2.0, 0.2) * 2e-4 / 0.5 + pressure(10.0, 0.2) * 4e-4 / 0.5 + pressure(10.0, -0.1) * 3e-4 / 0.8
    scene = falling(ACCOUNT, tanks(), vehicle=ANCHORED, speed=0.25)
    # The first look of Runge-Kutta methods is a stage after the start: a part of h^2 of what the depth changes.
    first = 0.25 * WEIGHT * 0.25 * 5e-5 / 0.5 * 0.25**2 if method != "psi_s" else 0.0
    assert worked(scene, method, 0.25, 14.0)[0] == pytest.approx(exact, rel=1e-10, abs=first)


@pytest.mark.slow
@pytest.mark.kernel
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_a_limited_rate_counts_the_volume_that_moved(method):
    # At a held depth what the pumps push out counts: at 2.5e-5 m3/s the first rises to 1e-4 and falls and rises behind it.
    scene = falling(ACCOUNT, tanks(rate_limit=2.5e-5), vehicle=ANCHORED)
    fine = np.linspace(0.0, 14.0, 140001)
    exact = 0.0
    for j, (below, efficiency) in enumerate(((0.2, 0.5), (-0.1, 0.8))):
        wanted, volume, places = np.interp(fine, TIMES, np.array(VOLUMES)[:, j]), VOLUMES[0][j], []
        for u in wanted:
            volume += np.clip(u - volume, -2.5e-5 * 1e-4, 2.5e-5 * 1e-4)
            places.append(volume)
        exact += WEIGHT * (10.0 + below) * np.maximum(np.diff(places), 0.0).sum() / efficiency
    # Of the sums, a step of each; of psi_s a turn within a step.
    assert worked(scene, method, 0.05, 14.0)[0] == pytest.approx(exact, rel=2e-3)
    # And the motion keeps its bits, with and without a lag.
    for motion in ({}, {"rate_limit": 2.5e-5}):
        ends = [lw.solve(falling(ACCOUNT, tanks(**motion, **more)), method, h=0.1, t1=3.0, threads=1).position
                for more in ({}, {"efficiency": None})]  # fmt: skip
        np.testing.assert_array_equal(*ends)


@pytest.mark.slow
@pytest.mark.kernel
def test_a_controller_that_fills_ballast_pays_for_it():
    # Up from 12 m to 8 m: nothing that it pushes out comes for less than the pressure of the least depth, nor of the greatest.
    hover = lw.Controller(period=0.5, guidance=[lw.control.SetPoint(depth=8.0)], laws=[lw.control.HeavePID(kp=3.0, kd=20.0)],
                          allocation=[lw.control.PseudoInverse(to="ballast")])  # fmt: skip
    tank = lw.terms.Ballast(efficiency=[0.5], rate_limit=[4e-5])
    scene = falling(ACCOUNT, tank, depth=12.0, controller=hover)
    save = lw.SaveAt(every=0.1, fields=("position", "energy_used", "actuator"))
    result = lw.solve(scene, "rk4", h=0.1, t1=20.0, threads=1, save=save)
    volume = result.samples["actuator"].reshape(len(result.time), -1)[:, 0]
    risen = np.maximum(np.diff(np.concatenate([[0.0], volume])), 0.0).sum()
    deep = result.position[:, 0, 2]
    work = (result.energy_used[-1, 0] - HOTEL * 20.0) * 0.5
    assert 0.9 * WEIGHT * deep.min() * risen < work < 1.1 * WEIGHT * deep.max() * risen
    assert work > 1.0


@pytest.mark.ci
def test_the_check_of_ballast_with_pumps():
    for numbers in ({}, {"rate_limit": 2e-5}):
        report = lw.laws.check_law(tanks(**numbers))
        assert report.ok, str(report)
    says(refused(tanks, efficiency=(0.5, 0.0)), "efficiency")
