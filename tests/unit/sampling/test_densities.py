# SPDX-License-Identifier: Apache-2.0
"""Kernel densities, copulas, derived numbers, distributions of OpenTURNS: SciPy, closed forms, and what is refused."""

import pickle

import numpy as np
import pytest
from scipy import stats
from scipy.special import ndtr, ndtri

import lgvi_warp as lw
from lgvi_warp.scene.scene import from_dict

D = lw.distributions
MASS, BUOYANCY = "vehicle.mass", "vehicle.buoyancy"


def scene(**others):
    vehicle = lw.Vehicle(120.0, inertia=(5.0, 10.0, 10.0), buoyancy=306.0)
    return lw.Scene(vehicle, start=lw.Start([0.0, 0.0, 0.0], velocity=[1.5, 0.0, 0.0]), **others)


def fleet_of(vary, members=4096, sampling="sobol", **others):
    return lw.Ensemble(scene(**others), members=members, seed=1, vary=vary, sampling=sampling)


@pytest.mark.parametrize("bandwidth", [None, 0.05])
def test_levels_of_a_density_are_those_of_scipy(bandwidth):
    """The level of the value at a level is that level; SciPy's kernel density has the same rule."""
    draws = np.concatenate([np.random.default_rng(1).normal(size=300), [25.0, 25.1]])
    law = D.KernelDensity(draws, bandwidth)
    kernel = stats.gaussian_kde(draws, None if bandwidth is None else bandwidth / draws.std(ddof=1))
    levels = np.concatenate([np.linspace(1e-4, 1.0 - 1e-4, 201), [1e-12, 1e-6, 1.0 - 1e-9]])
    levels = levels[np.abs(levels - 300.0 / 302.0) > 1e-3]  # between the two heaps the level stands still
    x = law.quantile(levels, np.array(0.0))
    found = np.array([kernel.integrate_box_1d(-np.inf, value) for value in x])
    # Cubic between 32 points a bandwidth: 1e-6 of the score; SciPy's upper levels have 1e-15 of 1.
    np.testing.assert_allclose(found, levels, rtol=2e-6, atol=1e-12)
    assert (np.diff(law.quantile(np.linspace(1e-9, 1.0 - 1e-9, 10_001), np.array(0.0))) > 0.0).all()


def test_the_density_of_two_draws_is_a_mean_of_two_normals():
    law = D.KernelDensity([0.0, 1.0], 0.5)
    x = law.quantile(np.array([0.1, 0.5, 0.99]), np.array(0.0))
    np.testing.assert_allclose(0.5 * (ndtr(x / 0.5) + ndtr((x - 1.0) / 0.5)), [0.1, 0.5, 0.99], rtol=1e-6)


def test_several_numbers_have_the_covariance_of_draws_and_kernels():
    """The covariance of a kernel density is that of the draws with weight 1 / n, and the kernels' beside."""
    rng = np.random.default_rng(2)
    draws = rng.multivariate_normal([120.0, 306.0], [[1.0, 0.6], [0.6, 1.0]], 500)
    members = fleet_of({f"{MASS}, {BUOYANCY}": D.KernelDensity(draws)}, 2**15).parameters(0, 2**15)
    x = np.stack([members[MASS], members[BUOYANCY]])
    kernel = stats.gaussian_kde(draws.T)
    wanted = np.cov(draws.T, bias=True) + kernel.covariance
    # 2^15 members of independent kind would have errors of some 0.01.
    np.testing.assert_allclose(np.cov(x), wanted, atol=0.02)
    np.testing.assert_allclose(x.mean(axis=1), draws.mean(axis=0), atol=0.02)


def test_a_copula_has_its_marginals_and_its_correlation():
    r = 2.0 * np.sin(np.pi * 0.7 / 6.0)
    marginals = {BUOYANCY: D.Uniform(low=300.0, high=312.0), MASS: stats.gamma(4.0, loc=100.0)}
    correlation = [[1.0, r], [r, 1.0]]
    for law in (D.Copula(correlation, marginals), D.Copula(correlation, list(marginals.values())[::-1])):
        drawn = fleet_of({f"{MASS}, {BUOYANCY}": law}).parameters(0, 4096)
        # Sobol points: the levels of 4,096 members are even to some 1e-3.
        assert stats.kstest(drawn[MASS], marginals[MASS].cdf).statistic < 0.005
        assert stats.kstest(drawn[BUOYANCY], stats.uniform(300.0, 12.0).cdf).statistic < 0.005
        assert stats.spearmanr(drawn[MASS], drawn[BUOYANCY]).statistic == pytest.approx(0.7, abs=0.01)


def test_a_copula_of_relative_marginals_is_about_the_scene():
    law = D.Copula([[1.0, 0.0], [0.0, 1.0]], [D.Normal(relative=0.01), D.Normal(std=0.1)])
    drawn = fleet_of({"start.velocity[0], start.position[2]": law}).select(0, 4096)
    assert drawn.velocity[:, 0].mean() == pytest.approx(1.5, abs=1e-3)
    assert drawn.velocity[:, 0].std() == pytest.approx(0.015, rel=0.02)
    with pytest.raises(lw.SceneError, match="is relative to the scene's value, 0"):
        fleet_of({"start.velocity[1], start.position[2]": law})


def test_one_factor_moves_many_entries():
    base = np.arange(1.0, 7.0)
    drag = lw.terms.Drag(linear=base, quadratic=10.0 * base)
    law = D.Derived({"drag.linear": lambda k: k * base, "drag.quadratic": lambda k, q: k * q * 10.0 * base},
                    k=D.Normal(std=0.1), q=D.Uniform(low=1.0, high=2.0))  # fmt: skip
    for key in ("drag.linear, drag.quadratic", "drag.quadratic, drag.linear"):
        fleet = lw.Ensemble(lw.Scene.named("sphere", terms=[drag]), members=512, vary={key: law}, sampling="sobol")
        drawn = fleet.parameters(0, 512)
        k = drawn["drag.linear"] / base
        np.testing.assert_allclose(k, k[:, :1] * np.ones(6), rtol=1e-14)
        assert k[:, 0].mean() == pytest.approx(1.0, abs=1e-3)
        q = drawn["drag.quadratic"] / (10.0 * base) / k
        assert q[:, 0].min() >= 1.0
        assert q[:, 0].max() <= 2.0
        assert fleet.space.dimensions == 2
        # Blocks and subsets have the same bits.
        np.testing.assert_array_equal(fleet.parameters(100, 110)["drag.linear"], drawn["drag.linear"][100:110])


class Gamma:
    """Stand-in for OpenTURNS' distributions of one number: levels in a list give a sample, a point for each."""

    def getDimension(self):
        return 1

    def getMarginal(self, i):
        return self

    def computeQuantile(self, levels, tail=False):
        if not isinstance(levels, list):
            return [float(stats.gamma(3.0).ppf(levels))]
        return [[float(value)] for value in stats.gamma(3.0).ppf(levels)]

    def __str__(self):
        return "Gamma(k = 3)"


class Pair(Gamma):
    """Two normal numbers of correlation 0.6, by levels one after the other."""

    def __init__(self, independent=False):
        self.independent = independent

    def getDimension(self):
        return 2

    def hasIndependentCopula(self):
        return self.independent

    def getMarginal(self, i):
        return Gamma()

    def computeSequentialConditionalQuantile(self, levels):
        a, b = ndtri(levels)
        return [120.0 + a, 306.0 + 0.6 * a + 0.8 * b]


def test_distributions_of_openturns_are_taken_as_they_are():
    drawn = fleet_of({MASS: Gamma()}, sampling="sobol").parameters(0, 4096)[MASS]
    assert stats.kstest(drawn, stats.gamma(3.0).cdf).statistic < 0.005
    both = fleet_of({f"{MASS}, {BUOYANCY}": Pair()}).parameters(0, 4096)
    assert np.corrcoef(both[MASS], both[BUOYANCY])[0, 1] == pytest.approx(0.6, abs=0.01)
    apart = fleet_of({f"{MASS}, {BUOYANCY}": Pair(independent=True)}).parameters(0, 4096)
    assert abs(np.corrcoef(apart[MASS], apart[BUOYANCY])[0, 1]) < 0.02
    assert stats.kstest(apart[BUOYANCY], stats.gamma(3.0).cdf).statistic < 0.005
    in_copula = D.Copula(np.eye(2), [Gamma(), D.Normal(std=1.0)])
    assert fleet_of({f"{MASS}, {BUOYANCY}": in_copula}).parameters(0, 8)[MASS].shape == (8,)
    assert "Gamma(k = 3)" in str(fleet_of({MASS: Gamma()}, 2, "random").to_dict())


@pytest.mark.parametrize(
    ("key", "law"),
    [
        (MASS, D.KernelDensity([120.0, 121.0, 123.0])),
        (f"{MASS}, {BUOYANCY}", D.KernelDensity(np.random.default_rng(3).normal(300.0, size=(20, 2)), [0.1, 0.2])),
        (f"{MASS}, {BUOYANCY}", D.Copula([[1, 0.5], [0.5, 1]], [stats.gamma(4.0, loc=100.0), D.Normal(std=1.0)])),
        (f"{MASS}, {BUOYANCY}", D.Copula([[1, 0.5], [0.5, 1]], {BUOYANCY: D.Normal(std=1.0), MASS: D.Normal(std=2.0)})),
    ],
)
def test_a_scene_file_holds_them(key, law):
    fleet = fleet_of({key: law}, 64, "random")
    content = fleet.scene.to_dict() | {"ensemble": fleet.to_dict()}
    again = lw.Ensemble.from_scene(from_dict(content))
    for name in (MASS, BUOYANCY):
        np.testing.assert_array_equal(again.parameters(0, 64)[name], fleet.parameters(0, 64)[name])
    np.testing.assert_array_equal(
        pickle.loads(pickle.dumps(fleet)).parameters(3, 9)[MASS], fleet.parameters(3, 9)[MASS]
    )


def test_a_scene_file_holds_no_functions():
    for table in ({"derived": {"k": {"normal": {"std": 0.1}}}}, {"openturns": {"law": "Gamma"}}):
        with pytest.raises(lw.SceneError, match=r"which a file does not hold. Give the ensemble again"):
            D.Normal
            from_dict(scene().to_dict() | {"ensemble": {"members": 2, "vary": {MASS: table}}})


@pytest.mark.parametrize(
    ("law", "text"),
    [
        (lambda: D.KernelDensity([1.0]), r"have shape \(1,\). Give"),
        (lambda: D.KernelDensity([1.0, 1.0]), "do not vary. Give a bandwidth"),
        (lambda: D.KernelDensity([1.0, 2.0], 0.0), "is not above 0"),
        (lambda: D.KernelDensity([1.0, np.nan]), "draws"),
        (lambda: D.Copula([[1, 2], [2, 1]], [D.Normal(std=1), D.Normal(std=1)]), "is not positive semidefinite"),
        (lambda: D.Copula(np.eye(3), [D.Normal(std=1), D.Normal(std=1)]), "does not fit 2 marginals"),
        (
            lambda: D.Copula(np.eye(2), [D.Normal(std=1), 3.0]),
            r"marginals.1 = 3.0 is not a distribution of a single number",
        ),
        (lambda: D.Copula(np.eye(1), []), "are no list of distributions"),
        (lambda: D.Derived({MASS: 3.0}, k=D.Normal(std=1)), "is not a function"),
        (lambda: D.Derived({MASS: lambda q: q}, k=D.Normal(std=1)), "is not a factor, of k"),
        (lambda: D.Derived({MASS: lambda k: k}), "factors = None are missing"),
    ],
)
def test_what_is_wrong_is_refused(law, text):
    with pytest.raises(lw.SceneError, match=text):
        law()


def test_what_does_not_fit_is_refused():
    two = D.KernelDensity(np.random.default_rng(0).normal(size=(9, 2)))
    with pytest.raises(lw.SceneError, match="has draws of 2 numbers, 1 are named"):
        fleet_of({MASS: two})
    with pytest.raises(lw.SceneError, match="draws one quantity, several are named"):
        fleet_of({f"{MASS}, {BUOYANCY}": D.KernelDensity([1.0, 2.0])})
    named = D.Copula(np.eye(2), {MASS: D.Normal(std=1), "vehicle.length": D.Normal(std=1)})
    with pytest.raises(lw.SceneError, match=r"are not of what varies, vehicle\.mass, vehicle\.buoyancy"):
        fleet_of({f"{MASS}, {BUOYANCY}": named})
    with pytest.raises(lw.SceneError, match=r"gave an array of shape \(4096, 2\)"):
        fleet_of({MASS: D.Derived({MASS: lambda k: np.ones((len(k), 2))}, k=D.Normal(std=1))})
