# SPDX-License-Identifier: Apache-2.0
"""Buoyancy at the surface, by volumes and closed forms: depth of rest, bobbing, metacentre, energy, flight, waves."""

import re
import subprocess
import sys

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import lgvi_warp as lw
from lgvi_warp.physics.energy import drift
from lgvi_warp.reference.terms.waves import Waves
from tests.conftest import ROOT
from tests.extensions.gliders.cases import SURFACE, surface
from tests.laws.cases_water import arrays
from tests.laws.test_parity import BENT, both
from tests.support.hamel import turn
from tests.support.tools import difference, last, one, slope

GRAVITY, DENSITY = 9.8, 1000.0
LENGTH, HEIGHT = 1.6, 0.3
MASS, ADDED, INERTIA = 60.0, (5.0, 40.0, 45.0), (1.5, 12.0, 13.0)
STATIONS = np.linspace(-0.5 * LENGTH, 0.5 * LENGTH, 5)
# Where the volume's middle is, from the body's origin, which is the centre of gravity.
ABOVE = -0.02


def breadth_of(section, z):
    """Breadth of a section at z below its middle; the box's is 0.25 m."""
    return 0.25 if section == "box" else 2.0 * np.sqrt(max(0.25 * HEIGHT**2 - z**2, 0.0))


def below(section, middle, power=0):
    """Integral of z^power over the part of a section below the surface, whose middle is at that depth."""
    return quad(lambda z: breadth_of(section, z) * z**power, -min(middle, 0.5 * HEIGHT), 0.5 * HEIGHT, epsabs=1e-13)[0]


def vehicle_of(section, share, **numbers):
    """The vehicle whose weight is that share of its buoyancy."""
    buoyancy = DENSITY * GRAVITY * LENGTH * below(section, 0.5 * HEIGHT)
    numbers = {"added_mass": ADDED, "inertia": INERTIA, "center_of_buoyancy": (0.0, 0.0, ABOVE)} | numbers
    return lw.Vehicle(share * buoyancy / GRAVITY, buoyancy=buoyancy, **numbers)


def floating(section, *more, share=0.4, stations=STATIONS, heights=HEIGHT, **numbers):
    """The scene of a hull of the same section all along."""
    hull = lw.terms.SurfaceBuoyancy(stations=stations, heights=heights, section=section)
    water = lw.Environment(GRAVITY, water_density=DENSITY)
    return lw.Scene(vehicle_of(section, share, **numbers), water, terms=[hull, *more])


def draught(section, share):
    """Archimedes: depth of the volume's middle at which the water displaced weighs as much as the body."""
    area = below(section, 0.5 * HEIGHT)
    return brentq(lambda d: below(section, d) / area - share, -0.5 * HEIGHT, 0.5 * HEIGHT, xtol=1e-14)


@pytest.mark.ci
@pytest.mark.parametrize("section", ["box", "circle"])
@pytest.mark.parametrize("share", [0.25, pytest.param(0.8, marks=pytest.mark.slow)])
def test_a_hull_comes_to_rest_at_archimedes_depth(section, share):
    scene = floating(section, lw.terms.Drag(linear=(200.0,) * 3 + (20.0,) * 3), share=share)
    result = lw.solve(one(scene, b=(0.0, 0.0, 0.1), R=turn([0.0, 0.1, 0.0])), "psi_s", h=0.02, t1=120.0)
    b, R, nu, _ = last(result)
    # What is left decays by 2 to 4 a second; the rest is the drag's own rounding.
    assert b[2] + ABOVE == pytest.approx(draught(section, share), abs=1e-12)
    assert np.abs(R - np.eye(3)).max() < 1e-9
    assert np.abs(nu).max() < 1e-11


def oscillation(scene, omega, kick, h):
    """States after 5 1/4 periods of a frequency, from a kick at the depth of rest: nothing of its size is left."""
    t1 = 5.25 * 2.0 * np.pi / omega
    steps = int(np.ceil(t1 / h))
    return last(lw.solve(one(scene, **kick), "rk8", h=t1 / steps, t1=t1))


@pytest.mark.ci
@pytest.mark.parametrize("section", ["box", "circle"])
def test_it_bobs_at_the_frequency_of_its_waterplane(section):
    # omega^2 = rho g A_w / M33.
    share = 0.4
    scene, d = floating(section, share=share), draught(section, share)
    omega = np.sqrt(DENSITY * GRAVITY * LENGTH * breadth_of(section, d) / scene.vehicle.mass_matrix[2, 2])
    speed = 1e-5
    b, _, nu, _ = oscillation(scene, omega, {"b": (0.0, 0.0, d - ABOVE), "nu": (0.0, 0.0, speed)}, 0.02)
    # At 5 1/4 periods it is one amplitude down, and at rest: an error e of omega turns the phase by 33 e.
    assert b[2] + ABOVE - d == pytest.approx(speed / omega, rel=1e-4)
    assert abs(nu[2]) < 1e-4 * speed


def metacentric_height(section, share):
    """Bouguer (1746): BM = I_w / V, above the middle of the water displaced; the origin is the centre of gravity."""
    d = draught(section, share)
    volume = LENGTH * below(section, d)
    keel_to_middle = below(section, d, 1) / below(section, d)
    return breadth_of(section, d) * LENGTH**3 / 12.0 / volume - (ABOVE + keel_to_middle)


@pytest.mark.ci
@pytest.mark.parametrize("section", ["box", "circle"])
def test_it_pitches_at_the_frequency_of_its_metacentre(section):
    # omega^2 = W GM / (J + A55).
    share = 0.4
    scene, d = floating(section, share=share), draught(section, share)
    weight = scene.vehicle.mass * GRAVITY
    omega = np.sqrt(weight * metacentric_height(section, share) / INERTIA[1])
    rate = 1e-6
    _, R, _, Om = oscillation(scene, omega, {"b": (0.0, 0.0, d - ABOVE), "Om": (0.0, rate, 0.0)}, 0.01)
    assert R[0, 2] == pytest.approx(rate / omega, rel=1e-4)
    assert abs(Om[1]) < 1e-4 * rate


def spread_of_volume(section, pose, many):
    """Energy of lifting what is above the surface out of the water, as a sum over small volumes."""
    b, R = pose
    x = LENGTH * ((np.arange(8 * many) + 0.5) / (8 * many) - 0.5)
    if section == "box":
        y, z = np.meshgrid(
            0.25 * ((np.arange(many) + 0.5) / many - 0.5), HEIGHT * ((np.arange(many) + 0.5) / many - 0.5)
        )
        share = np.ones_like(y)
    else:
        r, angle = np.meshgrid(
            0.5 * HEIGHT * (np.arange(many) + 0.5) / many, 2.0 * np.pi * np.arange(4 * many) / (4 * many)
        )
        y, z, share = r * np.cos(angle), r * np.sin(angle), r
    depth = b[2] + R[2, 0] * x[:, None, None] + R[2, 1] * y + R[2, 2] * (z + ABOVE)
    share = np.broadcast_to(share, depth.shape)
    return np.sum(share * np.maximum(-depth, 0.0)) / share.sum()


@pytest.mark.parametrize("section", ["box", "circle"])
def test_its_potential_is_that_of_the_volume_above_the_surface(section):
    # 40 stations: of slices a fortieth as long as the hull. The box does not roll: its parts have no breadth.
    scene = floating(section, stations=np.linspace(-0.8, 0.8, 41))
    hull, rng = scene.terms[0], np.random.default_rng(4)
    parameters = {name: value[None] for name, value in scene.parameters().items()}
    for _ in range(6):
        roll = rng.uniform(-3.0, 3.0) if section == "circle" else 0.0
        R = turn([0.0, rng.uniform(-0.6, 0.6), 0.0]) @ turn([roll, 0.0, 0.0])
        b = np.array([0.0, 0.0, rng.uniform(-0.1, 0.1)])
        numbers = {"heights": hull.heights[None], "stations": hull.stations[None]}
        got = hull.potential(numbers, b[None, None], R[None, None], parameters)[0, 0] / scene.vehicle.buoyancy
        # Midpoints of 40 to a height, and slices: the square of 1 / 40 of each.
        assert got == pytest.approx(spread_of_volume(section, (b, R), 40), rel=2e-3, abs=1e-5)


# Out of the water, and 0.35 m below the surface at the deepest, pitching by tens of degrees.
WILD = {"b": (0.0, 0.0, -0.25), "R": turn([0.2, 0.5, -0.3]), "nu": (0.3, -0.2, 0.4), "Om": (0.5, 0.4, -0.6)}


def energies(scene, method, h, t1, state=WILD):
    result = lw.solve(one(scene, **state), method, h=h, t1=t1, save=lw.SaveAt(every=10.0 * h))
    return result.time, result.energy[:, 0] - result.energy[0, 0], result


@pytest.mark.ci
def test_psi_s_keeps_the_energy_over_hundreds_of_leaps():
    scene = floating("circle")
    time, error, result = energies(scene, "psi_s", 0.005, 300.0)
    dives = np.diff(np.sign(result.position[:, 0, 2] - 0.05)) > 0.0
    assert dives.sum() > 100
    dry = result.position[:, 0, 2] < -0.2
    assert dry.any()
    first, rest = np.abs(error[time < 30.0]).max(), np.abs(error[time >= 270.0]).max()
    # An error that grew in proportion to time would be ten times as large at the end.
    assert rest < 2.0 * first
    shorter = energies(scene, "psi_s", 0.0025, 30.0)[1]
    assert first / np.abs(shorter).max() == pytest.approx(4.0, rel=0.25)
    # Momenta that a still surface keeps: round-off of 60,000 steps.
    changes = drift(result)
    assert changes["horizontal_momentum"] < 1e-9
    assert changes["vertical_angular_momentum"] < 1e-9


def wet_and_dry(section):
    """Bobbing with both ends always in part below the surface: nothing kinks."""
    return floating(section), {"b": (0.0, 0.0, -ABOVE), "nu": (0.0, 0.0, 0.1), "Om": (0.0, 0.05, 0.0)}


@pytest.mark.ci
@pytest.mark.parametrize(("method", "order"), [("psi_s", 2.0), ("rk4", 4.0)])
@pytest.mark.parametrize("section", ["circle", pytest.param("box", marks=pytest.mark.slow)])
def test_orders_between_wet_and_dry(section, method, order):
    scene, state = wet_and_dry(section)
    steps = np.array([0.04, 0.02, 0.01])
    truth = last(lw.solve(one(scene, **state), "rk8", h=0.01, t1=2.0))
    errors = [difference(last(lw.solve(one(scene, **state), method, h=h, t1=2.0)), truth) for h in steps]
    assert slope(steps, errors) == pytest.approx(order, abs=0.2)


@pytest.mark.ci
def test_rk4_loses_energy_by_its_order():
    # Bobbing and pitching of finite size: the error of each step is of order 5, in one direction.
    scene, state = wet_and_dry("circle")
    steps = np.array([0.08, 0.04, 0.02])
    errors = [np.abs(energies(scene, "rk4", h, 16.0, state)[1][-1]) for h in steps]
    assert slope(steps, errors) == pytest.approx(5.0, abs=0.5)


def across_the_surface(section, method, steps):
    """Errors of members that leap out at places of their own, in the mean: they cross at any part of a step."""
    places = np.linspace(0.3, 0.4, 64)
    states = np.stack([0.0 * places, 0.0 * places, places], axis=1)
    fleet = one(floating(section, stations=(0.0,)), b=states, nu=(0.0, 0.0, -3.0))
    ends = [lw.solve(fleet, method, h=h, t1=0.48).position[-1, :, 2] for h in steps]
    truth = lw.solve(fleet, "rk8", h=steps[-1] / 16.0, t1=0.48).position[-1, :, 2]
    return [np.abs(end - truth).mean() for end in ends]


STEPS = 0.03 * 0.5 ** np.arange(6)


@pytest.mark.ci
@pytest.mark.parametrize(("section", "order"), [("box", 2.0), ("circle", 2.5)])
def test_orders_across_the_kink(section, order):
    # The slope of the force by depth jumps at the box, and is a square root at the circle: rk4 keeps 2, and 2.5.
    assert slope(STEPS, across_the_surface(section, "rk4", STEPS)) == pytest.approx(order, abs=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("section", ["box", "circle"])
def test_psi_s_keeps_its_order_across_the_kink(section):
    assert slope(STEPS, across_the_surface(section, "psi_s", STEPS)) > 1.85


@pytest.mark.ci
@pytest.mark.parametrize("added", [0.0, 45.0])
def test_it_flies_while_it_is_dry(added):
    # Ballistic, with the water that the model still carries along: W / (m + A33). Parabolas are exact for rk4.
    scene = floating("circle", added_mass=(0.0, 0.0, added))
    v = scene.vehicle
    fall = v.mass * GRAVITY / (v.mass + added)
    result = lw.solve(one(scene, b=(0.0, 0.0, -0.3), nu=(0.0, 0.0, -5.0)), "rk4", h=0.02, t1=0.8)
    b, R, *_ = last(result)
    assert b[2] == pytest.approx(-0.3 - 5.0 * 0.8 + 0.5 * fall * 0.8**2, abs=1e-13)
    assert np.abs(R - np.eye(3)).max() < 1e-14


@pytest.mark.slow
def test_far_below_nothing_changes():
    drag = lw.terms.Drag(quadratic=(5.0, 30.0, 30.0, 1.0, 5.0, 5.0))
    deep = {"b": (0.0, 0.0, 40.0), "R": turn([0.2, 0.5, -0.3]), "nu": (1.0, 0.2, -0.1), "Om": (0.1, 0.2, 0.3)}
    with_surface = floating("circle", drag, share=0.95)
    without = lw.Scene(with_surface.vehicle, with_surface.environment, terms=[drag])
    ends = [last(lw.solve(one(scene, **deep), "psi_s", h=0.02, t1=4.0)) for scene in (with_surface, without)]
    for one_of, other in zip(*ends, strict=True):
        np.testing.assert_array_equal(one_of, other)


def response(scene, wave, d):
    """Heave over elevation of a body of one part in a wave of small steepness: its pressure and added mass, and its
    waterplane. (m + A) z'' = (m + A) w' - k (z + eta), w the water's velocity at the body's middle."""
    omega = 2.0 * np.pi / wave.periods[0]
    inertia = scene.vehicle.mass_matrix[2, 2]
    stiffness = scene.vehicle.buoyancy / HEIGHT
    decayed = np.exp(-(omega**2) / GRAVITY * max(d, 0.0))
    return (stiffness - inertia * omega**2 * decayed) / (stiffness - inertia * omega**2), decayed


@pytest.mark.ci
@pytest.mark.parametrize("period", [12.0, 2.2])
def test_a_body_follows_waves(period):
    wave = lw.terms.Waves(amplitudes=[1e-4], periods=[period], headings_deg=[0.0])
    share = 0.7
    # All in one point: water and pressure are those at the body's origin.
    scene = floating("box", wave, stations=(0.0,), share=share, center_of_buoyancy=(0.0, 0.0, 0.0))
    d = draught("box", share)
    ratio, decayed = response(scene, wave, d)
    if period > 10.0:
        # Long waves lift the body as they lift the surface.
        assert ratio == pytest.approx(1.0, abs=1e-3)
    else:
        assert ratio > 1.01
    omega, a = 2.0 * np.pi / period, 1e-4
    # At t = 0 a crest is at the body: it is at the top of its path, and goes ahead with the water.
    start = {"b": (0.0, 0.0, d - ratio * a), "nu": (a * omega * decayed, 0.0, 0.0)}
    result = lw.solve(
        one(scene, **start), "rk4", h=period / 400.0, t1=2.0 * period, save=lw.SaveAt(every=period / 20.0)
    )
    z = result.position[:, 0, 2] - d
    # Of second order are a k and a omega^2 t / (2 g), which is 1e-3 at the end of the short waves.
    np.testing.assert_allclose(z, -ratio * a * np.cos(omega * result.time), atol=1e-3 * a)
    # It swings with the water: the pressure on the part that is dry is not there.
    np.testing.assert_allclose(result.position[:, 0, 0], decayed * a * np.sin(omega * result.time), atol=1e-4 * a)


@pytest.mark.slow
def test_waves_tilt_a_long_hull():
    # Much longer waves than the hull: its pitch is the slope of the surface.
    period, a = 12.0, 1e-4
    wave = lw.terms.Waves(amplitudes=[a], periods=[period], headings_deg=[0.0])
    scene = floating("box", wave, lw.terms.Drag(linear=(0.0,) * 3 + (0.0, 100.0, 0.0)))
    d = draught("box", 0.4)
    k = (2.0 * np.pi / period) ** 2 / GRAVITY
    h = period / 600.0
    result = lw.solve(
        one(scene, b=(0.0, 0.0, d - ABOVE - a)), "rk4", h=h, t1=3.0 * period, save=lw.SaveAt(every=30 * h)
    )
    late = result.time > 2.0 * period
    pitch = -result.attitude[late, 0, 2, 0]
    slope_of_surface = -k * a * np.sin(k * result.position[late, 0, 0] - 2.0 * np.pi / period * result.time[late])
    # Up by the bow is positive pitch: eta rises ahead. Damping delays it by c omega / (W GM), 1 % of a turn here.
    assert np.abs(pitch - slope_of_surface).max() < 0.1 * k * a


@pytest.mark.slow
def test_slopes_by_its_numbers():
    # Of a hull at the surface in waves, and of one far below, where nothing depends on its height.
    wave = lw.terms.Waves(amplitudes=[0.05], periods=[2.5], headings_deg=[40.0])
    names = ["surface_buoyancy.heights[1]", "waves.amplitudes[0]"]
    scene = floating("circle", wave)
    settings = {"h": 0.02, "t1": 1.0, "threads": 1}
    for depth in (0.0, 20.0):
        at = scene.with_numbers({"start.position": [0.0, 0.0, depth]})
        slopes = lw.solve(at, "rk4", tangents=names, **settings).jacobian["position"][-1, 0]
        for i, (name, value) in enumerate(zip(names, (HEIGHT, 0.05), strict=True)):
            ends = [
                lw.solve(at.with_numbers({name: value + d}), "rk4", **settings).position[-1, 0] for d in (1e-5, -1e-5)
            ]
            # Differences have 1e-10 of curvature, and 1e-16 / 1e-5 of rounding of the position.
            np.testing.assert_allclose(slopes[:, i], (ends[0] - ends[1]) / 2e-5, rtol=1e-6, atol=1e-8)
    assert not np.any(slopes[:, 0])


@pytest.mark.ci
@pytest.mark.parametrize("section", ["circle", pytest.param("box", marks=pytest.mark.slow)])
def test_waves_in_axes_that_are_not_the_users(section):
    # Ten steps of a hull of parts below waves, whose axes of inertia are none of its own, beside the twin.
    waves = dict(amplitudes=(0.4, 0.3), periods=(3.0, 2.5), headings_deg=(20.0, 200.0), phases=(0.5, 2.5))
    case = surface(SURFACE, section, lw.terms.Waves(**waves), Waves(**arrays(waves), gravity=GRAVITY))
    kernel, twin = both(case, "psi_s", 0.02, 10, vehicle=BENT)
    assert difference(kernel, twin) < 5e-13


@pytest.mark.slow
def test_members_and_a_run_that_goes_on():
    # Numbers of their own, and waves of their own, in two runs as in one.
    wave = lw.terms.Waves(amplitudes=[0.1], periods=[2.5], headings_deg=[40.0])
    scene = floating("circle", wave, lw.terms.Drag(linear=(20.0,) * 6))
    uniform = lw.distributions.Uniform
    vary = {
        "surface_buoyancy.heights[0]": uniform(low=0.1, high=0.3),
        "waves.phases": uniform(low=0.0, high=6.0),
        "vehicle.buoyancy": uniform(low=800.0, high=1200.0),
    }
    fleet = lw.Ensemble(scene, members=5, seed=3, vary=vary)
    whole = lw.solve(fleet, "psi_s", h=0.02, t1=4.0)
    half = lw.solve(fleet, "psi_s", h=0.02, t1=2.0)
    further = lw.solve(fleet, "psi_s", h=0.02, t1=4.0, start=half.final)
    np.testing.assert_array_equal(further.position[-1], whole.position[-1])
    alone = lw.solve(fleet.subset([3]), "psi_s", h=0.02, t1=4.0)
    np.testing.assert_allclose(alone.position[-1, 0], whole.position[-1, 3], atol=1e-13)
    assert np.ptp(whole.position[-1, :, 2]) > 0.01


REMUS_HULL = {"stations": [-0.72, -0.18, 0.42, 0.52, 0.61], "heights": [0.01, 0.191, 0.191, 0.16, 0.0]}


@pytest.mark.slow
def test_an_autopilot_that_climbs_stays_in_the_water():
    # A REMUS 100 under way that is told to keep a depth of -1 m.
    controller = lw.Controller(
        period=0.1,
        sensors=[lw.control.Sensor(name="depth_cell", of="depth", noise=0.02)],
        guidance=[lw.control.SetPoint(depth=-1.0, heading=0.0)],
        laws=[
            lw.control.DepthPID(kp=0.15, ki=0.004, pitch_limit=0.35, kp_pitch=2.0, ki_pitch=0.2, kd_pitch=1.5),
            lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0),
        ],
        allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])],
    )
    start, depths = {"position": [0.0, 0.0, 1.5], "velocity": [1.5, 0.0, 0.0]}, []
    vary = {"vehicle.buoyancy": lw.distributions.Uniform(low=300.0, high=304.0)}
    for hulls in ([], [lw.terms.SurfaceBuoyancy(**REMUS_HULL)]):
        scene = lw.Scene.named("remus_100", terms=hulls, start=start, controller=controller)
        fleet = lw.Ensemble(scene, members=4, seed=2, vary=vary)
        result = lw.solve(fleet, h=0.02, t1=60.0, save=lw.SaveAt(every=0.5))
        assert result.status.counts() == {"ok": 4}
        depths.append(result.position[60:, :, 2])
    # As if there were water above; and with its nose in the air, its middle within a hull's height of the surface.
    assert np.all(np.median(depths[0], axis=0) < -0.7)
    assert np.all(np.abs(depths[1]) < 0.191)


@pytest.mark.ci
def test_a_floating_vehicle_is_not_odd():
    # Lighter than half of its water, above the surface on its way: without this term that is worth a message.
    scene = floating("box")
    leaping = {"b": (0.0, 0.0, 0.1), "nu": (0.0, 0.0, -3.0)}
    settings = {"h": 0.02, "t1": 0.4, "save": lw.SaveAt(every=0.1)}
    assert not lw.solve(one(scene, **leaping), "psi_s", **settings).messages
    sunk = lw.Scene(scene.vehicle, scene.environment)
    messages = " ".join(lw.solve(one(sunk, **leaping), "psi_s", **settings).messages)
    assert "net weight" in messages
    assert "SurfaceBuoyancy" in messages


@pytest.mark.slow
def test_what_is_refused():
    hull = lw.terms.SurfaceBuoyancy(heights=0.3)
    with pytest.raises(lw.SceneError, match="keep one of them"):
        floating("box", lw.terms.SurfaceBuoyancy(heights=0.3, name="second"))
    with pytest.raises(lw.SceneError, match=r"is a second term of the type surface_buoyancy. Keep one"):
        floating("box", hull)
    with pytest.raises(lw.SceneError, match="heights"):
        lw.terms.SurfaceBuoyancy(heights=[0.3, 0.0, 0.0], stations=[0.0, 1.0, 2.0])
    with pytest.raises(lw.SceneError, match="heights"):
        lw.terms.SurfaceBuoyancy(heights=0.0)
    with pytest.raises(lw.SceneError, match="section"):
        lw.terms.SurfaceBuoyancy(heights=0.3, section="square")
    assert hull.conserves
    # The event stops members at the surface as before.
    stopped = lw.Scene(vehicle_of("box", 0.4), lw.Environment(GRAVITY), terms=[hull], events=[lw.events.Surface()])
    assert lw.solve(one(stopped, b=(0.0, 0.0, 1.0)), "psi_s", h=0.01, t1=3.0).status.counts() == {"surface": 1}


@pytest.mark.slow
def test_the_example_follows_long_waves(tmp_path):
    command = [sys.executable, ROOT / "examples/laws/at_the_surface.py", tmp_path / "picture.png"]
    *lines, path = subprocess.run(command, check=True, capture_output=True, text=True, cwd=tmp_path).stdout.splitlines()
    heave, pitch = np.array([[float(x) for x in re.findall(r"(?:heave|pitch) ([\d.]+)", line)] for line in lines]).T
    assert (tmp_path / "picture.png").stat().st_size > 10_000
    assert path.endswith("picture.png")
    # The longest waves lift it as they lift the surface; of its pitch they are closer to the slope than shorter ones.
    assert heave[-1] == pytest.approx(1.0, abs=0.01)
    assert 1.0 < pitch[-1] < pitch[-2]
