# SPDX-License-Identifier: Apache-2.0
"""Sensitivity: known indices of known functions through the whole machinery, and what happens to members that fail.

All scenes run the paper's kernel with every field kept, which other tests compile as well. An estimate is to lie within 5
standard errors of the exact index, where the reported half interval is 1.96 of them (a chance of 6e-7; seeds are fixed).
"""

import csv
import dataclasses
import json

import numpy as np
import pytest
from scipy import stats

import lgvi_warp as lw
from lgvi_warp import cli, uq
from lgvi_warp.distributions import Normal, RotationNormal, Uniform, UniformRotation
from lgvi_warp.results import quantities
from lgvi_warp.scene.settings import RunSettings
from tests.conftest import ROOT
from tests.support.refusals import refused, says

FIVE = 5.0 / 1.96
RUN = {"h": 0.01, "t1": 0.02, "save": lw.SaveAt()}
PI = np.pi
BOX = {f"start.position[{i}]": Uniform(low=-PI, high=PI) for i in range(3)}


def ishigami(result):
    """Ishigami & Homma (1990) of the start's position: sin x + 7 sin^2 y + 0.1 z^4 sin x."""
    x, y, z = np.moveaxis(result.position[0], -1, 0)
    return np.sin(x) + 7.0 * np.sin(y) ** 2 + 0.1 * z**4 * np.sin(x)


# Parts of the variance a^2/8 + b pi^4/5 + b^2 pi^8/18 + 1/2 with a = 7, b = 0.1.
V1, V2, V13 = 0.5 * (1.0 + 0.1 * PI**4 / 5.0) ** 2, 49.0 / 8.0, 0.01 * PI**8 * (1.0 / 18.0 - 1.0 / 50.0)
V = V1 + V2 + V13
FIRST, TOTAL = np.array([V1, V2, 0.0]) / V, np.array([V1 + V13, V2, V13]) / V


@pytest.fixture(scope="module")
def answer(scene):
    return uq.sobol(scene, [ishigami, "position[1]"], samples=2048, vary=BOX, seed=3, **RUN)


@pytest.mark.ci
def test_what_a_scene_keeps_of_its_own_runs_is_no_matter(scene, answer):
    own = {"keep": "none", "statistics": [{"type": "mean", "of": "depth"}],
           "until": {"statistic": "mean depth", "half_width": 1e9}}  # fmt: skip
    told = scene.to_dict()
    other = lw.Scene.from_dict(told | {"run": told.get("run", {}) | own})
    again = uq.sobol(other, [ishigami, "position[1]"], samples=2048, vary=BOX, seed=3, **RUN)
    assert again.members == answer.members
    assert np.array_equal(again.first, answer.first)
    X = np.random.default_rng(0).uniform(-PI, PI, (1500, 3))
    np.testing.assert_array_equal(*(uq.model(one, BOX, "position[1]", **RUN)(X) for one in (scene, other)))
    # A run may leave them out as well.
    whole = lw.solve(lw.Ensemble(other, 2000), keep="all", statistics=(), until=False, **RUN)
    assert whole.position.shape[1] == 2000
    assert not whole.statistics


def assert_close(values, errors, exact):
    assert (np.abs(values - exact) <= FIVE * errors + 1e-12).all(), (values, errors, exact)


def test_indices_of_ishigamis_function(answer):
    assert answer.factors == tuple(BOX)
    assert answer.quantities == ("ishigami", "position[1]")
    assert (answer.samples, answer.members, answer.failed) == (2048, 2048 * 8, 0)
    assert_close(answer.first[0], answer.first_confidence[0], FIRST)
    assert_close(answer.total[0], answer.total_confidence[0], TOTAL)
    second = np.array([[np.nan, 0.0, V13 / V], [0.0, np.nan, 0.0], [V13 / V, 0.0, np.nan]])
    at = ~np.eye(3, dtype=bool)
    assert_close(answer.second[0][at], answer.second_confidence[0][at], second[at])
    # The intervals mean something: a factor taken for another would be outside.
    assert answer.first_confidence[0].max() < 0.08
    assert answer.second_confidence[0][at].max() < 0.1
    # Points of a sequence: the variance is much better than the 1 % of as many random ones.
    assert abs(answer.std[0] ** 2 / V - 1.0) < 0.02
    # In 0.02 s the vehicle drifts by 4 mm: its place is where it starts.
    assert_close(answer.first[1], answer.first_confidence[1], [0.0, 1.0, 0.0])


# Of Sobol's g, by factor; the vehicle's start has a factor for each.
WEIGHTS = np.array([0.0, 1.0, 4.5, 9.0, 99.0])
UNIT = {name: Uniform(low=0.0, high=1.0) for name in (*(f"start.angular_velocity[{i}]" for i in range(2)),
                                                         *(f"start.position[{i}]" for i in range(3)))}  # fmt: skip


def sobols_g(result):
    """Product of (|4 x_i - 2| + a_i) / (1 + a_i), Saltelli & Sobol (1995), of the start's rates and position."""
    x = np.concatenate([result.angular_velocity[0, :, :2], result.position[0]], axis=1)
    return np.prod((np.abs(4.0 * x - 2.0) + WEIGHTS) / (1.0 + WEIGHTS), axis=1)


@pytest.mark.ci
def test_indices_of_sobols_g(scene):
    found = uq.sobol(scene, sobols_g, samples=2048, vary=UNIT, seed=5, second_order=False, **RUN)
    assert found.factors == tuple(UNIT)
    assert found.members == 2048 * 7
    # V_i = 1 / 3 / (1 + a_i)^2 are the variances of its factors, whose means are 1.
    V = 1.0 / 3.0 / (1.0 + WEIGHTS) ** 2
    whole = np.prod(1.0 + V) - 1.0
    assert_close(found.first[0], found.first_confidence[0], V / whole)
    assert_close(found.total[0], found.total_confidence[0], V * np.prod(1.0 + V) / (1.0 + V) / whole)
    assert found.first_confidence[0].max() < 0.1
    assert found.total_confidence[0].max() < 0.1
    assert abs(found.std[0] ** 2 / whole - 1.0) < 0.02


def test_the_table_and_its_files(answer, tmp_path):
    text = str(answer)
    assert all(word in text for word in ("ishigami", "start.position[1]", "2048 samples", "16384 members", "0 failed"))
    assert "start.position[0] with start.position[2]" in text
    paths = answer.save(tmp_path)
    assert [path.name for path in paths] == ["sensitivity.txt", "sensitivity.csv", "sensitivity.json"]
    with paths[1].open() as file:
        rows = list(csv.DictReader(file))
    # 2 quantities: 3 factors with first and total, 3 pairs.
    assert len(rows) == 2 * (3 * 2 + 3)
    assert float(rows[0]["value"]) == answer.first[0, 0]
    assert rows[0]["index"] == "first"
    content = json.loads(paths[2].read_text())
    assert content["provenance"]["ensemble"]["sampling"] == {"saltelli": {"replicates": 8}}
    assert len(content["rows"]) == len(rows)
    back = lw.Ensemble.from_scene(
        lw.Scene.from_dict(content["provenance"]["scene"] | {"ensemble": content["provenance"]["ensemble"]})
    )
    assert back.members == answer.members


# A vehicle with a known answer -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sinking(scene):
    """Upright, moving down only: z = z0 + w0 t + t^2 (m g - B) / (m + A33) / 2."""
    start = lw.Start(velocity=(0.0, 0.0, 0.1))
    return dataclasses.replace(scene, start=start, ensemble_settings=None)


T1 = 2.0
SPREADS = {"vehicle.mass": 0.1, "vehicle.buoyancy": 2.0, "start.velocity[2]": 0.003}
LAWS = {name: Normal(std=std) for name, std in SPREADS.items()}
SINK = {"h": 0.02, "t1": T1, "save": lw.SaveAt()}


def depth(mass, buoyancy, speed):
    return speed * T1 + 0.5 * T1**2 * (mass * 9.8 - buoyancy) / (mass + 75.0)


@pytest.mark.ci
def test_parts_of_the_variance_of_a_sinking_vehicle(sinking):
    found = uq.sobol(sinking, "position[2]", samples=2048, vary=LAWS, second_order=False, **SINK)
    assert found.second is None
    assert found.members == 2048 * 5
    assert found.factors == tuple(LAWS)
    M = 123.8 + 75.0
    slopes = np.array([0.5 * T1**2 * (9.8 * M - (123.8 * 9.8 - 1215.8)) / M**2, -0.5 * T1**2 / M, T1])
    parts = (slopes * np.array([SPREADS[name] for name in found.factors])) ** 2
    # Linear but for mass over mass: a spread of 0.1 in 199 kg bends it by 5e-4, which moves the parts by as little.
    exact = parts / parts.sum()
    for values, errors in ((found.first, found.first_confidence), (found.total, found.total_confidence)):
        assert (np.abs(values[0] - exact) <= FIVE * errors[0] + 1e-3).all()
        assert (errors[0] < 0.1).all()
    assert abs(found.std[0] / np.sqrt(parts.sum()) - 1.0) < 0.02


@pytest.mark.ci
def test_an_adaptor_gives_the_numbers_themselves(sinking):
    f = uq.model(sinking, LAWS, "position[2]", **SINK)
    assert f.names == tuple(LAWS) == ("vehicle.mass", "vehicle.buoyancy", "start.velocity[2]")
    X = np.array([[123.8, 1215.8, 0.1], [125.0, 1210.0, 0.2], [123.0, 1216.0, -0.1]])
    exact = depth(X[:, 0], X[:, 1], X[:, 2])
    # Constant force: every step is exact, 100 of them round off some 1e-16 each.
    np.testing.assert_allclose(f(X), exact, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(f.scipy(X.T), f(X))
    np.testing.assert_array_equal(f({name: X[:, f.names.index(name)] for name in sorted(f.names)}), f(X))
    two = uq.model(sinking, list(f.names), ["position[2]", "norm(velocity)"], **SINK)
    assert (two(X).shape, two.scipy(X.T).shape) == ((3, 2), (2, 3))
    np.testing.assert_array_equal(two(X)[:, 0], f(X))


@pytest.mark.ci
def test_the_adaptor_serves_scipy_and_salib(sinking):
    from SALib.analyze import sobol as analyze
    from SALib.sample import sobol as sample

    f = uq.model(sinking, LAWS, "position[2]", **SINK)
    by_scipy = stats.sobol_indices(func=f.scipy, n=1024, dists=f.distributions, rng=1).first_order
    assert f.problem["dists"] == ["norm"] * 3
    assert f.problem["bounds"][1] == [1215.8, 2.0]
    X = sample.sample(f.problem, 1024, calc_second_order=False, seed=1)
    S = analyze.analyze(f.problem, f(X), calc_second_order=False, seed=1)
    assert_close(by_scipy, S["S1_conf"], S["S1"])
    # Levels: the same function of the unit cube, with any law.
    g = uq.model(sinking, LAWS, "position[2]", levels=True, **SINK)
    u = np.random.default_rng(0).random((20, 3))
    at = np.column_stack([law.ppf(column) for law, column in zip(f.distributions, u.T)])
    np.testing.assert_allclose(g(u), f(at), rtol=0, atol=1e-14)
    assert g.problem["bounds"] == [[0.0, 1.0]] * 3


def test_laws_that_salib_has_no_words_for(sinking):
    other = uq.model(sinking, {"vehicle.mass": stats.gamma(400.0, scale=0.3)}, "position", **SINK)
    assert "levels=True" in refused(lambda: other.problem)
    np.testing.assert_array_equal(other.distributions[0].ppf([0.2, 0.7]), stats.gamma(400.0, scale=0.3).ppf([0.2, 0.7]))
    joint = {"start.attitude": UniformRotation()}
    assert "levels=True" in refused(uq.model, sinking, joint, "position", **SINK)
    assert uq.model(sinking, joint, "position", levels=True, **SINK).problem["groups"] == ["start.attitude"] * 3


def test_morris_of_a_linear_quantity(sinking):
    laws = {"vehicle.buoyancy": Uniform(half_width=2.0),
            "start.velocity[2]": Uniform(half_width=0.01),
            "environment.water_density": Uniform(relative=0.1)}  # fmt: skip
    found = uq.morris(sinking, "position[2]", samples=8, vary=laws, **SINK)
    assert found.factors == tuple(laws)
    # Per side of the cube: a width of 4 N and of 0.02 m/s; nothing depends on the water's density. Round-off of Morris'
    # differences: 1e-14 over a step of half a side.
    effects = np.array([-4.0 * 0.5 * T1**2 / 198.8, 0.02 * T1, 0.0])
    np.testing.assert_allclose(found.mu[0], effects, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.mu_star[0], np.abs(effects), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.sigma[0], 0.0, rtol=0, atol=1e-12)
    assert found.members == 8 * 4
    assert "Morris" in str(found)


def test_a_joint_law_is_one_factor_of_a_screening(sinking):
    vary = {"start.attitude": RotationNormal(std=0.1), "vehicle.buoyancy": Normal(std=1.0)}
    found = uq.morris(sinking, ["position[0]", "position[2]"], samples=4, vary=vary, **SINK)
    assert found.factors == ("start.attitude", "vehicle.buoyancy")
    assert found.mu_star.shape == (2, 2)
    assert np.isnan(found.mu[:, 0]).all()
    assert np.isfinite(found.mu_star).all()


@pytest.mark.ci
def test_noise_that_acts_alike_belongs_to_no_factor(sinking):
    noisy = dataclasses.replace(sinking, terms=[lw.terms.WrenchNoise(force=(1.0, 1.0, 1.0), torque=(0.0, 0.0, 0.0))])
    vary = {"vehicle.buoyancy": Normal(std=1.0), "environment.water_density": Normal(std=1.0)}
    alone, alike = (
        uq.sobol(noisy, "position[2]", samples=16, vary=vary, common_noise=c, **SINK) for c in (False, True)
    )
    # Nothing depends on the water's density: its total is what the noise makes of a pair of members.
    assert alone.total[0, 1] > 1e-6
    assert alike.total[0, 1] < 1e-20


NOISE = lw.terms.WrenchNoise(force=(1.0, 1.0, 1.0), torque=(0.0, 0.0, 0.0))
HEAVIER = {"vehicle.mass": np.linspace(123.0, 125.0, 40)}
LINES = np.random.default_rng(0).uniform(0.01, 0.99, (40, 3))


@pytest.mark.ci
@pytest.mark.parametrize(
    "sampling",
    ["random", "sobol", "halton", {"latin_hypercube": {"group": 20}}, "saltelli", "morris",
     lw.designs.Grid({"vehicle.buoyancy": 8, "vehicle.mass": 5}), lw.designs.Table(values=HEAVIER),
     lw.designs.UnitCubePoints(LINES)],
    ids=lambda one: str(one)[:20],
)  # fmt: skip
def test_a_member_runs_again_alone_with_its_bits(sinking, sampling):
    noisy = dataclasses.replace(sinking, terms=[NOISE])
    laws = {name: law for name, law in LAWS.items() if not (isinstance(sampling, lw.designs.Table) and name in HEAVIER)}
    fleet = lw.Ensemble(noisy, 40, 3, laws, sampling)
    whole = lw.solve(fleet, **SINK).position
    assert len(np.unique(whole[-1, :, 2])) == 40
    for i in (0, 33, 39):
        np.testing.assert_array_equal(lw.solve(fleet.member(i), **SINK).position, whole[:, [i]])
    back = lw.Scene.from_dict(noisy.to_dict() | {"ensemble": fleet.subset([7, 2]).to_dict()})
    np.testing.assert_array_equal(lw.solve(back, **SINK).position, whole[:, [7, 2]])


@pytest.mark.ci
@pytest.mark.parametrize(
    "sampling", ["random", "sobol", "halton", {"latin_hypercube": {"group": 20}}, "saltelli", "morris"], ids=str
)
def test_members_that_are_added_leave_the_others_bits(sinking, sampling):
    """Noise included, and although they run in two blocks then."""
    few, many = (lw.Ensemble(dataclasses.replace(sinking, terms=[NOISE]), n, 3, LAWS, sampling) for n in (40, 400))
    np.testing.assert_array_equal(lw.solve(many, **SINK).position[:, :40], lw.solve(few, **SINK).position)


# Members that fail --------------------------------------------------------------------------------------------------------

# Beyond 2 / h = 200 rad/s the step is too large: 1 of 20 points of the cube.
FAST = {"start.angular_velocity[2]": Uniform(low=0.0, high=210.0), "vehicle.buoyancy": Normal(std=1.0)}


@pytest.mark.ci
def test_members_that_fail_are_counted_and_refused(scene):
    message = refused(uq.sobol, scene, "position[2]", samples=64, vary=FAST, **RUN)
    says(message, "of 384 members failed (step_too_large", 'failed="drop"')
    with pytest.raises(uq.FailedMembers):
        uq.morris(scene, "position[2]", samples=20,
                  vary=FAST | {"start.angular_velocity[2]": Uniform(low=100.0, high=300.0)},
                  **RUN)  # fmt: skip


@pytest.mark.ci
def test_whole_groups_are_used_alone(scene):
    found = uq.sobol(scene, "position[2]", samples=64, vary=FAST, failed="drop", **RUN)
    assert 30 < found.samples < 64
    assert found.failed > 0
    assert found.members == 384
    assert f"The {64 - found.samples} of 64 groups" in found.messages[0]
    assert np.isfinite(found.first).all()
    message = refused(uq.sobol, scene, "position[2]", samples=8, failed="drop", **RUN,
                    vary=FAST | {"start.angular_velocity[2]": Uniform(low=300.0, high=400.0)})  # fmt: skip
    assert "0 groups" in message


def test_an_adaptor_refuses_or_gives_nan(scene):
    X = [[10.0, 1215.8], [500.0, 1215.8]]
    names = ["start.angular_velocity[2]", "vehicle.buoyancy"]
    assert "1 of 2 members failed" in refused(uq.model(scene, names, "energy", **RUN), X)
    Y = uq.model(scene, names, "energy", failed="nan", **RUN)(X)
    np.testing.assert_array_equal(np.isnan(Y), [False, True])


def test_a_quantity_that_is_not_finite_is_a_failure(scene):
    def odd(result):
        return np.where(result.position[0, :, 0] > 0.5, np.nan, result.position[0, :, 0])

    message = refused(uq.sobol, scene, odd, samples=8, vary={"start.position[0]": Normal(std=1.0)}, **RUN)
    assert "quantity not finite" in message


@pytest.mark.ci
def test_members_that_reach_the_surface_count_with_where_they_arrive():
    """Neutral bodies that rise at their own speeds: at t1 each is where it is, or has been stopped at the surface."""
    body = lw.Vehicle(20.0, inertia=(1.0, 1.2, 1.4), added_mass=(10.0, 10.0, 10.0), buoyancy=20.0 * 9.8)
    start = lw.Start(position=(0.0, 0.0, 5.0), velocity=(0.3, 0.0, -1.0))
    rising = lw.Scene(body, lw.Environment(gravity=9.8), start=start, events=[lw.events.Surface()])
    names, settings = ["start.position[2]", "start.velocity[2]"], {"h": 0.1, "t1": 4.0}
    X = np.column_stack([np.linspace(0.5, 6.0, 12), np.repeat([-1.0, -0.2], 6)])
    Y = uq.model(rising, names, ["position[2]", "position[0]"], **settings)(X)
    end = np.minimum(X[:, 0] / -X[:, 1], 4.0)
    np.testing.assert_allclose(Y, np.column_stack([X[:, 0] + X[:, 1] * end, 0.3 * end]), atol=1e-9)
    assert 0 < (end < 4.0).sum() < 12

    vary = {"start.position[2]": Uniform(low=1.0, high=7.0), "start.velocity[0]": Uniform(low=0.2, high=0.4)}
    found = uq.sobol(rising, "position[2]", samples=256, vary=vary, seed=1, **settings)
    # z - 4 above 4 m, else 0: half of the members arrive, and the speed to the north is no matter.
    assert found.failed == 0
    assert found.std[0] ** 2 == pytest.approx(15.0 / 16.0, rel=0.05)
    np.testing.assert_allclose(found.total.ravel(), [1.0, 0.0], atol=0.02)


# Quantities --------------------------------------------------------------------------------------------------------------


def test_quantities_of_a_path(scene):
    result = lw.solve(lw.Ensemble(scene, 5, 1, BOX), h=0.01, t1=0.2, save=lw.SaveAt(every=0.05))
    b, v = result.position, result.velocity
    speed = np.linalg.norm(v, axis=-1)
    for text, exact in (
        ("position[2]", b[-1, :, 2]), ("position", b[-1]), ("max(position[2])", b[:, :, 2].max(axis=0)),
        ("range( position )", np.ptp(b, axis=0)), ("norm(velocity)", speed[-1]), ("min(norm(velocity))", speed.min(axis=0)),
        ("norm(max(velocity))", np.linalg.norm(v.max(axis=0), axis=-1)), ("attitude[0,1]", result.attitude[-1, :, 0, 1]),
        ("energy", result.energy[-1]),
        ("quaternion_wxyz[3]", result.quaternion_wxyz[-1, :, 3]), ("depth", b[-1, :, 2]), ("speed", speed[-1]),
        ("max(depth)", b[:, :, 2].max(axis=0)), ("max(speed)", speed.max(axis=0)),
        ("max(position)[2]", b[:, :, 2].max(axis=0)),
        ("euler[1]", -np.arcsin(result.attitude[-1, :, 2, 0])),
        ("velocity_inertial", np.einsum("nij,nj->ni", result.attitude[-1], v[-1])),
        (lw.statistics.Quantity("sunk", lambda samples, members: samples["position"][..., 2] - 10.0), b[-1, :, 2] - 10.0),
        (lambda samples, members: samples["velocity"][..., 0] ** 2, v[-1, :, 0] ** 2),
    ):  # fmt: skip
        (one,) = quantities.quantities(text)
        np.testing.assert_allclose(one.values(result), np.reshape(exact, (5, -1)), rtol=1e-15, err_msg=str(text))
    # The average over time, as of `lw.statistics.PathMean`, not over samples; some roundings of a sum of four parts.
    (average,) = quantities.quantities("mean(energy)")
    exact = np.trapezoid(result.energy, result.time, axis=0) / result.time[-1]
    np.testing.assert_allclose(average.values(result)[:, 0], exact, rtol=2e-15)
    labels = [one.labels(3)[2] for one in quantities.quantities(["max(position)"])]
    assert labels == ["max(position)[2]"]
    # Each label may be asked for.
    for text in ("position", "max(position)", "attitude", "euler", "norm(velocity)"):
        (whole,) = quantities.quantities(text)
        labels = whole.labels(whole.values(result).shape[1])
        alone = [quantities.quantities(label)[0].values(result) for label in labels]
        np.testing.assert_array_equal(np.concatenate(alone, axis=1), whole.values(result))


@pytest.mark.ci
def test_a_quantity_of_the_users_sees_what_members_start_from(sinking):
    fallen = lw.statistics.Quantity(
        "fallen",
        lambda samples, members: samples["position"][..., 2] - members.position[None, :, 2],
        fields=("position",),
    )
    vary = {"start.position[2]": Uniform(half_width=5.0), "start.velocity[2]": Normal(std=0.01)}
    X = np.array([[3.0, 0.1], [9.0, 0.2]])
    f = uq.model(sinking, vary, [fallen, "depth"], **SINK)
    np.testing.assert_allclose(f(X)[:, 0], depth(123.8, 1215.8, X[:, 1]), rtol=0, atol=1e-13)
    np.testing.assert_allclose(f(X)[:, 1], X[:, 0] + depth(123.8, 1215.8, X[:, 1]), rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    "of", ["deph", "position[3]", "attitude[0]", "energy[0]", "median(energy)", "max(min(energy))", 3, [], "max(energy"]
)
def test_bad_quantities(scene, of):
    assert "of = " in refused(uq.sobol, scene, of, vary=BOX, **RUN)


def test_all_bad_arguments_come_at_once(scene):
    message = refused(
        uq.sobol, scene, "energy", samples=1, confidence=2.0, replicates=3, failed="ignore", vary=BOX, **RUN
    )
    assert "4 faults" in message
    assert "has nothing that varies" in refused(uq.sobol, scene, "energy", vary={}, **RUN)
    assert "neither an Ensemble nor a Scene" in refused(uq.sobol, 3, "energy", **RUN)
    short = dataclasses.replace(scene, run=RunSettings(step=0.01, duration=1.0))
    assert "is taken over the whole path" in refused(uq.sobol, short, "max(energy)", samples=8, vary=BOX)
    assert "Return an array" in refused(uq.sobol, scene, lambda result: np.zeros(3), samples=8, vary=BOX, **RUN)


# The command --------------------------------------------------------------------------------------------------------------

PAPER = str(ROOT / "examples" / "paper.toml")


def test_the_command(tmp_path, capsys):
    options = ["--of", "energy", "--samples", "8", "--duration", "0.02", "--seed", "5"]
    assert cli.main(["sensitivity", PAPER, "--out", str(tmp_path / "a"), *options]) == 0
    out = capsys.readouterr().out
    assert all(word in out for word in ("vehicle.mass", "start.angular_velocity[1]", "energy", "sensitivity.csv", "+-"))
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == [
        f"sensitivity.{e}" for e in ("csv", "json", "png", "txt")
    ]
    assert json.loads((tmp_path / "a" / "sensitivity.json").read_text())["provenance"]["ensemble"]["seed"] == 5
    assert (
        cli.main(["sensitivity", PAPER, "--out", str(tmp_path / "b"), "--analysis", "morris", *options, "--quiet"]) == 0
    )
    assert capsys.readouterr().out == ""


def test_the_command_says_what_is_wrong(tmp_path, capsys):
    def run(*options):
        return cli.main(
            ["sensitivity", PAPER, "--out", str(tmp_path), "--of", "energy", "--samples", "8", *options, "--quiet"]
        )

    assert run("--samples", "0") == 2
    assert "samples = 0" in capsys.readouterr().err
    assert run("--set", "ensemble.vary.vehicle.buoyancy={ normal = { stdd = 1.0 } }") == 2
    assert "Did you mean 'std'" in capsys.readouterr().err
    fast = ["--set", "start.angular_velocity=[900.0, 0.0, 0.0]", "--duration", "0.02"]
    assert run(*fast) == 1
    assert "80 of 80 members failed (step_too_large 80" in capsys.readouterr().err
