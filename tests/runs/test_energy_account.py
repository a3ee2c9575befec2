# SPDX-License-Identifier: Apache-2.0
"""The account of energy through a run: batteries, steps made again, runs that go on, statistics, controllers, stores."""

import numpy as np
import pytest
from scipy import integrate

import lgvi_warp as lw
from tests.conftest import ROOT
from tests.laws.test_energy_used import HOTEL, JUMP, PAIR, TABLE, TAU, watts
from tests.support.tools import one, slope, vehicle
from tests.unit.views.test_recording import rows

FIELDS = ("position", "energy_used")
SAVE = lw.SaveAt(every=0.5, fields=FIELDS)


def account(hotel=HOTEL):
    return lw.terms.EnergyUse(hotel=hotel)


CUBE = lw.terms.Thrusters(position=[[0.0, 0.0, 0.0]], direction=[[1.0, 0.0, 0.0]], coefficient=1.0, torque_coefficient=2.0,
                          shaft_speed=10.0, time_constant=TAU, times=[0.0, JUMP], command_schedule=[[0.5], [0.9]])  # fmt: skip


def power_of_the_cube(t):
    """The power of an exponential approach from 0.5 to 0.9, beside the hotel load."""
    return HOTEL + 20.0 * (0.9 - 0.4 * np.exp(-t / TAU)) ** 3


def scene_of(*terms, events=(), **more):
    return lw.Scene.named("torpedo", terms=list(terms), events=list(events), **more)


def ending(terms, capacity, method, h, t1=3.0, **settings):
    """Time at which the battery of one member ends [s], and the energy used then [J]."""
    events = [lw.events.Battery(capacity=capacity)]
    result = lw.solve(scene_of(*terms, events=events), method, h=h, t1=t1, save=SAVE, threads=1, **settings)
    assert result.status.counts() == {"battery": 1}
    return float(result.failure_time[0]), float(result.energy_used[-1, 0])


@pytest.mark.ci
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_a_battery_ends_where_constant_power_ends_it(method):
    held = lw.terms.Thrusters(**PAIR, **TABLE, command=[0.4, -0.7])
    power = HOTEL + watts(0.4) + watts(-0.7)
    t, used = ending([account(), held], 1.2345 * power, method, 0.1)
    assert t == pytest.approx(1.2345, rel=1e-12)
    assert used == pytest.approx(1.2345 * power, rel=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_a_battery_ends_within_a_ramp_of_power(method):
    # P = 40 t: E = 5 t + 20 t^2 = 50, from the closed root; both methods integrate each part of a step exactly.
    ramp = lw.terms.Thrusters(position=[[0.0, 0.0, 0.0]], direction=[[1.0, 0.0, 0.0]], coefficient=1.0,
                              power_commands=[0.0, 1.0], power=[0.0, 120.0], times=[0.0, 3.0],
                              command_schedule=[[0.0], [1.0]])  # fmt: skip
    t, used = ending([account(), ramp], 50.0, method, 0.1)
    assert t == pytest.approx((-5.0 + np.sqrt(25.0 + 4.0 * 20.0 * 50.0)) / 40.0, rel=1e-12)
    assert used == pytest.approx(50.0, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "order", "steps"), [("rk4", 4, (0.05, 0.025)), ("psi_s", 2, (0.1, 0.05))])
def test_the_end_of_a_battery_has_the_order_of_the_method(method, order, steps):
    # By quadrature of the closed form of the power.
    exact = 1.73
    capacity = integrate.quad(power_of_the_cube, 0.0, exact, epsabs=0.0, epsrel=1e-13)[0]
    errors = [abs(ending([account(), CUBE], capacity, method, h)[0] - exact) for h in steps]
    assert slope(steps, errors) == pytest.approx(order, abs=0.4)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_of_two_events_in_one_step_the_earlier_one_stops(method):
    # One step of 1 s: the battery ends at 0.4 s, and the time is over before, after, or far after.
    for at, status in ((0.3, "time"), (0.5, "battery"), (5.0, "battery")):
        for events in ([lw.events.StopTime(at=at), lw.events.Battery(capacity=2.0)],
                       [lw.events.Battery(capacity=2.0), lw.events.StopTime(at=at)]):  # fmt: skip
            result = lw.solve(scene_of(account(), events=events), method, h=1.0, t1=1.0, save=SAVE_ALL, threads=1)
            assert result.status.counts() == {status: 1}
            assert result.failure_time[0] == pytest.approx(min(at, 0.4), rel=1e-12)
            assert result.energy_used[-1, 0] == pytest.approx(HOTEL * min(at, 0.4), rel=1e-12)


@pytest.mark.ci
@pytest.mark.slow_but("psi_s-True")
@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_a_battery_that_ends_beside_the_floor_or_the_surface(method, first):
    # One step of 1 s, at 1 m/s down or up: the end of the way lies 0.3 m, 0.5 m or 2 m off, that of the battery at 0.4 s.
    off = np.array([0.3, 0.5, 2.0])
    down, depth = np.repeat([1.0, -1.0], 3), np.concatenate([20.0 - off, off])
    ways = {1.0: "floor", -1.0: "surface"}
    stops = [lw.events.Floor(depth=20.0), lw.events.Surface()]
    battery = [lw.events.Battery(capacity=2.0)]
    body = lw.Vehicle(30.0, inertia=(0.3, 4.0, 4.0), buoyancy=30.0 * 9.80665)
    scene = lw.Scene(body, terms=[account()], events=battery + stops if first else stops + battery)
    fleet = one(scene, b=np.stack([0.0 * depth, 0.0 * depth, depth], 1), nu=np.stack([0.0 * down, 0.0 * down, down], 1))
    result = lw.solve(fleet, method, h=1.0, t1=1.0, save=SAVE_ALL, threads=1)
    told = [lw.Status(status).name.lower() for status in result.status]
    assert told == [ways[way] if far < 0.4 else "battery" for way, far in zip(down, np.tile(off, 2), strict=True)]
    np.testing.assert_allclose(result.failure_time, np.minimum(np.tile(off, 2), 0.4), rtol=1e-12)
    np.testing.assert_allclose(result.energy_used[-1], HOTEL * np.minimum(np.tile(off, 2), 0.4), rtol=1e-12)


SAVE_ALL = lw.SaveAt(fields=FIELDS)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_members_that_go_on_keep_their_bits_beside_empty_batteries(method):
    hotel = np.linspace(1.0, 9.0, 20)
    laws = [account(), lw.terms.Thrusters(**PAIR, **TABLE, time_constant=TAU, times=[0.0, 2.0],
                                          command_schedule=[[0.5, -0.2], [1.0, 0.9]])]  # fmt: skip

    def solved(capacity):
        scene = scene_of(*laws, events=[lw.events.Battery(capacity=capacity)])
        fleet = one(scene, parameters={"energy_use.hotel": hotel})
        return lw.solve(fleet, method, h=0.05, t1=2.0, save=SAVE, threads=1)

    far = solved(1e9)
    capacity = float(np.median(far.energy_used[-1]))
    near = solved(capacity)
    well = np.asarray(near.status) == 0
    assert 3 < well.sum() < 17
    for name in FIELDS:
        np.testing.assert_array_equal(near.samples[name][:, well], far.samples[name][:, well])
    # Those that stopped stay at their capacity.
    np.testing.assert_allclose(near.energy_used[-1, ~well], capacity, rtol=1e-12)
    assert np.all(np.diff(near.energy_used, axis=0) >= 0.0)


def spinning(rates):
    """Members about a step's limit for the solution of the rotation, with power that falls with the speed."""
    law = lw.terms.Thrusters(position=[[0.0, 0.1, 0.0]], direction=[[1.0, 0.0, 0.0]], coefficient=1.0, command=[0.8],
                             torque_coefficient=0.5, torque_loss=0.05, shaft_speed=12.0)  # fmt: skip
    body = vehicle(M=(2.0, 2.0, 2.0), J=(1.0, 2.0, 2.5))
    scene = lw.Scene(body, lw.Environment(gravity=9.8), terms=[account(), law])
    Om = np.array([[0.1, rate, 0.2] for rate in rates])
    return one(scene, nu=np.full((len(rates), 3), 0.2), Om=Om)


@pytest.mark.slow
def test_steps_that_are_made_in_parts_count_once():
    # The same members beside calm ones, and beside some whose steps have no solution until they are divided.
    calm, wild = [0.3, 0.5, 0.4, 0.2], [0.3, 9.0, 0.4, 5.0]
    settings = dict(h=0.4, t1=8.0, save=SAVE_ALL, on_failure="substep", width=4, threads=1)
    quiet, divided = lw.solve(spinning(calm), "psi_s", **settings), lw.solve(spinning(wild), "psi_s", **settings)
    assert (divided.substeps > 0).tolist() == [False, True, False, True]
    np.testing.assert_array_equal(quiet.energy_used[:, [0, 2]], divided.energy_used[:, [0, 2]])
    # In parts of a step the sum is that of a run with short steps, to the order of the method.
    fine = lw.solve(spinning(wild), "psi_s", h=0.005, t1=8.0, save=SAVE_ALL, threads=1)
    np.testing.assert_allclose(divided.energy_used[-1], fine.energy_used[-1], rtol=0.02)


@pytest.mark.ci
def test_neighbours_of_a_member_that_fails_count_once():
    settings = dict(h=0.4, t1=8.0, save=SAVE_ALL, width=4, threads=1)
    quiet, failing = (
        lw.solve(spinning(rates), "psi_s", **settings) for rates in ([0.3, 0.5, 0.4, 0.2], [0.3, 9.0, 0.4, 0.2])
    )
    assert failing.status.failed.tolist() == [False, True, False, False]
    np.testing.assert_array_equal(quiet.energy_used[:, [0, 2, 3]], failing.energy_used[:, [0, 2, 3]])
    assert failing.energy_used[-1, 1] <= quiet.energy_used[-1, 0]


@pytest.mark.ci
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_a_run_that_goes_on_goes_on_counting(method):
    scene = scene_of(account(), lw.terms.Thrusters(**PAIR, **TABLE, command=[0.4, -0.7]),
                     events=[lw.events.Battery(capacity=250.0)])  # fmt: skip
    whole = lw.solve(scene, method, h=0.1, t1=6.0, save=SAVE, threads=1)
    first = lw.solve(scene, method, h=0.1, t1=2.0, save=SAVE, threads=1)
    second = lw.solve(scene, method, h=0.1, t1=6.0, start=first.final, save=SAVE, threads=1)
    np.testing.assert_array_equal(second.energy_used, whole.energy_used[4:])
    np.testing.assert_array_equal(second.failure_time, whole.failure_time)
    assert whole.status.counts() == {"battery": 1}
    # Also where neither run saves it before, and from a member that has stopped.
    third = lw.solve(scene, method, h=0.1, t1=7.0, start=second.final, save=SAVE, threads=1)
    assert third.energy_used[-1, 0] == pytest.approx(250.0, rel=1e-12)
    unsaved = lw.solve(scene, method, h=0.1, t1=2.0, threads=1)
    after = lw.solve(scene, method, h=0.1, t1=3.0, start=unsaved.final, save=SAVE, threads=1)
    assert after.energy_used[-1, 0] == pytest.approx(3.0 * (HOTEL + watts(0.4) + watts(-0.7)), rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_float32_loses_nothing_over_many_steps(method):
    # 40,000 additions of 0.05 J: a plain sum of float32 would be off by a part of 1e-4 and more.
    scene = scene_of(account())
    result = lw.solve(scene, method, h=0.01, t1=400.0, dtype="float32", save=SAVE_ALL, threads=1)
    assert result.energy_used[-1, 0] == pytest.approx(400.0 * HOTEL, rel=2e-7)
    t, _ = ending([account()], 1e3, method, 0.01, t1=300.0, dtype="float32")
    assert t == pytest.approx(200.0, rel=4e-7)


@pytest.mark.ci
def test_statistics_are_those_of_the_samples():
    hotel = np.linspace(1.0, 9.0, 300)
    fleet = one(scene_of(account()), parameters={"energy_use.hotel": hotel})
    statistics = [
        lw.statistics.Mean("energy_used"),
        lw.statistics.Quantiles("energy_used"),
        lw.metrics.ElectricalEnergy(),
    ]
    result = lw.solve(fleet, "psi_s", h=0.1, t1=2.0, save=SAVE, statistics=statistics, threads=1)
    np.testing.assert_allclose(result.energy_used, result.time[:, None] * hotel, rtol=1e-13)
    np.testing.assert_allclose(
        np.ravel(result.statistics["mean energy_used"].value), result.energy_used.mean(axis=1), rtol=1e-12
    )
    (mean,) = np.ravel(result.statistics["mean electrical_energy"].value)
    assert mean == pytest.approx(2.0 * hotel.mean(), rel=1e-12)


@pytest.mark.ci
def test_a_sweep_means_the_account_by_energy():
    sweep = lw.sweep(scene_of(account()), metrics=["energy"], members=2, h=0.1, t1=2.0, threads=1)
    np.testing.assert_allclose(sweep.values("scene", "energy"), 2.0 * HOTEL, rtol=1e-13)


@pytest.mark.slow
def test_members_have_power_of_their_own():
    tables = np.array([WATTS_OF_ONE, [2.0 * x for x in WATTS_OF_ONE], [0.0] * 5])[:, :, None] * np.ones(2)
    scene = scene_of(account(), lw.terms.Thrusters(**PAIR, **TABLE, command=[0.4, -0.7]))
    fleet = one(scene, parameters={"thrusters.power": tables, "energy_use.hotel": np.array([1.0, 2.0, 3.0])})
    result = lw.solve(fleet, "rk4", h=0.1, t1=2.0, save=SAVE_ALL, threads=1)
    expected = 2.0 * (np.array([1.0, 2.0, 3.0]) + np.array([1.0, 2.0, 0.0]) * (watts(0.4) + watts(-0.7)))
    np.testing.assert_allclose(result.energy_used[-1], expected, rtol=1e-13)


WATTS_OF_ONE = TABLE["power"]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "method"), [("bluerov2_dead_thruster", "rk4"), ("remus_100_autopilot", "psi_x")])
def test_driven_vehicles_use_the_power_of_where_their_actuators_are(name, method):
    # A trapezoid of the recorded places of all thrusters, at each of the steps: an error of order h^2.
    scene = lw.Scene.load(ROOT / "examples" / "scenes" / f"{name}.toml", {"run.duration": 3.0})
    tables = scene.to_dict()
    knots, power = [-1.0, -0.1, 0.0, 0.1, 1.0], [150.0, 4.0, 2.0, 4.0, 180.0]
    if name.startswith("remus"):
        tables["terms"].append({"type": "thrusters", "position": [[-0.6, 0.0, 0.0]], "direction": [[1.0, 0.0, 0.0]],
                                "coefficient": [4.0], "command": [0.8]})  # fmt: skip
    propulsion = next(term for term in tables["terms"] if term["type"] == "thrusters")
    propulsion |= {"power_commands": knots, "power": power}
    tables["terms"].append({"type": "energy_use", "hotel": 12.0})
    tables.get("ensemble", {}).pop("members", None)
    for fault in tables["controller"].get("faults", ()):
        fault["time"] = 1.0
    scene = lw.Scene.from_dict(tables)
    h = 0.005
    settings = dict(h=h, t1=3.0, threads=1, save=lw.SaveAt(every=h, fields=("actuator", "energy_used")))
    result = lw.solve(lw.Ensemble(scene, 2), method, **settings)
    assert result.status.counts() == {"ok": 2}
    if name.startswith("remus"):
        exact = np.full(2, 3.0 * (12.0 + np.interp(0.8, knots, power)))
    else:
        each = np.interp(result.actuator, knots, power).sum(axis=2) + 12.0
        exact = integrate.trapezoid(each, result.time, axis=0)
        assert np.ptp(each) > 10.0
    np.testing.assert_allclose(result.energy_used[-1], exact, rtol=2e-4)


def test_what_does_not_go_together_is_a_sentence():
    battery = lw.events.Battery(capacity=1.0)
    with pytest.raises(lw.SceneError, match=r'battery.*no term accounts. Give a term of type "energy_use"'):
        scene_of(events=[battery])
    # Other names do not help: a scene has one account.
    for second in (account(), lw.terms.EnergyUse(name="other")):
        with pytest.raises(lw.SceneError, match=r"is a second term of the type energy_use. Keep one of them"):
            scene_of(account(), second)
    with pytest.raises(lw.SceneError, match="energy_used' is not accounted"):
        lw.solve(scene_of(), h=0.1, t1=1.0, save=SAVE)
    with pytest.raises(lw.SceneError, match="energy_used' is not accounted"):
        lw.solve(scene_of(), h=0.1, t1=1.0, statistics=[lw.statistics.Mean("energy_used")])
    with pytest.raises(lw.SceneError, match=r"power.*without power_commands"):
        lw.terms.Thrusters(**PAIR, power=[1.0, 2.0])
    with pytest.raises(lw.SceneError, match="without torque_coefficient"):
        lw.terms.Thrusters(**PAIR, shaft_speed=2.0)
    with pytest.raises(lw.SceneError, match="beside shaft_speed"):
        lw.terms.Thrusters(**PAIR, **TABLE, torque_coefficient=1.0, shaft_speed=2.0)
    with pytest.raises(lw.SceneError, match="gauss4"):
        lw.solve(scene_of(account()), "gauss4", h=0.1, t1=1.0)


@pytest.mark.ci
def test_a_store_has_the_account(tmp_path):
    fleet = one(scene_of(account()), parameters={"energy_use.hotel": np.array([1.0, 2.0, 3.0])})
    run = lw.solve(fleet, "psi_s", h=0.1, t1=2.0, save=SAVE, store=tmp_path / "run.zarr", threads=1)
    np.testing.assert_allclose(run.energy_used[-1], [2.0, 4.0, 6.0], rtol=1e-13)
    np.testing.assert_array_equal(lw.open_run(tmp_path / "run.zarr").energy_used, run.energy_used)


@pytest.mark.ci
def test_pictures_and_recordings_show_it(tmp_path):
    fleet = one(scene_of(account()), parameters={"energy_use.hotel": np.array([1.0, 2.0, 3.0])})
    save = lw.SaveAt(every=0.5, fields=("position", "attitude", "velocity", "angular_velocity", "energy_used"))
    result = lw.solve(fleet, "psi_s", h=0.1, t1=2.0, save=save, threads=1)
    axes = lw.plots.fan(result, "energy_used", path=tmp_path / "used.svg")
    assert axes.get_ylabel() == "energy used [J]"
    lw.record(result, tmp_path / "run.rrd")
    median = rows(tmp_path / "run.rrd", "/curves/energy_used/median", "scalars")
    np.testing.assert_allclose([median[t][0] for t in sorted(median)], [0.0, 1.0, 2.0, 3.0, 4.0], rtol=1e-12)


@pytest.mark.slow
def test_adaptive_steps_count_those_that_are_accepted():
    # A tolerance far below what is asked here; capacity and end by quadrature of the closed form.
    method = lw.Method("rk5", rtol=1e-9, atol=1e-9)
    exact = integrate.quad(power_of_the_cube, 0.0, 3.0, epsrel=1e-13)[0]
    result = lw.solve(scene_of(account(), CUBE), method, h=0.2, t1=3.0, save=SAVE_ALL, threads=1)
    assert result.energy_used[-1, 0] == pytest.approx(exact, rel=1e-5)
    capacity = integrate.quad(power_of_the_cube, 0.0, 1.73, epsrel=1e-13)[0]
    t, used = ending([account(), CUBE], capacity, method, 0.2, t1=3.0)
    assert t == pytest.approx(1.73, rel=1e-5)
    assert used == pytest.approx(capacity, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "most"), [("rk8", 1e-9), ("rkmk4", 2e-7), ("rkw3", 2e-5), ("psi_x", 1e-3), ("psi", 1e-3)]
)
def test_a_lag_in_other_methods(method, most):
    # rk8 goes back in time between its stages: its error is that of the ramp, 1e-9 s; psi has its forces in halves of a step.
    exact = integrate.quad(power_of_the_cube, 0.0, 3.0, epsrel=1e-13)[0]
    result = lw.solve(scene_of(account(), CUBE), method, h=0.05, t1=3.0, save=SAVE_ALL, threads=1)
    assert result.energy_used[-1, 0] == pytest.approx(exact, rel=most)


@pytest.mark.ci
@pytest.mark.parametrize("dtype", ["float64", pytest.param("float32_compensated", marks=pytest.mark.slow)])
def test_a_battery_ends_in_water_that_moves_and_remembers(dtype):
    water = [lw.terms.GaussMarkovCurrent(standard_deviation=[0.1, 0.1, 0.0], time_constant=5.0),
             lw.terms.CurrentProfile(depths=[0.0, 20.0], velocities=[[0.3, 0.0, 0.0], [0.0, 0.2, 0.0]])]  # fmt: skip
    scene = scene_of(account(), *water, events=[lw.events.Battery(capacity=6.0), lw.events.StopTime(at=1.7)])
    hotel = np.array([2.0, 3.0, 4.0, 5.0])
    fleet = one(scene, b=np.full((4, 3), 5.0), parameters={"energy_use.hotel": hotel})
    result = lw.solve(fleet, "psi_s", h=0.1, t1=2.0, dtype=dtype, save=SAVE_ALL, threads=1)
    rel = 1e-12 if dtype == "float64" else 1e-6
    assert result.status.counts() == {"time": 2, "battery": 2}
    np.testing.assert_allclose(result.failure_time, [1.7, 1.7, 1.5, 1.2], rtol=rel)
    np.testing.assert_allclose(result.energy_used[-1], [3.4, 5.1, 6.0, 6.0], rtol=rel)


@pytest.mark.ci
@pytest.mark.parametrize("fields", [("position", "energy_used"), ("command", "energy_used", "demand")])
def test_a_controlled_vehicle_stops_where_its_battery_ends(fields):
    # The controller's rows of the memory lie before those of the account.
    tables = lw.Scene.load(ROOT / "examples" / "scenes" / "bluerov2_dead_thruster.toml").to_dict()
    tables["terms"].append({"type": "energy_use", "hotel": 12.0})
    tables["events"] = [{"type": "battery", "capacity": 18.0}]
    scene = lw.Scene.from_dict(tables)
    save = lw.SaveAt(every=0.1, fields=fields)
    result = lw.solve(lw.Ensemble(scene, 2), "rk4", h=0.01, t1=2.0, save=save, threads=1)
    assert result.status.counts() == {"battery": 2}
    np.testing.assert_allclose(result.failure_time, 1.5, rtol=1e-12)
    times = np.minimum(result.time, 1.5)[:, None]
    np.testing.assert_allclose(result.energy_used, 12.0 * np.broadcast_to(times, result.energy_used.shape), rtol=1e-12)
    again = lw.solve(lw.Ensemble(scene, 2), "rk4", h=0.01, t1=2.0, save=save, threads=1,
                     start=lw.solve(lw.Ensemble(scene, 2), "rk4", h=0.01, t1=1.0, save=save, threads=1).final)  # fmt: skip
    np.testing.assert_array_equal(again.energy_used, result.energy_used[10:])
