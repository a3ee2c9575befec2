# SPDX-License-Identifier: Apache-2.0
"""Noise of the rows of a prepared run: frozen by row, or by seed and indices; and a rare event by chains over it."""

import functools

import numpy as np
import pytest
from scipy import stats

import lgvi_warp as lw

pytestmark = pytest.mark.kernel

MASS, DRAG, STRENGTH, T, H = 10.0, 2.0, 1.0, 4.0, 0.1
BODY = lw.Vehicle(mass=MASS, inertia=(1.0, 1.0, 1.0), buoyancy=MASS * 9.80665)
NAMES = ["start.position[2]", "start.velocity[2]"]


@pytest.fixture(scope="module")
def noisy():
    """A neutral body with linear drag under white force and torque, in a random current, which holds a heading."""
    controller = lw.Controller(period=H, sensors=[lw.control.Sensor(of="heading", noise=0.1, name="compass")],
                               guidance=[lw.control.SetPoint(heading=0.5)],
                               laws=[lw.control.HeadingPID(kp=1.0, kd=1.0)])  # fmt: skip
    terms = [lw.terms.Drag(linear=(DRAG,) * 6), lw.terms.WrenchNoise(force=(0.0, 0.0, STRENGTH), torque=(0.1, 0.1, 0.1)),
             lw.terms.GaussMarkovCurrent(standard_deviation=(0.1,) * 3, time_constant=5.0),
             lw.terms.ControlWrench(limit=2.0)]  # fmt: skip
    return lw.Scene(BODY, terms=terms, controller=controller)


@pytest.mark.ci
def test_rows_have_the_noise_of_the_members_that_are_named(noisy):
    """All draws: of forces, of the current and of sensors. To the bit, in any order, twice the same, in one row or in many."""
    vary = {"start.velocity[2]": lw.distributions.Normal(mean=0.2, std=0.1)}
    settings = dict(method="psi_x", h=H, t1=1.0)
    run = lw.prepare(noisy, list(vary), of=["position", "euler[2]"], **settings)
    for seed in (0, 7, 2**40 + 1):
        fleet = lw.Ensemble(noisy, 300, seed, vary)
        truth = lw.solve(fleet, **settings)
        X = fleet.select(0, 300).velocity[:, 2:]
        for indices in (np.arange(300), np.arange(300)[::-1], np.array([3, 299, 3, 0]), np.array([17], np.uint8)):
            found = run(X[indices], seed=seed, indices=indices)
            np.testing.assert_array_equal(found[:, :3], truth.position[-1, indices])
        np.testing.assert_array_equal(run(X, seed=seed), run(X, seed=seed, indices=np.arange(300)))
        states = fleet.select(0, 300)
        by_state = run.states(states.position, states.attitude, states.velocity, states.angular_velocity, seed=seed)
        np.testing.assert_array_equal(by_state[:, :3], truth.position[-1])
    np.testing.assert_array_equal(run(X[:4]), run(X[:4], seed=0, indices=[0, 1, 2, 3]))
    assert (run(X[:4], indices=[4, 5, 6, 7]) != run(X[:4])).any(axis=1).all()
    assert (run(X[:4], seed=1) != run(X[:4])).any(axis=1).all()


@pytest.mark.ci
def test_a_seed_beside_levels_is_that_of_the_noise_alone():
    quiet = lw.Scene(BODY, terms=[lw.terms.Drag(linear=(DRAG,) * 6)])
    run = lw.prepare(
        quiet, {NAMES[1]: lw.distributions.Normal(std=1.0)}, of="depth", levels=True, method="psi_x", h=H, t1=T
    )
    X = np.linspace(0.1, 0.9, 5)[:, None]
    np.testing.assert_array_equal(run(X), run(X, seed=9, indices=[5, 6, 7, 8, 2]))


@pytest.mark.ci
def test_common_noise_is_that_of_member_0_of_the_seed(prepared):
    common = lw.prepare(scene(), NAMES, of="position[2]", common_noise=True, method="psi_x", h=H, t1=T)
    X = np.zeros((5, 2))
    np.testing.assert_array_equal(common(X, seed=4), prepared(X, seed=4, indices=np.zeros(5, int)))
    with pytest.raises(lw.SceneError, match=r"indices = .*common_noise=True"):
        common(X, indices=np.arange(5))


@pytest.mark.parametrize(("more", "words"), [
    ({"indices": [0, 1]}, r"indices = .*Give an array of shape \(3,\)"), ({"indices": [0.0, 1.0, 2.0]}, "indices = "),
    ({"indices": [-1, 0, 1]}, "indices = .*from 0"), ({"indices": [0, 1, 2**31]}, "indices = .*below 2147483648"),
    ({"indices": "abc"}, "indices = "), ({"seed": -1}, "seed = "), ({"seed": 1.5}, "seed = "), ({"members": 3}, "members = 3"),
    ({"X": None, "indices": [0, 1, 2]}, "indices = .*there is no X"),
])  # fmt: skip
def test_noise_that_is_asked_for_wrongly_is_refused(prepared, more, words):
    with pytest.raises(lw.SceneError, match=words):
        prepared(**{"X": np.zeros((3, 2)), **more})


@pytest.mark.ci
def test_a_model_for_other_libraries_takes_them_too(prepared):
    f = lw.uq.model(scene(), NAMES, "position[2]", method="psi_x", h=H, t1=T)
    X, noise = np.zeros((3, 2)), dict(seed=5, indices=[4, 4, 1])
    expected = prepared(X, **noise)
    np.testing.assert_array_equal(f(X, **noise), expected)
    np.testing.assert_array_equal(f.scipy(X.T, **noise), expected)
    assert expected[0] == expected[1] != expected[2]


# A rare event by chains ---------------------------------------------------------------------------------------------------


def scene():
    """A neutral body with linear drag under white force: an Ornstein-Uhlenbeck velocity, and a depth that is normal."""
    return lw.Scene(BODY, terms=[lw.terms.Drag(linear=(DRAG,) * 6), lw.terms.WrenchNoise(force=(0.0, 0.0, STRENGTH))])


# Variance of the depth at T by the force, by the stochastic integral over (1 - e^(-a (T - s))) / a; and of the start, four
# times it, half by its depth and half by its velocity.
A = DRAG / MASS
REACH = (1.0 - np.exp(-A * T)) / A
BY_FORCE = (STRENGTH / DRAG) ** 2 * (T - 2.0 * REACH + (1.0 - np.exp(-2.0 * A * T)) / (2.0 * A))
STD = np.sqrt(2.0 * BY_FORCE) * np.array([1.0, 1.0 / REACH])
RARE = 1e-5
LEVEL = np.sqrt(5.0 * BY_FORCE) * stats.norm.isf(RARE)

# Chains that are run beside one another, members of a level, and those of them that are kept.
RUNS, N, KEPT = 8, 1000, 100


@pytest.fixture(scope="module")
def prepared():
    return lw.prepare(scene(), NAMES, of="position[2]", method="psi_x", h=H, t1=T)


def subset_simulation(depth, seed, keyed):
    """Eight independent estimates of P(depth > LEVEL), by levels of which each holds a tenth of the one before.

    depth(u, index): depths of normals u (..., 2) under the noise of these indices. A step moves u and keeps the index, then
    takes an index that no row had and keeps u; not `keyed`, it moves u alone.
    """
    rng, fresh = np.random.default_rng(seed), iter(range(10_000))

    def new(shape):
        return next(fresh) * RUNS * N + np.arange(np.prod(shape)).reshape(shape)

    def member(values, chosen):
        return np.take_along_axis(values, chosen.reshape(chosen.shape + (1,) * (values.ndim - 2)), 1)

    u, k = rng.normal(size=(RUNS, N, 2)), new((RUNS, N))
    y, p, found = depth(u, k), np.ones(RUNS), np.full(RUNS, np.nan)
    while True:
        u, k, y = (member(values, np.argsort(-y, axis=1)) for values in (u, k, y))
        bound = (y[:, KEPT - 1] + y[:, KEPT]) / 2.0
        reached = np.isnan(found) & (bound >= LEVEL)
        found[reached] = (p * (y >= LEVEL).mean(axis=1))[reached]
        if np.isfinite(found).all() or p.min() < 1e-9:
            return found
        p, bound = p * KEPT / N, np.minimum(bound, LEVEL)[:, None]
        chain = [(u[:, :KEPT], k[:, :KEPT], y[:, :KEPT])]
        for _ in range(N // KEPT - 1):
            u, k, y = chain[-1]
            moved = 0.8 * u + 0.6 * rng.normal(size=u.shape)
            there = depth(moved, k)
            u, y = np.where((there >= bound)[..., None], moved, u), np.where(there >= bound, there, y)
            if keyed:
                other = new(k.shape)
                there = depth(u, other)
                k, y = np.where(there >= bound, other, k), np.where(there >= bound, there, y)
            chain.append((u, k, y))
        u, k, y = (np.concatenate(values, axis=1) for values in zip(*chain, strict=True))


def within(answer):
    """Whether the 95 % interval of the mean logarithm of independent estimates holds the truth, and that logarithm's estimate.

    Logarithms of estimates spread by 0.4: their mean is low by half the variance, 0.08, of a half width of 0.3.
    """
    logs = np.log(answer)
    half = stats.t.ppf(0.975, len(logs) - 1) * logs.std(ddof=1) / np.sqrt(len(logs))
    return abs(logs.mean() - np.log(RARE)) <= half, logs.mean()


def keyed(run, seed):
    return subset_simulation(functools.partial(by_index, run, seed), seed, True)


def by_index(run, seed, u, index):
    return run((u * STD).reshape(-1, 2), seed=seed, indices=index.ravel()).reshape(index.shape)


def by_row(run, u, index):
    return run((u * STD).reshape(-1, 2)).reshape(index.shape)


@pytest.mark.ci
def test_the_depth_is_the_normal_one(prepared):
    """Its variance, from 40,000 members: the error of that of normals is sqrt(2 / 40,000), 0.7 %."""
    u = np.random.default_rng(0).normal(size=(40_000, 2))
    y = by_index(prepared, 3, u, np.arange(40_000))
    assert y.var() == pytest.approx(5.0 * BY_FORCE, rel=4 * 0.0071)
    by_noise = y - u @ (STD * [1.0, REACH])
    assert by_noise.var() == pytest.approx(BY_FORCE, rel=4 * 0.0071)
    assert stats.kstest(y / np.sqrt(5.0 * BY_FORCE), "norm").pvalue > 1e-3


@pytest.mark.ci
def test_a_chain_finds_a_rare_event_by_indices_and_not_by_rows(prepared):
    held, value = within(keyed(prepared, 0))
    assert held
    assert abs(value - np.log(RARE)) < 0.5
    # The same few hundred noises for ever: below the truth by far more than a chain's own spread.
    frozen = subset_simulation(functools.partial(by_row, prepared), 0, False)
    assert not np.log(frozen).mean() > np.log(RARE) - 0.8


@pytest.mark.slow
def test_intervals_of_chains_hold_a_rare_event_in_19_of_20(prepared):
    assert sum(within(keyed(prepared, seed))[0] for seed in range(20)) >= 19
