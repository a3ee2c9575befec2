# SPDX-License-Identifier: Apache-2.0
"""Ensembles: what varies, that a draw depends on seed, member and name only, and what is refused."""

import dataclasses

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.distributions import LogNormal, Normal, TruncatedNormal, Uniform
from lgvi_warp.physics import notation
from lgvi_warp.results.drawn import DrawnParameters
from lgvi_warp.scene import draws
from tests.support.refusals import faults, says

FULL = np.array([[5.0, 0.3, 0.1], [0.3, 6.0, -0.2], [0.1, -0.2, 7.0]])
EVERYTHING = {"vehicle.mass": Normal(relative=0.01),
              "vehicle.added_mass": Uniform(relative=0.1),
              "vehicle.inertia": LogNormal(sigma=0.05),
              "vehicle.buoyancy": TruncatedNormal(std=1.0),
              "vehicle.center_of_buoyancy": Normal(std=(0.001, 0.001, 0.002)),
              "environment.gravity": Uniform(low=9.78, high=9.83),
              "environment.water_density": Uniform(low=1020.0, high=1030.0),
              "start.position": Normal(std=0.5),
              "start.rotation_vector": Normal(std=0.1),
              "start.velocity_inertial": Normal(std=0.05),
              "start.angular_velocity": Normal(std=(0.03, 0.02, 0.01))}  # fmt: skip


def numbers(m):
    """Everything in a Members, by name."""
    others = ("parameters", "indices", "seed", "starts", "weight", "final", "given", "shifted")
    names = [f.name for f in dataclasses.fields(m) if f.name not in others]
    return m.parameters | m.starts | {name: getattr(m, name) for name in names}


def assert_same(m, complete, indices):
    """The members of m are those of `whole` at the indices, bit by bit."""
    for name, value in numbers(m).items():
        expected = numbers(complete)[name]
        expected = expected if len(expected) == 1 and len(value) == 1 else expected[indices]
        np.testing.assert_array_equal(value, expected, err_msg=name)


def states(n):
    return np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3)), np.zeros((n, 3))


# Shapes and sharing ------------------------------------------------------------------------------------------------


def test_nothing_varied_is_shared(scene):
    m = lw.Ensemble(scene, members=5).select(1, 4)
    assert m.count == 3
    shapes = {name: value.shape for name, value in m.parameters.items()}
    assert shapes == {"vehicle.mass": (1,), "vehicle.added_mass": (1, 3, 3), "vehicle.inertia": (1, 3, 3),
                      "vehicle.buoyancy": (1,), "vehicle.center_of_buoyancy": (1, 3), "environment.gravity": (1,),
                      "environment.water_density": (1,)}  # fmt: skip
    assert (m.position.shape, m.attitude.shape) == ((3, 3), (3, 3, 3))
    np.testing.assert_array_equal(m.position, np.tile([0.0, 0.0, 10.0], (3, 1)))


def test_everything_varied_has_its_own(scene):
    m = lw.Ensemble(scene, 50, 3, EVERYTHING).select(0, 50)
    for name, value in numbers(m).items():
        assert len(value) == 50, name
        assert value.dtype == np.float64, name
        assert len(np.unique(value.reshape(50, -1), axis=0)) == 50, name
    # Of a diagonal matrix the diagonal varies.
    off = m.parameters["vehicle.inertia"][:, ~np.eye(3, dtype=bool)]
    assert not off.any()
    assert (m.parameters["environment.gravity"] >= 9.78).all()
    assert (m.parameters["environment.gravity"] <= 9.83).all()


def test_the_inertial_velocity_is_turned_by_each_members_attitude(scene):
    vary = {"start.rotation_vector": Normal(std=0.5)}
    m = lw.Ensemble(scene, 20, 0, vary).select(0, 20)
    # R nu = v, a few roundings of numbers up to 1
    v = notation.rotate_out(m.attitude, m.velocity)
    np.testing.assert_allclose(v, np.tile([0.1, 0.2, 1.0], (20, 1)), rtol=0, atol=1e-15)
    assert np.ptp(m.velocity, axis=0).min() > 0.1


@pytest.mark.parametrize("way, value", [("quaternion_wxyz", (1.0, 0.0, 0.0, 0.0)), ("euler_deg", (0.0, 0.0, 90.0))])
def test_other_ways_of_the_attitude_vary_too(scene, way, value):
    other = dataclasses.replace(scene, start=lw.Start(**{way: value}), ensemble_settings=None)
    R = lw.Ensemble(other, 30, 0, {f"start.{way}": Normal(std=0.05)}).select(0, 30).attitude
    np.testing.assert_allclose(np.swapaxes(R, 1, 2) @ R, np.tile(np.eye(3), (30, 1, 1)), rtol=0, atol=2e-15)
    assert len(np.unique(R.reshape(30, 9), axis=0)) == 30


def test_the_scene_file_describes_the_ensemble(scene):
    fleet = lw.Ensemble.from_scene(scene)
    assert (fleet.members, fleet.seed, set(fleet.vary)) == (4096, 1, {"start.angular_velocity", "vehicle.mass"})
    mass = fleet.select(0, 4096).parameters["vehicle.mass"]
    # std = 0.001 * 123.8; 5 standard errors of mean and of standard deviation, sigma / sqrt(2 n).
    assert abs(mass.mean() - 123.8) < 5 * 0.1238 / np.sqrt(4096)
    assert abs(mass.std() - 0.1238) < 5 * 0.1238 / np.sqrt(2 * 4096)


# Reproducible ------------------------------------------------------------------------------------------------------


@pytest.fixture(params=["kept", "drawn anew"])
def _either_way(request, monkeypatch):
    """Numbers of few members are drawn once and kept, those of many are drawn each time."""
    if request.param == "drawn anew":
        monkeypatch.setattr(draws, "KEPT", 0)


@pytest.mark.usefixtures("_either_way")
def test_any_run_gives_the_same_members(scene):
    fleet = lw.Ensemble(scene, 1000, 3, EVERYTHING)
    whole = fleet.select(0, 1000)
    for first, stop in ((0, 1), (1, 8), (7, 8), (513, 1000), (999, 1000)):
        assert_same(fleet.select(first, stop), whole, slice(first, stop))


@pytest.mark.usefixtures("_either_way")
def test_any_order_gives_the_same_members(scene):
    fleet = lw.Ensemble(scene, 100, 3, EVERYTHING)
    order = np.random.default_rng(0).permutation(100)[:30]
    assert_same(fleet.subset(order).select(0, 30), fleet.select(0, 100), order)


def test_few_members_are_drawn_once(scene):
    fleet = lw.Ensemble(scene, 5, 3, EVERYTHING)
    few, some = fleet.select(0, 5), fleet.select(1, 3)
    for name in ("vehicle.mass", "vehicle.added_mass"):
        values = few.parameters[name]
        assert fleet.parameters(0, 5)[name] is values
        assert not values.flags.writeable
        np.testing.assert_array_equal(some.parameters[name], values[1:3])
    assert fleet.with_seed(4).select(0, 5).parameters["vehicle.mass"][0] != few.parameters["vehicle.mass"][0]


def test_parameters_of_a_result_are_copies(scene):
    fleet = lw.Ensemble(scene, 5, 3, EVERYTHING)
    drawn, masses = DrawnParameters(fleet, 5), fleet.parameters(0, 5)["vehicle.mass"].copy()
    for name in ("vehicle.mass", "environment.gravity"):
        drawn[name][...] = 7.0
    np.testing.assert_array_equal(fleet.parameters(0, 5)["vehicle.mass"], masses)
    assert not np.any(fleet.parameters(0, 5)["environment.gravity"] == 7.0)


def test_a_scene_describes_itself_anew_each_time(scene):
    scene.to_dict()["vehicle"]["center_of_buoyancy"][0] = 7.0
    scene.to_dict()["run"].clear()
    assert scene.to_dict() == dataclasses.replace(scene).to_dict() != {}


def test_the_number_of_members_does_not_matter(scene):
    few, many = lw.Ensemble(scene, 10, 3, EVERYTHING), lw.Ensemble(scene, 1000, 3, EVERYTHING)
    assert_same(few.select(0, 10), many.select(0, 1000), slice(0, 10))


def test_varying_more_does_not_change_the_rest(scene):
    alone = lw.Ensemble(scene, 50, 3, {"vehicle.mass": EVERYTHING["vehicle.mass"]}).select(0, 50)
    among = lw.Ensemble(scene, 50, 3, dict(reversed(EVERYTHING.items()))).select(0, 50)
    np.testing.assert_array_equal(alone.parameters["vehicle.mass"], among.parameters["vehicle.mass"])


def test_another_seed_gives_other_members(scene):
    a, b = (lw.Ensemble(scene, 50, seed, EVERYTHING).select(0, 50) for seed in (3, 4))
    for name, value in numbers(a).items():
        assert not np.isin(value, numbers(b)[name][value != 0.0] if value.ndim == 3 else numbers(b)[name]).all(), name


def test_runs_beyond_the_members_are_errors(scene):
    fleet = lw.Ensemble(scene, 10)
    for first, stop in ((0, 11), (-1, 3), (5, 5), (10, 11)):
        with pytest.raises(IndexError):
            fleet.select(first, stop)
    with pytest.raises(IndexError):
        fleet.subset([3, 10])


# Explicit states ---------------------------------------------------------------------------------------------------


def test_given_states_are_kept(scene):
    rng = np.random.default_rng(0)
    b, nu, Om = rng.normal(size=(3, 7, 3))
    R = notation.matrix_from_rotation_vector(rng.normal(size=(7, 3)))
    mass, J = rng.uniform(100, 200, 7), rng.uniform(4, 6, (7, 3))
    fleet = lw.Ensemble.from_states(scene, b, R, nu, Om, {"vehicle.mass": mass, "vehicle.inertia": J})
    assert fleet.members == 7
    m = fleet.select(2, 6)
    for got, given in ((m.position, b), (m.attitude, R), (m.velocity, nu), (m.angular_velocity, Om)):
        np.testing.assert_array_equal(got, given[2:6])
    np.testing.assert_array_equal(m.parameters["vehicle.mass"], mass[2:6])
    np.testing.assert_array_equal(m.parameters["vehicle.inertia"][0], np.diag(J[2]))
    assert len(m.parameters["vehicle.buoyancy"]) == 1
    b[:] = 0.0  # the caller's array is his own
    assert fleet.select(0, 7).position.any()


def test_full_matrices_may_be_given_by_member(scene):
    fleet = lw.Ensemble.from_states(scene, *states(2), {"vehicle.inertia": np.stack([FULL, 2.0 * FULL])})
    np.testing.assert_array_equal(fleet.select(1, 2).parameters["vehicle.inertia"], 2.0 * FULL[None])


@pytest.mark.parametrize("which", range(4))
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_states_that_are_not_finite_are_let_through(scene, which, bad):
    """The run gives such a member its status; the others are as they were."""
    given = states(3)
    given[which][1] = bad
    m = lw.Ensemble.from_states(scene, *given).select(0, 3)
    assert not np.isfinite((m.position, m.attitude, m.velocity, m.angular_velocity)[which][1]).any()
    np.testing.assert_array_equal(m.attitude[[0, 2]], [np.eye(3), np.eye(3)])


def test_wrong_shapes_are_refused_together(scene):
    b, R, nu, Om = states(4)
    found = faults(lw.Ensemble.from_states, scene, b, R[:, :2], nu[:3], Om[0])
    assert len(found) == 3
    for fault, key in zip(found, ("attitude", "velocity", "angular_velocity"), strict=True):
        assert key in fault
        assert "(4, 3" in fault
    assert len(faults(lw.Ensemble.from_states, scene, "here", R, nu, "fast")) == 2


def test_given_attitudes_must_be_rotations(scene):
    b, R, nu, Om = states(5)
    R[3, 0, 0] = -1.0
    R[4] *= 1.001
    R[0] = np.nan
    (fault,) = faults(lw.Ensemble.from_states, scene, b, R, nu, Om)
    says(fault, "member 3", "2 of 5")


def test_bad_parameters_are_refused(scene):
    def found(parameters):
        return faults(lw.Ensemble.from_states, scene, *states(3), parameters)

    assert "vehicle.mass of member 1" in found({"vehicle.mass": [1.0, -1.0, 1.0]})[0]
    assert "vehicle.mass of member 2" in found({"vehicle.mass": [1.0, 1.0, np.nan]})[0]
    assert "shape (2,)" in found({"vehicle.mass": [1.0, 1.0]})[0]
    assert "(3, 3, 3) or (3, 3)" in found({"vehicle.inertia": np.ones(3)})[0]
    assert "Did you mean 'vehicle.mass'?" in found({"vehicle.mas": np.ones(3)})[0]
    skew = np.stack([FULL, FULL, FULL])
    skew[1, 0, 1] += 0.1
    assert "not symmetric" in found({"vehicle.inertia": skew})[0]
    indefinite = np.stack([FULL, FULL - 6.0 * np.eye(3), FULL])
    assert "vehicle.inertia of member 1" in found({"vehicle.inertia": indefinite})[0]
    indefinite[1, 1, 2] = indefinite[1, 2, 1] = np.inf
    assert "vehicle.inertia[1,2] of member 1 = inf " in found({"vehicle.inertia": indefinite})[0]
    assert "not numeric" in found({"vehicle.mass": "heavy"})[0]


@pytest.mark.parametrize("count", [0, -1, 1.5, True])
def test_an_ensemble_needs_members(scene, count):
    assert faults(lw.Ensemble, scene, members=count)[0].startswith(f"ensemble.members = {count}")


def test_empty_states_are_refused(scene):
    assert "holds no member" in faults(lw.Ensemble.from_states, scene, *states(0))[0]


def test_one_member(scene):
    assert lw.Ensemble(scene).select(0, 1).count == 1


# Refused laws ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name, text", [
    ("vehicle.mas", "Did you mean 'vehicle.mass'?"), ("mass", "Did you mean 'vehicle.mass'?"),
    ("start.velocity", "The scene gives start.position, start.rotation_vector, start.velocity_inertial"),
    ("start.euler_deg", "The scene gives start.position, start.rotation_vector"),
])  # fmt: skip
def test_names_that_the_scene_does_not_have(scene, name, text):
    (fault,) = faults(lw.Ensemble, scene, 4, 0, {name: Normal(std=0.1)})
    assert f'ensemble.vary."{name}"' in fault
    assert text in fault


def test_an_attitude_matrix_cannot_vary_by_entry(scene):
    other = dataclasses.replace(scene, start=lw.Start(attitude=np.eye(3)))
    assert "rotation_vector" in faults(lw.Ensemble, other, 4, 0, {"start.attitude": Normal(std=0.1)})[0]


def test_a_full_matrix_varies_and_stays_symmetric(scene):
    other = dataclasses.replace(scene, vehicle=dataclasses.replace(scene.vehicle, inertia=FULL))
    J = lw.Ensemble(other, 4, 0, {"vehicle.inertia": Normal(relative=0.01)}).parameters(0, 4)["vehicle.inertia"]
    np.testing.assert_array_equal(J, np.swapaxes(J, 1, 2))
    assert len(np.unique(J.reshape(4, 9)[:, [0, 1, 2, 4, 5, 8]])) == 24
    np.testing.assert_allclose(J, np.broadcast_to(FULL, J.shape), rtol=0.05)


@pytest.mark.parametrize("name, law", [
    ("vehicle.mass", Normal(std=(1.0, 2.0, 3.0))), ("start.position", Normal(std=(1.0, 2.0))),
    ("start.position", Normal(std=np.ones((3, 3)))), ("vehicle.inertia", Uniform(low=np.ones((3, 3)), high=2.0)),
])  # fmt: skip
def test_laws_of_the_wrong_shape(scene, name, law):
    assert "does not fit a quantity of shape" in faults(lw.Ensemble, scene, 4, 0, {name: law})[0]


def test_numbers_are_no_laws(scene):
    assert "lw.distributions.Normal" in faults(lw.Ensemble, scene, 4, 0, {"vehicle.mass": 0.1})[0]


def test_all_bad_laws_come_in_one_message(scene):
    vary = {"vehicle.mas": Normal(std=1.0), "vehicle.mass": 3, "start.velocity": Normal(std=1.0)}
    assert len(faults(lw.Ensemble, scene, 4, 0, vary)) == 3


@pytest.mark.parametrize("name, law, key", [
    ("vehicle.mass", Normal(relative=1.0), "vehicle.mass"),
    ("vehicle.inertia", Normal(relative=1.0), "vehicle.inertia"),
    ("vehicle.added_mass", Normal(std=300.0), "vehicle.mass + vehicle.added_mass"),
    ("vehicle.buoyancy", Normal(relative=1.0), "vehicle.buoyancy"),
    ("environment.gravity", Normal(relative=1.0), "environment.gravity"),
    ("vehicle.mass", LogNormal(sigma=1e5), "vehicle.mass"),  # 0 or infinite
    ("vehicle.buoyancy", LogNormal(sigma=1e5), "vehicle.buoyancy"),
    ("vehicle.inertia", LogNormal(sigma=1e5), "vehicle.inertia[0,0]"),
])  # fmt: skip
def test_unphysical_draws_are_counted_and_shown(scene, name, law, key):
    (fault,) = faults(lw.Ensemble, scene, 200, 0, {name: law})
    assert fault.startswith(f"{key} of member ")
    says(fault, " of 200 members)", "TruncatedNormal")
    # At one standard deviation per mean 16 % of 200 are negative: 32 +- 5 standard errors of 5.2.
    if "relative=1.0" in str(law) and name == "vehicle.mass":
        assert 6 <= int(fault.split("(")[1].split()[0]) <= 58, fault


def test_provenance(scene):
    fleet = lw.Ensemble.from_scene(scene)
    assert fleet.to_dict() == scene.to_dict()["ensemble"]
    explicit = lw.Ensemble.from_states(scene, *states(2), {"vehicle.mass": [1.0, 2.0]})
    assert explicit.to_dict()["members"] == 2
    assert "vehicle.mass" in explicit.to_dict()["explicit"]
