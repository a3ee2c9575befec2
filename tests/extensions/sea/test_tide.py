# SPDX-License-Identifier: Apache-2.0
"""Tides against closed forms of bodies that are held, float or hold their depth, and against a shift of the surface."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.extensions.gliders.twin.buoyancy_engine import BuoyancyEngine
from lgvi_warp.extensions.gliders.twin.surface_buoyancy import SurfaceBuoyancy
from lgvi_warp.extensions.sea.twin.tide import InTide
from lgvi_warp.extensions.sea.twin.tide import Tide as TideTwin
from lgvi_warp.physics.terms.base import own
from lgvi_warp.reference.terms.waves import Waves
from tests.control.test_altitude import FREE
from tests.extensions.gliders.cases import BALL, BUOYANCY, CENTER_OF_BUOYANCY, ENGINE, WATER
from tests.laws.case import Case
from tests.laws.cases_water import GRAVITY, WAVES, arrays
from tests.laws.test_parity import both
from tests.laws.test_waves import cell, neutral
from tests.support.tools import difference

CONSTITUENTS = dict(amplitudes=[0.5], periods=[400.0], phases=[0.3])
TABLE = dict(times=[0.0, 100.0, 300.0], heights=[0.0, 0.2, -0.1])


def test_heights():
    tide = lw.terms.Tide(**CONSTITUENTS, **TABLE, mean=0.7)
    t = np.array([-5.0, 0.0, 50.0, 250.0, 1000.0])
    table = [0.0, 0.0, 0.1, -0.025, -0.1]
    np.testing.assert_allclose(tide.at(t), 0.7 + 0.5 * np.cos(2.0 * np.pi * t / 400.0 + 0.3) + table, atol=1e-15)
    # M2 by its speed: 360 deg in 44,714 s.
    by_speed = lw.terms.Tide(amplitudes=[1.0], speeds=[28.984104])
    assert by_speed.at([0.0, 0.5 * 44714.16])[1] == pytest.approx(-1.0, abs=1e-9)
    numbers = {name: value[None] for name, value in tide.parameters().items()}
    assert tide.highest(numbers)[0] == pytest.approx(1.4)
    # Of the table by hand: 10 to 100 s, 10 to 300 s, over 300 s.
    assert tide.mean_height(numbers)[0] == pytest.approx(0.7 + 20.0 / 300.0)


def test_numbers_vary_by_member():
    vary = {
        "tide.mean": lw.distributions.Uniform(low=0.0, high=1.0),
        "tide.amplitudes": lw.distributions.Normal(std=0.1),
    }
    fleet = lw.Ensemble(neutral([lw.terms.Tide(**CONSTITUENTS, mean=0.5)]), 5, 1, vary)
    tide, p = fleet.scene.terms[0], fleet.parameters(0, 5)
    height = tide.height(own(tide, p), np.array([0.0, 10.0]))
    assert height.shape == (2, 5)
    for i in range(5):
        alone = lw.terms.Tide(**CONSTITUENTS | {"amplitudes": p["tide.amplitudes"][i]}, mean=p["tide.mean"][i])
        np.testing.assert_array_equal(alone.at([0.0, 10.0]), height[:, i])


def test_waves_over_a_floor_know_the_mean_of_a_table():
    # Three ways to say that the water is 6 m deep: sqrt(g k tanh(6 k)) = omega.
    waves = lw.terms.SeaState(significant_height=0.5, peak_period=6.0, heading_deg=0.0, seed=1)
    tides = (
        {"mean": 4.0},
        {"times": [0.0], "heights": [4.0]},
        {"times": [0.0, 50.0, 100.0], "heights": [1.0, 3.0, 5.0], "mean": 1.0},
    )
    for numbers in tides:
        scene = neutral([waves, lw.terms.Tide(**numbers)], events=[lw.events.Floor(depth=2.0)])
        p = lw.Ensemble(scene, 1).parameters(0, 1)
        c = scene.terms[0].wave_table(own(scene.terms[0], p), p)
        np.testing.assert_allclose(np.sqrt(scene.environment.gravity * c.k * np.tanh(6.0 * c.k)), c.omega, rtol=1e-9)


@pytest.mark.kernel
def test_a_floor_above_the_surface_leaves_no_waves():
    waves = lw.terms.SeaState(significant_height=0.5, peak_period=6.0, heading_deg=0.0)
    scene = neutral([waves, lw.terms.Tide(mean=-3.0)], events=[lw.events.Floor(depth=2.0)])
    with pytest.raises(lw.SceneError, match=r"floor.depth.*leaves no water for sea_state: 1 m.*Give a deeper floor"):
        lw.solve(scene, "psi_s", h=0.1, t1=1.0)


@pytest.mark.ci
@pytest.mark.kernel
def test_heights_above_the_tide_of_each_member():
    # Free bodies that rise by 1 m: from 2 m under their surfaces, and from 0.5 m under them.
    mean = np.array([3.0, 3.0, -2.0, -2.0])
    place = np.zeros((4, 3))
    place[:, 2] = np.array([2.0, 0.5, 2.0, 0.5]) - mean
    rising = np.tile([0.0, 0.0, -0.5], (4, 1))
    fleet = lw.Ensemble.from_states(
        neutral([lw.terms.Tide(mean=0.0)]),
        place,
        np.tile(np.eye(3), (4, 1, 1)),
        rising,
        np.zeros((4, 3)),
        {"tide.mean": mean},
    )
    result = lw.solve(fleet, "psi_s", h=0.1, t1=2.0)
    assert result.warnings.has(lw.Warnings.ABOVE_SURFACE).tolist() == [False, True, False, True]


def test_numbers_that_are_no_tide_are_refused():
    for numbers, words in (
        ({}, "amplitudes"),
        ({"amplitudes": [1.0]}, "have neither periods nor speeds"),
        ({"amplitudes": [1.0], "periods": [1.0], "speeds": [1.0]}, "have both periods and speeds"),
        ({"periods": [1.0], "mean": 0.0}, "has no amplitudes"),
        ({"times": [0.0, 1.0]}, "has no heights"),
        ({"times": [1.0, 0.0], "heights": [0.0, 1.0]}, "is not rising"),
        ({"amplitudes": [1.0, 2.0], "periods": [1.0]}, "has shape"),
    ):
        with pytest.raises(lw.SceneError, match=words):
            lw.terms.Tide(**numbers)
    with pytest.raises(lw.SceneError, match="tide"):
        neutral([lw.terms.Tide(mean=1.0), lw.terms.Tide(mean=2.0, name="other")])


def test_who_knows_it():
    # A scene without it has neither rows nor features; taken away, it is forgotten.
    terms = [
        lw.terms.Waves(amplitudes=[0.2], periods=[4.0], headings_deg=[30.0]),
        lw.terms.SurfaceBuoyancy(heights=0.3),
    ]
    scene = neutral([*terms, lw.terms.Tide(mean=1.0)], events=[lw.events.Surface()])
    assert all(thing.surface_level is scene.terms[2] for thing in (*scene.terms[:2], *scene.events))
    plain = neutral(list(scene.terms[:2]), events=list(scene.events))
    assert all(thing.surface_level is None for thing in (*plain.terms, *plain.events))


@pytest.mark.ci
@pytest.mark.kernel
def test_a_floating_body_in_a_slow_tide():
    # A box that floats: M z'' + c z' + B / H (z + eta - d) = 0, d where it floats in still water. Its steady motion follows.
    ball = lw.Vehicle(8.0, inertia=[0.1] * 3, added_mass=[4.0] * 3, buoyancy=100.0)
    B, H, M, c, T = 100.0, 0.3, 12.0, 20.0, 40.0
    tide = lw.terms.Tide(amplitudes=[0.1], periods=[T], phases=[0.3], times=[0.0, 1e9], heights=[0.25, 0.25], mean=0.5)
    terms = [tide, lw.terms.SurfaceBuoyancy(heights=H, section="box"), lw.terms.Drag(linear=[c] * 6)]
    scene = lw.Scene(ball, lw.Environment(gravity=10.0), terms=terms, start=lw.Start(position=[0.0, 0.0, -0.7]))
    result = lw.solve(scene, "psi_s", h=0.02, t1=80.0, save=lw.SaveAt(every=2.0))
    # It is in the water by 80 / 100 of its height: its middle is 0.3 H below the surface.
    omega, k = 2.0 * np.pi / T, B / H
    follow = k / (k - M * omega**2 + 1j * omega * c)
    wanted = 0.3 * H - 0.75 - np.real(0.1 * follow * np.exp(1j * (omega * result.time + 0.3)))
    late = result.time > 30.0
    # exp(-c t / 2 M) of the start is 1e-11 by then. The step turns the tide by 0.003: 1e-5 / 12 of 0.1 m.
    assert np.abs(result.position[late, 0, 2] - wanted[late]).max() < 1e-6
    assert np.ptp(wanted[late]) > 0.19


@pytest.mark.slow
@pytest.mark.kernel
def test_a_cell_in_waves_on_a_tide_and_the_event_at_the_surface():
    # The reading is the depth below the tide and the pressure of the waves at that depth.
    tide = lw.terms.Tide(**CONSTITUENTS, **TABLE, mean=0.7)
    wave = lw.terms.Waves(amplitudes=[0.2], periods=[4.0], headings_deg=[30.0])
    terms = [tide, wave, lw.terms.ControlWrench()]
    scene = neutral(terms, controller=cell(reads="pressure"), events=[lw.events.Surface(depth=0.5)])
    fleet = lw.Ensemble.from_states(scene, [[0.0, 0.0, 2.0]], np.eye(3)[None], [[0.0, 0.0, -0.05]], np.zeros((1, 3)))
    save = lw.SaveAt(every=2.0, fields=("position", "measured_depth"))
    result = lw.solve(fleet, "rk4", h=0.05, t1=100.0, width=2, save=save)
    assert result.status.counts() == {"surface": 1}
    before = result.time < result.failure_time[0]
    b, t = result.position[before, 0], result.time[before]
    g, omega = scene.environment.gravity, 2.0 * np.pi / 4.0
    k, below = omega**2 / g, b[:, 2] + tide.at(t)
    theta = k * b[:, :2] @ [np.cos(np.pi / 6.0), np.sin(np.pi / 6.0)] - omega * t
    wanted = below + 0.2 * np.exp(-k * np.maximum(below, 0.0)) * np.cos(theta)
    np.testing.assert_allclose(result.measured_depth[before, 0], wanted, atol=1e-11)
    end = result.position[-1, 0, 2] + tide.at([result.failure_time[0]])[0]
    assert end == pytest.approx(0.5, abs=1e-6)


@pytest.mark.slow
@pytest.mark.kernel
def test_a_mean_height_is_a_shift():
    # All that looks at the surface: raised by 0.8 m, a vehicle 0.8 m higher does the same.
    shift = 0.8
    terms = [
        lw.terms.Tide(**CONSTITUENTS, mean=shift),
        lw.terms.Waves(amplitudes=[0.2], periods=[4.0], headings_deg=[30.0]),
        lw.terms.SurfaceBuoyancy(heights=0.3),
        lw.terms.DensityProfile(depths=[0.0, 3.0, 8.0], densities=[1000.0, 1020.0, 1060.0]),
        lw.terms.Ballast(command=[1e-4]),
        lw.terms.BuoyancyEngine(
            pump_rate=1e-4, volume_down=-2e-4, volume_up=2e-4, depth_top=0.5, depth_bottom=1.2, volume_start=1e-4
        ),
        lw.terms.Drag(linear=[5.0] * 6),
    ]
    scene = neutral(terms)
    place = np.array([[0.0, 0.0, 0.4 + shift], [0.0, 0.0, 0.4]])
    still = np.zeros((2, 3))
    R = np.broadcast_to(lw.notation.matrix_from_rotation_vector(np.array([0.2, 0.3, 0.5])), (2, 3, 3))
    fleet = lw.Ensemble.from_states(scene, place, R, still, still, {"tide.mean": np.array([0.0, shift])})
    result = lw.solve(fleet, "psi_s", h=0.05, t1=20.0, width=2)
    first, second = result.position[-1]
    np.testing.assert_allclose(first - second, [0.0, 0.0, shift], atol=1e-9)
    assert abs(first[2] - place[0, 2]) > 0.1


@pytest.mark.slow
@pytest.mark.kernel
def test_altitude_of_a_vehicle_that_holds_its_depth_by_pressure():
    # It follows the surface over a floor at D, whose place no tide moves: its altitude is D + eta - depth, 12 m at eta = 0.
    tide = lw.terms.Tide(amplitudes=[1.0], periods=[2000.0])
    floor = lw.events.Floor(depth=20.0, clearance=12.0)
    controller = lw.Controller(
        period=0.1,
        sensors=[lw.control.Sensor(name="depth_cell", of="depth", reads="pressure")],
        guidance=[lw.control.SetPoint(depth=8.0)],
        laws=[lw.control.HeavePID(kp=4.0, kd=6.0)],
    )
    scene = neutral(
        [tide, lw.terms.ControlWrench(), lw.terms.Drag(linear=[2.0] * 6)], controller=controller, events=[floor]
    )
    fleet = lw.Ensemble.from_states(scene, [[0.0, 0.0, 7.0]], np.eye(3)[None], np.zeros((1, 3)), np.zeros((1, 3)))
    save = lw.SaveAt(every=20.0, fields=("position", "measured_depth"))
    result = lw.solve(fleet, "rk4", h=0.1, t1=1000.0, save=save)
    ended = result.failure_time[0]
    # A tide of 0.003 m/s leaves a lag of (drag + kd) / kp = 2 s times that.
    assert result.status.counts() == {"floor": 1}
    assert ended == pytest.approx(500.0, abs=5.0)
    at = (result.time > 60.0) & (result.time < ended)
    np.testing.assert_allclose(result.measured_depth[at, 0], 8.0, atol=0.01)


@pytest.mark.slow
@pytest.mark.kernel
def test_kernel_and_twin():
    # Waves, a hull at the surface and an engine, each at its depth below a tide that moves fast; 20 steps of round-off.
    numbers = dict(amplitudes=[0.3], periods=[2.0], phases=[0.4], times=[0.0, 0.1, 0.3], heights=[0.0, 0.2, -0.1])
    twin = TideTwin(**numbers, mean=0.2)
    waves = Waves(**arrays(WAVES), gravity=GRAVITY)
    hull = SurfaceBuoyancy(**arrays(BALL), section="box", buoyancy=BUOYANCY, center_of_buoyancy=CENTER_OF_BUOYANCY)
    engine = BuoyancyEngine(**{name: np.asarray(value) for name, value in ENGINE.items()}, **WATER)
    laws = tuple(InTide(law=law, tide=twin) for law in (waves, hull.beside((waves,)), engine))
    terms = [
        *(lw.terms.Tide(**numbers, mean=0.2), lw.terms.Waves(**WAVES)),
        *(lw.terms.SurfaceBuoyancy(**BALL, section="box"), lw.terms.BuoyancyEngine(**ENGINE)),
    ]
    kernel, reference = both(Case(tuple(terms), laws), "psi_s", 0.02, 20)
    assert difference(kernel, reference) < 1e-12


@pytest.mark.slow
@pytest.mark.kernel
def test_an_altimeter_and_the_clearance_know_no_tide():
    # Floor and axes stay: a body that sinks by 0.5 m/s from 8 m is D - z above the floor and ends at D - clearance, whatever
    # its tide, while a pressure cell reads z + eta. The guidance adds to that what is too high.
    n, tilt, T = 3, np.radians(40.0), 60.0
    numbers = {
        "tide.mean": np.array([0.0, 2.0, -1.5]),
        "tide.amplitudes": np.array([[0.5], [1.5], [0.0]]),
        "tide.phases": np.array([[0.0], [1.0], [2.0]]),
        "floor.depth": np.array([20.0, 23.0, 18.0]),
    }
    tide = lw.terms.Tide(amplitudes=[1.0], periods=[T], mean=0.0)
    sensors = [
        lw.control.Altimeter(direction=[np.sin(tilt), 0.0, np.cos(tilt)]),
        lw.control.Sensor(name="depth_cell", of="depth", reads="pressure"),
    ]
    controller = lw.Controller(
        period=0.1,
        sensors=sensors,
        guidance=[lw.control.Altitude(**FREE)],
        laws=[lw.control.HeavePID(kp=0.0)],
    )
    floor = lw.events.Floor(depth=20.0, clearance=1.0)
    scene = neutral([tide, lw.terms.ControlWrench()], controller=controller, events=[floor])
    place, sinking = np.tile([0.0, 0.0, 8.0], (n, 1)), np.tile([0.0, 0.0, 0.5], (n, 1))
    fleet = lw.Ensemble.from_states(scene, place, np.tile(np.eye(3), (n, 1, 1)), sinking, np.zeros((n, 3)), numbers)
    save = lw.SaveAt(every=2.0, fields=("position", "measured_depth", "reference_depth"))
    result = lw.solve(fleet, "rk4", h=0.1, t1=40.0, save=save)
    D = numbers["floor.depth"]
    assert result.status.counts() == {"floor": n}
    np.testing.assert_allclose(result.failure_time, (D - 1.0 - 8.0) / 0.5, atol=1e-9)
    before = result.time[:, None] < result.failure_time
    z = 8.0 + 0.5 * result.time[:, None] + np.zeros(n)
    angle = 2.0 * np.pi * result.time[:, None] / T + numbers["tide.phases"][:, 0]
    eta = numbers["tide.mean"] + numbers["tide.amplitudes"][:, 0] * np.cos(angle)
    np.testing.assert_allclose(result.altitude[before], (D - z)[before], atol=1e-9)
    np.testing.assert_allclose(result.measured_depth[before], (z + eta)[before], atol=1e-9)
    reading = result.samples["reference_depth"] - result.measured_depth + FREE["altitude"]
    np.testing.assert_allclose(reading[before], (D - z)[before], atol=1e-9)
