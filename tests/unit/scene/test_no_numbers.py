# SPDX-License-Identifier: Apache-2.0
"""Values that NumPy would silently take for numbers: masks, texts, truth values, complex numbers; laws without numbers."""

from fractions import Fraction

import numpy as np
import pytest
from scipy import stats

import lgvi_warp as lw
from lgvi_warp.common.real_numbers import NotReal, real_numbers
from lgvi_warp.scene.settings import EnsembleSettings, RunSettings
from tests.support.refusals import refused, says

N = 3
R = np.array([np.eye(3)] * N)
ZERO = np.zeros((N, 3))
MASKED = np.ma.array(np.arange(9.0).reshape(N, 3), mask=np.eye(3))
ODD = {"texts": [["1.5", "2", "3"]] * N, "array of texts": np.array([["1.5", "2", "3"]] * N),
       "bytes": np.array([[b"1", b"2", b"3"]] * N),
       "objects that are texts": np.array([["1.5", 2.0, 3.0]] * N, dtype=object),
       "truth values": np.ones((N, 3), dtype=bool), "a truth value": [[True, 0.0, 0.0]] * N,
       "a truth value of NumPy's": [[np.True_, 0.0, 0.0]] * N,
       "an array of truth values": [np.array([True, False, True])] * N, "complex": ZERO + 0j,
       "a complex number": [[0j, 0.0, 0.0]] * N, "dates": np.zeros((N, 3), dtype="datetime64[s]"),
       "nothing": [[None, 0.0, 0.0]] * N, "ragged": [[1.0, 2.0, 3.0], [1.0], [2.0]], "masked": MASKED,
       "masked within a list": [MASKED[0], MASKED[1], MASKED[2]],
       "the masked number": [[np.ma.masked, 0.0, 0.0]] * N}  # fmt: skip
GOOD = {"lists": ZERO.tolist(), "whole numbers": np.zeros((N, 3), dtype=np.int8),
        "objects that are numbers": np.array(ZERO, dtype=object), "fractions": [[Fraction(0), 0, 0.0]] * N,
        "half precision": ZERO.astype(np.float16), "a mask that hides nothing": np.ma.masked_greater(ZERO, 1.0)}  # fmt: skip


@pytest.mark.parametrize("form", ODD)
@pytest.mark.parametrize("place", range(1, 5))
def test_states_that_are_no_numbers(scene, form, place):
    states = [ZERO, R, ZERO, ZERO]
    odd = ODD[form]
    states[place - 1] = [odd] * N if place == 2 and form not in ("nothing",) else odd
    message = refused(lw.Ensemble.from_states, scene, *states)
    assert ("position", "attitude", "velocity", "angular_velocity")[place - 1] in message
    assert "not numeric" in message or "mask" in message


@pytest.mark.parametrize("form", GOOD)
def test_states_that_are_numbers(scene, form):
    fleet = lw.Ensemble.from_states(scene, GOOD[form], R, GOOD[form], GOOD[form])
    np.testing.assert_array_equal(fleet.select(0, N).position, ZERO)


def test_states_may_be_nan_and_are_a_copy(scene):
    position = ZERO.copy()
    position[1, 2] = np.nan
    fleet = lw.Ensemble.from_states(scene, position, R, ZERO, ZERO)
    position[0] = 7.0
    np.testing.assert_array_equal(fleet.select(0, N).position, [[0, 0, 0], [0, 0, np.nan], [0, 0, 0]])


MASS = np.ma.array([5.0, 6.0, 7.0], mask=[False, True, False])
# Every door for numbers of a user's: with a mask, and with truth values.
DOORS = {
    "vehicle's inertia": lambda x: lw.Vehicle(mass=10.0, inertia=x),
    "vehicle's mass": lambda x: lw.Vehicle(mass=x[1], inertia=[5.0, 6.0, 7.0]),
    "vehicle's buoyancy": lambda x: lw.Vehicle(mass=10.0, inertia=[5.0, 6.0, 7.0], center_of_buoyancy=x),
    "start": lambda x: lw.Start(position=x),
    "term": lambda x: lw.terms.Current(velocity=x),
    "schedule": lambda x: lw.terms.WrenchSchedule(times=[0.0, 1.0, 2.0], force=[x] * 3),
    "normal": lambda x: lw.distributions.Normal(std=x),
    "uniform": lambda x: lw.distributions.Uniform(low=[-9.0] * 3, high=x),
    "choice": lambda x: lw.distributions.Choice(x),
    "weights": lambda x: lw.distributions.Choice([1.0, 2.0, 3.0], weights=x),
    "correlated": lambda x: lw.distributions.CorrelatedNormal(std=x),
    "frozen": lambda x: lw.distributions.ScipyDistribution(stats.norm(loc=x)),
    "table": lambda x: lw.designs.Table({"vehicle.mass": x}),
    "levels": lambda x: lw.designs.UnitCubePoints([x]),
    "grid": lambda x: lw.designs.Grid({"vehicle.mass": x}),
    "saving": lambda x: lw.SaveAt(at=x),
    "limits": lambda x: lw.statistics.Exceedance("position", above=x),
    "edges": lambda x: lw.statistics.Histogram("depth", edges=x),
}  # fmt: skip


@pytest.mark.parametrize("door", DOORS)
def test_no_door_drops_a_mask(door):
    message = refused(DOORS[door], MASS)
    assert "mask" in message


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("odd", [[True, True, True], ["5", "6", "7"], [5j, 6j, 7j]], ids=["truth", "texts", "complex"])
def test_no_door_takes_what_is_no_number(door, odd):
    assert "not numeric" in refused(DOORS[door], odd)


def test_members_that_are_masked():
    members = np.ma.array([0, 1, 2], mask=[False, True, False])
    assert "is not a list of members" in refused(RunSettings, keep=members)
    assert "is not a list of members" in refused(EnsembleSettings, indices=members)
    assert "is not a list of members" in refused(EnsembleSettings, indices=members)


def test_a_mask_says_how_many_and_where():
    with pytest.raises(NotReal, match=r"hides 2 of 6 numbers \(the first: \[0, 1\]\)"):
        real_numbers(np.ma.array(np.ones((2, 3)), mask=[[0, 1, 0], [0, 0, 1]]))


# Laws -------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["norm", "gamma", "uniform", "poisson", "t", "beta", "lognorm"])
def test_a_law_without_its_numbers_is_refused(scene, name):
    law = getattr(stats, name)
    for make in (lambda: lw.Ensemble(scene, 4, 0, {"vehicle.mass": law}), lambda: lw.distributions.ScipyDistribution(law),
                 lambda: EnsembleSettings(4, 0, {"vehicle.mass": law}),
                 lambda: lw.uq.model(scene, {"vehicle.mass": law}, "depth", h=0.01, t1=0.1),
                 lambda: lw.uq.sobol(scene, "depth", vary={"vehicle.mass": law}, h=0.01, t1=0.1)):  # fmt: skip
        message = refused(make)
        assert f"scipy.stats.{name}" in message
        says(message, "not a frozen distribution", "loc=...")
    assert ("scale=..." in message) == (name != "poisson")


class Wedge(stats.rv_continuous):
    """A user's own: quantiles u^(1/2)."""

    def _ppf(self, q):
        return np.sqrt(q)


def test_laws_with_all_their_numbers_are_taken(scene):
    histogram = stats.rv_histogram((np.array([1.0, 2.0]), np.array([120.0, 121.0, 122.0])))
    for law in (stats.norm(120.0, 1.0), stats.norm(), histogram, stats.rv_discrete(values=((120, 121), (0.5, 0.5))),
                Wedge(name="wedge"), stats.Normal(mu=120.0, sigma=1.0)):  # fmt: skip
        settings = EnsembleSettings(4, 0, {"vehicle.buoyancy": law})
        assert np.isfinite(settings.vary["vehicle.buoyancy"].quantile(np.array([0.25, 0.75]), np.array(1215.0))).all()


@pytest.mark.parametrize("table", [{"scipy": {"name": "norm"}}, {"exponential": {}}], ids=str)
def test_a_table_of_a_law_without_numbers_is_refused(scene, table):
    assert "has no numbers. Give one or more of loc, scale" in refused(
        lw.Ensemble, scene, 4, 0, {"vehicle.mass": table}
    )


def test_what_was_frozen_without_numbers_is_read_again():
    law = lw.distributions.ScipyDistribution(stats.norm())
    settings = EnsembleSettings(4, 0, {"vehicle.mass": law.to_dict()})
    levels = np.array([0.2, 0.7])
    np.testing.assert_array_equal(settings.vary["vehicle.mass"].quantile(levels, 0.0), stats.norm().ppf(levels))


# What functions of the user's give ------------------------------------------------------------------------------------------


def test_what_a_law_of_the_users_gives():
    class Law:
        def __init__(self, values):
            self.values = values

        def ppf(self, u):
            return self.values(np.asarray(u))

    for odd in (lambda u: u + 0j, lambda u: np.ma.masked_greater(u, 0.5), lambda u: u.astype(str)):
        with pytest.raises(lw.SceneError, match="gives no numbers"):
            EnsembleSettings(4, 0, {"vehicle.mass": Law(odd)})
    late = EnsembleSettings(4, 0, {"vehicle.mass": Law(lambda u: np.ma.masked_greater(120.0 + u, 120.9))})
    drawn = late.vary["vehicle.mass"].quantile(np.array([0.5, 0.95]), 0.0)
    np.testing.assert_array_equal(drawn, [120.5, np.nan])


def test_what_a_quantity_of_the_users_gives():
    from types import SimpleNamespace

    samples = type("Samples", (dict,), {"time": np.arange(2.0), "terms": ()})(position=np.arange(18.0).reshape(2, 3, 3))
    members = SimpleNamespace(count=3)
    hidden = lw.statistics.Quantity(
        "hidden", lambda samples, members: np.ma.masked_less(samples["position"][..., 0], 4.0)
    )
    np.testing.assert_array_equal(hidden(samples, members)[:, 0], [[np.nan, np.nan, 6.0], [9.0, 12.0, 15.0]])
    for odd in (lambda s, m: s["position"][..., 0] + 0j, lambda s, m: s["position"][..., 0].astype(str)):
        with pytest.raises(ValueError, match="quantity odd gave"):
            lw.statistics.Quantity("odd", odd)(samples, members)


def test_what_a_function_of_a_result_gives():
    from lgvi_warp.results.quantities import quantities

    result = type("Result", (), {"members": 3})()
    (one,) = quantities(lambda result: np.ma.array([1.0, 2.0, 3.0], mask=[0, 1, 0]))
    np.testing.assert_array_equal(one.values(result)[:, 0], [1.0, np.nan, 3.0])
    (one,) = quantities(lambda result: np.array([1j, 2.0, 3.0]))
    assert "gave complex numbers" in refused(one.values, result)


# Conditions without a number -----------------------------------------------------------------------------------------------

LIMITED = [
    lambda of, **limits: lw.statistics.Exceedance(of, **limits),
    lambda of, **limits: lw.statistics.FirstPassage(of, **limits),
    lambda of, **limits: lw.statistics.PathTime(of, **limits),
    lambda of, **limits: lw.statistics.PathMaximum(of, then=lw.statistics.Exceedance(**limits)),
]
ONE_NUMBER = ["depth", "position[2]", "speed", "euler[1]", "energy", "norm(velocity)", ["depth"]]


@pytest.mark.parametrize("make", LIMITED)
@pytest.mark.parametrize("of", ONE_NUMBER, ids=str)
def test_a_condition_wants_a_number(make, of):
    message = refused(make, of)
    says(message, "missing", "compared with nothing", "Give above=")
    assert make(of, above=1.0) is not None
    assert make(of, below=1.0) is not None


@pytest.mark.parametrize("type_", ["exceedance", "first_passage", "path_time"])
def test_a_condition_of_a_scene_file_wants_a_number(type_):
    tables = [{"type": type_, "of": "depth"}]
    assert "compared with nothing" in refused(RunSettings, statistics=tables)


def below(samples, members):
    return samples["position"][..., 2] > 3.0


@pytest.mark.parametrize("make", LIMITED)
def test_a_function_says_true_or_false(make):
    for of in (below, lw.statistics.Quantity("below", below)):
        assert make(of) is not None
