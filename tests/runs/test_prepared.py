# SPDX-License-Identifier: Apache-2.0
"""A prepared run has the bits of solve, whatever varies, however often and from however many threads it is called."""

import dataclasses
import functools
import gc
import pickle
import re
import tracemalloc
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.calls import predict, prepared
from lgvi_warp.calls.prepared import FailedMembers
from lgvi_warp.designs import Grid, Table, UnitCubePoints
from lgvi_warp.distributions import Normal, RotationNormal, Uniform
from lgvi_warp.engine import plan as plans
from lgvi_warp.engine.arrays import LawArrays
from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.shared import SharedResultsCache
from lgvi_warp.runs.run import run_plan
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.scene import ensemble as ensembles
from lgvi_warp.terms import Current, DragMatrix, Thrusters, WrenchNoise

pytestmark = pytest.mark.kernel

NAMES = ["vehicle.mass", "start.angular_velocity[0]", "vehicle.buoyancy"]
SETTINGS = dict(h=0.01, t1=0.3)
# Step and end of the runs whose kernel is compiled for one test only.
SHORT = dict(h=0.01, t1=0.02, width=4)


@pytest.fixture(scope="module")
def paper():
    return lw.Scene.load("examples/paper.toml")


def numbers(n, seed=0):
    rng = np.random.default_rng(seed)
    return np.array([123.8, 0.3, 1215.8]) + rng.normal(size=(n, 3)) * [1.0, 0.01, 1.0]


def solved(scene, names, X, **settings):
    """The result of solve for the same members."""
    fleet = lw.Ensemble(scene, None, 0, None, Table(values=dict(zip(names, np.asarray(X).T, strict=True))))
    return lw.solve(fleet, **settings)


@pytest.mark.ci
def test_quantities_are_those_of_solve(paper):
    run = lw.prepare(paper, NAMES, of=["position[2]", "norm(velocity)"], **SETTINGS)
    assert run.names == tuple(NAMES)
    for n, seed in ((16, 0), (3, 1), (300, 2), (16, 3), (1, 4), (16, 0)):
        X = numbers(n, seed)
        expected = solved(paper, NAMES, X, **SETTINGS)
        Y = run(X)
        np.testing.assert_array_equal(Y[:, 0], expected.position[-1, :, 2])
        np.testing.assert_array_equal(Y[:, 1], np.sqrt((expected.velocity[-1] ** 2).sum(axis=1)))


def test_a_result_without_quantities_is_that_of_solve(paper):
    run = lw.prepare(paper, NAMES, save=lw.SaveAt(every=0.1), **SETTINGS)
    X = numbers(20)
    result, expected = run(X), solved(paper, NAMES, X, save=lw.SaveAt(every=0.1), **SETTINGS)
    for name in ("time", "position", "attitude", "velocity", "angular_velocity", "status", "warnings", "warning_value"):
        np.testing.assert_array_equal(getattr(result, name), getattr(expected, name))
    for name, values in expected.parameters.items():
        np.testing.assert_array_equal(result.parameters[name], values)
    assert result.provenance["kernel"] == expected.provenance["kernel"]
    assert result.provenance["ensemble"]["members"] == 20


@pytest.mark.ci
def test_columns_may_have_names(paper):
    run = lw.prepare(paper, NAMES, of="depth", **SETTINGS)
    X = numbers(5)
    by_name = {name: X[:, i] for i, name in enumerate(NAMES)}
    np.testing.assert_array_equal(run({name: by_name[name] for name in NAMES[::-1]}), run(X))


@pytest.mark.ci
def test_members_may_be_drawn(paper):
    vary = {"vehicle.mass": Normal(relative=0.01), "start.angular_velocity": Normal(std=0.1)}
    run = lw.prepare(lw.Ensemble(paper, 40, 7, vary), of="position", **SETTINGS)
    for seed, members in ((None, None), (8, None), (8, 5), (7, 40)):
        fleet = lw.Ensemble(paper, members or 40, 7 if seed is None else seed, vary)
        expected = lw.solve(fleet, **SETTINGS).position[-1]
        np.testing.assert_array_equal(run(seed=seed, members=members), expected)
    assert run.names == ("vehicle.mass", *(f"start.angular_velocity[{i}]" for i in range(3)))
    with pytest.raises(lw.SceneError, match="seed"):
        run(seed=-1)
    with pytest.raises(lw.SceneError, match="beside X"):
        run(np.ones((1, 4)), members=1)


@pytest.mark.ci
def test_another_seed_draws_the_same_members_anew(paper):
    vary = {"vehicle.mass": Normal(relative=0.01)}
    run = lw.prepare(lw.Ensemble(paper, 40, 7, vary).subset([3, 30]), of="position", **SETTINGS)
    for seed in (7, np.int64(8)):
        expected = lw.solve(lw.Ensemble(paper, 40, seed, vary).subset([3, 30]), **SETTINGS).position[-1]
        np.testing.assert_array_equal(run(seed=seed), expected)
    whole = lw.solve(lw.Ensemble(paper, 5, 7, vary), **SETTINGS).position[-1]
    np.testing.assert_array_equal(run(members=5), whole)


def test_common_noise_leaves_the_ensemble_as_it_is(paper):
    fleet = lw.Ensemble(paper, 3, 0, {"vehicle.mass": Normal(relative=0.01)})
    lw.prepare(fleet, of="position", common_noise=True, **SETTINGS)()
    np.testing.assert_array_equal(fleet.indices, [0, 1, 2])


def test_given_states_are_not_drawn(paper):
    still = np.zeros((4, 3))
    fleet = lw.Ensemble.from_states(paper, still, np.repeat(np.eye(3)[None], 4, axis=0), still + 1.0, still)
    run = lw.prepare(fleet, of="position", **SETTINGS)
    assert run(seed=3).shape == (4, 3)
    with pytest.raises(lw.SceneError, match=r"members = 9 .* 4 "):
        run(members=9)


def test_columns_that_a_sampling_has_are_not_dropped(paper):
    vary = {"vehicle.buoyancy": Normal(relative=0.01)}
    for sampling in (Table(values={"vehicle.mass": np.full(4, 120.0)}), Grid({"vehicle.mass": [120.0, 121.0]})):
        run = lw.prepare(lw.Ensemble(paper, None, 0, vary, sampling), of="position", **SETTINGS)
        assert len(run()) in (2, 4)
        with pytest.raises(lw.SceneError, match=r"X.*vehicle\.mass"):
            run(np.full((1, 1), 1215.8))


def test_levels_stand_for_distributions(paper):
    vary = {"vehicle.mass": Normal(relative=0.01), "start.attitude": RotationNormal(std=0.1)}
    run = lw.prepare(paper, vary, of="position", levels=True, **SETTINGS)
    X = np.random.default_rng(0).random((6, len(run.names)))
    space = lw.Ensemble(paper, 1, 0, vary).space
    cube = np.empty_like(X)
    order = [
        f"{label} {i}" if len(columns) > 1 else label for label, columns in space.factors for i in range(len(columns))
    ]
    cube[:, [order.index(name) for name in run.names]] = X
    fleet = lw.Ensemble(paper, None, 0, vary, UnitCubePoints(cube))
    np.testing.assert_array_equal(run(X), lw.solve(fleet, **SETTINGS).position[-1])
    with pytest.raises(lw.SceneError, match="level"):
        run(X + 1.0)
    drawn = lw.prepare(paper, vary, of="position", **SETTINGS)
    with pytest.raises(lw.SceneError, match="joint distribution"):
        drawn(X)


def test_states_may_be_given(paper):
    run = lw.prepare(paper, NAMES, of="position", **SETTINGS)
    rng = np.random.default_rng(0)
    states = rng.normal(size=(4, 3)), np.repeat(np.eye(3)[None], 4, axis=0), rng.normal(size=(4, 3)), np.zeros((4, 3))
    mass = {"vehicle.mass": np.linspace(120.0, 124.0, 4)}
    expected = lw.solve(lw.Ensemble.from_states(paper, *states, mass), **SETTINGS)
    np.testing.assert_array_equal(run.states(*states, mass), expected.position[-1])
    for keys in ([1, 2], [1.0, 2.0, 3.0, 4.0], [-1, 0, 1, 2], [2**31, 0, 1, 2]):
        with pytest.raises(lw.SceneError, match=r"indices = .*(below 2147483648|is not a list of members|is negative)"):
            run.states(*states, indices=keys)
    for seed in (-1, 1.5):
        with pytest.raises(lw.SceneError, match="seed = "):
            run.states(*states, seed=seed)


def test_failed_members_are_refused_or_have_no_number(paper):
    X = numbers(4)
    X[2, 1] = 1e6
    with pytest.raises(FailedMembers, match=r"1 of 4 members failed .*member 2.*failed=\"nan\""):
        lw.prepare(paper, NAMES, of="depth", **SETTINGS)(X)
    Y = lw.prepare(paper, NAMES, of="depth", failed="nan", **SETTINGS)(X)
    assert np.isnan(Y[2])
    assert np.isfinite(np.delete(Y, 2)).all()


def test_unphysical_numbers_are_refused(paper):
    run = lw.prepare(paper, NAMES, of="depth", **SETTINGS)
    X = numbers(4)
    X[1, 0] = -1.0
    with pytest.raises(lw.SceneError, match=r"vehicle\.mass of member 1"):
        run(X)
    for odd in (np.ones((3, 2)), np.ones(3), np.ones((0, 3)), "x", {name: () for name in NAMES}):
        with pytest.raises(lw.SceneError, match="X"):
            run(odd)
    with pytest.raises(lw.SceneError) as caught:
        lw.prepare(paper, ["vehicle.mas"], of="dept", failed="no", h=0.1, t1=1.0)
    assert all(word in str(caught.value) for word in ("dept", "failed"))


def test_whole_numbers_are_refused_with_the_name_of_an_entry(paper):
    for name, entry in (("start.position", "start.position[0]"), ("drag_matrix.linear", "drag_matrix.linear[0,0]")):
        scene = lw.Scene(paper.vehicle, paper.environment, terms=[DragMatrix(linear=np.eye(6))], start=paper.start)
        with pytest.raises(lw.SceneError, match=rf'such as "{re.escape(entry)}"'):
            lw.prepare(scene, [name], of="depth", **SETTINGS)
        lw.Ensemble(scene, 1, 0, {entry: Uniform(1.0, 2.0)})


@pytest.mark.ci
def test_other_members_may_need_another_kernel():
    """A term that no member feels is in no kernel, and an isotropic mass matrix has code of its own."""
    scene = lw.Scene(lw.Vehicle(mass=10.0, added_mass=[0.0, 0.0, 0.0], inertia=[1.0, 2.0, 3.0]),
                     start=lw.Start(velocity=[1.0, 0.2, 0.1], angular_velocity=[0.1, 0.2, 0.3]),
                     terms=[Current(velocity=[0.0, 0.0, 0.0])])  # fmt: skip
    names = ["current.velocity[0]", "vehicle.added_mass[1,1]"]
    run = lw.prepare(scene, names, of="position", **SHORT)
    for X in ([[0.0, 0.0]], [[0.5, 0.0]], [[0.0, 3.0]], [[0.0, 0.0], [0.5, 3.0]], [[0.0, 0.0]]):
        np.testing.assert_array_equal(run(np.array(X)), solved(scene, names, X, **SHORT).position[-1])


@pytest.mark.ci
def test_paths_are_kept_of_some_members_at_a_time(paper, monkeypatch):
    run = lw.prepare(paper, NAMES, of=["max(depth)", "depth"], save=lw.SaveAt(every=0.1), failed="nan", **SETTINGS)
    X = numbers(300)
    X[290, 1] = 1e6
    expected, sizes, told = run(X), [], []
    monkeypatch.setattr(prepared, "PATHS_AT_ONCE", 128)
    whole = prepared.Runner.run
    monkeypatch.setattr(prepared.Runner, "run", lambda *given, **named: (
        sizes.append(given[1].members), whole(*given, **named))[1])  # fmt: skip
    np.testing.assert_array_equal(run(X, progress=told.append), expected)
    assert sizes == [128, 128, 44]
    assert told == sorted(told)
    assert told[-1] == 1.0
    assert np.isnan(expected[290]).all()
    with pytest.raises(FailedMembers, match=r"1 of 300 members failed .*member 290"):
        lw.prepare(paper, NAMES, of="max(depth)", save=lw.SaveAt(every=0.1), **SETTINGS)(X)


# Calls one after the other, each of which changes one kind of number, or none: (columns that change, by how much).
CHANGES = [([], 0.0), ([1], 0.1), ([0], 0.5), ([2], -0.5), ([0, 1, 2], 0.2), ([1], 1e-16), ([], 0.0), ([1], -0.3)]


@pytest.mark.ci
@pytest.mark.parametrize("members", [1, 5])
def test_nothing_of_the_call_before_is_left(paper, members):
    run, X = lw.prepare(paper, NAMES, of="position", **SETTINGS), numbers(members)
    sound = X.copy()
    for columns, change in CHANGES:
        X[-1, columns] += change  # in the caller's array, which an earlier call has read
        np.testing.assert_array_equal(run(X), solved(paper, NAMES, X, **SETTINGS).position[-1])
        with pytest.raises(lw.SceneError) as first:
            run(np.where(np.arange(3) == 2, -1.0, X))
        with pytest.raises(lw.SceneError) as alone:
            solved(paper, NAMES, np.where(np.arange(3) == 2, -1.0, X), **SETTINGS)
        assert str(first.value) == str(alone.value)
    np.testing.assert_array_equal(run(sound[:1]), solved(paper, NAMES, sound[:1], **SETTINGS).position[-1])
    np.testing.assert_array_equal(run(sound), solved(paper, NAMES, sound, **SETTINGS).position[-1])


@pytest.mark.ci
def test_a_zero_of_another_sign_is_another_number():
    scene = lw.Scene.named("sphere", terms=[Current(velocity=[0.0, 0.0, 0.0])])
    run = lw.prepare(scene, ["current.velocity[0]"], of=lambda end: end.parameters["current.velocity"][:, 0], **SHORT)
    for zero in (0.0, -0.0, 0.0):
        assert run([[zero]]).tobytes() == np.array([zero]).tobytes()


def test_columns_that_their_owner_changes_are_others(paper):
    fleet = lw.Ensemble(paper, None, 0, None, Table(values={"vehicle.mass": [123.8]}))
    column = np.array([124.0])
    before = fleet.with_columns({"vehicle.mass": column}).parameters(0, 1)["vehicle.mass"]
    column += 1.0
    assert fleet.with_columns({"vehicle.mass": column}).parameters(0, 1)["vehicle.mass"] == 125.0
    assert before == 124.0


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_mass_whose_square_is_no_number_gives_no_warning_of_numpy():
    vehicle = lw.Vehicle(mass=10.0, added_mass=[0.0, 1.0, 2.0], inertia=[1.0, 2.0, 3.0])
    scene = lw.Scene(vehicle, terms=[lw.terms.Drag(quadratic=[5.0, 6.0, 7.0, 0.1, 0.1, 0.1])])
    make_plan(lw.Ensemble(scene, None, 0, None, Table(values={"vehicle.mass": [1e160]})), "psi_x", **SHORT)


@pytest.mark.ci
def test_noise_of_a_call_is_its_own():
    noise = WrenchNoise(force=(1.0, 0.0, 0.0))
    scene = lw.Scene(lw.Vehicle(mass=10.0, added_mass=[0.0, 1.0, 2.0], inertia=[1.0, 2.0, 3.0]), terms=[noise])
    names, X = ["vehicle.mass"], np.full((2, 1), 10.0)
    run = lw.prepare(scene, names, of="position", **SHORT)
    for seed, indices in ((0, [0, 1]), (3, [0, 1]), (3, [1, 0]), (0, [7, 7]), (0, [0, 1])):
        fleet = lw.Ensemble(scene, None, seed, None, Table(values={"vehicle.mass": X[:, 0]}))
        fleet.indices = np.array(indices)
        np.testing.assert_array_equal(run(X, seed=seed, indices=indices), lw.solve(fleet, **SHORT).position[-1])


@pytest.mark.ci
def test_a_call_computes_nothing_again_that_follows_from_the_same_numbers(monkeypatch):
    scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
    names, X = ["start.velocity[0]", "drag_matrix.quadratic[1,1]"], np.array([[1.5, 150.0]])
    run = lw.prepare(scene, names, of="position", **SHORT)
    run(X)
    counts = Counter()
    for kind, name in ((DragMatrix, "packed"), (DragMatrix, "unphysical"), (LawArrays, "write")):
        monkeypatch.setattr(kind, name, counted(counts, getattr(kind, name)))
    run(X)
    run(X + np.array([[0.1, 0.0]]))
    assert not counts
    run(X + np.array([[0.0, 1.0]]))
    assert counts == {"packed": 1, "unphysical": 1, "write": 1}


def counted(counts, function):
    """The function, whose calls are counted."""

    @functools.wraps(function)
    def call(*values, **named):
        counts[function.__name__] += 1
        return function(*values, **named)

    return call


@pytest.mark.ci
def test_threads_may_call_at_once(paper):
    run = lw.prepare(paper, NAMES, of="position", threads=1, **SETTINGS)
    inputs = [numbers(17 + i % 3, i) for i in range(40)]
    expected = [run(X) for X in inputs]
    with ThreadPoolExecutor(4) as pool:
        for Y, known in zip(pool.map(run, inputs), expected, strict=True):
            np.testing.assert_array_equal(Y, known)


def test_a_pickle_runs_again(paper):
    run = lw.prepare(paper, NAMES, of="depth", **SETTINGS)
    again = pickle.loads(pickle.dumps(run))
    np.testing.assert_array_equal(again(numbers(3)), run(numbers(3)))


def test_statistics_are_gathered_by_call(paper):
    mean = lw.statistics.Mean("position")
    run = lw.prepare(paper, NAMES, statistics=[mean], **SETTINGS)
    X = numbers(12)
    expected = solved(paper, NAMES, X, statistics=[mean], **SETTINGS).statistics[mean.key]
    np.testing.assert_array_equal(run(X).statistics[mean.key].value, expected.value)


OF_CALLS = [tracemalloc.Filter(True, f"*/{name}/*") for name in ("lgvi_warp", "lgvi_kernels", "warp", "numpy")]


@pytest.mark.slow
def test_calls_take_no_more_and_more_memory(paper):
    run = lw.prepare(paper, NAMES, of="depth", h=0.01, t1=0.01)
    X = [numbers(1 + i % 7) for i in range(50)]
    for each in X:
        run(each)
    tracemalloc.start()
    try:
        sizes = []
        for _ in range(4):
            for _ in range(5):
                for each in X:
                    run(each)
            gc.collect()
            # Of what calls run: other threads of the process allocate as they please.
            sizes.append(sum(trace.size for trace in tracemalloc.take_snapshot().filter_traces(OF_CALLS).traces))
    finally:
        tracemalloc.stop()
    assert sizes[-1] - sizes[0] < 20_000


def leaves(values):
    """The plain arrays of a structured one; between them are bytes that no code reads."""
    if values.dtype.names is None:
        return [values]
    return [leaf for name in values.dtype.names for leaf in leaves(values[name])]


def arrays(packets):
    """All numbers that a kernel is given, as bytes."""
    structs = [packets.inertia, *packets.laws.structs]
    views = [leaf for part in structs if len(part.view) for leaf in leaves(part.view)]
    views += [packets.laws.table.view, packets.laws.memory.view, packets.state_lanes.view]
    return [np.broadcast_to(view, (packets.count, *view.shape[1:])).tobytes() for view in views]


@pytest.mark.parametrize("vehicle", ["paper", "remus_100"])
def test_what_is_shared_changes_no_bit(vehicle, paper):
    """For every name of the scene: numbers that vary are packed alone, or all numbers as if all varied."""
    scene = paper if vehicle == "paper" else lw.Scene.named("remus_100")
    method = "psi_s" if vehicle == "paper" else "psi_x"
    width = 4
    for name, value in scene.parameters().items():
        if not np.any(value) or name.endswith(("times", "stations", "tolerance")):
            continue
        factor = 1.0 + 1e-4 * np.arange(6.0)
        columns = {name: value[None] * factor.reshape(6, *(1,) * value.ndim)}
        still = np.zeros((6, 3))
        states = still, np.repeat(np.eye(3)[None], 6, axis=0), still + 1.0, still + 0.1
        try:
            fleet = lw.Ensemble.from_states(scene, *states, columns)
        except lw.SceneError:  # a table of places that must not move
            continue
        plan = make_plan(fleet, method, h=0.01, t1=0.01, width=width)
        alone = arrays(Packets(plan, fleet.select(0, 6)))
        everything = {*scene.parameters(), *fleet.varied_names, "frame", "axes", "members", "seed"}
        plan = dataclasses.replace(plan, shared=SharedResultsCache(everything))
        assert alone == arrays(Packets(plan, fleet.select(0, 6))), name


# Commands along a schedule, which have rows, and a memory of their lag.
PUSHING = {
    "position": [[-0.5, 0.2, 0.0]], "direction": [[1.0, 0.0, 0.0]], "coefficient": [20.0], "limit": [1.0],
    "time_constant": [0.3], "times": [0.0, 0.3, 0.6], "command_schedule": [[0.2], [0.9], [0.1]],
}  # fmt: skip


@pytest.mark.ci
def test_laws_remember_nothing_of_the_call_before():
    scene = lw.Scene.named("sphere", terms=[Thrusters(**PUSHING)])
    names = ["start.velocity[0]", "thrusters.coefficient[0]"]
    run = lw.prepare(scene, names, of="position", **SHORT)
    for X in ([[0.0, 20.0]], [[0.0, 20.0]], [[1.0, 20.0]], [[1.0, 25.0]], [[1.0, 25.0]]):
        np.testing.assert_array_equal(run(X), solved(scene, names, X, **SHORT).position[-1])


@pytest.mark.ci
@pytest.mark.parametrize("columns", [(5,), (2, 5)])
def test_packets_take_members_whose_laws_have_other_rows(columns):
    """Turned axes: a drag matrix has as many rows as some member has columns, and the thrusters' rows come after them."""
    inertia = [[1.0, 0.1, 0.0], [0.1, 2.0, 0.2], [0.0, 0.2, 2.5]]
    vehicle = lw.Vehicle(mass=10.0, added_mass=[1.0, 2.0, 3.0], inertia=inertia)
    thrusters = Thrusters(**PUSHING)
    drag = DragMatrix(linear=np.eye(6), quadratic=np.diag([10.0, 20.0, 0.0, 1.0, 2.0, 0.0]))
    scene = lw.Scene(vehicle, terms=[drag, thrusters], start=lw.Start(velocity=[1.0, 0.2, 0.1]))
    names = ["drag_matrix.quadratic[2,2]", "drag_matrix.quadratic[5,5]"]
    fleet = lw.Ensemble(scene, None, 0, None, Table(values={name: np.linspace(0.0, 5.0, 6) for name in names}))
    plan = make_plan(fleet, "psi_x", **SHORT)
    few, more = [np.zeros((6, 2)) for _ in range(2)]
    more[:, [names.index(f"drag_matrix.quadratic[{j},{j}]") for j in columns]] = 3.0
    blocks = [fleet.with_columns(dict(zip(names, X.T, strict=True))).select(0, 6) for X in (few, more, few)]
    packets = Packets(plan, blocks[0])
    for members in blocks:
        packets.refill(members)
        assert arrays(packets) == arrays(Packets(plan, members))


@pytest.mark.ci
def test_packets_take_members_whose_commands_reach_their_limits():
    # Commands are cut on the host: a block has as many pieces as its members need.
    vehicle = lw.Vehicle(mass=10.0, added_mass=[1.0, 2.0, 3.0], inertia=[1.0, 2.0, 2.5])
    name = "thrusters.limit[0]"
    table = Table(values={name: np.linspace(0.5, 1.0, 6)})
    fleet = lw.Ensemble(lw.Scene(vehicle, terms=[Thrusters(**PUSHING)]), None, 0, None, table)
    plan = make_plan(fleet, "psi_x", **SHORT)
    free, cut = np.ones(6), np.array([1.0, 1.0, 0.5, 1.0, 0.7, 1.0])
    blocks = [fleet.with_columns({name: limit}).select(0, 6) for limit in (free, cut, free)]
    packets = Packets(plan, blocks[0])
    for members in blocks:
        packets.refill(members)
        assert arrays(packets) == arrays(Packets(plan, members))


def late(scene, members, odd, values):
    """Members of which one alone, beyond those that are looked at before a run, has other values: (name -> its value)."""

    class Late(lw.Ensemble):
        def _values(self, first, stop, start=True):
            found = super()._values(first, stop, start)
            here = self.indices_of(first, stop) == odd
            for name, value in values.items():
                if here.any():
                    column = np.repeat(np.asarray(found[name], float)[:1], stop - first, axis=0)
                    column[here] = value
                    found[name] = column
            return found

    return Late(scene, members, 0, {"vehicle.mass": Normal(std=1e-3)} | {name: Normal(std=0.0) for name in values})


@pytest.fixture
def surveyed(monkeypatch):
    for module in (ensembles, plans):
        monkeypatch.setattr(module, "SURVEYED", 256)


@pytest.fixture
def drifting():
    """Members of which one alone, the 500th, has a current."""
    scene = lw.Scene(lw.Vehicle(mass=10.0, added_mass=[0.0, 1.0, 2.0], inertia=[1.0, 2.0, 3.0]),
                     start=lw.Start(velocity=[1.0, 0.2, 0.1]), terms=[Current(velocity=[0.0, 0.0, 0.0])])  # fmt: skip
    return late(scene, 600, 500, {"current.velocity": [0.5, 0.0, 0.0]})


@pytest.mark.ci
def test_a_late_member_that_needs_more_starts_the_run_anew(surveyed, drifting):
    result = lw.solve(drifting, threads=1, **SHORT)
    whole = make_plan(drifting, **SHORT)
    assert {term.type for term, _ in whole.kernel_choice.laws} >= {"current"}
    assert "current" in result.provenance["terms"]
    expected = run_plan(whole, 1).position
    np.testing.assert_array_equal(result.position, expected)
    kept = lw.solve(drifting, threads=1, keep=[3, 500], **SHORT).kept
    np.testing.assert_array_equal(kept.position, expected[:, [3, 500]])


@pytest.mark.ci
def test_a_prepared_run_begins_anew_and_says_what_ran(surveyed, drifting):
    result = lw.prepare(drifting, threads=1, **SHORT)()
    np.testing.assert_array_equal(result.position, lw.solve(drifting, threads=1, **SHORT).position)
    assert "current" in result.provenance["terms"]


@pytest.mark.ci
def test_a_late_member_that_needs_more_is_predicted(surveyed, drifting, monkeypatch):
    monkeypatch.setattr(predict, "TRIAL_SECONDS", 1e-3)
    assert lw.predict(drifting, threads=3, **SHORT).members == 600


class Ahead:
    """Runs all blocks before it yields the first, as threads may."""

    def run(self, work, blocks, advanced):
        yield from [(block, work(block)) for block in blocks]


@pytest.mark.ci
@pytest.mark.parametrize("values", [{"vehicle.mass": -1.0}, {"current.velocity": [0.5, 0.0, 0.0]}])
def test_a_late_member_that_the_run_does_not_need_changes_nothing(surveyed, drifting, values):
    fleet = late(drifting.scene, 2000, 1900, values)
    enough = lw.Until("mean position[0]", 1e3, members=256)
    one, ahead = (lw.solve(fleet, until=enough, **SHORT, **each) for each in ({"threads": 1}, {"executor": Ahead()}))
    assert len(one.status) < 1900
    assert one.provenance["terms"] == ahead.provenance["terms"]
    np.testing.assert_array_equal(one.position, ahead.position)


def test_a_late_member_that_is_unphysical_is_named(paper, surveyed):
    fleet = late(paper, 600, 500, {"vehicle.buoyancy": -1.0})
    with pytest.raises(lw.SceneError, match=r"vehicle\.buoyancy of member 500"):
        lw.solve(fleet, **SETTINGS)


def test_late_members_of_a_scene_file_are_looked_at(paper, surveyed):
    """A file's ensemble is checked when it is read and not again; but its late members as the run comes to them."""
    vary = {"vehicle.buoyancy": Normal(mean=1215.8, std=390.0).to_dict()}
    for seed in range(50):
        ensemble = {"members": 600, "seed": seed, "vary": vary}
        try:
            scene = lw.Scene.from_dict(paper.to_dict() | {"ensemble": ensemble})
        except lw.SceneError:  # an early one
            continue
        if (lw.Ensemble.from_scene(scene).parameters(0, 600)["vehicle.buoyancy"] < 0.0).any():
            break
    for _ in range(2):
        with pytest.raises(lw.SceneError, match=r"vehicle\.buoyancy of member"):
            lw.solve(scene, **SETTINGS)


def test_an_early_member_that_is_unphysical_is_counted_among_those_looked_at(paper, surveyed):
    with pytest.raises(lw.SceneError, match=r"of the 256 members that were looked at"):
        lw.Ensemble(paper, 600, 0, {"vehicle.mass": Normal(std=100.0)})


def test_a_hundred_million_members_are_planned_at_once(paper):
    """Nothing has as many entries as there are members: 800 MB each in float64."""
    tracemalloc.start()
    try:
        fleet = lw.Ensemble(paper, 10**8, 1, {"vehicle.mass": Normal(relative=0.001)})
        make_plan(fleet, h=0.01, t1=0.2, survey_all=False)
        assert tracemalloc.get_traced_memory()[1] < 100e6
    finally:
        tracemalloc.stop()
