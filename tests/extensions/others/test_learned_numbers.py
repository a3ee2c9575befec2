# SPDX-License-Identifier: Apache-2.0
"""Numbers that are learned by their own distributions, against quadrature of Bayes' rule and Kalman's filter in NumPy."""

import re

import numpy as np
import pytest
from scipy import stats

import lgvi_warp as lw
from lgvi_warp.extensions.others.assimilation import filters, innovations
from lgvi_warp.extensions.others.assimilation.coordinates import Coordinates
from lgvi_warp.scene.variations import targets
from tests.extensions.others.test_assimilation import DRAG, MASS, TIMES, design, drifting, kalman, series, unknowns

D = lw.distributions
NAME = "drag.linear[0]"
FIXES = np.arange(1.0, 11.0)
BALL = lw.Scene.named("sphere").vehicle
M = 1.5 * float(BALL.mass)  # with the added mass of a sphere


def slowing(members=200, seed=0, law=None, **more):
    """A sphere that slows down from 1 m/s by a linear drag that is not known."""
    drag = lw.terms.Drag(linear=[20.0] * 3 + [1.0] * 3)
    scene = lw.Scene(BALL, terms=[drag, *more.pop("terms", [])], start=lw.Start(velocity=[1, 0, 0]))
    return lw.Ensemble(scene, members, seed, more or {NAME: law or D.LogNormal(sigma=1.0)})


def along(c, t, x=0.0, v=1.0):
    """Place and speed at t of a body of drag c: x + v tau (1 - exp(-t / tau)), v exp(-t / tau), tau = M / c."""
    left = np.exp(-c * t / M)
    return x + v * M / c * (1.0 - left), v * left


def measured(seed, truth=5.0, std=0.05):
    """Fixes of a body of that drag."""
    errors = std * np.random.default_rng(seed).normal(size=len(FIXES))
    return along(truth, FIXES)[0] + errors


def posterior(y, std=0.05, sigma=1.0, median=20.0):
    """Mean, standard deviation and logarithm of the evidence by Bayes' rule, on 20,001 points of z = log(c / median)."""
    z = np.linspace(-8.0, 8.0, 20_001)
    c = median * np.exp(sigma * z)
    apart = along(c[:, None], FIXES)[0] - y
    log = -0.5 * z**2 - 0.5 * np.sum(apart**2, axis=1) / std**2
    p = np.exp(log - log.max())
    evidence = np.log(p.sum() * (z[1] - z[0]) / np.sqrt(2.0 * np.pi)) + log.max()
    p /= p.sum()
    mean = p @ c
    return mean, np.sqrt(p @ (c - mean) ** 2), evidence - len(y) * np.log(std * np.sqrt(2.0 * np.pi))


def follow(fleet, y, std=0.05, **more):
    """The answer for fixes of the place along north."""
    fixes = lw.studies.Series("position[0]", FIXES, y, std)
    return lw.assimilate(fleet, fixes, [NAME], **{"method": "psi_x", "h": 0.5, **more})


@pytest.mark.ci
def test_kalmans_update_moves_the_logarithm_of_a_log_normal_number():
    # The same members by closed form, with Kalman's gain of their own covariance of place, speed and log(drag).
    fleet, y = slowing(), measured(0)
    x, v, z = np.zeros(200), np.ones(200), np.log(fleet.parameters(0, 200)["drag.linear"][:, 0])
    for dt, fix in zip(np.diff(FIXES, prepend=0.0), y, strict=True):
        x, v = along(np.exp(z), dt, x, v)
        E = np.stack([x, v, z])
        A = E - E.mean(axis=1, keepdims=True)
        P = A @ A.T / 199.0
        S = P[0, 0] + 0.05**2
        # The square root of Kalman's update of one measurement (Whitaker & Hamill 2002).
        alpha = 1.0 / (1.0 + 0.05 / np.sqrt(S))
        shift, K = P[:, 0] / S * (fix - x.mean()), P[:, 0] / S
        x, v, z = E + shift[:, None] - alpha * np.outer(K, A[0])
    answer = follow(fleet, y, filter="etkf", method="rk8", h=0.1)
    learned = answer.parameters[NAME]
    assert np.log(learned).mean() == pytest.approx(z.mean(), abs=1e-6)
    assert np.log(learned).std() == pytest.approx(z.std(), rel=1e-5)
    assert (learned > 0.0).all()


@pytest.mark.ci
def test_particles_find_the_posterior():
    y = measured(1)
    mean, std, evidence = posterior(y)
    # Of 3,000 members some 20 begin within two deviations of the posterior.
    answer = follow(slowing(3000, 3), y, filter="particles")
    assert answer.mean[NAME][-1] == pytest.approx(mean, abs=0.6 * std)
    assert answer.std[NAME][-1] == pytest.approx(std, rel=0.5)
    assert answer.log_likelihood == pytest.approx(evidence, abs=0.7)
    assert (answer.parameters[NAME] > 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize(("filter", "members"), [("etkf", 200), ("enkf", 200), ("particles", 2000)])
def test_a_positive_number_is_covered(filter, members):
    # 20 seeds: of the intervals of two deviations 19 should hold; 16 or fewer have a probability of 2 %.
    held, apart, spread = 0, [], []
    for seed in range(20):
        y = measured(seed)
        mean, std, _ = posterior(y)
        answer = follow(slowing(members, seed), y, filter=filter, seed=seed)
        got, sure = answer.mean[NAME][-1], answer.std[NAME][-1]
        held += abs(got - 5.0) < 2.0 * sure
        apart.append((got - mean) / std)
        spread.append(sure / std)
    assert held >= 17
    # A linear update of a relation that bends over the prior is unsure, not wrong; particles have no such error.
    assert np.sqrt(np.mean(np.square(apart))) < (0.5 if filter == "particles" else 2.0 * np.median(spread))
    assert np.median(spread) < (1.4 if filter == "particles" else 6.0)


def moved(law, name=NAME, by=3.0, learn=None):
    """Members' numbers before and after all coordinates moved by so much, and the coordinates."""
    fleet = slowing(50, 1, **{name: law})
    members = fleet.select(0, 50).parameters
    coordinates = Coordinates(fleet, targets(learn or name), members)
    return coordinates.values(coordinates.at, members), coordinates.values(coordinates.at + by, members), coordinates


@pytest.mark.parametrize(
    ("law", "exact"),
    [
        (D.Uniform(low=2.0, high=30.0), stats.uniform(2.0, 28.0)),
        (D.TruncatedNormal(std=8.0, low=1.0), stats.truncnorm(-19.0 / 8.0, np.inf, 20.0, 8.0)),
        (stats.gamma(2.0, scale=5.0), stats.gamma(2.0, scale=5.0)),
        (D.LogNormal(sigma=0.7), stats.lognorm(0.7, scale=20.0)),
        (D.Normal(std=2.0), stats.norm(20.0, 2.0)),
        (D.Derived({NAME: lambda k: 20.0 * k**2}, k=D.Uniform(low=1.0, high=2.0)), None),
    ],
    ids=lambda item: type(item).__name__,
)
def test_a_number_moves_in_its_own_normal_scores(law, exact):
    before, after, coordinates = moved(law, by=0.25)
    drawn = slowing(50, 1, law).parameters(0, 50)["drag.linear"][:, 0]
    np.testing.assert_allclose(before[NAME], drawn, rtol=1e-9)
    if exact is None:
        exact = stats.uniform(1.0, 1.0)
        drawn, after = np.sqrt(drawn / 20.0), {NAME: np.sqrt(after[NAME] / 20.0)}
    # The same by SciPy, but for the scale of what moves as it is.
    unit = {"Normal": 2.0, "LogNormal": 0.7}.get(type(law).__name__, 1.0)
    moved_on = exact.ppf(stats.norm.cdf(stats.norm.ppf(exact.cdf(drawn)) + 0.25 / unit))
    np.testing.assert_allclose(after[NAME], moved_on, rtol=1e-7)
    assert not coordinates.separate.any()


@pytest.mark.parametrize("by", [-40.0, 40.0])
def test_no_move_leaves_what_a_distribution_has(by):
    assert np.all(moved(D.Uniform(low=2.0, high=30.0), by=by)[1][NAME] == pytest.approx(2.0 if by < 0.0 else 30.0))
    histogram = stats.rv_histogram((np.array([1.0, 2.0]), np.array([3.0, 5.0, 7.0])))
    after = moved(histogram, by=by)[1][NAME]
    assert np.all((after >= 3.0) & (after <= 7.0))
    assert np.all(moved(D.LogNormal(sigma=1.0), by=by)[1][NAME] > 0.0)
    matrices = moved(D.PositiveDefinite(sigma=0.2, off_diagonal=0.1), "vehicle.added_mass", by / 10.0)[1]
    assert np.all(np.linalg.eigvalsh(matrices["vehicle.added_mass"]) > 0.0)


def test_vectors_and_joint_distributions():
    # One entry of a vector's own distribution; the others stay.
    _, after, coordinates = moved(D.LogNormal(sigma=[0.5] * 6), "drag.linear", 1.0, learn=NAME)
    assert (list(after), coordinates.at.shape) == ([NAME], (1, 50))
    # All of it; entries keep their sign, and one that is 0 stays so.
    current = lw.Scene(BALL, terms=[lw.terms.Current(velocity=[1.0, -0.5, 0.0])])
    fleet = lw.Ensemble(current, 50, 1, {"current.velocity": D.LogNormal(sigma=0.5)})
    members = fleet.select(0, 50).parameters
    coordinates = Coordinates(fleet, targets("current.velocity"), members)
    after = coordinates.values(coordinates.at + 1.0, members)["current.velocity"]
    assert (members["current.velocity"][:, 1] < 0.0).all()
    np.testing.assert_allclose(after, members["current.velocity"] * np.e, rtol=1e-12)
    # A distribution of two numbers together moves both, and says so.
    both = D.Copula([[1.0, 0.8], [0.8, 1.0]], [D.LogNormal(sigma=0.5), D.Uniform(low=10.0, high=30.0)])
    key = "drag.linear[0], drag.linear[1]"
    before, after, _ = moved(both, key, -1.0, learn=NAME)
    assert list(after) == ["drag.linear[0]", "drag.linear[1]"]
    drawn = slowing(50, 1, **{key: both}).parameters(0, 50)["drag.linear"]
    np.testing.assert_allclose(np.stack([*before.values()], axis=1), drawn[:, :2], rtol=1e-9)
    scores = stats.norm.ppf((before["drag.linear[1]"] - 10.0) / 20.0)
    expected = 10.0 + 20.0 * stats.norm.cdf(scores - 1.0 * (0.8 + 0.6))
    np.testing.assert_allclose(after["drag.linear[1]"], expected, rtol=1e-7)
    # Entries with distributions of their own, of a number that is learned as a whole; one of them does not vary.
    vary = {NAME: D.LogNormal(sigma=1.0), "drag.linear[1]": D.Uniform(low=5.0, high=6.0)}
    fleet = slowing(20, 0, **vary)
    members = fleet.select(0, 20).parameters
    coordinates = Coordinates(fleet, targets("drag.linear"), members)
    values = coordinates.values(coordinates.at, members)["drag.linear"]
    np.testing.assert_allclose(values, members["drag.linear"], rtol=1e-9)
    far = coordinates.values(coordinates.at + 50.0 * np.array([1.0, 1.0, 0, 0, 0, 0])[:, None], members)["drag.linear"]
    np.testing.assert_allclose(far[:, 1], 6.0)
    np.testing.assert_array_equal(far[:, 2:], members["drag.linear"][:, 2:])


def test_members_given_as_arrays():
    # Without a distribution: as they are, or as logarithms where the scene refuses the other sign.
    scene, n = slowing().scene, 30
    rng = np.random.default_rng(1)
    states = [np.zeros((n, 3)), np.broadcast_to(np.eye(3), (n, 3, 3)), np.ones((n, 3)), np.zeros((n, 3))]
    c = rng.uniform(3.0, 9.0, n)
    fleet = lw.Ensemble.from_states(scene, *states, {NAME: c})
    members = fleet.select(0, n).parameters
    coordinates = Coordinates(fleet, targets(NAME), members)
    np.testing.assert_allclose(coordinates.at[0], np.log(c), rtol=1e-12)
    drifts = lw.Scene(BALL, terms=[lw.terms.Current(velocity=[1.0, 0.0, 0.0])])
    table = lw.Ensemble(drifts, sampling=lw.designs.Table(values={"current.velocity[0]": c}))
    coordinates = Coordinates(table, targets("current.velocity[0]"), table.select(0, n).parameters)
    np.testing.assert_array_equal(coordinates.at[0], c)


@pytest.mark.ci
def test_separate_values_are_left_to_particles():
    fleet, y = slowing(300, 0, D.Choice([3.0, 5.0, 8.0])), measured(2)
    message = f"learn = {NAME}: one of them has separate values"
    with pytest.raises(lw.SceneError, match=re.escape(message)):
        follow(fleet, y)
    answer = follow(fleet, y, filter="particles")
    # Bayes' rule among three values; 300 members know their shares before to 3 %.
    density = [stats.norm.logpdf(y, along(c, FIXES)[0], 0.05).sum() for c in (3.0, 5.0, 8.0)]
    assert answer.mean[NAME][-1] == pytest.approx(5.0)
    assert answer.log_likelihood == pytest.approx(max(density) + np.log(1.0 / 3.0), abs=0.3)
    assert set(answer.parameters[NAME]) <= {3.0, 5.0, 8.0}


@pytest.mark.ci
def test_the_filter_is_named_where_it_leaves_what_the_scene_takes():
    fleet = slowing(50, 0, D.Normal(std=8.0, mean=40.0))
    with pytest.raises(lw.SceneError, match=r"learn: at \d+ s the filter moved .*LogNormal\(sigma=\.\.\.\)"):
        follow(fleet, measured(0, truth=1.0), std=0.01, gate=None)


@pytest.mark.ci
def test_the_log_likelihood_is_that_of_kalmans_filter():
    # Of a linear scene the series is normal: H m, H P H^T + R, with the members' own moments at the start.
    fleet, (_, y, fixes) = drifting(), series()
    second = lw.studies.Series("position[0]", TIMES[1:2], y[1:2] + 0.3, 0.4, name="second")
    answer = lw.assimilate(fleet, [fixes, second], ["current.velocity[0]"], method="rk8", h=0.05)
    z = unknowns(fleet)
    H = design(np.append(TIMES, TIMES[1]))
    S = H @ np.cov(z) @ H.T + np.diag([0.04, 0.04, 0.04, 0.16])
    exact = stats.multivariate_normal(H @ z.mean(axis=1), S).logpdf(np.append(y, y[1] + 0.3))
    assert answer.log_likelihood == pytest.approx(exact, abs=1e-6)
    # Innovations of vectors are white by their own covariance.
    apart, covariance = rng_case()
    root, total, log = filters.whitened(apart, covariance)
    assert root @ root == pytest.approx(apart @ np.linalg.solve(covariance, apart)) == pytest.approx(total)
    assert log == pytest.approx(stats.multivariate_normal(np.zeros(3), covariance).logpdf(apart))


def rng_case():
    """An innovation of three numbers, and a covariance."""
    rng = np.random.default_rng(4)
    A = rng.normal(size=(3, 5))
    return rng.normal(size=3), A @ A.T


@pytest.mark.ci
def test_particles_have_the_log_likelihood_too():
    fleet, (_, y, fixes) = drifting(4000), series()
    answer = lw.assimilate(fleet, fixes, ["current.velocity[0]"], filter="particles", method="rk8", h=0.05)
    z, H = unknowns(fleet), design(TIMES)
    exact = stats.multivariate_normal(H @ z.mean(axis=1), H @ np.cov(z) @ H.T + 0.04 * np.eye(3)).logpdf(y)
    # Three times a relative error of about 1 / sqrt(500), the effective number.
    assert answer.log_likelihood == pytest.approx(exact, abs=0.25)


@pytest.mark.ci
def test_a_value_far_away_is_left_out_and_told():
    fleet, (_, y, _) = drifting(), series()
    wild = lw.studies.Series("position[0]", TIMES, [y[0], 1e6, y[2]], 0.2)
    missing = lw.studies.Series("position[0]", TIMES, [y[0], np.nan, y[2]], 0.2)
    answer, without = (lw.assimilate(fleet, each, method="rk8", h=0.05) for each in (wild, missing))
    assert answer.left_out["position[0]"].tolist() == [False, True, False]
    np.testing.assert_array_equal(answer.final.position, without.final.position)
    assert answer.log_likelihood == without.log_likelihood
    (message,) = answer.messages
    assert message.startswith("the gate left out 1 of 3 measurements of position[0], at 2.5 s; gate=None takes all")
    test = answer.consistency()["position[0]"]
    assert (test.count, test.left_out) == (2, 1)
    taken = lw.assimilate(fleet, wild, method="rk8", h=0.05, gate=None)
    assert taken.mean["position"][1, 0] > 1e4
    assert not taken.left_out["position[0]"].any()


@pytest.mark.ci
@pytest.mark.parametrize("filter", ["etkf", "particles"])
def test_the_gate_is_a_chi_square_test(filter):
    # Three numbers at once: the square of the innovation over its covariance, beside chi-square of the same probability.
    fleet = drifting()
    before = lw.solve(fleet, "rk8", h=0.05, t1=1.0).position[-1]
    S = np.cov(before.T) + 0.04 * np.eye(3)
    direction = np.array([1.0, -2.0, 0.5])
    unit = direction / np.sqrt(direction @ np.linalg.solve(S, direction))
    bound = np.sqrt(stats.chi2.isf(2.0 * stats.norm.sf(3.0), 3))
    for factor, out in ((0.999, False), (1.001, True)):
        y = before.mean(axis=0) + factor * bound * unit
        fix = lw.studies.Series("position", [1.0], [y], 0.2)
        answer = lw.assimilate(fleet, fix, filter=filter, method="rk8", h=0.05, gate=3.0)
        assert answer.left_out["position"].tolist() == [out]


@pytest.mark.ci
def test_inflation_is_a_factor_on_the_covariance():
    # Kalman's filter with P times 1.5 before each update, of place, speed and current.
    fleet, (_, y, fixes) = drifting(), series()
    answer = lw.assimilate(fleet, fixes, ["current.velocity[0]"], method="rk8", h=0.05, inflation=1.5)
    z = unknowns(fleet)
    mean, P = z.mean(axis=1), np.cov(z)
    for dt, fix in zip(np.diff(TIMES, prepend=0.0), y, strict=True):
        b, left = MASS / DRAG * (1.0 - np.exp(-DRAG * dt / MASS)), np.exp(-DRAG * dt / MASS)
        F = np.array([[1.0, b, dt - b], [0.0, left, 1.0 - left], [0.0, 0.0, 1.0]])
        mean, P = kalman(F @ mean, 1.5 * F @ P @ F.T, np.array([[1.0, 0.0, 0.0]]), np.array([fix]), np.array([[0.04]]))
    assert answer.parameters["current.velocity[0]"].mean() == pytest.approx(mean[2], abs=1e-8)
    assert answer.parameters["current.velocity[0]"].var(ddof=1) == pytest.approx(P[2, 2], rel=1e-6)
    assert answer.inflation.tolist() == [1.5] * 3


@pytest.mark.parametrize("q", [0.3, 1.0])
def test_adaptive_inflation_finds_what_is_missing(q):
    # A random walk of variance q whose filter knows none: 1 + q / P, P the stationary variance of the exact filter.
    P = 1.0
    for _ in range(200):
        P = (P + q) / (P + q + 1.0)
    found = []
    for seed in range(4):
        rng, factor, truth = np.random.default_rng(seed), 1.0, 0.0
        E = rng.normal(size=(1, 50))
        for step in range(400):
            truth, mean = truth + np.sqrt(q) * rng.normal(), E.mean()
            y = np.array([truth + rng.normal()])
            E = mean + np.sqrt(factor) * (E - mean)
            E, factor = filters.etkf(E, E, y, np.ones(1)), filters.estimated_inflation(factor, E, y, np.ones(1), 0.36)
            found += [factor] * (step >= 100)
    # The means of 300 steps have a relative error of 8 %, as 20 other seeds say, and one half as large of four.
    assert np.mean(found) == pytest.approx(1.0 + q / P, rel=0.12)


def accelerated(seed, acceleration, **more):
    """A sphere whose scene knows no force, followed by fixes of one that has an acceleration; its error in deviations."""
    rng, t = np.random.default_rng(seed), np.arange(1.0, 21.0)
    x, v = rng.normal(), 0.3 * rng.normal()
    y = x + v * t + 0.5 * acceleration * t**2 + 0.5 * rng.normal(size=20)
    vary = {"start.position[0]": D.Normal(std=1.0), "start.velocity[0]": D.Normal(std=0.3)}
    fixes = lw.studies.Series("position[0]", t, y, 0.5)
    answer = lw.assimilate(lw.Ensemble(lw.Scene(BALL), 100, seed, vary), fixes, method="psi_s", h=1.0, **more)
    error = answer.mean["position"][-1, 0] - (x + 20.0 * v + 200.0 * acceleration)
    return answer, error / answer.std["position"][-1, 0]


@pytest.mark.ci
def test_an_acceleration_that_the_scene_lacks_is_seen():
    answer, error = accelerated(3, 0.05)
    assert abs(error) > 3.0
    test = answer.consistency()["position[0]"]
    assert "biased" in test.verdict
    assert "correlated in time" in test.verdict
    assert any("innovations of position[0] are biased" in text for text in answer.messages)
    assert "biased" in repr(answer)
    right, _ = accelerated(3, 0.0)
    assert right.consistency()["position[0]"].verdict == "consistent"
    assert not right.messages
    # The members follow it once their covariance is inflated.
    inflated, less = accelerated(3, 0.05, inflation="adaptive")
    assert abs(less) < 0.5 * abs(error)
    assert inflated.inflation[0] == 1.0
    assert inflated.inflation[-1] > 1.2
    assert "of the covariance" in repr(inflated)


@pytest.mark.slow
def test_a_right_filter_is_rarely_doubted():
    # At most 5 %: of 60 seeds 8 or more have a probability of 1 %.
    doubted = sum(accelerated(seed, 0.0)[0].consistency()["position[0]"].verdict != "consistent" for seed in range(60))
    assert doubted <= 7


def test_bands_of_innovations():
    # White numbers are outside any of their bands in 5 % of 1,000 series, or less; each other kind is named.
    rng = np.random.default_rng(8)
    z = rng.normal(size=(1000, 40, 2))
    verdicts = [innovations.tested(each, each, 0, 0.95).verdict for each in z]
    assert 0.02 < np.mean([verdict != "consistent" for verdict in verdicts]) < 0.05 + 4.0 * np.sqrt(0.05 * 0.95 / 1000)
    test = innovations.tested(z[0], z[0], 0, 0.95)
    assert test.correlation == pytest.approx(np.sum(z[0, 1:] * z[0, :-1]) / np.sum(z[0] ** 2))
    assert test.ratio == pytest.approx(np.sqrt(np.mean(z[0] ** 2)))
    np.testing.assert_allclose(test.mean, z[0].mean(axis=0))
    np.testing.assert_allclose(test.ratio_band**2 * 80, stats.chi2.ppf([0.05 / 6.0, 1.0 - 0.05 / 6.0], 80))
    np.testing.assert_allclose(test.mean_band, stats.norm.isf(0.05 / 12.0) / np.sqrt(40.0))
    wandering = np.array(z[0])
    for k in range(1, 40):
        wandering[k] = 0.7 * wandering[k - 1] + np.sqrt(1.0 - 0.49) * z[0, k]
    for other, word in ((1.5 * z[0], "too sure"), (0.5 * z[0], "not sure enough"), (z[0] + [0.0, 1.0], "biased"),
                        (wandering, "correlated in time")):  # fmt: skip
        assert word in innovations.tested(other, other, 0, 0.95).verdict
    nothing = np.full((3, 1), np.nan)
    assert innovations.tested(nothing, nothing, 3, 0.95).verdict == "nothing to compare"
    gaps = np.where(rng.uniform(size=(40, 2)) < 0.3, np.nan, z[0])
    assert innovations.tested(gaps, gaps, 0, 0.95).count == np.isfinite(gaps).sum()


@pytest.mark.ci
def test_copies_of_a_particle_count_once():
    fleet, y = slowing(100), measured(0)
    fixes = lw.studies.Series("position[0]", FIXES, y, 0.05)
    answer = lw.assimilate(fleet, fixes, filter="particles", method="psi_x", h=0.5)
    distinct, own = np.unique(answer.final.position[:, 0], return_inverse=True)
    shares = np.bincount(own, answer.weights)
    assert len(distinct) == answer.ancestors[-1] < 20
    assert answer.effective[-1] <= len(distinct)
    assert 1.0 / np.sum(shares**2) <= len(distinct)
    assert any("copies of a particle stay copies" in text for text in answer.messages)
    # Where all that differs is drawn anew, particles are members of their own; ancestors are counted still.
    learned = follow(fleet, y, filter="particles")
    assert learned.ancestors[-1] < 20 < learned.effective[-1]
    # Copies that nothing can draw apart, since one member had all the weight, stay one.
    alone = follow(slowing(20), y, std=1e-5, filter="particles", gate=None)
    assert len(np.unique(alone.parameters[NAME])) == 1
    assert alone.effective[-1] == pytest.approx(1.0)


@pytest.mark.ci
def test_weights_of_a_table_are_those_of_particles():
    # 3 and 5 kg/s, of which the first is nine times as probable before.
    fleet = slowing(2)
    values = {NAME: [4.9, 5.1], "w": [9.0, 1.0]}
    fleet = lw.Ensemble(fleet.scene, sampling=lw.designs.Table(values=values, weights="w"))
    answer = follow(fleet, measured(0, truth=5.0), std=1e3, filter="particles", discount=None)
    assert answer.weights[0] == pytest.approx(0.9, abs=1e-3)
    assert any("members count alike" in text for text in follow(fleet, measured(0), std=10.0).messages)


@pytest.mark.parametrize(
    ("message", "more"),
    [
        ("gate = 0 is not positive", {"gate": 0}),
        ("inflation = 0.5 is below 1", {"inflation": 0.5}),
        ("inflation = 'adaptiv' is not known", {"inflation": "adaptiv"}),
        ("filter = [0.0, 0.0] is not known", {"filter": np.zeros(2)}),
        ("inflation = 1.1 is of Kalman filters", {"inflation": 1.1, "filter": "particles"}),
    ],
)
def test_options_out_of_range_are_refused(message, more):
    with pytest.raises(lw.SceneError, match=re.escape(message)):
        follow(slowing(10), measured(0), **more)
