# SPDX-License-Identifier: Apache-2.0
"""Waves over a floor and on a current against closed forms, and against the same waves seen from a moving frame."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.physics.terms.waves import wavenumbers
from lgvi_warp.reference.terms.waves import wavenumber
from tests.support.tools import GRAVITY

WATER = 20.0
PERIOD = 8.0


def test_wavenumbers():
    # In 20 m of water 8 s waves have k h = 1.416 (g 9.80665). Others against the twin, which halves intervals.
    omega = np.array([[2.0 * np.pi / PERIOD]])
    (k,) = wavenumbers(omega, 0.0, np.array([[WATER]]), np.array([[9.80665]]))[0]
    assert k * WATER == pytest.approx(1.416, abs=5e-4)
    for period in (2.0, 5.0, 12.0, 25.0):
        for depth in (0.5, 3.0, 20.0, 400.0, np.inf):
            for drift in (-0.9, -0.2, 0.0, 0.4, 3.0):
                w = 2.0 * np.pi / period
                found = wavenumbers(
                    np.full((1, 1), w), np.full((1, 1), drift), np.full((1, 1), depth), np.full((1, 1), 9.8)
                )
                twin = wavenumber(w, drift, depth, 9.8)
                assert np.isnan(found[0, 0]) if twin is None else found[0, 0] == pytest.approx(twin, rel=1e-10)


def neutral(terms, **sections):
    """A small neutral body without added mass: a particle of water."""
    body = lw.Vehicle(2.0, inertia=(1.0, 1.0, 1.0), added_mass=(0.0, 0.0, 0.0), buoyancy=2.0 * GRAVITY)
    return lw.Scene(body, lw.Environment(GRAVITY), terms=terms, **sections)


def with_the_water(scene, position, **parameters):
    """Members that start with the water at these places (n, 3)."""
    position = np.asarray(position, dtype=float)
    at_rest = np.broadcast_to(np.eye(3), (len(position), 3, 3)), np.zeros_like(position), np.zeros_like(position)
    fleet = lw.Ensemble.from_states(scene, position, *at_rest, parameters)
    p = fleet.parameters(0, fleet.members)
    flow = sum(
        t.water(fleet.own(t, p), position[None], np.zeros(1), p)[0] for t in scene.terms if t.type != "control_wrench"
    )
    return lw.Ensemble.from_states(scene, position, at_rest[0], flow, at_rest[2], parameters)


@pytest.mark.slow
@pytest.mark.kernel
def test_orbits_of_a_particle_over_a_floor():
    # Ellipses with the half axes a cosh k(h - z) / sinh k h and a sinh k(h - z) / sinh k h, to k a; at the floor lines.
    a, depths = 0.02, np.array([1.0, 6.0, 13.0, 20.0])
    wave = lw.terms.Waves(amplitudes=[a], periods=[PERIOD], headings_deg=[30.0], depth=WATER)
    fleet = with_the_water(neutral([wave]), [[0.0, 0.0, z] for z in depths])
    result = lw.solve(fleet, "rk4", h=0.05, t1=PERIOD, save=lw.SaveAt(every=0.2))
    k = wavenumber(2.0 * np.pi / PERIOD, 0.0, WATER, GRAVITY)
    along = result.position[..., :2] @ [np.cos(np.pi / 6.0), np.sin(np.pi / 6.0)]
    aside = result.position[..., :2] @ [-np.sin(np.pi / 6.0), np.cos(np.pi / 6.0)]
    angle = 2.0 * np.pi / PERIOD * result.time
    # With a drift in time, of second order.
    columns = np.stack([np.ones_like(angle), angle, np.cos(angle), np.sin(angle)], axis=1)
    for swing, shape in ((along, np.cosh), (result.position[..., 2], np.sinh)):
        fit = np.linalg.lstsq(columns, swing)[0]
        wanted = a * shape(k * (WATER - depths)) / np.sinh(k * WATER)
        np.testing.assert_allclose(np.hypot(*fit[2:]), wanted, rtol=0.0, atol=3.0 * k * a * a)
        assert np.abs(swing - columns @ fit).max() < 3.0 * k * a * a
    assert np.abs(aside).max() < 1e-12
    assert np.abs(result.position[:, 3, 2] - WATER).max() < 1e-12


# A hull of 2 m that floats half out of the water, with loads along it.
FLOATING = (
    lw.terms.HullLoads(stations=[-1.0, -0.5, 0.6, 1.0], diameters=[0.05, 0.2, 0.2, 0.02], drag_coefficient=1.0),
    lw.terms.SurfaceBuoyancy(heights=[0.05, 0.2, 0.2, 0.02], stations=[-1.0, -0.5, 0.6, 1.0]),
    lw.terms.Drag(linear=(8.0, 30.0, 30.0, 2.0, 20.0, 20.0)),
)
DRIFT = np.array([0.7, -0.4, 0.0])


@pytest.mark.slow
@pytest.mark.kernel
@pytest.mark.parametrize("depth", [6.0, None])
@pytest.mark.parametrize("periods_of", ["water", "ground"])
def test_a_run_on_a_current_is_that_in_still_water_from_a_moving_frame(periods_of, depth):
    # Member 0 on a uniform current, member 1 in still water: positions differ by the drift, the rest by nothing but rounding.
    periods, headings = np.array([3.0, 2.2]), np.array([20.0, 140.0])
    body = lw.Vehicle(50.0, inertia=(0.5, 12.0, 12.0), added_mass=(3.0, 45.0, 45.0), buoyancy=54.0 * GRAVITY,
                      center_of_buoyancy=(0.0, 0.0, -0.03))  # fmt: skip
    waves = lw.terms.Waves(amplitudes=[0.1, 0.06], periods=periods, headings_deg=headings, phases=[0.4, 2.0], depth=depth,
                           periods_of=periods_of)  # fmt: skip
    flow = lw.terms.Current(velocity=DRIFT)
    scene = lw.Scene(body, lw.Environment(GRAVITY), terms=[waves, flow, *FLOATING])
    omega = 2.0 * np.pi / periods
    unit = np.stack([np.cos(np.radians(headings)), np.sin(np.radians(headings))], axis=1)
    k = np.array([wavenumber(w, 0.0, depth or np.inf, GRAVITY) for w in omega])
    of_ground = 2.0 * np.pi / (omega + k * (unit @ DRIFT[:2]))
    seen = np.stack([of_ground if periods_of == "ground" else periods, periods])
    R = lw.notation.matrix_from_rotation_vector(np.array([0.05, -0.1, 0.6]))
    start = np.array([3.0, -2.0, 0.05])
    states = [
        np.stack([start] * 2),
        np.stack([R] * 2),
        np.stack([R.T @ DRIFT, np.zeros(3)]) + np.array([0.8, 0.0, 0.0]),
        np.zeros((2, 3)),
    ]
    fleet = lw.Ensemble.from_states(
        scene, *states, {"current.velocity": np.stack([DRIFT, 0.0 * DRIFT]), "waves.periods": seen}
    )
    result = lw.solve(fleet, "rk4", h=0.02, t1=8.0, save=lw.SaveAt(every=1.0))
    assert result.status.counts() == {"ok": 2}
    moved = result.position[:, 0] - np.outer(result.time, DRIFT)
    assert np.abs(moved - result.position[:, 1]).max() < 1e-9
    assert np.abs(result.attitude[:, 0] - result.attitude[:, 1]).max() < 1e-9
    assert np.abs(result.angular_velocity[:, 0] - result.angular_velocity[:, 1]).max() < 1e-9
    # And it moves.
    assert np.ptp(result.position[:, 1, 2]) > 0.05


def cell(**numbers):
    """A controller that reads a depth and pushes nothing."""
    return lw.Controller(
        period=0.1,
        sensors=[lw.control.Sensor(name="depth_cell", of="depth", **numbers)],
        guidance=[lw.control.SetPoint(depth=1.0)],
        laws=[lw.control.HeavePID(kp=0.0)],
    )


@pytest.mark.slow
@pytest.mark.kernel
@pytest.mark.parametrize("depth", [WATER, None])
def test_a_pressure_cell_on_a_free_particle(depth):
    # In deep water it goes along a surface of constant pressure, to the second order: (k a)^2 a. Over a floor the reading
    # swings by a sinh k z / (sinh k h cosh k h), what the pressure has more than the orbit.
    a = 0.1
    wave = lw.terms.Waves(amplitudes=[a], periods=[PERIOD], headings_deg=[30.0], depth=depth)
    k = wavenumber(2.0 * np.pi / PERIOD, 0.0, depth or np.inf, GRAVITY)
    scene = neutral([wave, lw.terms.ControlWrench()], controller=cell(reads="pressure"))
    fleet = with_the_water(scene, [[0.0, 0.0, z] for z in (1.0, 4.0, 10.0)])
    save = lw.SaveAt(every=0.1, fields=("position", "measured_depth"))
    result = lw.solve(fleet, "rk4", h=0.05, t1=PERIOD, save=save)
    z, swing = np.array([1.0, 4.0, 10.0]), 0.5 * np.ptp(result.measured_depth, axis=0)
    wanted = 0.0 if depth is None else a * np.sinh(k * z) / (np.sinh(k * depth) * np.cosh(k * depth))
    # Samples a tenth of a second apart see the crest to (omega dt / 2)^2 / 2.
    missed = wanted * (np.pi / PERIOD * 0.1) ** 2 / 2.0
    assert np.all(np.abs(swing - wanted) < 3.0 * (k * a) * a * (depth is not None) + 3.0 * (k * a) ** 2 * a + missed)
    assert np.all(0.5 * np.ptp(result.position[..., 2], axis=0) > 2.0 * swing)


@pytest.mark.slow
@pytest.mark.kernel
@pytest.mark.parametrize("depth", [WATER, None])
def test_readings_of_a_cell_off_the_origin_are_those_of_the_twin(depth):
    # At its place on a hull that turns, in two seas on a current, near the surface and out of it.
    place = np.array([0.6, 0.1, -0.2])
    first = dict(amplitudes=(0.4, 0.2), periods=(5.0, 3.0), headings_deg=(20.0, -70.0), phases=(0.3, 1.0))
    sea = lw.terms.SeaState(significant_height=0.3, peak_period=4.0, heading_deg=100.0, components=4, depth=depth)
    terms = [lw.terms.Waves(**first, depth=depth), sea, lw.terms.Current(velocity=DRIFT), lw.terms.ControlWrench()]
    scene = neutral(terms, controller=cell(reads="pressure", place=place))
    rng = np.random.default_rng(2)
    start = np.array([[0.0, 0.0, 3.0], [4.0, 2.0, 0.2], [1.0, 1.0, -1.0]])
    spin = rng.normal(size=(3, 3))
    fleet = lw.Ensemble.from_states(scene, start, np.stack([np.eye(3)] * 3), 0.0 * start, spin)
    save = lw.SaveAt(every=0.1, fields=("position", "attitude", "measured_depth"))
    result = lw.solve(fleet, "rk4", h=0.05, t1=2.0, save=save)
    twin_sea = lw.Ensemble.own(sea, fleet.parameters(0, 3))
    p, wave = fleet.parameters(0, 3), scene.terms[1]
    amplitude, omega, heading, phase = wave.sea(twin_sea)
    at = result.position + result.attitude @ place
    known = [(np.array(first["amplitudes"]), 2.0 * np.pi / np.array(first["periods"]), np.radians(first["headings_deg"]),
              np.array(first["phases"]))] * 3  # fmt: skip
    for member in range(3):
        total = at[:, member, 2].copy()
        for a, w, h, c in (known[member], tuple(x[member % len(x)] for x in (amplitude, omega, heading, phase))):
            for j in range(len(a)):
                unit = np.array([np.cos(h[j]), np.sin(h[j]), 0.0])
                k = wavenumber(w[j], unit @ DRIFT, depth or np.inf, GRAVITY)
                z = np.maximum(at[:, member, 2], 0.0)
                fall = np.exp(-k * z) if depth is None else np.cosh(k * (depth - z)) / np.cosh(k * depth)
                total += a[j] * fall * np.cos(k * at[:, member] @ unit - w[j] * result.time + c[j])
        np.testing.assert_allclose(result.measured_depth[:, member], np.maximum(total, 0.0), rtol=0.0, atol=1e-11)
    assert np.any(result.measured_depth == 0.0)
    assert np.ptp(result.measured_depth) > 0.5
    assert p["sea_state.levels"].shape == (3, 4, 2)


def test_pressure_is_of_a_depth():
    with pytest.raises(lw.SceneError, match=r"reads.*has no meaning for a sensor of heading"):
        lw.control.Sensor(of="heading", reads="pressure")
    with pytest.raises(lw.SceneError, match=r"reads.*has no meaning for a sensor of range"):
        lw.control.Altimeter(reads="pressure")
