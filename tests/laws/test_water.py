# SPDX-License-Identifier: Apache-2.0
"""Waves, currents that change and noise against exact solutions, known laws and their twins."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.physics import terms
from lgvi_warp.reference import random
from lgvi_warp.reference.terms import View
from lgvi_warp.reference.terms.current_harmonics import CurrentHarmonics
from lgvi_warp.reference.terms.waves import Waves
from tests.laws.cases_water import HARMONICS, WAVES, WRENCH_NOISE, arrays
from tests.support.tools import GRAVITY, TURN, one, random_states, vehicle

# A chance of 6e-7 for a right code; the seeds are fixed: a failure means a changed law.
ERRORS = 5.0
MEMBERS = 4096


def scene(*inputs, **named):
    """A neutrally buoyant vehicle, nothing but these terms acting on it."""
    return lw.Scene(vehicle(**named), lw.Environment(gravity=GRAVITY), terms=list(inputs))


UNFELT = (1e-30, 1e-30, 0.0)


def in_water(harmonics=None, wander=None, second=None):
    """Terms of uniform water, those that are not given too weak to be seen: the tests of this file share a kernel."""
    weak = {"standard_deviation": UNFELT, "time_constant": 1.0}
    return (
        terms.CurrentHarmonics(**(harmonics or HARMONICS | {"amplitudes": (UNFELT,) * 3})),
        terms.GaussMarkovCurrent(**(wander or weak)),
        terms.GaussMarkovCurrent(**(second or weak), name="second"),
    )


def inertial(result):
    """Velocity over ground (k, n, 3)."""
    return np.einsum("knij,knj->kni", result.attitude, result.velocity)


def flow_at(twin, b, t):
    """The twin's water at a place and time."""
    return twin.flow(View(np.eye(3), np.asarray(b), np.zeros(3), np.zeros(3), t))


@pytest.mark.slow
def test_a_vehicle_at_rest_in_accelerating_water_stays_with_it():
    # The push (rho V + A) a moves (m + A), and rho V = m: nothing is left of it but round-off, whatever M is.
    twin, h, steps = CurrentHarmonics(**arrays(HARMONICS)), 0.05, 200
    start = flow_at(twin, np.zeros(3), 0.0).velocity
    fleet = one(scene(*in_water(HARMONICS)), R=TURN, nu=TURN.T @ start)
    result = lw.solve(fleet, "psi_s", h=h, t1=steps * h, save=lw.SaveAt(every=h))
    expected = np.array([flow_at(twin, np.zeros(3), t).velocity for t in result.time])
    assert np.abs(inertial(result)[:, 0] - expected).max() < 1e-14
    # The drift of a step is that of its middle.
    moves = [h * flow_at(twin, np.zeros(3), (k + 0.5) * h).velocity for k in range(steps)]
    assert np.abs(result.position[1:, 0] - np.cumsum(moves, axis=0)).max() < 1e-13
    # The energy is that of the motion through the water: none.
    assert np.abs(result.energy).max() < 1e-26


@pytest.mark.slow
def test_a_heavy_vehicle_is_pushed_by_accelerating_water():
    # (m + A) dv/dt = (rho V + A) du/dt for a sphere without drag, so v = u (rho V + A) / (m + A), u(0) = 0.
    term = terms.CurrentHarmonics(amplitudes=[[0.4, 0.0, 0.0]], periods=[6.0], phases=[-0.5 * np.pi])
    heavy = lw.Vehicle(3.0, inertia=(1.0, 1.0, 1.0), added_mass=(1.0, 1.0, 1.0), buoyancy=2.0 * GRAVITY)
    result = lw.solve(one(lw.Scene(heavy, lw.Environment(GRAVITY), terms=[term])), "psi_s", h=0.01, t1=4.5)
    # The force of each step's middle: an error of (omega h)^2 / 24.
    assert result.velocity[-1, 0, 0] == pytest.approx(-0.4 * 3.0 / 4.0, rel=1e-5)


def test_waves_are_a_potential_flow():
    twin, rng, d = Waves(**arrays(WAVES), gravity=GRAVITY), np.random.default_rng(5), 1e-5
    for _ in range(10):
        b, t = rng.uniform(0.1, 8.0, 3), rng.uniform(0.0, 50.0)
        flow = flow_at(twin, b, t)
        assert abs(np.trace(flow.gradient)) < 1e-15
        assert np.abs(flow.gradient - flow.gradient.T).max() < 1e-15
        columns = [
            (flow_at(twin, b + e, t).velocity - flow_at(twin, b - e, t).velocity) / (2 * d) for e in d * np.eye(3)
        ]
        # Central differences: d^2 / 6 of the third derivative and round-off / d.
        assert np.abs(np.transpose(columns) - flow.gradient).max() < 1e-9
        rate = (flow_at(twin, b, t + d).velocity - flow_at(twin, b, t - d).velocity) / (2 * d)
        assert np.abs(rate - flow.rate).max() < 1e-9


def test_the_host_knows_the_same_waves():
    twin, host, rng = Waves(**arrays(WAVES), gravity=GRAVITY), terms.Waves(**WAVES), np.random.default_rng(6)
    own = {name: value[None] for name, value in host.parameters().items()}
    b, t = rng.uniform(-2.0, 8.0, (4, 3, 3)), rng.uniform(0.0, 50.0, 4)
    got = host.water(own, b, t, {"environment.gravity": np.array([GRAVITY])})
    expected = [[flow_at(twin, place, when).velocity for place in row] for row, when in zip(b, t, strict=True)]
    np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-14)


@pytest.mark.ci
@pytest.mark.parametrize("amplitude", [0.05, 0.1])
def test_drift_and_orbit_of_a_particle(amplitude):
    # A small neutrally buoyant sphere at rest in the water is a particle of it (Faltinsen 1990; Stokes 1847):
    # orbits of radius a e^(-k d), drift a^2 omega k e^(-2 k d) along the heading; both to a factor 1 + O((k a e^(-k d))^2).
    period, depth, heading = 4.0, 2.0, np.radians(30.0)
    along = np.array([np.cos(heading), np.sin(heading), 0.0])
    omega = 2.0 * np.pi / period
    k = omega**2 / GRAVITY
    term = terms.Waves(amplitudes=[amplitude], periods=[period], headings_deg=[30.0], phases=[0.5 * np.pi])
    # Phase pi/2: it starts in the mean depth of its orbit, with the water's velocity there.
    radius = amplitude * np.exp(-k * depth)
    h, cycles = period / 400.0, 10
    fleet = one(scene(term, M=(2.0, 2.0, 2.0)), b=(0.0, 0.0, depth), nu=(0.0, 0.0, -radius * omega))
    result = lw.solve(fleet, "psi_s", h=h, t1=cycles * period, save=lw.SaveAt(every=h))
    path = result.position[:, 0]
    x, z = path @ along, path[:, 2] - depth
    drift = amplitude**2 * omega * k * np.exp(-2.0 * k * depth)
    small = (k * radius) ** 2
    assert x[-1] / (cycles * period) == pytest.approx(drift, rel=10.0 * small + 1e-4)
    assert np.abs(path @ np.array([-along[1], along[0], 0.0])).max() < 1e-12
    swing = x - drift * result.time
    for size in (np.ptp(swing) / 2.0, np.ptp(z) / 2.0):
        assert size == pytest.approx(radius, rel=10.0 * small + 1e-4)


@pytest.mark.parametrize("course_deg", [0.0, 60.0, 180.0])
def test_frequency_of_encounter(course_deg):
    # At speed V and an angle b from the waves' heading: omega_e = |omega - k V cos b|, and without added mass
    # dv/dt = Du/Dt: the speed along the heading swings by a omega e^(-k d) omega / omega_e, to O(k a).
    a, period, depth, speed = 1e-5, 5.0, 1.0, 1.5
    omega = 2.0 * np.pi / period
    k, course = omega**2 / GRAVITY, np.radians(course_deg)
    encounter = abs(omega - k * speed * np.cos(course))
    light = lw.Vehicle(2.0, inertia=(1.0, 1.0, 1.0), added_mass=(0.0, 0.0, 0.0), buoyancy=2.0 * GRAVITY)
    wave = terms.Waves(amplitudes=[a], periods=[period], headings_deg=[0.0], phases=[0.3])
    fleet = one(lw.Scene(light, lw.Environment(GRAVITY), terms=[wave]), b=(0.0, 0.0, depth),
                nu=speed * np.array([np.cos(course), np.sin(course), 0.0]))  # fmt: skip
    result = lw.solve(fleet, "psi_s", h=0.01, t1=20.0, save=lw.SaveAt(every=0.01))
    # Nothing but a mean and one line: another frequency, by 1 % already, would leave tenths of the swing at the end.
    swing, angle = result.velocity[:, 0, 0], encounter * result.time
    columns = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)
    fit = np.linalg.lstsq(columns, swing)[0]
    size = a * omega * np.exp(-k * depth) * omega / encounter
    assert np.hypot(*fit[1:]) == pytest.approx(size, rel=1e-3)
    assert np.abs(swing - columns @ fit).max() < 1e-3 * size


WANDER = dict(standard_deviation=(0.3, 0.2, 0.0), time_constant=2.0)


def ensemble(*inputs, members=MEMBERS, seed=7, **named):
    """Members that differ by their random numbers alone."""
    return lw.Ensemble(scene(*inputs, **named), members, seed)


@pytest.mark.ci
def test_statistics_of_the_wandering_current():
    # Started at 0, after t: E u_t u_(t+s) = sd^2 e^(-s/tau) (1 - e^(-2t/tau)), whatever the step is.
    h, tau, sd = 0.5, WANDER["time_constant"], np.array(WANDER["standard_deviation"][:2])
    result = lw.solve(ensemble(*in_water(wander=WANDER)), "psi_s", h=h, t1=22.0,
                      save=lw.SaveAt(at=[1.0, 20.0, 20.5, 22.0]))  # fmt: skip
    u = result.velocity[1:, :, :2] / sd
    assert np.all(result.velocity[..., 2] == 0.0)
    early = 1.0 - np.exp(-2.0 * 1.0 / tau)
    # Variance of a sample variance, 2 s^4 / n; of a sample covariance, (s1^2 s2^2 + c^2) / n.
    assert np.abs(np.mean(u[0] ** 2, axis=0) - early).max() < ERRORS * early * np.sqrt(2.0 / MEMBERS)
    assert np.abs(np.mean(u[1] ** 2, axis=0) - 1.0).max() < ERRORS * np.sqrt(2.0 / MEMBERS)
    for i, lag in ((2, 0.5), (3, 2.0)):
        c = np.exp(-lag / tau)
        assert np.abs(np.mean(u[1] * u[i], axis=0) - c).max() < ERRORS * np.sqrt((1.0 + c**2) / MEMBERS)
    assert np.abs(np.mean(u[1], axis=0)).max() < ERRORS / np.sqrt(MEMBERS)
    assert abs(np.mean(u[1, :, 0] * u[1, :, 1])) < ERRORS / np.sqrt(MEMBERS)


@pytest.mark.ci
def test_a_stationary_start():
    # The vehicle rests over ground and the water has u(0): the velocity over ground is u(t) - u(0). It turns by 1e-10.
    tau, sd = WANDER["time_constant"], np.array(WANDER["standard_deviation"][:2])
    water = in_water(wander=WANDER | {"start": "stationary"})
    result = lw.solve(ensemble(*water, J=(1e9, 2e9, 3e9)), "psi_s", h=0.5, t1=1.0)
    assert np.abs(result.velocity[0]).max() == 0.0
    change = 2.0 * (1.0 - np.exp(-1.0 / tau))
    got = np.mean((result.velocity[-1, :, :2] / sd) ** 2, axis=0)
    assert np.abs(got - change).max() < ERRORS * change * np.sqrt(2.0 / MEMBERS)


@pytest.mark.ci
def test_the_wandering_current_is_that_of_the_twin():
    # At rest in the water a neutral vehicle shows u(t), here by the process itself; and the seed's high word counts.
    seed, h, steps = 12 + (34 << 32), 0.1, 50
    water = in_water(wander=WANDER)
    term = water[1]
    result = lw.solve(ensemble(*water, members=3, seed=seed), "psi_s", h=h, t1=steps * h, save=lw.SaveAt(every=h))
    channel = terms.noisy.channel(term.key)
    xi = random.normals(12, 34, np.arange(3), np.arange(steps)[:, None], channel)[..., :3]
    u, decay = np.zeros((steps + 1, 3, 3)), np.exp(-h / term.time_constant)
    for k in range(steps):
        u[k + 1] = decay * u[k] + np.sqrt(1.0 - decay**2) * term.standard_deviation * xi[k]
    assert np.abs(result.velocity - u).max() < 1e-14
    moves = 0.5 * h * np.cumsum(u[1:] + u[:-1], axis=0)
    assert np.abs(result.position[1:] - moves).max() < 1e-13


NOISES = {
    "current": terms.GaussMarkovCurrent(**WANDER, start="stationary"),
    "wrench": terms.WrenchNoise(**WRENCH_NOISE),
}


# 100 steps of round-off, which a body that tumbles under its noise multiplies by up to 1e5.
WIDTHS = {"float64": 1e-10, "float32": 1e-2}


@pytest.mark.slow
@pytest.mark.parametrize("dtype", WIDTHS)
@pytest.mark.parametrize("name", NOISES)
def test_same_bits(name, dtype):
    fleet = ensemble(NOISES[name], members=700)

    def run(fleet, **named):
        return lw.solve(fleet, "psi_s", h=0.05, t1=5.0, dtype=dtype, **named).velocity

    whole = run(fleet, threads=1)
    np.testing.assert_array_equal(run(fleet, threads=3), whole)
    np.testing.assert_array_equal(run(fleet.subset([613])), whole[:, 613:614])
    np.testing.assert_array_equal(run(fleet.subset([5, 699, 6])), whole[:, [5, 699, 6]])
    for width in (1, 2, 4, 8):
        # The same numbers are drawn; another width is another kernel, whose sums may be fused otherwise.
        np.testing.assert_allclose(run(fleet, width=width), whole, rtol=0.0, atol=WIDTHS[dtype])
    assert len(np.unique(whole[-1, :, 0])) > 0.99 * 700


@pytest.mark.ci
def test_two_terms_of_a_type_draw_their_own_numbers():
    numbers = dict(standard_deviation=(0.3, 0.3, 0.3), time_constant=1.0)
    result = lw.solve(ensemble(*in_water(wander=numbers, second=numbers), seed=3), h=0.5, t1=10.0)
    variance = np.mean(result.velocity[-1] ** 2, axis=0) / 0.3**2
    assert np.abs(variance - 2.0).max() < ERRORS * 2.0 * np.sqrt(2.0 / MEMBERS)


# A full inertia makes the kernel turn the axes: noise must not see it.
FULL = TURN @ np.diag([1.0, 2.0, 3.0]) @ TURN.T


@pytest.mark.ci
@pytest.mark.parametrize("h", [0.1, 0.025])
def test_growth_under_white_noise(h):
    # Impulses of variance S^2 h: <v^2> = S^2 t / m^2 at every step, exactly, whatever the step is. Without a moment
    # of inertia to speak of nothing else acts; the body does not turn.
    S, t1, m = np.array(WRENCH_NOISE["force"]), 2.0, np.array([2.0, 3.0, 4.0])
    fleet = ensemble(terms.WrenchNoise(force=S), M=tuple(m), J=1e6 * FULL)
    result = lw.solve(fleet, "psi_s", h=h, t1=t1)
    growth = np.mean(result.velocity[-1] ** 2, axis=0) / (S**2 * t1 / m**2)
    assert np.abs(growth - 1.0).max() < ERRORS * np.sqrt(2.0 / MEMBERS)


@pytest.mark.ci
@pytest.mark.parametrize("h", [0.1, 0.025])
def test_growth_of_the_spin_under_white_noise(h):
    # One moment of inertia: J Om in inertial axes is the sum of turned impulses, each isotropic.
    S, t1, J = 0.2, 2.0, 5.0
    fleet = ensemble(terms.WrenchNoise(torque=(S, S, S)), M=FULL, J=(J, J, J))
    result = lw.solve(fleet, "psi_s", h=h, t1=t1)
    growth = np.mean(result.angular_velocity[-1] ** 2) / (S**2 * t1 / J**2)
    assert abs(growth - 1.0) < ERRORS * np.sqrt(2.0 / (3 * MEMBERS))


@pytest.mark.ci
def test_noise_does_not_see_the_kernels_axes():
    # Along the user's axes, the impulse of one step is that of the twin.
    term = terms.WrenchNoise(**WRENCH_NOISE)
    h, M = 0.01, np.diag([2.0, 3.0, 4.0])
    result = lw.solve(ensemble(term, members=5, M=M, J=FULL), "psi_s", h=h, t1=h)
    channels = terms.noisy.channel(term.key) + np.array([[0], [1]])
    xi = random.normals(7, 0, np.arange(5), 0, channels)[..., :3] * np.sqrt(h)
    Om = np.linalg.solve(FULL, (term.torque * xi[1]).T).T
    # Half a step of turning, |Om| h / 2, is left.
    np.testing.assert_allclose(result.angular_velocity[-1], Om, rtol=0.0, atol=5e-4)
    np.testing.assert_allclose(result.velocity[-1], term.force * xi[0] @ np.linalg.inv(M), rtol=0.0, atol=2e-3)


def test_waves_want_gravity():
    drifter = lw.Vehicle(2.0, inertia=(1.0, 1.0, 1.0), added_mass=(1.0, 1.0, 1.0))
    here = lw.Scene(drifter, lw.Environment(gravity=0.0), terms=[terms.Waves(**WAVES)])
    with pytest.raises(
        lw.SceneError, match=r"environment.gravity = 0.*leaves the length of waves unknown.*Give gravity"
    ):
        lw.solve(one(here), "psi_s", h=0.1, t1=0.1)


def test_members_with_unphysical_periods_are_counted():
    fleet = {"waves.periods": np.array([[5.0, 4.0, 3.0], [5.0, -4.0, 3.0]])}
    with pytest.raises(lw.SceneError, match=r"waves.periods of member 1 .*is unphysical \(1 of 2 members\)"):
        lw.Ensemble.from_states(scene(terms.Waves(**WAVES)), *random_states(1, 2), parameters=fleet)
