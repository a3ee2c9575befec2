# SPDX-License-Identifier: Apache-2.0
"""Samplings: marginals, discrepancy, that any block, subset or longer ensemble has the same members, and what is refused.

Kolmogorov-Smirnov: P(sqrt(n) D > x) < 2 exp(-2 x^2); at 2.5 that is 7e-6, and seeds are fixed.
"""

import itertools

import numpy as np
import pytest
from scipy import stats
from scipy.stats import qmc

import lgvi_warp as lw
from lgvi_warp.designs import Grid, Halton, LatinHypercube, Morris, Sobol, Table, UnitCubePoints
from lgvi_warp.distributions import (
    Choice,
    CorrelatedNormal,
    Normal,
    PhysicalInertia,
    PositiveDefinite,
    RotationNormal,
    Uniform,
    UniformRotation,
)
from lgvi_warp.sampling import designs as sampling
from lgvi_warp.sampling.designs.sequences import sobol_points
from lgvi_warp.sampling.designs.space import Space
from lgvi_warp.scene import draws
from lgvi_warp.scene.settings import MOST_MEMBERS
from lgvi_warp.scene.variations import targets
from tests.support.refusals import says
from tests.unit.scene.test_ensemble import assert_same, faults

KOLMOGOROV = 2.5
VARY = {
    "vehicle.mass": Normal(relative=0.01),
    "vehicle.inertia": PhysicalInertia(sigma=0.1, off_diagonal=0.05),
    "vehicle.buoyancy": stats.gamma(100.0, scale=10.0),
    "start.attitude": RotationNormal(std=0.2),
    "start.position[2]": Uniform(low=5.0, high=15.0),
    "start.velocity_inertial[0], start.angular_velocity": CorrelatedNormal(
        covariance=0.01 * (np.eye(4) + 0.5 * (np.ones((4, 4)) - np.eye(4)))
    ),
}
SPACE = Space(3, ("a", "b"), (2, 1), (("a[0]", (0,)), ("a[1]", (1,)), ("b", (2,))))
SEQUENCES = ("random", "sobol", "halton", {"latin_hypercube": {"group": 40}})
REPLICATED = ({"sobol": {"replicates": 8}}, {"halton": {"replicates": 4}},
              {"latin_hypercube": {"group": 10, "replicates": 4}})  # fmt: skip
# 6 factors vary, three of them joint laws: groups of 14 or 8 members, and paths of 7.
DESIGNS = ({"saltelli": {"second_order": True}}, {"saltelli": {"second_order": False}}, "morris")


def members_of(content):
    """A number of members that the sampling may have, 560 to 600."""
    kind = content if isinstance(content, str) else next(iter(content))
    return {"latin_hypercube": 600, "saltelli": 560, "morris": 560}.get(kind, 600)


def cube(content, members, space=SPACE):
    drawn = sampling.sampling_of(content).draw(space, np.asarray(members))
    return np.concatenate([drawn[key] for key in space.keys], axis=1)


# The same members ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("content", [*SEQUENCES, *DESIGNS, *REPLICATED], ids=str)
def test_blocks_subsets_and_longer_ensembles_have_the_same_members(scene, content, monkeypatch):
    monkeypatch.setattr(draws, "KEPT", 0)
    n = members_of(content)
    fleet = lw.Ensemble(scene, n, 3, VARY, content)
    whole = fleet.select(0, n)
    for first, stop in ((0, 1), (1, 8), (7, 8), (255, 513), (n - 1, n)):
        assert_same(fleet.select(first, stop), whole, slice(first, stop))
    order = np.random.default_rng(0).permutation(n)[:60]
    some = fleet.subset(order)
    assert_same(some.select(0, 60), whole, order)
    assert_same(some.subset([7, 3]).select(0, 2), whole, order[[7, 3]])
    assert_same(fleet.member(17).select(0, 1), whole, [17])
    np.testing.assert_array_equal(some.select(3, 5).indices, order[3:5])
    longer = lw.Ensemble(scene, 5 * n, 3, VARY, content)
    assert_same(longer.select(0, n), whole, slice(0, n))


@pytest.mark.parametrize("kind", [Table, UnitCubePoints])
def test_lines_may_be_added(scene, kind):
    """Members of the lines that were there stay as they are, and so do the numbers drawn beside a table."""
    lines = np.random.default_rng(2).uniform(0.1, 0.9, (50, 2))
    vary = {"vehicle.buoyancy": Uniform(half_width=1.0), "start.position[2]": Normal(std=1.0)}

    def of(rows):
        if kind is UnitCubePoints:
            return lw.Ensemble(scene, None, 3, vary, UnitCubePoints(rows))
        return lw.Ensemble(scene, None, 3, vary, Table({"vehicle.mass": rows[:, 0], "start.position[0]": rows[:, 1]}))

    fewer, more = of(lines[:20]), of(lines)
    assert_same(more.select(0, 20), fewer.select(0, 20), slice(0, 20))
    assert_same(more.member(17).select(0, 1), fewer.select(0, 20), [17])
    assert len(np.unique(more.select(0, 50).position[:, 2])) == 50


@pytest.mark.parametrize("content", [*SEQUENCES, *REPLICATED], ids=str)
def test_far_members(content):
    far = 10**8 + 3
    np.testing.assert_array_equal(cube(content, np.arange(far, far + 50))[[7, 30]], cube(content, [far + 7, far + 30]))


@pytest.mark.parametrize("content", ["random", pytest.param("sobol", marks=pytest.mark.slow), *SEQUENCES[2:]], ids=str)
def test_the_last_members_there_can_be(scene, content):
    """The first words of Sobol's basis for the last points take 2^31 steps of scipy's."""
    vary = {"start.position": Normal(std=1.0)}
    n = MOST_MEMBERS - (MOST_MEMBERS % 40 if isinstance(content, dict) else 0)
    fleet = lw.Ensemble(scene, n, 3, vary, content)
    last = fleet.select(n - 50, n)
    assert_same(fleet.member(n - 1).select(0, 1), last, [49])
    assert last.indices[-1] == n - 1
    assert len(np.unique(last.position[:, 0])) == 50
    # As the kernels have the index, which keys a member's noise.
    assert last.indices.astype(np.int32)[-1] == n - 1


def test_no_sampling_has_more_members_than_there_can_be(scene):
    for content in ("random", "sobol", {"sobol": {"replicates": 64}}, "halton"):
        (fault,) = faults(lw.Ensemble, scene, MOST_MEMBERS + 64, 0, None, content)
        says(fault, "ensemble.members = 2147483712 are more members than the 2147483648", "or less")
    uniform = Uniform(low=0.0, high=1.0)
    names = ("start.position", "start.angular_velocity")
    grid = {"grid": dict.fromkeys(names, 3000)}
    content = scene.to_dict() | {"ensemble": {"vary": dict.fromkeys(names, uniform.to_dict()), "sampling": grid}}
    (fault,) = faults(lw.Scene.from_dict, content)
    assert f"ensemble.sampling.grid = {3000**6} are more members" in fault
    assert "fewer values" in fault
    # Beyond whole numbers of 64 bits.
    assert "more members" in faults(lw.Ensemble, scene, None, 0, {names[0]: uniform}, Grid({names[0]: 10**30}))[0]
    fleet = lw.Ensemble(scene, None, 0, {names[0]: uniform}, Grid({names[0]: 2**10}))
    assert fleet.members == 2**30
    assert len(fleet.select(2**30 - 3, 2**30).position) == 3


@pytest.mark.parametrize("content", [*SEQUENCES, *REPLICATED], ids=str)
def test_another_seed_gives_other_members(content):
    other = Space(4, *[getattr(SPACE, name) for name in ("keys", "sizes", "factors")])
    assert not np.any(cube(content, np.arange(80)) == cube(content, np.arange(80), other))


def test_sequences_are_these_numbers():
    """The members of a seed are a promise: drawn once, with scipy 1.17."""
    np.testing.assert_array_equal(cube("sobol", [0, 5]), SOBOL)
    np.testing.assert_allclose(cube("halton", [0, 5]), HALTON, rtol=1e-15)
    np.testing.assert_array_equal(cube({"latin_hypercube": {"group": 8}}, [0, 9]), LATIN)


SOBOL = [[0.029180726618506014, 0.21242503903340548, 0.31510313984472305],
         [0.8223508863011375, 0.9412634876789525, 0.41237329703290015]]  # fmt: skip
HALTON = [[0.6569170426508356, 0.42754819126216037, 0.5106789685181907],
          [0.031917042650835614, 0.9831037468177162, 0.5506789685181908]]  # fmt: skip
LATIN = [[0.24267010446711515, 0.7606552021171017, 0.9640351063422453],
         [0.394352329870452, 0.1927249966504648, 0.8978476365967205]]  # fmt: skip


@pytest.mark.parametrize("content", ["random", {"latin_hypercube": {"group": 40}}], ids=str)
def test_varying_more_does_not_change_the_rest(scene, content):
    less = {"vehicle.mass": VARY["vehicle.mass"]}
    a, b = (lw.Ensemble(scene, 80, 3, vary, content).select(0, 80) for vary in (less, VARY))
    np.testing.assert_array_equal(a.parameters["vehicle.mass"], b.parameters["vehicle.mass"])


# The unit cube ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("content", [*SEQUENCES, "saltelli", *REPLICATED], ids=str)
def test_levels_are_uniform_within_the_open_cube(content):
    n = 8000
    u = cube(content, np.arange(n))
    assert u.min() > 0.0
    assert u.max() < 1.0
    grid = (np.arange(n) + 0.5) / n
    # Saltelli's members repeat the points A and B: n / 4 of them are their own, in each column.
    own = n / 4 if content == "saltelli" else n
    for column in u.T:
        assert np.sqrt(own) * np.abs(np.sort(column) - grid).max() < KOLMOGOROV


@pytest.mark.parametrize("content", ["sobol", "halton", {"latin_hypercube": {"group": 1024}}], ids=str)
def test_discrepancy_is_below_that_of_random_points(content):
    # Centred discrepancy, squared, of 1024 points in 3 dimensions: of 5 random sets none comes near.
    random = min(qmc.discrepancy(np.random.default_rng(i).random((1024, 3))) for i in range(5))
    found = qmc.discrepancy(cube(content, np.arange(1024)))
    # A Latin hypercube fills the sides only: its gain is in the one-dimensional part.
    assert found < (0.7 if isinstance(content, dict) else 0.02) * random


def test_sobol_points_are_balanced_and_those_of_scipy():
    u = sobol_points(1, "x", 4, np.arange(256))
    for column in u.T:
        np.testing.assert_array_equal(np.sort(np.floor(column * 256)), np.arange(256))
    engine = qmc.Sobol(4, scramble=False, bits=32)
    got = sobol_points(1, "x", 4, np.arange(300), scramble=False)
    with pytest.warns(UserWarning):
        expected = engine.random(300)
    np.testing.assert_array_equal(got, expected + 2.0**-33)


def test_every_group_is_a_latin_hypercube():
    u = cube({"latin_hypercube": {"group": 40}}, np.arange(120))
    for group in range(3):
        for column in u[40 * group : 40 * group + 40].T:
            np.testing.assert_array_equal(np.sort(np.floor(column * 40)), np.arange(40))
    assert not np.any(u[:40] == u[40:80])


def test_every_replicate_is_a_balanced_design_of_its_own():
    sobol, halton = (cube({kind: {"replicates": 8}}, np.arange(512)) for kind in ("sobol", "halton"))
    latin = cube({"latin_hypercube": {"group": 64, "replicates": 8}}, np.arange(512))
    for r in range(8):
        for u in (sobol[r::8], latin[r::8]):
            for column in u.T:
                np.testing.assert_array_equal(np.sort(np.floor(column * 64)), np.arange(64))
        # Of Halton's sequence each base b: its first b^k points have one in each of so many parts.
        for base, column in zip((2, 3, 5), halton[r::8].T, strict=True):
            np.testing.assert_array_equal(np.sort(np.floor(column[: base**2] * base**2)), np.arange(base**2))
    for u in (sobol, halton, latin):
        points = u.reshape(64, 8, 3)
        assert len(np.unique(points[:, :, 0])) == 512
        assert len(np.unique((points**2).mean(axis=0)[:, 0])) == 8


def test_replicates_of_a_latin_hypercube_fill_its_groups_in_turn():
    plain, dealt = ({"latin_hypercube": {"group": 16, **more}} for more in ({}, {"replicates": 4}))
    u, v = (cube(content, np.arange(128)).reshape(2, -1, 3) for content in (plain, dealt))
    np.testing.assert_array_equal(u.reshape(2, 4, 16, 3), np.swapaxes(v.reshape(2, 16, 4, 3), 1, 2))


@pytest.mark.parametrize("content", REPLICATED, ids=str)
def test_replicates_are_told_and_read(scene, content):
    fleet = lw.Ensemble(scene, 80, 3, VARY, content)
    told = fleet.to_dict()
    assert told["sampling"] == content
    assert fleet.replicates == next(iter(content.values()))["replicates"]
    again = lw.Scene.from_dict(scene.to_dict() | {"ensemble": told})
    assert_same(lw.Ensemble.from_scene(again).select(0, 80), fleet.select(0, 80), slice(0, 80))
    assert fleet.subset(range(40)).replicates == fleet.member(3).replicates == 1
    assert lw.Ensemble(scene, 80, 3, VARY, "sobol").replicates == lw.Ensemble(scene, 80).replicates == 1
    assert Sobol(replicates=1).to_dict() == "sobol"


def test_whole_numbers_of_numpy(scene):
    """They are as good as Python's, in provenance as well."""
    import json

    pairs = [(LatinHypercube(np.int64(10), replicates=np.int32(2)), LatinHypercube(10, replicates=2)),
             (Sobol(replicates=np.uint8(4)), Sobol(replicates=4)),
             (Halton(replicates=np.int16(4)), Halton(replicates=4)),
             (Morris(np.int64(6)), Morris(6)),
             (Grid({"vehicle.buoyancy": np.int64(4)}), Grid({"vehicle.buoyancy": 4}))]  # fmt: skip
    vary = {"vehicle.buoyancy": Uniform(half_width=1.0), "start.position[2]": Normal(std=1.0)}
    for ours, theirs in pairs:
        n = {"grid": 4, "morris": 60}.get(ours.kind, 80)
        fleets = [lw.Ensemble(scene, kind(n), kind(3), vary, one) for kind, one in ((np.int64, ours), (int, theirs))]
        assert json.dumps(fleets[0].to_dict()) == json.dumps(fleets[1].to_dict())
        assert_same(fleets[0].select(0, n), fleets[1].select(0, n), slice(0, n))


@pytest.mark.parametrize("second_order", [True, False])
def test_saltellis_design_is_that_of_salib(second_order):
    from SALib.sample import sobol

    d, N = 3, 16
    problem = {"num_vars": d, "names": ["x", "y", "z"], "bounds": [[0.0, 1.0]] * d}
    expected = sobol.sample(problem, N, calc_second_order=second_order, scramble=False)
    design = lw.designs.Saltelli(second_order)
    AB = sobol_points(0, "x", 2 * d, np.arange(N), scramble=False)
    rows = design.rows(SPACE)
    got = np.concatenate([np.where(rows, one[d:], one[:d]) for one in AB])
    np.testing.assert_allclose(got, expected, rtol=0, atol=2.0**-32)
    assert design.group_size(SPACE) == len(rows) == len(expected) // N
    # The design itself is these rows of its own scrambled points.
    own = sobol_points(3, "saltelli", 2 * d, np.arange(N))
    np.testing.assert_array_equal(cube(design, np.arange(len(expected))),
                                  np.concatenate([np.where(rows, one[d:], one[:d]) for one in own]))  # fmt: skip


def test_a_joint_law_moves_as_one_factor():
    space = Space(1, ("a", "b"), (3, 1), (("a", (0, 1, 2)), ("b", (3,))))
    u = cube("saltelli", np.arange(6), space)
    A, B = u[0], u[-1]
    np.testing.assert_array_equal(u[1], [*B[:3], A[3]])
    np.testing.assert_array_equal(u[2], [*A[:3], B[3]])
    path = cube("morris", np.arange(3), space)
    moved = np.diff(path, axis=0) != 0.0
    assert sorted(moved.sum(axis=1)) == [1, 3]
    assert (moved.sum(axis=0) == 1).all()


def test_a_path_moves_one_factor_at_a_time_by_half_the_levels():
    u = cube("morris", np.arange(40))
    np.testing.assert_allclose(u * 4.0 - 0.5, np.round(u * 4.0 - 0.5), atol=1e-12)
    for path in u.reshape(10, 4, 3):
        moved = np.abs(np.diff(path, axis=0))
        np.testing.assert_allclose(np.sort(moved, axis=None), [0.0] * 6 + [0.5] * 3, atol=1e-12)
        assert ((moved > 0.1).sum(axis=0) == 1).all()


# Grids and tables --------------------------------------------------------------------------------------------------------


def test_a_grid_is_every_combination(scene):
    grid = Grid({"vehicle.mass": [120.0, 121.0, 125.0], "start.position[2]": [5.0, 6.0], "vehicle.buoyancy": 4,
                    "start.angular_velocity": [[0.0, 0.0, 0.1], [0.0, 0.2, 0.0]]})  # fmt: skip
    vary = {"vehicle.buoyancy": Uniform(low=1000.0, high=1400.0), "environment.gravity": Normal(std=0.001)}
    fleet = lw.Ensemble(scene, None, 1, vary, grid)
    assert fleet.members == 2 * 2 * 4 * 3
    m = fleet.select(0, 48)
    got = [(om[1], b[2], float(B), float(mass)) for om, b, B, mass in
           zip(m.angular_velocity, m.position, m.parameters["vehicle.buoyancy"], m.parameters["vehicle.mass"])]  # fmt: skip
    # In the order of the names, the last one fastest; a number of levels gives the middles of the law's parts.
    expected = list(itertools.product([0.0, 0.2], [5.0, 6.0], [1050.0, 1150.0, 1250.0, 1350.0], [120.0, 121.0, 125.0]))
    np.testing.assert_allclose(got, expected, rtol=1e-14)
    assert len(np.unique(m.parameters["environment.gravity"])) == 48
    assert_same(fleet.select(13, 20), m, slice(13, 20))
    assert_same(fleet.subset([40, 2]).select(0, 2), m, [40, 2])


def test_a_table_of_arrays(scene):
    rng = np.random.default_rng(0)
    J = rng.uniform(5.0, 5.5, (6, 3))
    R = stats.special_ortho_group(3, seed=1).rvs(6)
    values = {"vehicle.mass": rng.uniform(100, 150, 6), "start.position[1]": np.arange(6.0), "vehicle.inertia": J,
              "start.attitude": R, "vehicle.added_mass[0,1]": np.arange(6.0)}  # fmt: skip
    fleet = lw.Ensemble(scene, sampling=Table(values), vary={"environment.gravity": Normal(std=0.001)})
    m = fleet.select(0, 6)
    np.testing.assert_array_equal(m.parameters["vehicle.mass"], values["vehicle.mass"])
    np.testing.assert_array_equal(m.position, [[0.0, i, 10.0] for i in range(6)])
    np.testing.assert_array_equal(m.parameters["vehicle.inertia"], J[:, :, None] * np.eye(3))
    np.testing.assert_array_equal(m.attitude, R)
    added = m.parameters["vehicle.added_mass"]
    np.testing.assert_array_equal(added[:, 0, 1], np.arange(6.0))
    np.testing.assert_array_equal(added, np.swapaxes(added, 1, 2))
    assert_same(fleet.subset([4, 1]).select(0, 2), m, [4, 1])
    assert len(m.parameters["environment.gravity"]) == 6


def test_a_table_of_a_file(scene, tmp_path):
    path = tmp_path / "members.csv"
    path.write_text('vehicle.mass, start.position[2],"vehicle.inertia[0,0]"\n120.5,7,5.4\n121,8.25,5.5\n')
    (tmp_path / "scene.toml").write_text(
        '[vehicle]\nmass = 123.8\ninertia = [5.46, 5.29, 5.72]\n[ensemble]\nsampling = { table = { file = "members.csv" } }\n'
    )
    fleet = lw.Ensemble.from_scene(lw.Scene.load(tmp_path / "scene.toml"))
    m = fleet.select(0, 2)
    np.testing.assert_array_equal(m.parameters["vehicle.mass"], [120.5, 121.0])
    np.testing.assert_array_equal(m.position[:, 2], [7.0, 8.25])
    np.testing.assert_array_equal(m.parameters["vehicle.inertia"][:, 0, 0], [5.4, 5.5])
    content = fleet.scene.to_dict() | {"ensemble": fleet.to_dict()}
    assert_same(lw.Ensemble.from_scene(lw.Scene.from_dict(content)).select(0, 2), m, [0, 1])
    path.write_text(path.read_text().replace("120.5", "120.6"))
    assert "has changed" in faults(lw.Scene.from_dict, content)[0]


PLAIN = "vehicle.mass,start.position[2]\n120.5,7\n121,8.25\n"


@pytest.mark.parametrize(
    "text",
    [
        PLAIN,
        PLAIN.replace(",", ";"),
        PLAIN.replace(",", "\t"),
        PLAIN.replace(",", "  ,  "),
        PLAIN.replace("\n", "\r\n"),
        "\ufeff" + PLAIN,
        "# made by hand\n\n" + PLAIN.replace("121", "\n  # heavier\n121"),
        '"vehicle.mass","start.position[2]"\n"120.5","7"\n"121","8.25"\n',
        PLAIN.replace("121", "1.21e2").rstrip(),
    ],
    ids=["commas", "semicolons", "tabs", "spaces", "crlf", "bom", "comments", "quotes", "last line"],
)
def test_files_as_programs_write_them(tmp_path, text):
    (tmp_path / "members.csv").write_bytes(text.encode())
    found = Table(tmp_path / "members.csv").own_values()
    np.testing.assert_array_equal(found["vehicle.mass"], [120.5, 121.0])
    np.testing.assert_array_equal(found["start.position[2]"], [7.0, 8.25])


def test_numbers_of_a_file_have_all_their_digits(tmp_path):
    rng = np.random.default_rng(3)
    numbers = rng.standard_normal((50, 2)) * 10.0 ** rng.integers(-300, 300, (50, 2))
    numbers[0] = np.finfo(float).max, np.finfo(float).max  # whose sum is not finite
    np.savetxt(tmp_path / "a.csv", numbers, fmt="%.17g", delimiter=",", header="x,y", comments="")
    found = Table(tmp_path / "a.csv").own_values()
    np.testing.assert_array_equal(np.stack([found["x"], found["y"]], axis=1), numbers)


def test_columns_that_no_scene_has_are_left_out(scene, tmp_path):
    import pandas

    frame = pandas.DataFrame({"id": ["a", "b"], "vehicle.mass": [120, 121], "start.position[2]": [7.0, 8.25]})
    path = tmp_path / "members.csv"
    frame.to_csv(path)
    found = faults(Table, path, columns=["vehicle.mass", "id"])
    assert len(found) == 2
    assert all('leave the column out: ignore = ["id"]' in fault for fault in found)
    tables = [Table(path, ignore=["", "id"]), Table(path, columns=("start.position[2]", "vehicle.mass")),
              Table(frame, ignore=["id"]),
              Table(values=frame, columns=["vehicle.mass", "start.position[2]"])]  # fmt: skip
    for table in tables:
        assert sorted(table.own_values()) == ["start.position[2]", "vehicle.mass"]
        fleet = lw.Ensemble(scene, sampling=table)
        np.testing.assert_array_equal(fleet.parameters(0, 2)["vehicle.mass"], [120.0, 121.0])
        again = lw.Scene.from_dict(scene.to_dict() | {"ensemble": fleet.to_dict()})
        assert_same(lw.Ensemble.from_scene(again).select(0, 2), fleet.select(0, 2), [0, 1])


@pytest.mark.parametrize("kind", ["table", "levels"])
def test_the_first_lines_alone(scene, kind):
    lines = np.random.default_rng(4).uniform(0.1, 0.9, (30, 1))
    vary = {"start.position[2]": Normal(std=1.0)}
    design = UnitCubePoints(lines) if kind == "levels" else Table({"vehicle.mass": 120.0 + lines[:, 0]})
    whole, part = (lw.Ensemble(scene, members, 3, vary, design) for members in (None, 20))
    assert (whole.members, part.members) == (30, 20)
    assert_same(part.select(0, 20), whole.select(0, 30), slice(0, 20))
    assert_same(part.subset([17, 4]).select(0, 2), whole.select(0, 30), [17, 4])
    again = lw.Ensemble.from_scene(lw.Scene.from_dict(scene.to_dict() | {"ensemble": part.to_dict()}))
    assert again.members == 20
    assert_same(again.select(0, 20), whole.select(0, 30), slice(0, 20))


def test_a_design_of_ones_own(scene):
    u = np.random.default_rng(1).random((20, 2))
    vary = {"vehicle.mass": Uniform(low=100.0, high=110.0), "environment.gravity": Uniform(low=9.0, high=10.0)}
    fleet = lw.Ensemble(scene, None, 0, vary, UnitCubePoints(u))
    assert fleet.space.keys == ("environment.gravity", "vehicle.mass")
    np.testing.assert_allclose(fleet.parameters(0, 20)["environment.gravity"], 9.0 + u[:, 0], rtol=1e-15)
    np.testing.assert_allclose(fleet.parameters(3, 9)["vehicle.mass"], 100.0 + 10.0 * u[3:9, 1], rtol=1e-15)


# There and back ----------------------------------------------------------------------------------------------------------

GRID = {"grid": {"vehicle.mass": [120.0, 121.0], "vehicle.buoyancy": 3}}
TABLE = {"table": {"values": {"start.velocity_inertial[1]": [0.1, 0.2, 0.3]}}}


@pytest.mark.parametrize("content", [*SEQUENCES, *DESIGNS, GRID, TABLE], ids=str)
def test_an_ensemble_comes_back_from_its_provenance(scene, content):
    import json

    varied = {key: law for key, law in VARY.items() if content is not GRID or key != "vehicle.mass"}
    n = None if content in (GRID, TABLE) else members_of(content)
    fleet = lw.Ensemble(scene, n, 3, varied, content)
    for one in (fleet, fleet.subset([2, 0])):
        written = json.loads(json.dumps(scene.to_dict() | {"ensemble": one.to_dict()}))
        back = lw.Ensemble.from_scene(lw.Scene.from_dict(written))
        assert back.members == one.members
        assert back.to_dict() == one.to_dict()
        assert_same(back.select(0, one.members), one.select(0, one.members), slice(None))


def test_a_scene_file_names_its_sampling(tmp_path):
    text = """
        [vehicle]
        mass = 20.0
        inertia = [1.5, 4.0, 4.5]
        buoyancy = 196.0
        [ensemble]
        members = 512
        seed = 4
        sampling = "sobol"
        [ensemble.vary]
        "vehicle.mass" = { gamma = { a = 400.0, scale = 0.05 } }
        "vehicle.mass_dummy" = { normal = { std = 1.0 } }
        "start.attitude" = { rotation_normal = { std = [0.1, 0.1, 0.3] } }
        "start.velocity[0], vehicle.buoyancy" = { correlated_normal = { covariance = [[0.01, 0.01], [0.01, 0.04]] } }
        "environment.gravity" = { choice = { values = [9.78, 9.80665, 9.83] } }
    """
    path = tmp_path / "scene.toml"
    path.write_text(text)
    (fault,) = faults(lw.Scene.load, path)
    assert "vehicle.mass_dummy" in fault
    path.write_text(text.replace('        "vehicle.mass_dummy" = { normal = { std = 1.0 } }\n', ""))
    m = lw.Ensemble.from_scene(lw.Scene.load(path)).select(0, 512)
    # A sequence of 512 points: means good to a few 1/512 of the spread.
    assert abs(m.parameters["vehicle.mass"].mean() - 20.0) < 0.02
    assert set(m.parameters["environment.gravity"]) == {9.78, 9.80665, 9.83}
    # Covariance 0.01 of deviations 0.1 and 0.2: a correlation of 0.5, whose standard error at random is 0.75 / sqrt(512).
    assert abs(np.corrcoef(m.velocity[:, 0], m.parameters["vehicle.buoyancy"])[0, 1] - 0.5) < 5.0 * 0.75 / np.sqrt(512)


# What is refused -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "members", "texts"),
    [
        ("sobbol", 8, ["Did you mean 'sobol'?"]),
        (3, 8, ["is not a sampling"]),
        ({"sobol": {}, "halton": {}}, 8, ["is not a sampling"]),
        ({"sobol": 3}, 8, ["is not a table"]),
        ({"sobol": {"scramble": True}}, 8, ["unknown key"]),
        ({"sobol": {"replicates": 12}}, 24, ["ensemble.sampling.sobol.replicates = 12", "not a power of two", "Give 8, 16"]),
        ({"sobol": {"replicates": 128}}, 128, ["replicates = 128"]),
        ({"halton": {"replicates": True}}, 8, ["replicates = True"]),
        ({"halton": {"replicate": 8}}, 8, ["Did you mean 'replicates'?"]),
        ({"sobol": {"replicates": 16}}, 40, ["groups of 16", "32 or 48"]),
        ({"latin_hypercube": {"group": 16, "replicates": 4}}, 80, ["groups of 64", "64 or 128"]),
        ("latin_hypercube", 8, ["group = None", "is missing", "256"]),
        ({"latin_hypercube": {"group": 2.5}}, 8, ["group = 2.5"]),
        ({"latin_hypercube": {"group": -16}}, 8, ["group = -16"]),
        ({"latin_hypercube": {"group": True}}, 8, ["group = True"]),
        ({"latin_hypercube": {"group": np.True_}}, 8, ["group = True"]),
        ({"sobol": {"replicates": 0}}, 8, ["replicates = 0"]),
        ({"sobol": {"replicates": -8}}, 8, ["replicates = -8"]),
        ({"halton": {"replicates": np.True_}}, 8, ["replicates = True"]),
        ({"halton": {"replicates": 8.0}}, 8, ["replicates = 8.0"]),
        ({"morris": {"levels": -4}}, 7, ["levels = -4"]),
        ({"morris": {"levels": True}}, 7, ["levels = True"]),
        ({"grid": {"vehicle.mass": -3}}, None, ["whole number from 1"]),
        ({"grid": {"vehicle.mass": True}}, None, ["not numeric"]),
        ({"latin_hypercube": {"group": 30}}, 80, ["not a whole number of groups of 30", "60 or 90"]),
        ("saltelli", 13, ["groups of 14", "Give 14"]),
        ({"saltelli": {"second_order": 1}}, 14, ["second_order = 1"]),
        ("morris", 20, ["groups of 7", "14 or 21"]),
        ({"morris": {"levels": 5}}, 7, ["levels = 5"]),
        ({"grid": {}}, None, ["names nothing"]),
        ({"grid": {"vehicle.mass": []}}, None, ["not a list of values"]),
        ({"grid": {"vehicle.mass": 0}}, None, ["whole number from 1"]),
        ({"grid": {"environment.gravity": 3}}, None, ["has no distribution"]),
        ({"grid": {"environment.gravity": [9.8, 9.9]}}, 3, ["is not the 2 of the grid"]),
        ({"grid": {"vehicle.mass": [1.0, 2.0]}}, None, ["Drop one of them"]),
        ({"table": {}}, None, ["one of file and values"]),
        ({"table": {"file": "/nowhere.csv"}}, None, ["cannot be read"]),
        ({"table": {"values": {"environment.gravity": [9.8], "environment.water_density": [1.0, 2.0]}}}, None,
         ["lengths"]),
        ({"table": {"values": {"environment.gravity": [9.8], "environment.gravty": [1.0]}}}, None, ["Did you mean"]),
        ({"table": {"values": {"vehicle.mass": [9.8]}}}, None, ["varied by", "Keep one"]),
        ({"table": {"values": {"vehicle.center_of_buoyancy": [9.8]}}}, None, ["shape (1,)", "(1, 3)"]),
        ({"table": {"values": {"environment.gravity": [9.8, 9.9]}}}, 5, ["more than the 2 of the table", "2 or less"]),
        ({"table": {"values": {"id": [1.0], "environment.gravity": [9.8]}}}, None, ['leave it out: ignore = ["id"]']),
        ({"table": {"values": {"environment.gravity": [9.8]}, "columns": ["gravity"]}}, None,
         ["columns = 'gravity'", "Did you mean 'environment.gravity'?"]),
        ({"table": {"values": {"environment.gravity": [9.8]}, "ignore": ["id"]}}, None, ["ignore = 'id'", "not a column"]),
        ({"table": {"values": {"environment.gravity": [9.8]}, "ignore": "id"}}, None, ["is not a list of names"]),
        ({"table": {"values": {"environment.gravity": [9.8]}, "ignore": ["environment.gravity"]}}, None,
         ["leaves no column"]),
        ({"table": {"values": {"id": [9.8]}, "columns": ["id"], "ignore": ["id"]}}, None, ["Keep one of them"]),
        ({"table": {"values": np.eye(3)}}, None, ["has no names of columns", "DataFrame"]),
        ({"table": {"values": {}}}, None, ["has no names of columns"]),
        ({"table": {"values": {3: [1.0]}}}, None, ["has no names of columns"]),
        ({"table": {"values": {"environment.gravity": np.array([9.8, np.nan])}}}, None, ["nan", "of member 1"]),
        ({"levels": {"points": np.full((2, 16), 0.5)}}, 3, ["more than the 2 of the levels"]),
        ({"levels": {"points": [[0.5, 1.0]]}}, None, ["has points outside the open unit cube"]),
        ({"levels": {"points": [[0.5, 0.1]]}}, None, ["has 2 columns"]),
    ],
    ids=str,
)  # fmt: skip
def test_bad_samplings(scene, content, members, texts):
    (fault,) = faults(lw.Ensemble, scene, members, 3, VARY, content)
    assert all(text in fault for text in texts), fault


# Text of a file -> of each fault what it must say, with | between.
BAD_FILES = {
    "": ["is empty"],
    "# vehicle.mass\n\n": ["is empty"],
    "vehicle.mass\n": ["names and no members"],
    "vehicle.mass\nheavy\n": ['\'heavy\', which is not a number, in line 2, column "vehicle.mass"'],
    "vehicle.mass\n1,2\n": ["1 names and 2 cells in line 2"],
    "a,b\n1,2\n3\n": ["2 names and 1 cells in line 3"],
    "vehicle.mass,vehicle.mass\n1,2\n": ["twice, 'vehicle.mass' (line 1)"],
    "# a\n\nx,y\n1,2\n\n# b\nnan,3\n1,\n": ['nan, which is not finite, in line 7, column "x"',
                                          'no number in line 8, column "y"'],
    "x,y\n1e400,-inf\n": ['1e400, which is not finite, in line 2, column "x"', '-inf|column "y"'],
    "120,121\n1,2\n": ["numbers where the names should be (line 1)"],
    "\nvehicle.inertia[0,0],vehicle.mass\n5,120\n": ["'vehicle.inertia[0' (line 2). Quote a name"],
    ",vehicle.mass\n0,120\n": ['without a name, number 1|ignore = [""]'],
    "x;y\n120,5;7\n": ["'120,5', which is not a number|with a point"],
    'x\n"120\n121\n': ["which is not a number, in line 3"],
    "x\n" + "?\n" * 20: [*(f"in line {i}," for i in range(2, 10)), "12 more such faults"],
    "x\n" + "1" * 200_000: ["cannot be read|line 2"],
}  # fmt: skip


@pytest.mark.parametrize("text", BAD_FILES, ids=range(len(BAD_FILES)))
def test_bad_files(tmp_path, text):
    path = tmp_path / "members.csv"
    path.write_text(text)
    found = faults(Table, str(path))
    assert len(found) == len(BAD_FILES[text]), found
    for fault, expected in zip(found, BAD_FILES[text], strict=True):
        assert all(words in fault for words in expected.split("|")), fault


def test_files_that_are_none(scene, tmp_path):
    path = tmp_path / "members.csv"
    assert "No such file" in faults(Table, path)[0]
    path.write_bytes(b"x\n120\xb0\n")
    assert "not a text in UTF-8" in faults(Table, path)[0]
    path.write_text("vehicle.mass [kg],vehicle.buoyancy\n120,1000\n")
    (fault,) = faults(lw.Ensemble, scene, sampling=Table(path))
    says(fault, '"vehicle.mass [kg]"', "Did you mean 'vehicle.mass'?")


def test_bad_names_and_laws_come_in_one_message(scene):
    vary = {"vehicle.mass, vehicle.buoyancy": Normal(std=1.0),
            "vehicle.inertia[0,5]": Normal(std=1.0),
            "vehicle.mass[0]": Normal(std=1.0), "start.position": Normal(std=1.0),
            "start.position[1]": Normal(std=1.0),
            "vehicle.added_mass": RotationNormal(std=0.1),
            "vehicle.center_of_buoyancy": PositiveDefinite(sigma=0.1),
            "environment.gravity, environment.water_density": CorrelatedNormal(covariance=np.eye(3)),
            "vehicle.inertia": PositiveDefinite(sigma=(0.1, 0.2)),
            "vehicle.nothing": stats.gamma(2.0)}  # fmt: skip
    found = faults(lw.Ensemble, scene, 4, 0, vary)
    assert len(found) == 9
    for key in vary:
        assert sum(f'"{key}" =' in fault for fault in found) == (0 if key == "start.position" else 1), key


def test_every_fault_of_a_section_comes_at_once(scene):
    content = scene.to_dict() | {"ensemble": {
        "members": 0, "seed": -1, "sampling": "sobbol", "indices": [],
        "vary": {"vehicle.mas": {"normal": {"std": 1.0}}, "vehicle.mass": {"gamma": {}}},
    }}  # fmt: skip
    found = faults(lw.Scene.from_dict, content)
    assert len(found) == 6
    for word in ("members = 0", "seed = -1", "'sobbol'", "indices = []", "vehicle.mas", "gamma.a"):
        assert any(word in fault for fault in found), word


def test_whole_matrices_of_a_grid(scene):
    J = np.diag([5.0, 5.5, 6.0])
    skew = J + np.array([[0.0, 0.1, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    fleet = lw.Ensemble(scene, sampling=Grid({"vehicle.inertia": [J, 1.1 * J]}))
    np.testing.assert_array_equal(fleet.parameters(0, 2)["vehicle.inertia"], [J, 1.1 * J])
    assert "not symmetric" in faults(lw.Ensemble, scene, sampling=Grid({"vehicle.inertia": [J, skew]}))[0]


def test_attitudes_of_a_list(scene):
    """Chosen from a grid, a law and a table alike; the scene's own is a rotation vector."""
    R = stats.special_ortho_group(3, seed=1).rvs(4)
    grid = lw.Ensemble(scene, sampling=Grid({"start.attitude": R, "vehicle.mass": [120.0, 121.0]}))
    m = grid.select(0, 8)
    np.testing.assert_array_equal(m.attitude, np.repeat(R, 2, axis=0))
    np.testing.assert_array_equal(m.parameters["vehicle.mass"], [120.0, 121.0] * 4)
    assert_same(grid.member(5).select(0, 1), m, [5])
    law = Choice(R, weights=[1, 1, 1, 0])
    drawn = lw.Ensemble(scene, 100, 0, {"start.attitude": law})
    which = np.abs(drawn.select(0, 100).attitude[:, None] - R).max(axis=(2, 3)).argmin(axis=1)
    np.testing.assert_array_equal(drawn.select(0, 100).attitude, R[which])
    assert set(which) == {0, 1, 2}
    for fleet in (grid, drawn):
        again = lw.Scene.from_dict(scene.to_dict() | {"ensemble": fleet.to_dict()})
        assert_same(lw.Ensemble.from_scene(again).select(0, 8), fleet.select(0, 8), slice(0, 8))


def test_attitudes_that_are_no_rotations(scene):
    R = stats.special_ortho_group(3, seed=1).rvs(4)
    R[2, 0] *= -1.0
    for sampling_, vary in ((Grid({"start.attitude": R}), None), ("random", {"start.attitude": Choice(R)})):
        (fault,) = faults(lw.Ensemble, scene, None, 0, vary, sampling_)
        says(fault, 'vary."start.attitude"', "not a rotation to 1e-9 (number 3)")
    assert "by entry" in faults(lw.Ensemble, scene, 4, 0, {"start.attitude": Choice([0.0, 1.0])})[0]
    assert "shape (2, 2)" in faults(lw.Ensemble, scene, 4, 0, {"start.attitude": Choice([np.eye(2)])})[0]


def test_the_attitude_varies_in_one_way_only(scene):
    vary = {"start.attitude": UniformRotation(), "start.rotation_vector": Normal(std=0.1)}
    assert "Keep one of them" in faults(lw.Ensemble, scene, 4, 0, vary)[0]
    assert "RotationNormal" in faults(lw.Ensemble, scene, 4, 0, {"start.attitude[0,0]": Normal(std=0.1)})[0]


def test_indices_that_are_not_there(scene):
    content = scene.to_dict() | {"ensemble": {"members": 4, "indices": [1, 4]}}
    assert "is none of the 4 members" in faults(lw.Scene.from_dict, content)[0]
    content["ensemble"]["indices"] = [0.5]
    assert "whole numbers" in faults(lw.Scene.from_dict, content)[0]
    fleet = lw.Ensemble(scene, 10)
    for bad in ([], [10], [-1], [0.5], [[1]]):
        with pytest.raises(IndexError):
            fleet.subset(bad)


def test_names_and_entries():
    (a,), (b, c, d) = targets("vehicle.mass"), targets("x.y[1, 2],start.position[0] , z")
    assert (a.name, a.index) == ("vehicle.mass", None)
    assert [one.label for one in (b, c, d)] == ["x.y[1,2]", "start.position[0]", "z"]


def test_an_entry_varies_alone(scene):
    vary = {"start.position[2]": Normal(std=1.0), "vehicle.inertia[0,1]": Normal(std=0.01)}
    m = lw.Ensemble(scene, 30, 0, vary).select(0, 30)
    np.testing.assert_array_equal(m.position[:, :2], 0.0)
    J = m.parameters["vehicle.inertia"]
    assert len(np.unique(m.position[:, 2])) == len(np.unique(J[:, 0, 1])) == 30
    np.testing.assert_array_equal(J, np.swapaxes(J, 1, 2))
    np.testing.assert_array_equal(J[:, 2], np.tile([0.0, 0.0, 5.72], (30, 1)))


def test_many_members_take_little_memory(scene):
    """All members are looked at when the ensemble is made; nothing of them stays."""
    import tracemalloc

    tracemalloc.start()
    fleet = lw.Ensemble(scene, 300_000, 0, {"vehicle.mass": Normal(relative=0.001)}, "sobol")
    fleet.select(299_000, 300_000)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # 65,536 members at a time: a 3x3 matrix, its copy and a few numbers of each are below 30 doubles; of all members they
    # would be 72 MB.
    assert peak < 65_536 * 8 * 60


@pytest.mark.parametrize("axes", [None, {}, [1.0], "vehicle.mass", 3])
def test_a_grid_names_what_it_is_a_grid_of(axes):
    """A value that is no table of axes is one fault, and no error of Python's follows."""
    (fault,) = faults(Grid, axes)
    assert fault.startswith("ensemble.sampling.grid.axes = ")
    assert "names nothing" in fault


def test_a_hypercube_without_its_group_is_told_so():
    for make in (LatinHypercube, lambda: sampling.sampling_of("latin_hypercube"), lambda: LatinHypercube(replicates=2)):
        (fault,) = faults(make)
        assert fault == (
            "ensemble.sampling.latin_hypercube.group = None is missing. Give how many members make a hypercube: group = 256."
        )
    assert "is not a whole number from 2" in faults(LatinHypercube, 0)[0]


def test_a_posterior_by_chain_and_draw_is_a_table_of_all_draws():
    """A posterior in ArviZ' form: idata.posterior."""
    import xarray as xr

    buoyancy, start = np.arange(6.0).reshape(2, 3), np.arange(18.0).reshape(2, 3, 3)
    each = {"vehicle.buoyancy": (("chain", "draw"), buoyancy), "start.position": (("chain", "draw", "axis"), start)}
    posterior = xr.Dataset(each, {"chain": [0, 1], "draw": [0, 1, 2]})
    table = Table(posterior)
    np.testing.assert_array_equal(table.own_values()["vehicle.buoyancy"], np.arange(6.0))
    np.testing.assert_array_equal(table.own_values()["start.position"], np.arange(18.0).reshape(6, 3))
    # One chain is as good, and what has other dimensions is read as before.
    np.testing.assert_array_equal(Table(posterior.isel(chain=0)).own_values()["vehicle.buoyancy"], [0.0, 1.0, 2.0])
    for other in (
        posterior.transpose("axis", "draw", "chain"),
        xr.DataTree.from_dict({"posterior": posterior})["posterior"],
    ):
        again = Table(other).own_values()
        assert again.keys() == table.own_values().keys()
        for name, values in table.own_values().items():
            np.testing.assert_array_equal(again[name], values)
