# SPDX-License-Identifier: Apache-2.0
"""Laws of whole quantities and those of scipy: moments against theory, matrices that stay physical, what is refused.

Sampled moments are within 5 standard errors of the exact ones (6e-7 for a right code; seeds are fixed).
"""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import stats

import lgvi_warp as lw
from lgvi_warp.common.random import uniforms, uniforms_of
from lgvi_warp.physics import notation
from lgvi_warp.sampling.distributions import joint as joint_laws
from lgvi_warp.sampling.distributions.named import from_dict
from tests.support.refusals import refused, says

N = 100_000
ERRORS = 5.0
COVARIANCE = np.array([[4.0, 1.2, -0.5], [1.2, 1.0, 0.3], [-0.5, 0.3, 2.0]])


def drawn(law, *bases, count=N, seed=5):
    bases = [np.asarray(base, dtype=float) for base in bases]
    return law.draw(uniforms(seed, "x", 0, count, law.size(bases)), bases)


def log(R):
    """Rotation vectors of (n, 3, 3)."""
    q = notation.quaternion_from_matrix(R)
    v, sine = q[:, 1:], np.linalg.norm(q[:, 1:], axis=1)
    return v * (2.0 * np.arctan2(sine, q[:, 0]) / np.where(sine > 0.0, sine, 1.0))[:, None]


def assert_covariance(x, mean, covariance):
    """Moments of normal numbers x (n, d), within 5 standard errors: of a covariance sqrt((S_ii S_jj + S_ij^2) / n)."""
    n, variance = len(x), np.diag(covariance)
    assert (np.abs(x.mean(axis=0) - mean) <= ERRORS * np.sqrt(variance / n)).all()
    errors = np.sqrt((np.outer(variance, variance) + covariance**2) / n)
    assert (np.abs(np.cov(x.T) - covariance) <= ERRORS * errors + 1e-15).all()


# Uniform numbers of scattered members --------------------------------------------------------------------------------


def test_uniforms_of_scattered_members():
    whole = uniforms(7, "a", 0, 5000, 5)
    for members in ([3], [0, 1, 2], [4000, 7, 8, 9, 70, 4999, 7], list(range(4999, -1, -37))):
        np.testing.assert_array_equal(uniforms_of(7, "a", np.array(members), 5), whole[members])


# Correlated normals --------------------------------------------------------------------------------------------------


def test_correlated_normals_have_their_covariance():
    a, b = drawn(lw.distributions.CorrelatedNormal(covariance=COVARIANCE), 10.0, [1.0, -2.0])
    assert a.shape == (N,)
    assert b.shape == (N, 2)
    assert_covariance(np.column_stack([a, b]), [10.0, 1.0, -2.0], COVARIANCE)


def test_correlation_and_deviations():
    std = np.sqrt(np.diag(COVARIANCE))
    correlation = COVARIANCE / np.outer(std, std)
    (x,) = drawn(lw.distributions.CorrelatedNormal(std=std, correlation=correlation, mean=(0.0, 1.0, 2.0)), np.zeros(3))
    assert_covariance(x, [0.0, 1.0, 2.0], COVARIANCE)
    (x,) = drawn(lw.distributions.CorrelatedNormal(std=0.5), np.zeros(3))
    assert_covariance(x, np.zeros(3), 0.25 * np.eye(3))


def test_a_singular_covariance_keeps_what_it_says():
    (x,) = drawn(
        lw.distributions.CorrelatedNormal(covariance=[[1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 0.0]]),
        [1.0, 2.0, 3.0],
    )
    # The root of a matrix with eigenvalues of round-off, 1e-16 of 5, is good to the square root of that.
    np.testing.assert_allclose(x[:, 1], 2.0 * x[:, 0], rtol=0, atol=1e-7)
    np.testing.assert_allclose(x[:, 2], 3.0, rtol=0, atol=1e-7)


def test_all_faults_of_a_covariance_come_at_once():
    message = refused(lw.distributions.CorrelatedNormal, covariance="wide", mean=np.nan)
    says(message, "covariance = 'wide'", "mean = nan")


def test_a_singular_covariance_of_six_digits():
    S = np.array([[0.333333, 0.471405], [0.471405, 0.666667]])
    (x,) = drawn(lw.distributions.CorrelatedNormal(covariance=S.tolist()), [0.0, 0.0])
    # The eigenvalue -1.1e-6 of the correlation is taken for 0: the spread changes by as much.
    assert_covariance(x, 0.0, S)
    np.testing.assert_allclose(x[:, 1], np.sqrt(2.0) * x[:, 0], rtol=0, atol=5e-3)


def test_entries_of_any_sizes_have_their_covariance():
    S = np.outer((1e-6, 1e3, 1.0), (1e-6, 1e3, 1.0)) * [[1.0, 0.9, 0.0], [0.9, 1.0, -0.3], [0.0, -0.3, 1.0]]
    (x,) = drawn(lw.distributions.CorrelatedNormal(covariance=S.tolist()), np.zeros(3))
    scale = 1.0 / np.array((1e-6, 1e3, 1.0))
    assert_covariance(x * scale, 0.0, S * np.outer(scale, scale))


# Attitudes -----------------------------------------------------------------------------------------------------------

R0 = notation.matrix_from_rotation_vector(np.array([0.4, -0.7, 1.2]))


@pytest.mark.parametrize("law", [
    lw.distributions.RotationNormal(std=(0.3, 0.1, 0.2)),
    lw.distributions.RotationNormal(covariance=0.02 * COVARIANCE),
])  # fmt: skip
def test_turns_about_the_body_have_their_covariance(law):
    (R,) = drawn(law, R0)
    covariance = np.diag(np.square(law.std)) if law.std else 0.02 * COVARIANCE
    # The largest deviation is 0.3 rad: a turn past pi, where log comes back on the other side, has a chance below 1e-24.
    assert_covariance(log(R0.T @ R), np.zeros(3), covariance)
    np.testing.assert_allclose(np.swapaxes(R, 1, 2) @ R, np.broadcast_to(np.eye(3), R.shape), rtol=0, atol=2e-15)


def test_the_mean_matrix_of_an_isotropic_law():
    """E exp(hat(v)) = (1 + 2 E cos|v|) / 3 I, and E cos|v| = (1 - s^2) exp(-s^2/2) for v ~ N(0, s^2 I): its characteristic
    function in the radius of three normal numbers."""
    s = 0.8
    (R,) = drawn(lw.distributions.RotationNormal(std=s), np.eye(3))
    expected = (1.0 + 2.0 * (1.0 - s**2) * np.exp(-0.5 * s**2)) / 3.0
    # Entries are within -1 and 1: a standard deviation of at most 1.
    np.testing.assert_allclose(R.mean(axis=0), expected * np.eye(3), rtol=0, atol=ERRORS / np.sqrt(N))


def test_uniform_attitudes_are_haars():
    (R,) = drawn(lw.distributions.UniformRotation(), R0)
    # Of Haar's measure: E R = 0, E R_ij R_kl = delta / 3, and each entry is uniform in (-1, 1) (Archimedes).
    flat = R.reshape(N, 9)
    assert np.abs(flat.mean(axis=0)).max() < ERRORS * np.sqrt(1.0 / 3.0 / N)
    second = flat.T @ flat / N
    # Var R_ij^2 = 1/5 - 1/9 = 4/45; products of others vary less than 1/5.
    assert np.abs(second - np.eye(9) / 3.0).max() < ERRORS * np.sqrt(0.2 / N)
    for entry in flat.T[:9:4]:
        assert stats.kstest(entry, stats.uniform(-1.0, 2.0).cdf).statistic * np.sqrt(N) < 2.5
    # The turn's angle has the density (1 - cos a) / pi.
    angle = np.linalg.norm(log(R), axis=1)
    assert stats.kstest(angle, lambda a: (a - np.sin(a)) / np.pi).statistic * np.sqrt(N) < 2.5


# Matrices that stay physical -----------------------------------------------------------------------------------------

positive = st.floats(1e-3, 1e3)
spreads = st.floats(0.0, 2.0)
turns = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


def turned(values, turn):
    Q = notation.matrix_from_rotation_vector(np.array(turn))
    return Q @ np.diag(values) @ Q.T


@settings(deadline=None, max_examples=60)
@given(st.tuples(positive, positive, positive), turns, spreads, st.floats(0.0, 1.0), st.integers(0, 2**31))
def test_inertias_stay_those_of_rigid_bodies(moments, turn, sigma, off, seed):
    S = turned(moments, turn)
    J = np.trace(S) * np.eye(3) - S
    law = lw.distributions.PhysicalInertia(sigma=sigma, off_diagonal=off)
    if law.unusable(J) is not None:
        assume(False)  # so flat that round-off decides
    (drawn_J,) = drawn(law, J, count=50, seed=seed)
    small, middle, large = np.linalg.eigvalsh(drawn_J).T
    assert (small > 0.0).all()
    # eigvalsh is good to some 1e-15 of the largest.
    assert (small + middle >= large * (1.0 - 1e-14)).all()


@settings(deadline=None, max_examples=60)
@given(st.lists(positive, min_size=6, max_size=6), spreads, st.floats(0.0, 1.0), st.integers(0, 2**31))
def test_positive_matrices_stay_positive(values, sigma, off, seed):
    (A,) = drawn(lw.distributions.PositiveDefinite(sigma=sigma, off_diagonal=off), np.diag(values), count=20, seed=seed)
    np.testing.assert_array_equal(A, np.swapaxes(A, 1, 2))
    scale = np.sqrt(np.einsum("nii->ni", A))
    # Scaled to a diagonal of 1, a positive definite matrix has positive eigenvalues; round-off is some 1e-15.
    assert (np.linalg.eigvalsh(A / scale[:, :, None] / scale[:, None, :])[:, 0] > -1e-14).all()


def test_the_second_moments_are_lognormal():
    J = np.diag([5.46, 5.29, 5.72])
    (found,) = drawn(lw.distributions.PhysicalInertia(sigma=0.2), J)
    S = joint_laws.second_moments(found)
    logs = np.log(np.einsum("nii->ni", S) / np.diag(joint_laws.second_moments(J)))
    assert_covariance(logs, np.zeros(3), 0.04 * np.eye(3))
    assert not S[:, ~np.eye(3, dtype=bool)].any()


def test_what_is_zero_stays_zero():
    (A,) = drawn(lw.distributions.PositiveDefinite(sigma=0.5, off_diagonal=0.3), np.diag([65.0, 0.0, 75.0]), count=20)
    np.testing.assert_allclose(A[:, 1], 0.0, rtol=0, atol=1e-12)
    assert len(np.unique(A[:, 0, 0])) == 20
    (A,) = drawn(lw.distributions.PositiveDefinite(sigma=0.5), np.zeros((3, 3)), count=20)
    assert not A.any()


def test_a_rigid_body_of_six_dimensions_keeps_its_centre():
    m, r = 31.9, np.array([0.01, -0.02, 0.0196])
    J = turned([0.177, 3.45, 3.46], (0.1, 0.02, -0.03))
    H = notation_hat(r)
    base = np.block([[m * np.eye(3), -m * H], [m * H, J - m * H @ H]])
    law = lw.distributions.PhysicalInertia(sigma=0.1, off_diagonal=0.05, mass_sigma=0.02)
    (found,) = drawn(law, base, count=200)
    masses = found[:, 0, 0]
    assert len(np.unique(masses)) == 200
    np.testing.assert_allclose(found[:, :3, :3], masses[:, None, None] * np.eye(3), rtol=0, atol=1e-14 * m)
    np.testing.assert_allclose(found[:, :3, 3:], -masses[:, None, None] * H, rtol=1e-14)
    np.testing.assert_array_equal(found[:, 3:, :3], np.swapaxes(found[:, :3, 3:], 1, 2))
    about = found[:, 3:, 3:] + masses[:, None, None] * (H @ H)
    small, middle, large = np.linalg.eigvalsh(about).T
    assert (small > 0.0).all()
    assert (small + middle > large).all()


def notation_hat(r):
    from lgvi_warp.physics.notation import hat

    return hat(r)


def test_matrix_laws_that_do_not_fit(scene):
    def found(name, law, **changes):
        import dataclasses

        other = dataclasses.replace(scene, vehicle=dataclasses.replace(scene.vehicle, **changes))
        with pytest.raises(lw.SceneError) as caught:
            lw.Ensemble(other, 2, 0, {name: law})
        return str(caught.value)

    assert "no rigid body has" in found(
        "vehicle.inertia", lw.distributions.PhysicalInertia(sigma=0.1), inertia=(1.0, 1.0, 3.0)
    )
    assert "not positive in the scene" in found(
        "vehicle.added_mass", lw.distributions.PositiveDefinite(sigma=0.1), added_mass=(-10.0, 5.0, 5.0)
    )
    assert "rigid body's inertia" in found("vehicle.added_mass", lw.distributions.PhysicalInertia(sigma=0.1))
    assert "mass_sigma" in found("vehicle.inertia", lw.distributions.PhysicalInertia(sigma=0.1, mass_sigma=0.1))


# scipy's laws and choices --------------------------------------------------------------------------------------------

FROZEN = {
    "beta": (stats.beta(2.0, 3.0, loc=1.0, scale=4.0), {"a": 2.0, "b": 3.0, "loc": 1.0, "scale": 4.0}),
    "exponential": (stats.expon(scale=2.0), {"scale": 2.0}),
    "gamma": (stats.gamma(2.0, scale=3.0), {"a": 2.0, "scale": 3.0}),
    "gumbel": (stats.gumbel_r(loc=1.0, scale=0.5), {"loc": 1.0, "scale": 0.5}),
    "student_t": (stats.t(5.0, 1.0, 2.0), {"df": 5.0, "loc": 1.0, "scale": 2.0}),
    "triangular": (stats.triang(0.3, scale=2.0), {"c": 0.3, "scale": 2.0}),
    "weibull": (stats.weibull_min(1.5, scale=2.0), {"c": 1.5, "scale": 2.0}),
}


@pytest.mark.parametrize("kind", FROZEN)
def test_laws_of_scipy_by_name(kind):
    exact, values = FROZEN[kind]
    law = from_dict("key", {kind: values})
    assert law == lw.distributions.ScipyDistribution(exact)
    assert law.to_dict() == {kind: values}
    u = uniforms(5, kind, 0, 20_000, 1)[:, 0]
    x = law.quantile(u, np.array(10.0))
    np.testing.assert_array_equal(x, exact.ppf(u))
    assert stats.kstest(x, exact.cdf).statistic * np.sqrt(len(x)) < 2.5


def test_any_law_of_scipy():
    for law, content in (
        (stats.johnsonsu(1.0, 2.0, loc=3.0), {"name": "johnsonsu", "a": 1.0, "b": 2.0, "loc": 3.0}),
        (stats.binom(5, 0.3), {"name": "binom", "n": 5, "p": 0.3}),
        (stats.norm([1.0, 2.0, 3.0], 0.1), {"name": "norm", "loc": [1.0, 2.0, 3.0], "scale": 0.1}),
    ):
        mine = lw.distributions.ScipyDistribution(law)
        assert mine.to_dict() == {"scipy": content}
        assert from_dict("key", mine.to_dict()) == mine


class Triangle:
    """A law of a user's."""

    def ppf(self, u):
        return np.sqrt(u)

    def __str__(self):
        return "Triangle()"


def test_whatever_has_quantiles_is_a_law(scene):
    u = np.array([[0.25], [0.81]])
    for law in (
        Triangle(),
        stats.Normal(mu=3.0, sigma=0.1),
        stats.Mixture([stats.Normal(mu=20.0), stats.Normal(mu=29.0)]),
    ):
        found = lw.Ensemble(scene, 4, vary={"vehicle.buoyancy": law}).vary["vehicle.buoyancy"]
        exact = law.ppf(u) if isinstance(law, Triangle) else law.icdf(u)
        np.testing.assert_array_equal(found.quantile(u, np.array([7.0])), exact)
    fleet = lw.Ensemble(scene, 4, vary={"vehicle.buoyancy": Triangle()})
    assert fleet.to_dict()["vary"] == {"vehicle.buoyancy": {"own": {"law": "Triangle()"}}}
    with pytest.raises(
        lw.SceneError, match=r"distribution of your own, which a file does not hold. Give the ensemble again"
    ):
        from_dict("key", {"own": {"law": "Triangle()"}})
    for nothing in (3.0, "wide", Triangle, np.ones(3)):
        with pytest.raises(lw.SceneError, match=r"is not a distribution. Give"):
            lw.Ensemble(scene, 4, vary={"vehicle.buoyancy": nothing})
    with pytest.raises(lw.SceneError, match=r"distribution = .* gives no numbers"):
        lw.Ensemble(scene, 4, vary={"vehicle.buoyancy": type("Bad", (), {"ppf": lambda self, u: "x"})()})


def test_histograms_are_laws_in_files_too(scene):
    counts, edges = [1.0, 0.0, 3.0], [0.0, 1.0, 2.0, 2.5]
    law = from_dict("key", {"histogram": {"counts": counts, "edges": edges}})
    np.testing.assert_allclose(law.quantile(np.array([0.125, 0.25 + 1e-12, 0.625]), np.zeros(())), [0.5, 2.0, 2.25])
    for density in (False, True):
        mine = stats.rv_histogram((np.array(counts), np.array(edges)), density=density)
        for one in (mine, mine()):
            found = lw.Ensemble(scene, 4, vary={"vehicle.buoyancy": one}).vary["vehicle.buoyancy"]
            u = np.linspace(0.01, 0.99, 50)
            np.testing.assert_allclose(found.quantile(u, np.zeros(())), mine.ppf(u), rtol=1e-12)
            assert from_dict("key", found.to_dict()).to_dict() == found.to_dict()


def test_scipys_multivariate_normal_is_correlated_normals(scene):
    law = stats.multivariate_normal([100.0, 200.0], [[1.0, 0.5], [0.5, 2.0]])
    found = lw.Ensemble(scene, 4, vary={"vehicle.mass, vehicle.buoyancy": law}).vary
    expected = lw.distributions.CorrelatedNormal(covariance=[[1.0, 0.5], [0.5, 2.0]], mean=[100.0, 200.0])
    assert found == {"vehicle.mass, vehicle.buoyancy": expected}


def test_choices_come_as_often_as_they_weigh():
    law = lw.distributions.Choice(values=(1.0, -2.0, 5.0), weights=(1.0, 2.0, 5.0))
    x = law.quantile(uniforms(1, "x", 0, N, 2), np.zeros(2))
    for value, chance in zip((1.0, -2.0, 5.0), (0.125, 0.25, 0.625)):
        share = (x == value).mean(axis=0)
        assert (np.abs(share - chance) < ERRORS * np.sqrt(chance * (1.0 - chance) / N)).all()
    assert set(x.ravel()) == {1.0, -2.0, 5.0}
    assert (x[:, 0] != x[:, 1]).any()
    whole = lw.distributions.Choice(values=[[1.0, 2.0], [3.0, 4.0]])
    assert whole.joint
    assert set(map(tuple, whole.draw(uniforms(1, "x", 0, 100, 1), [np.zeros(2)])[0])) == {(1.0, 2.0), (3.0, 4.0)}


@pytest.mark.parametrize("law", [
    lw.distributions.Choice(values=[1.0, 2.0], weights=[1.0, 3.0]),
    lw.distributions.CorrelatedNormal(std=[1.0, 2.0], correlation=[[1.0, 0.5], [0.5, 1.0]]),
    lw.distributions.RotationNormal(std=[0.1, 0.2, 0.3]),
    lw.distributions.UniformRotation(), lw.distributions.PositiveDefinite(sigma=0.1, off_diagonal=0.2),
    lw.distributions.PhysicalInertia(sigma=0.1, mass_sigma=0.01),
])  # fmt: skip
def test_there_and_back(law):
    assert from_dict("key", law.to_dict()) == law
    assert list(law.to_dict()) == [law.kind]
