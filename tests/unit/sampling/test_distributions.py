# SPDX-License-Identifier: Apache-2.0
"""Distributions and the uniform numbers that feed them.

Quantiles are compared with scipy.stats at given levels. Sampled moments are compared with the exact ones within
5 standard errors (a chance of 6e-7 for a right code, and the seeds are fixed: a failure means a changed law).
"""

import numpy as np
import pytest
from scipy import stats

import lgvi_warp as lw
from lgvi_warp.common.random import uniforms
from lgvi_warp.distributions import (
    Choice,
    CorrelatedNormal,
    LogNormal,
    Normal,
    PositiveDefinite,
    RotationNormal,
    ScipyDistribution,
    TruncatedNormal,
    Uniform,
)
from lgvi_warp.sampling.distributions.named import as_distribution, from_dict
from tests.support.refusals import refused

LEVELS = np.array([1e-12, 1e-6, 0.02, 0.3, 0.5, 0.77, 0.999, 1.0 - 1e-9])
N = 200_000
ERRORS = 5.0


# Uniform numbers ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("components", [1, 3, 4, 5, 9])
def test_uniforms_of_a_member_do_not_depend_on_the_run_asked_for(components):
    whole = uniforms(7, "vehicle.mass", 0, 1000, components)
    assert whole.shape == (1000, components)
    for first, count in ((0, 1), (1, 1), (3, 17), (511, 489), (999, 1)):
        np.testing.assert_array_equal(
            uniforms(7, "vehicle.mass", first, count, components), whole[first : first + count]
        )


def test_uniforms_of_far_members():
    far = 10**9
    np.testing.assert_array_equal(uniforms(1, "a", far, 5, 3)[4:], uniforms(1, "a", far + 4, 1, 3))


def test_uniforms_are_these_numbers():
    """The stream is a promise (same seed, same ensemble): these were drawn once, with numpy 2.4's Philox4x64-10."""
    expected = [[0.30032835230117977, 0.9112373408280774], [0.49574279561855944, 0.9612748147706509]]
    np.testing.assert_array_equal(uniforms(1, "vehicle.mass", 0, 2, 2), expected)


def test_uniforms_depend_on_seed_name_and_member():
    reference = uniforms(1, "vehicle.mass", 0, N, 1)[:, 0]
    others = {"seed": uniforms(2, "vehicle.mass", 0, N, 1)[:, 0],
              "large seed": uniforms(1 + 2**32, "vehicle.mass", 0, N, 1)[:, 0],
              "name": uniforms(1, "vehicle.buoyancy", 0, N, 1)[:, 0],
              "next member": uniforms(1, "vehicle.mass", 1, N, 1)[:, 0]}  # fmt: skip
    for what, other in others.items():
        # The correlation of independent samples has a standard error of 1/sqrt(N).
        assert abs(np.corrcoef(reference, other)[0, 1]) < ERRORS / np.sqrt(N), what
        assert not np.array_equal(reference, other), what


def test_uniforms_are_uniform_and_their_components_independent():
    u = uniforms(3, "x", 0, N, 3)
    assert u.min() > 0.0
    assert u.max() < 1.0
    grid = (np.arange(N) + 0.5) / N
    for component in u.T:
        # Kolmogorov: P(sqrt(N) D > 2.5) = 2 exp(-2 * 2.5^2) = 7e-6
        assert np.sqrt(N) * np.abs(np.sort(component) - grid).max() < 2.5
    correlation = np.corrcoef(u.T) - np.eye(3)
    assert np.abs(correlation).max() < ERRORS / np.sqrt(N)


# Quantiles ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law, exact", [
    (Normal(std=0.5), stats.norm(10.0, 0.5)), (Normal(relative=0.02), stats.norm(10.0, 0.2)),
    (Normal(mean=-1.0, std=2.0), stats.norm(-1.0, 2.0)), (Uniform(low=-1.0, high=3.0), stats.uniform(-1.0, 4.0)),
    (Uniform(half_width=2.0), stats.uniform(8.0, 4.0)), (Uniform(relative=0.1), stats.uniform(9.0, 2.0)),
    (LogNormal(sigma=0.3), stats.lognorm(0.3, scale=10.0)),
    (LogNormal(sigma=0.3, median=2.0), stats.lognorm(0.3, scale=2.0)),
    (TruncatedNormal(std=2.0), stats.truncnorm(-3.0, 3.0, 10.0, 2.0)),
    (TruncatedNormal(relative=0.2, width=1.5), stats.truncnorm(-1.5, 1.5, 10.0, 2.0)),
    (TruncatedNormal(std=2.0, low=9.0, high=13.0), stats.truncnorm(-0.5, 1.5, 10.0, 2.0)),
    (TruncatedNormal(std=2.0, low=9.0), stats.truncnorm(-0.5, np.inf, 10.0, 2.0)),
    (TruncatedNormal(std=2.0, high=9.0), stats.truncnorm(-np.inf, -0.5, 10.0, 2.0)),
    (TruncatedNormal(std=1.0, mean=0.0, low=12.0), stats.truncnorm(12.0, np.inf, 0.0, 1.0)),
    (TruncatedNormal(std=1.0, mean=0.0, high=-12.0), stats.truncnorm(-np.inf, -12.0, 0.0, 1.0)),
])  # fmt: skip
def test_quantiles(law, exact):
    # ndtri is good to some 1e-15 of its argument; its own condition at 1 - 1e-9 is 1e9 * 1e-16 * 0.2 = 2e-8.
    got = law.quantile(LEVELS, np.array(10.0))
    np.testing.assert_allclose(got, exact.ppf(LEVELS), rtol=2e-8)
    middle = slice(1, 6)
    np.testing.assert_allclose(got[middle], exact.ppf(LEVELS)[middle], rtol=1e-10)
    assert (np.diff(got) > 0.0).all()


@pytest.mark.parametrize("law, exact", [
    (Normal(std=0.5), stats.norm(10.0, 0.5)),
    (Uniform(half_width=2.0), stats.uniform(8.0, 4.0)),
    (LogNormal(sigma=0.3), stats.lognorm(0.3, scale=10.0)),
    (TruncatedNormal(std=2.0, low=9.0, high=13.0), stats.truncnorm(-0.5, 1.5, 10.0, 2.0)),
])  # fmt: skip
def test_sampled_moments(law, exact):
    x = law.quantile(uniforms(5, law.kind, 0, N, 1)[:, 0], np.array(10.0))
    mean, variance, excess = (float(moment) for moment in exact.stats(moments="mvk"))
    assert abs(x.mean() - mean) < ERRORS * np.sqrt(variance / N)
    # The sample variance has a variance of (kurtosis - 1) sigma^4 / N.
    assert abs(x.var() - variance) < ERRORS * variance * np.sqrt((excess + 2.0) / N)


def test_components_have_their_own_spread_about_their_own_value():
    base = np.array([0.3, 0.2, 0.0])
    u = np.tile(stats.norm.cdf([[1.0], [-2.0]]), 3)
    got = Normal(std=(0.03, 0.02, 0.01)).quantile(u, base)
    np.testing.assert_allclose(got, [[0.33, 0.22, 0.01], [0.24, 0.16, -0.02]], rtol=0, atol=1e-15)
    # A fraction of zero is zero; of a negative value it widens the same way.
    got = Normal(relative=0.1).quantile(u, np.array([1.0, -1.0, 0.0]))
    np.testing.assert_allclose(got, [[1.1, -0.9, 0.0], [0.8, -1.2, 0.0]], rtol=0, atol=1e-15)


def test_a_spread_of_zero_is_the_value_itself():
    u = np.array([0.01, 0.5, 0.9])
    for law in (Normal(std=0.0), Uniform(half_width=0.0), LogNormal(sigma=0.0), TruncatedNormal(std=0.0)):
        np.testing.assert_array_equal(law.quantile(u, np.array(10.0)), [10.0, 10.0, 10.0])


def test_truncated_values_stay_within_their_bounds():
    extremes = np.array([2.0**-54, 1.0 - 2.0**-53])
    got = TruncatedNormal(std=1.0, low=0.1, high=0.3).quantile(extremes, np.array(0.0))
    assert (got >= 0.1).all()
    assert (got <= 0.3).all()


@pytest.mark.parametrize("bound", [15.0, 19.9, 20.1, 37.0, 40.0, 200.0])
def test_far_tails_against_scipy(bound):
    u = np.array([0.01, 0.5, 0.99])
    for sign in (1.0, -1.0):
        limits = {"low": bound} if sign > 0.0 else {"high": -bound}
        got = TruncatedNormal(std=1.0, **limits).quantile(u if sign > 0.0 else 1.0 - u, np.array(0.0))
        # The tail beyond b falls like exp(-b z): scipy's truncnorm has the same to its own 1e-10 or so of the distance.
        exact = stats.truncnorm(bound, np.inf).ppf(u)
        np.testing.assert_allclose(sign * got - bound, exact - bound, rtol=1e-6, atol=0)
    both = TruncatedNormal(std=1.0, low=bound, high=bound + 0.5).quantile(u, np.array(0.0))
    assert (np.diff(both) > 0.0).all()
    assert both.min() > bound
    assert both.max() < bound + 0.5


def test_a_law_relative_to_nothing_is_refused(scene):
    for law in (Normal(relative=0.1), Uniform(relative=0.1), LogNormal(sigma=0.1)):
        with pytest.raises(lw.SceneError, match=r"0, so that its \w+ varies nothing. Give an absolute spread"):
            lw.Ensemble(scene, 4, vary={"vehicle.center_of_buoyancy[0]": law})
    lw.Ensemble(scene, 4, vary={"vehicle.center_of_buoyancy": Normal(relative=0.1)})  # one entry is not 0
    lw.Ensemble(scene, 4, vary={"vehicle.center_of_buoyancy[0]": Normal(relative=0.0)})
    lw.Ensemble(scene, 4, vary={"vehicle.center_of_buoyancy[0]": LogNormal(sigma=0.1, median=0.01)})


def test_tables_are_laws_in_code_too(scene):
    fleet = lw.Ensemble(scene, 4, 1, {"vehicle.mass": {"normal": {"relative": 0.01}}})
    assert fleet.vary == {"vehicle.mass": Normal(relative=0.01)}
    again = lw.Ensemble(scene, **fleet.to_dict())
    np.testing.assert_array_equal(again.parameters(0, 4)["vehicle.mass"], fleet.parameters(0, 4)["vehicle.mass"])
    with pytest.raises(lw.SceneError, match=r'vary."vehicle.mass".*Did you mean .normal.'):
        lw.Ensemble(scene, 4, 1, {"vehicle.mass": {"norml": {"relative": 0.01}}})


# What is refused ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind, values, key", [
    (Normal, {}, "width"),
    (Normal, {"std": -1.0}, "normal.std"),
    (Normal, {"std": (1.0, -1.0, 1.0)}, "normal.std"),
    (Normal, {"std": np.nan}, "normal.std"),
    (Normal, {"std": "wide"}, "normal.std"),
    (Normal, {"std": True}, "normal.std"),
    (Normal, {"std": 1.0, "relative": 0.1}, "normal.std and relative"),
    (Normal, {"std": 1.0, "mean": np.inf}, "normal.mean"),
    (Normal, {"relative": -0.1}, "normal.relative"),
    (Uniform, {"low": 1.0, "high": 1.0}, "uniform.low and high"),
    (Uniform, {"low": (0.0, 2.0), "high": (1.0, 1.0)}, "uniform.low and high"),
    (Uniform, {"low": (0.0, 2.0), "high": (1.0, 1.0, 1.0)}, "uniform.low and high"),
    (Uniform, {"high": 1.0}, "uniform.high"),
    (Uniform, {"half_width": 1.0, "low": 0.0}, "uniform.low"),
    (Uniform, {"half_width": -1.0}, "uniform.half_width"),
    (Uniform, {"half_width": 1.0, "relative": 0.1}, "uniform.half_width and relative"),
    (LogNormal, {}, "lognormal."),
    (LogNormal, {"sigma": -0.1}, "lognormal.sigma"),
    (TruncatedNormal, {"low": 0.0}, "truncated_normal."),
    (TruncatedNormal, {"std": 1.0, "low": 2.0, "high": 1.0}, "truncated_normal.low and high"),
    (TruncatedNormal, {"std": 1.0, "low": 2.0, "width": 1.0}, "truncated_normal.width"),
    (TruncatedNormal, {"std": 1.0, "width": -1.0}, "truncated_normal.width"),
    (CorrelatedNormal, {}, "nothing given"),
    (CorrelatedNormal, {"covariance": np.eye(2), "std": 1.0}, "covariance and std given"),
    (CorrelatedNormal, {"correlation": np.eye(2)}, "correlation given"),
    (CorrelatedNormal, {"covariance": [[1.0, 2.0], [2.0, 1.0]]}, "positive semidefinite"),
    (CorrelatedNormal, {"covariance": [[1.0, 0.5], [0.2, 1.0]]}, "not a symmetric matrix"),
    (CorrelatedNormal, {"covariance": [1.0, 2.0]}, "not a symmetric matrix"),
    (CorrelatedNormal, {"covariance": [[np.nan]]}, "not finite"),
    (CorrelatedNormal, {"covariance": "wide"}, "not numeric"),
    (CorrelatedNormal, {"std": (1.0, -1.0)}, "negative"),
    (CorrelatedNormal, {"std": (1.0, 1.0, 1.0), "correlation": np.eye(2)}, "does not fit 2"),
    (CorrelatedNormal, {"std": 1.0, "correlation": 2.0 * np.eye(2)}, "diagonal that is not 1"),
    # Metres beside newtons: the sizes of the entries say nothing about whether they can go together.
    (CorrelatedNormal, {"std": (1e-3, 1e3), "correlation": [[1.0, 1.2], [1.2, 1.0]]}, "positive semidefinite"),
    (CorrelatedNormal, {"covariance": [[1e-10, 50.0 * 1e-2], [50.0 * 1e-2, 1e6]]}, "positive semidefinite"),
    (CorrelatedNormal, {"covariance": [[0.0, 0.1], [0.1, 1.0]]}, "positive semidefinite"),
    (CorrelatedNormal, {"covariance": [[-1.0, 0.0], [0.0, 1.0]]}, "negative variance"),
    (RotationNormal, {}, "nothing given"),
    (RotationNormal, {"std": (0.1, 0.2)}, "does not fit 3"),
    (RotationNormal, {"covariance": np.eye(2)}, "not 3 x 3"),
    (RotationNormal, {"std": -0.1}, "negative"),
    (RotationNormal, {"std": np.inf}, "not finite"),
    (PositiveDefinite, {}, "width"),
    (PositiveDefinite, {"sigma": -0.1}, "negative"),
    (PositiveDefinite, {"sigma": 0.1, "off_diagonal": (0.1, 0.2)}, "not one number"),
    (Choice, {}, "not a list of values"),
    (Choice, {"values": ("a",)}, "not numeric"),
    (Choice, {"values": (1.0, 2.0), "weights": (1.0,)}, "weigh 2 values"),
    (Choice, {"values": (1.0, 2.0), "weights": (2.0, -1.0)}, "negative"),
    (ScipyDistribution, {"distribution": stats.gamma}, "not a frozen distribution"),
    (ScipyDistribution, {"distribution": stats.gamma(-1.0)}, "scipy.stats refuses"),
])  # fmt: skip
def test_bad_numbers(kind, values, key):
    message = refused(kind, **values)
    assert key in message
    assert "\n" not in message


def test_all_faults_of_a_law_come_at_once():
    message = refused(TruncatedNormal, std="no", relative=-1.0, mean=np.nan, low="a", high=1.0)
    for key in ("std and relative", "truncated_normal.std =", "relative = -1.0", "mean = nan", "low = 'a'"):
        assert key in message


@pytest.mark.parametrize("law", [
    Normal(std=[0.03, 0.02, 0.01]), Uniform(low=0.0, high=1.0),
    LogNormal(sigma=0.1),
    TruncatedNormal(relative=0.1, width=2.0),
])  # fmt: skip
def test_there_and_back(law):
    assert from_dict("key", law.to_dict()) == law
    assert list(law.to_dict()) == [law.kind]


@pytest.mark.parametrize("content, text", [
    (3.0, "is not a distribution"), ({}, "is not a distribution"),
    ({"normal": {"std": 1.0}, "uniform": {}}, "is not a distribution"),
    ({"gaussian": {"std": 1.0}}, "Known: normal, uniform"), ({"normal": 1.0}, "is not a table"),
    ({"normal": {"sd": 1.0}}, "Did you mean 'std'?"), ({"normal": {"std": -1.0}}, "negative"),
    ({"gamma": {"scale": 3.0}}, "key.gamma.a = None is missing"),
    ({"gamma": {"a": 1.0, "sale": 3.0}}, "Did you mean 'scale'"), ({"gamma": {"a": -1.0}}, "scipy.stats refuses"),
    ({"gamma": {"a": "x"}}, "not numeric"), ({"scipy": {"name": "gama"}}, "not a distribution of scipy.stats"),
    ({"scipy": {}}, "not a distribution of scipy.stats"), ({"scipy": 3}, "is not a table"),
    ({"gammma": {"a": 1.0}}, "Did you mean 'gamma'"),
    ({"histogram": {"counts": [0.0], "edges": [0.0, 1.0]}}, "weigh no bin"),
    ({"histogram": {"counts": [1.0], "edges": [0.0]}}, "bound 1"),
    ({"histogram": {"counts": [1.0, 1.0], "edges": [0.0, 1.0, 1.0]}}, "rising"),
])  # fmt: skip
def test_bad_tables_name_the_key(content, text):
    with pytest.raises(lw.SceneError, match="the key") as caught:
        from_dict("the key", content)
    assert text in str(caught.value)


@pytest.mark.parametrize("shift", [{"loc": 10.0}, 10.0])
def test_a_histogram_of_scipy_keeps_its_shift(shift):
    """A frozen histogram is taken with its parameters, by name or by place; without any it is one of ours."""
    edges = np.array([0.0, 1.0, 3.0])
    plain = stats.rv_histogram((np.array([1.0, 3.0]), edges), density=False)
    shifted = plain(**shift) if isinstance(shift, dict) else plain(shift)
    levels = np.linspace(0.05, 0.95, 10)
    for given in (plain, shifted):
        own = as_distribution("x", given)
        np.testing.assert_allclose(own.quantile(levels[:, None], np.zeros(1)).ravel(), given.ppf(levels), rtol=1e-12)
