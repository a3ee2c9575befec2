# SPDX-License-Identifier: Apache-2.0
"""Filters against Kalman's own, on arrays and on vehicles that are linear in what is not known."""

import re

import numpy as np
import pytest
from scipy import stats

import lgvi_warp as lw
from lgvi_warp.extensions.others.assimilation import filters

MASS, DRAG = 10.0, 4.0
TIMES = np.array([1.0, 2.5, 4.0])


def kalman(mean, P, H, y, R):
    """Kalman's update of a mean and a covariance."""
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    return mean + K @ (y - H @ mean), P - K @ H @ P


@pytest.mark.parametrize("d", [1, 3])
@pytest.mark.parametrize("m", [1, 2, 5])
def test_the_transform_filter_is_kalmans_on_its_own_moments(m, d):
    # The sample's mean and covariance go where Kalman's update takes them, to round-off.
    rng = np.random.default_rng(m + 10 * d)
    E, H, std = rng.normal(size=(d, 40)), rng.normal(size=(m, d)), rng.uniform(0.2, 2.0, m)
    y = rng.normal(size=m)
    mean, P = kalman(E.mean(axis=1), np.atleast_2d(np.cov(E)), H, y, np.diag(std**2))
    moved = filters.etkf(E, H @ E, y, std)
    np.testing.assert_allclose(moved.mean(axis=1), mean, atol=1e-12)
    np.testing.assert_allclose(np.atleast_2d(np.cov(moved)), P, atol=1e-12)


def test_the_stochastic_filter_is_kalmans_in_the_mean():
    # Over many draws; the mean of one draw is exact, since its errors have the mean zero.
    rng = np.random.default_rng(3)
    E, H, std, y = rng.normal(size=(2, 60)), rng.normal(size=(2, 2)), np.array([0.5, 1.0]), np.array([0.3, -0.8])
    mean, P = kalman(E.mean(axis=1), np.cov(E), H, y, np.diag(std**2))
    draws = [filters.enkf(E, H @ E, y, std, rng) for _ in range(2000)]
    np.testing.assert_allclose(draws[0].mean(axis=1), mean, atol=1e-12)
    # The covariance of 60 drawn errors has a relative error of sqrt(2 / 60) in each of 2,000 draws.
    np.testing.assert_allclose(np.mean([np.cov(each) for each in draws], axis=0), P, atol=4.0 * 0.2 / np.sqrt(2000.0))


@pytest.mark.parametrize("name", ["etkf", "enkf"])
def test_normalised_errors_are_inside_their_band(name):
    """500 repetitions of a random walk that is measured ten times: the mean of e^T P^-1 e is that of chi squared."""
    repetitions, n, steps = 500, 100, 10
    rng, nees = np.random.default_rng(5), []
    for _ in range(repetitions):
        truth, E = rng.normal(size=2), rng.normal(size=(2, n))
        for _ in range(steps):
            truth = truth + 0.3 * rng.normal(size=2)
            E = E + 0.3 * rng.normal(size=(2, n))
            y, std = truth[:1] + 0.5 * rng.normal(size=1), np.array([0.5])
            E = filters.etkf(E, E[:1], y, std) if name == "etkf" else filters.enkf(E, E[:1], y, std, rng)
        e = truth - E.mean(axis=1)
        nees.append(e @ np.linalg.solve(np.cov(E), e))
    low, high = stats.chi2.ppf([0.001, 0.999], 2 * repetitions) / repetitions
    # A covariance of n members is inverted: its mean is (n - 1) / (n - d - 2) of the inverse.
    assert low < np.mean(nees) / ((n - 1.0) / (n - 4.0)) < high


def test_particles():
    rng = np.random.default_rng(7)
    x = rng.normal(size=(1, 200_000))
    w = filters.normalised(filters.log_likelihood(x, np.array([1.0]), np.array([0.5])))
    # Kalman's: mean 0.8, variance 0.2.
    assert x[0] @ w == pytest.approx(0.8, abs=0.01)
    places = filters.resampled(w, rng)
    counts = np.bincount(places, minlength=len(w))
    assert np.all(np.abs(counts - len(w) * w) < 1.0 + 1e-9)
    spread = filters.jittered(x[:, places], 0.9, rng)
    # Liu & West (2001): each is drawn about a x + (1 - a) mean, with a = (3 d - 1) / (2 d), here 17 / 18.
    slope = np.cov(x[0, places], spread[0])[0, 1] / x[0, places].var()
    assert slope == pytest.approx(17.0 / 18.0, abs=4.0 * np.sqrt((1.0 - (17.0 / 18.0) ** 2) / x.shape[1]))
    assert spread.mean() == pytest.approx(0.8, abs=0.01)
    assert spread.var() == pytest.approx(0.2, rel=0.05)
    assert filters.effective_number(np.full(10, 0.1), np.arange(10)) == pytest.approx(10.0)
    # Copies of one member count once: three of them and seven others weigh 0.3 and 0.1 each.
    copies = np.array([4, 4, 4, 0, 1, 2, 3, 5, 6, 7])
    assert filters.effective_number(np.full(10, 0.1), copies) == pytest.approx(1.0 / (0.3**2 + 7.0 * 0.1**2))
    assert filters.normalised(np.full(3, -np.inf)).tolist() == pytest.approx([1 / 3] * 3)


def drifting(members=200, **changes):
    """A sphere that drifts: its place, its speed and the current are not known."""
    vehicle = lw.Vehicle(MASS, inertia=(1.0, 1.0, 1.0), buoyancy=MASS * 9.81)
    linear = (DRAG, DRAG, DRAG, 1.0, 1.0, 1.0)
    terms = [lw.terms.Drag(linear=linear), lw.terms.Current(velocity=(0.2, -0.1, 0.0))]
    scene = lw.Scene(vehicle, lw.Environment(gravity=9.81), terms=terms)
    vary = {
        "start.position": lw.distributions.Normal(std=[1.0, 1.0, 0.5]),
        "start.velocity": lw.distributions.Normal(std=[0.3, 0.3, 0.1]),
        "current.velocity": lw.distributions.Normal(std=[0.2, 0.2, 0.0]),
    }
    return lw.Ensemble(scene, members, 2, vary | changes)


def design(t):
    """x(t) = x0 + a v0 + (t - a) u, with a = (m / c) (1 - exp(-c t / m)): a row for each time."""
    a = MASS / DRAG * (1.0 - np.exp(-DRAG * np.atleast_1d(t) / MASS))
    return np.stack([np.ones_like(a), a, np.atleast_1d(t) - a], axis=1)


def unknowns(fleet):
    """Place, speed and current along one axis of each member, (3, n)."""
    members = fleet.select(0, fleet.members)
    current = fleet.parameters(0, fleet.members)["current.velocity"]
    return np.stack([members.position[:, 0], members.velocity[:, 0], current[:, 0]])


def series(std=0.2):
    """Fixes of a vehicle with a place, a speed and a current of its own."""
    rng, truth = np.random.default_rng(11), np.array([0.7, -0.2, 0.35])
    y = design(TIMES) @ truth + std * rng.normal(size=3)
    return truth, y, lw.studies.Series("position[0]", TIMES, y, std)


@pytest.mark.ci
def test_a_drifting_body_is_a_linear_regression():
    # In any order of the updates: of the members' own moments the filter makes what Bayes' rule does.
    fleet, (_, y, fixes) = drifting(), series()
    answer = lw.assimilate(fleet, fixes, ["current.velocity[0]"], method="rk8", h=0.05)
    z = unknowns(fleet)
    mean, P = kalman(z.mean(axis=1), np.cov(z), design(TIMES), y, 0.04 * np.eye(3))
    learned = answer.parameters["current.velocity[0]"]
    assert learned.mean() == pytest.approx(mean[2], abs=1e-9)
    assert learned.var(ddof=1) == pytest.approx(P[2, 2], rel=1e-7)
    at_end = design(TIMES[-1])[0]
    assert answer.final.position[:, 0].mean() == pytest.approx(at_end @ mean, abs=1e-8)
    assert answer.final.position[:, 0].var(ddof=1) == pytest.approx(at_end @ P @ at_end, rel=1e-6)
    # It goes on from there with what it learned.
    run = lw.prepare(fleet.scene, method="rk8", h=0.05, t1=1.0)
    later = run.states(answer.final, parameters=answer.parameters)
    expected = (design(5.0)[0]) @ mean
    assert later.position[-1, :, 0].mean() == pytest.approx(expected, abs=1e-8)


def test_another_library_finds_the_same():
    filters = pytest.importorskip("filterpy.kalman")
    fleet, (_, y, fixes) = drifting(), series()
    answer = lw.assimilate(fleet, fixes, ["current.velocity[0]"], method="rk8", h=0.05)
    z = unknowns(fleet)
    # One axis of the body: its place, its speed over ground and the current, from fix to fix.
    other = filters.KalmanFilter(dim_x=3, dim_z=1)
    other.x, other.P = z.mean(axis=1)[:, None], np.cov(z)
    other.H, other.R, other.Q = np.array([[1.0, 0.0, 0.0]]), np.array([[0.04]]), np.zeros((3, 3))
    for dt, fix in zip(np.diff(TIMES, prepend=0.0), y, strict=True):
        b, left = MASS / DRAG * (1.0 - np.exp(-DRAG * dt / MASS)), np.exp(-DRAG * dt / MASS)
        other.F = np.array([[1.0, b, dt - b], [0.0, left, 1.0 - left], [0.0, 0.0, 1.0]])
        other.predict()
        other.update(fix)
    learned = answer.parameters["current.velocity[0]"]
    assert learned.mean() == pytest.approx(other.x[2, 0], abs=1e-9)
    assert learned.var(ddof=1) == pytest.approx(other.P[2, 2], rel=1e-7)
    assert answer.final.position[:, 0].mean() == pytest.approx(other.x[0, 0], abs=1e-8)


@pytest.mark.ci
@pytest.mark.parametrize("name", ["enkf", "particles"])
def test_other_filters_come_near_it(name):
    fleet, (_, y, fixes) = drifting(4000), series()
    answer = lw.assimilate(fleet, fixes, ["current.velocity[0]"], filter=name, method="rk8", h=0.05, discount=0.99)
    z = unknowns(fleet)
    mean, P = kalman(z.mean(axis=1), np.cov(z), design(TIMES), y, 0.04 * np.eye(3))
    spread = np.sqrt(P[2, 2])
    # Four standard errors of a mean of the effective number, at least a fifth of the members here.
    assert answer.mean["current.velocity[0]"][-1] == pytest.approx(mean[2], abs=4.0 * spread / np.sqrt(800.0))
    assert answer.std["current.velocity[0]"][-1] == pytest.approx(spread, rel=0.15)


@pytest.mark.ci
def test_two_instruments_and_missing_values():
    # Two series at one time are one measurement; a missing value says nothing; innovations have their spread.
    fleet, (_, _, fixes) = drifting(), series()
    both = lw.studies.Series("velocity", [2.5], [[np.nan, 0.1, np.nan]], 0.1)
    answer = lw.assimilate(fleet, [fixes, both], method="rk8", h=0.05)
    assert answer.innovations["velocity"].shape == (3, 3)
    assert np.isfinite(answer.innovations["velocity"]).sum() == 1
    alone = lw.assimilate(fleet, fixes, method="rk8", h=0.05)
    np.testing.assert_allclose(answer.mean["position"][0], alone.mean["position"][0], rtol=1e-12)
    assert set(answer.consistency()) == {"position[0]", "velocity"}
    assert "Assimilation of 3 times to 4 s" in repr(answer)


@pytest.mark.ci
def test_members_that_an_event_stops_are_told():
    fleet, (_, _, fixes) = drifting(60), series()
    assert not lw.assimilate(fleet, fixes, method="rk8", h=0.05).messages
    scene = lw.Scene(
        fleet.scene.vehicle, fleet.scene.environment, terms=fleet.scene.terms, events=[lw.events.Floor(depth=0.3)]
    )
    answer = lw.assimilate(lw.Ensemble(scene, 60, 2, fleet.vary), fixes, method="rk8", h=0.05)
    (message,) = answer.messages
    # Those that start below it, and some that go there.
    below = int((fleet.select(0, 60).position[:, 2] > 0.3).sum())
    assert 5 < below <= int(re.search(r"stopped (\d+) of 60 members", message)[1]) < 40


@pytest.mark.ci
def test_an_attitude_is_learned_from_headings():
    # Turns about the vertical add: the headings are a scalar that Kalman's filter knows.
    vary = {"start.attitude": lw.distributions.RotationNormal(std=[0.0, 0.0, 0.3])}
    vehicle = lw.Vehicle(MASS, inertia=(1.0, 1.0, 1.0), buoyancy=MASS * 9.81)
    fleet = lw.Ensemble(lw.Scene(vehicle, lw.Environment(gravity=9.81)), 300, 1, vary)
    heading = lw.studies.Series("euler[2]", [0.5], [0.4 + 2.0 * np.pi], 0.1)
    answer = lw.assimilate(fleet, heading, method="psi_x", h=0.1)
    before = lw.solve(fleet, "psi_x", h=0.1, t1=0.5).euler[-1, :, 2]
    gain = before.var(ddof=1) / (before.var(ddof=1) + 0.01)
    after = lw.solve(fleet.subset(range(300)), "psi_x", h=0.1, t1=0.6, start=answer.final).euler[-1, :, 2]
    assert after.mean() == pytest.approx(before.mean() + gain * (0.4 - before.mean()), abs=2e-3)


@pytest.mark.parametrize("of", ["euler", "euler[2]"])
def test_angles_are_compared_within_half_a_turn(of):
    measured = [[0.1, -0.2, 3.1]] if of == "euler" else [3.1]
    heading = lw.studies.Series(of, [0.5], measured, 0.1)
    predicted = np.array([[0.1, 0.0], [0.0, -0.2], [-3.1, 3.0]])[-heading.values.shape[1] :]
    apart = heading.near(heading.values[0], predicted) - heading.values[0][:, None]
    np.testing.assert_allclose(apart[-1], [2.0 * np.pi - 6.2, -0.1], atol=1e-12)
    assert np.all(np.abs(apart) < 0.3)


@pytest.mark.ci
def test_what_is_refused():
    fleet, (_, _, fixes) = drifting(10), series()
    for message, call in {
        "is not a whole number of steps of 0.3 s": lambda: lw.assimilate(fleet, fixes, h=0.3),
        "does not vary": lambda: lw.assimilate(fleet, fixes, ["vehicle.buoyancy"], h=0.05),
        "is one member": lambda: lw.assimilate(fleet.scene, fixes, h=0.05),
        "is where the members start": lambda: lw.assimilate(
            fleet, lw.studies.Series("depth", [0.0], [1.0], 0.1), h=0.05
        ),
        "is not a Series": lambda: lw.assimilate(fleet, [1.0], h=0.05),
        "series = <object": lambda: lw.assimilate(fleet, object(), h=0.05),
        "h = 0 is not positive": lambda: lw.assimilate(fleet, fixes, h=0),
        "discount = 'all' is not numeric": lambda: lw.assimilate(fleet, fixes, discount="all", h=0.05),
        "seed = -1": lambda: lw.assimilate(fleet, fixes, seed=-1, h=0.05),
        "learn = 3 is not a list": lambda: lw.assimilate(fleet, fixes, 3, h=0.05),
        "names no instrument": lambda: lw.assimilate(fleet, [], h=0.05),
        "is not known": lambda: lw.assimilate(fleet, fixes, filter="ukf", h=0.05),
        "series.std = 0": lambda: lw.studies.Series("depth", [1.0], [1.0], 0.0),
        "that are infinite. Give NaN": lambda: lw.studies.Series("depth", [1.0, 2.0], [1.0, np.inf], 0.1),
        "has 3 numbers, and 1 were measured": lambda: lw.assimilate(
            fleet, lw.studies.Series("position", [1.0], [1.0], 0.1), h=0.05
        ),
        "no member is near": lambda: lw.assimilate(
            fleet, lw.studies.Series("position[0]", [1.0], [1e200], 1e-3), filter="particles", h=0.05, gate=None
        ),
    }.items():
        with pytest.raises(lw.SceneError, match=re.escape(message)):
            call()


@pytest.mark.slow
@pytest.mark.parametrize("filter", ["etkf", "enkf"])
def test_vehicles_are_as_sure_as_they_should_be(filter):
    """500 vehicles from the members' own distributions: e^T P^-1 e of place and current is chi squared with two degrees."""
    rng, n, nees = np.random.default_rng(17), 400, []
    for seed in range(500):
        truth = np.array([rng.normal(), 0.3 * rng.normal(), 0.2 + 0.2 * rng.normal()])
        y = design(TIMES) @ truth + 0.2 * rng.normal(size=3)
        fleet = drifting(n).with_seed(seed)
        fixes = lw.studies.Series("position[0]", TIMES, y, 0.2)
        answer = lw.assimilate(fleet, fixes, ["current.velocity[0]"], filter=filter, method="rk4", h=0.1, seed=seed)
        z = np.stack([answer.final.position[:, 0], answer.parameters["current.velocity[0]"]])
        e = np.array([design(TIMES[-1])[0] @ truth, truth[2]]) - z.mean(axis=1)
        nees.append(e @ np.linalg.solve(np.cov(z), e))
    low, high = stats.chi2.ppf([0.001, 0.999], 2 * len(nees)) / len(nees)
    # Of n members the inverse of a covariance is too large by (n - 1) / (n - 4), and its mean by as much again.
    assert low < np.mean(nees) / ((n - 1.0) / (n - 4.0)) ** 2 < high


@pytest.mark.ci
def test_two_instruments_of_one_quantity():
    fleet, (_, y, fixes) = drifting(), series()
    other = lw.studies.Series("position[0]", TIMES[:1], y[:1] + 0.1, 0.3)
    with pytest.raises(lw.SceneError, match=re.escape("series = 'position[0]' is measured by two")):
        lw.assimilate(fleet, [fixes, other], method="rk8", h=0.05)
    named = lw.studies.Series("position[0]", TIMES[:1], y[:1] + 0.1, 0.3, name="second receiver")
    silent = lw.studies.Series("depth", [0.5], [np.nan], 0.1)
    answer = lw.assimilate(fleet, [fixes, named, silent], method="rk8", h=0.05)
    assert set(answer.innovations) == {"position[0]", "second receiver", "depth"}
    assert len(answer.effective) == len(answer.time) == 4
