# SPDX-License-Identifier: Apache-2.0
"""Currents on a grid: exact where they are linear, a closed circle in an eddy, scenarios, times, the ends, and bad input."""

import pickle
import tracemalloc

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lgvi_warp as lw
from lgvi_warp.engine.arrays import Lanes
from tests.support.tools import GRAVITY, last, one

# Neutral, and as heavy as the water that it displaces: it goes with the water if it begins so.
DRIFTER = lw.Vehicle(10.0, inertia=(1.0, 1.2, 1.3), added_mass=(4.0, 5.0, 6.0), buoyancy=10.0 * GRAVITY,
                     center_of_buoyancy=(0.0, 0.0, 0.0))  # fmt: skip
NODES = [np.linspace(-60.0, 60.0, 13), np.linspace(-60.0, 60.0, 7), np.linspace(0.0, 40.0, 5)]
SPACING = [x[1] - x[0] for x in NODES]
ORIGIN = [x[0] for x in NODES]


def field_of(u, **more):
    """A field from a function of north, east and depth."""
    places = np.meshgrid(*NODES, indexing="ij")
    values = np.stack([np.broadcast_to(x, places[0].shape) for x in u(*places)], axis=-1)
    return lw.terms.CurrentField(velocities=values, origin=ORIGIN, spacing=SPACING, **more)


def scene(*terms):
    return lw.Scene(DRIFTER, lw.Environment(GRAVITY), terms=list(terms))


TURN = 2.0 * np.pi / 200.0


@pytest.mark.slow
@pytest.mark.parametrize(("method", "h", "allowed"), [("rk8", 1.0, 1e-8), ("psi_s", 0.5, 2e-3)])
def test_what_drifts_in_an_eddy_comes_back(method, h, allowed):
    # psi_s takes the water half way: its circle opens by (turn h)^4 / 8 of the radius a step, and lags by (turn h)^2 / 6.
    eddy = field_of(lambda x, y, z: (-TURN * y, TURN * x, 0.0 * z))
    start = np.array([30.0, 5.0, 11.0])
    fleet = one(scene(eddy), b=start, nu=(-TURN * start[1], TURN * start[0], 0.0))
    turns = 100 if method == "rk8" else 1
    b, *_ = last(lw.solve(fleet, method, h=h, t1=turns * 200.0))
    assert np.abs(b - start).max() < allowed * 30.0


@pytest.mark.slow
def test_a_trilinear_current_in_time_is_exact():
    # A drifter goes as a particle does: through cells, by SciPy, in a current that is linear in each number and in time.
    def u(x, y, z, t):
        grow = 1.0 + 0.004 * t
        return np.array([0.2 + 0.01 * y, 0.1 - 0.002 * x * y / 60.0, 0.001 * z + 0.0005 * x]) * grow

    places = np.meshgrid(*NODES, indexing="ij")
    values = np.stack([np.stack(u(*places, t), axis=-1) for t in (0.0, 50.0, 100.0)])
    field = lw.terms.CurrentField(velocities=values, origin=ORIGIN, spacing=SPACING, times=[0.0, 50.0])
    start = np.array([-20.0, 10.0, 12.0])
    b, *_ = last(lw.solve(one(scene(field), b=start, nu=u(*start, 0.0)), "rk8", h=0.5, t1=100.0))
    path = solve_ivp(lambda t, b: u(*b, t), (0.0, 100.0), start, method="DOP853", rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(b, path.y[:, -1], atol=1e-9)
    result = lw.solve(one(scene(field), b=start), "rk8", h=0.5, t1=100.0)
    known = field.water({"velocities": field.velocities[None], "scenario": np.zeros(1), "times": field.times[None],
                         "origin": field.origin[None], "spacing": field.spacing[None]},
                        result.position[-1:], np.array([100.0]), {})  # fmt: skip
    np.testing.assert_allclose(known[0, 0], u(*result.position[-1, 0], 100.0), rtol=1e-12)


ORDERS = {"phi": 1, "psi": 2, "psi_s": 2, "psi_1": 2, "psi_x": 2, "psi_x8": 2, "psi_w": 2, "rk4": 4, "rk5": 5}


@pytest.mark.ci
@pytest.mark.parametrize(
    "method", [pytest.param(name, marks=() if name in ("psi_s", "rk4") else pytest.mark.slow) for name in ORDERS]
)
def test_within_a_cell_each_method_keeps_its_order(method):
    def u(x, y, z, t):
        steady = np.array([0.2 + 0.01 * y + 1e-4 * x * z, 0.1 - 2e-4 * x * y, 0.001 * z + 5e-4 * x])
        return steady * (1.0 + 0.02 * t)

    ends = np.meshgrid([-60.0, 60.0], [-60.0, 60.0], [0.0, 40.0], indexing="ij")
    values = np.stack([np.stack(u(*ends, t), axis=-1) for t in (0.0, 50.0)])
    field = lw.terms.CurrentField(
        velocities=values, origin=[-60.0, -60.0, 0.0], spacing=[120.0, 120.0, 40.0], times=[0.0, 50.0]
    )
    start = np.array([-20.0, 10.0, 12.0])
    path = solve_ivp(lambda t, b: u(*b, t), (0.0, 20.0), start, method="DOP853", rtol=1e-13, atol=1e-13)
    fleet = one(scene(field), b=start, nu=u(*start, 0.0))
    errors = [np.abs(last(lw.solve(fleet, method, h=h, t1=20.0))[0] - path.y[:, -1]).max() for h in (1.0, 0.5)]
    # Below 1e-12 of 20 m it is round-off of both.
    assert errors[1] < 2e-11 or errors[0] / errors[1] > 2.0 ** (ORDERS[method] - 0.1), errors


@pytest.mark.slow
def test_outside_the_grid_and_its_times_the_nearest_holds():
    field = lw.terms.CurrentField(
        velocities=np.array([0.1, 0.3])[:, None, None, None, None] * np.ones((1, 1, 1, 1, 3)),
        spacing=[1.0, 1.0, 1.0], times=[10.0, 5.0],
    )  # fmt: skip
    result = lw.solve(one(scene(field), b=(500.0, -500.0, 900.0), nu=(0.1, 0.1, 0.1)), "rk8", h=0.5, t1=30.0)
    # (rho V + A) dv/dt = (rho V + A) du/dt: it goes with the water, whose speed grows between the two times alone.
    expected = 0.1 * 10.0 + 0.5 * (0.1 + 0.3) * 5.0 + 0.3 * 15.0
    np.testing.assert_allclose(result.position[-1, 0] - [500.0, -500.0, 900.0], expected, rtol=1e-9)


@pytest.mark.slow
def test_scenarios_are_members_of_a_forecast():
    steady = np.array([[0.1, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, -0.3]])
    field = lw.terms.CurrentField(velocities=steady[:, None, None, None], spacing=[1.0, 1.0, 1.0])
    assert field.velocities.shape == (3, 1, 1, 1, 1, 3)
    each = {"current_field.scenario": np.arange(3.0)}
    still = np.zeros((3, 3))
    fleet = lw.Ensemble.from_states(scene(field), still, np.tile(np.eye(3), (3, 1, 1)), steady, still, each)
    result = lw.solve(fleet, h=0.1, t1=5.0)
    np.testing.assert_allclose(result.position[-1], 5.0 * steady, atol=1e-12)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"velocities": np.zeros((3, 3))}, "has shape"),
        ({"velocities": np.zeros((2, 3, 4, 5, 2))}, "has shape"),
        ({"velocities": np.zeros((1, 2, 3, 3, 3, 3))}, "times = None is missing for 2 fields"),
        ({"times": [0.0, 0.0], "velocities": np.zeros((2, 3, 3, 3, 3))}, "has no time between two fields"),
        ({"scenario": 1.0}, "scenario = 1.0 is none of 1"),
        ({"spacing": [1.0, 0.0, 1.0]}, "spacing"),
    ],
)
def test_bad_input(wrong, words):
    with pytest.raises(lw.SceneError, match=words):
        lw.terms.CurrentField(**{"velocities": np.zeros((3, 3, 3, 3)), "spacing": [1.0, 1.0, 1.0]} | wrong)


def test_a_member_of_a_scenario_that_is_not_there_is_refused():
    field = lw.terms.CurrentField(velocities=np.ones((2, 1, 1, 1, 1, 3)), spacing=[1.0, 1.0, 1.0])
    with pytest.raises(lw.SceneError, match=r"current_field.scenario of member 0 = 2.0"):
        lw.Ensemble(scene(field), 2, 0, {"current_field.scenario": lw.distributions.Choice([2.0])})


@pytest.mark.ci
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("levels", [1, 4])
def test_a_large_grid_gives_what_its_part_gives(dtype, levels):
    # All members share the numbers of a large grid, and each packet has its own of a small one: other reads, the same water.
    rng = np.random.default_rng(5)
    small = 0.3 * rng.normal(size=(2, 3, 3, levels, 3))
    large = np.zeros((2, 30, 40, levels, 3))
    large[:, 13:16, 20:23] = small
    shape = dict(spacing=[10.0, 10.0, 5.0], times=[0.0, 2.0])
    part = lw.terms.CurrentField(velocities=small, **shape)
    whole = lw.terms.CurrentField(velocities=large, origin=[-130.0, -200.0, 0.0], **shape)
    # Seventeen members in cells of their own, and as many in one: more than a packet of each.
    places = np.vstack([rng.uniform([1.0, 1.0, 1.0], [19.0, 19.0, 9.0], (17, 3)), np.full((17, 3), 3.0)])
    still, upright = np.zeros((34, 3)), np.tile(np.eye(3), (34, 1, 1))
    ends = [
        lw.solve(
            lw.Ensemble.from_states(scene(field), places, upright, still, still), "rk4", h=0.1, t1=1.0, dtype=dtype
        )
        for field in (part, whole)
    ]
    tolerance = 1e-13 if dtype == "float64" else 2e-5
    assert np.ptp(ends[0].velocity[-1], axis=0).min() > 0.01
    np.testing.assert_allclose(ends[1].velocity[-1], ends[0].velocity[-1], rtol=0.0, atol=tolerance)
    np.testing.assert_allclose(ends[1].position[-1], ends[0].position[-1], rtol=0.0, atol=30.0 * tolerance)


@pytest.mark.ci
def test_the_nodes_of_a_field_are_written_once_for_all_calls(monkeypatch):
    rng = np.random.default_rng(5)
    field = lw.terms.CurrentField(velocities=0.1 * rng.normal(size=(60, 60, 20, 3)), spacing=[1.0, 1.0, 1.0])
    made = []
    begin = Lanes.__init__
    monkeypatch.setattr(Lanes, "__init__", lambda self, *given: made.append(given[:2]) or begin(self, *given))
    vary = {"start.velocity": lw.distributions.Normal(std=0.1)}
    run = lw.prepare(scene(field), vary, of="speed", method="rk4", h=0.1, t1=0.1)
    first, second = rng.normal(size=(2, 64, 3))
    run(first)
    tables = [(packets, rows) for packets, rows in made if packets * rows >= field.velocities.size]
    # One for all packets; a vector of the last node is one load of four rows.
    assert tables == [(1, 1 + field.velocities.size + 1)]
    tracemalloc.start()
    answer = run(second)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len([size for size in made if size == tables[0]]) == 1
    assert peak < field.velocities.nbytes / 4
    np.testing.assert_array_equal(answer, run(second))


@pytest.mark.ci
def test_no_list_is_made_of_the_numbers_of_a_field_before_the_provenance_is_read():
    rng = np.random.default_rng(6)
    field = lw.terms.CurrentField(velocities=0.1 * rng.normal(size=(60, 60, 20, 3)), spacing=[1.0, 1.0, 1.0])
    lw.solve(scene(field), method="rk4", h=0.1, t1=0.1)
    other = lw.terms.CurrentField(velocities=2.0 * field.velocities, spacing=[1.0, 1.0, 1.0])
    tracemalloc.start()
    result = lw.solve(scene(other), method="rk4", h=0.1, t1=0.1)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    # A list takes 32 bytes a number beside the 8 of a row; the rows are in two arrays at most while they are written.
    assert peak < 3 * other.velocities.nbytes
    kept = pickle.loads(pickle.dumps(result))
    for held in (result, kept):
        assert held.provenance["scene"]["terms"][-1]["velocities"] == other.velocities.tolist()


def hills(depth):
    """A floor that lies at this depth in the south and rises to the north by 1 m in 4 m."""
    return lw.events.Floor(
        depth=[[depth, depth], [depth - 30.0, depth - 30.0]], origin=[-60.0, -60.0], spacing=[120.0, 120.0]
    )


@pytest.mark.ci
@pytest.mark.parametrize("method", ["psi_s", "rk4", "psi_x"])
@pytest.mark.parametrize("h", [0.5, 30.0])
def test_a_member_that_leaves_a_field_and_meets_the_floor_stops_at_what_comes_first(method, h):
    # Water of 0.5 m/s to the north and of 0.25 m/s downwards carries all: to the edge at 60 m, and to the floor.
    water = np.array([0.5, 0.0, 0.25])
    wide = lw.terms.CurrentField(velocities=np.broadcast_to(0.4 * water, (3, 3, 3, 3)), origin=[-600.0, -600.0, 0.0],
                                 spacing=[600.0, 600.0, 40.0], name="wide")  # fmt: skip
    near = field_of(lambda x, y, z: [0.6 * v + 0.0 * x for v in water], outside="stop", name="near")
    floor = hills(45.0)
    start = np.array([[49.9, 0.0, 6.0], [49.9, 0.0, 9.9], [49.9, 0.0, 10.0], [49.9, 0.0, 12.0]])
    until_edge = (60.0 - start[:, 0]) / water[0]
    # z + 0.25 t = 45 - (x + 60 + 0.5 t) / 4.
    until_floor = (45.0 - (start[:, 0] + 60.0) / 4.0 - start[:, 2]) / (water[2] + water[0] / 4.0)
    first = np.minimum(until_edge, until_floor)
    # The two in the middle meet both within one step.
    assert np.all(np.floor(np.stack([until_edge, until_floor])[:, 1:3] / 0.5) == 40.0)
    still, upright = np.zeros((4, 3)), np.tile(np.eye(3), (4, 1, 1))
    sea = lw.Scene(DRIFTER, lw.Environment(GRAVITY), terms=[wide, near], events=[floor])
    fleet = lw.Ensemble.from_states(sea, start, upright, still + water, still)
    result = lw.solve(fleet, method, h=h, t1=60.0)
    outside, met = lw.Status.OUTSIDE, lw.Status.FLOOR
    assert [lw.Status(status) for status in result.status] == [outside, outside, met, met]
    np.testing.assert_allclose(result.end_time, first, rtol=1e-9)
    np.testing.assert_allclose(result.position[-1], start + first[:, None] * water, rtol=1e-9)


@pytest.mark.ci
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_a_run_goes_on_in_a_field_with_a_single_scenario(dtype):
    # One member, one scenario, one fleet of many: each goes on as if it had not been cut.
    rng = np.random.default_rng(7)
    field = lw.terms.CurrentField(
        velocities=0.3 * rng.normal(size=(1, 3, *(len(x) for x in NODES), 3)),
        origin=ORIGIN,
        spacing=SPACING,
        times=[0.0, 1.0],
    )
    assert field.velocities.shape[0] == 1
    for members in (1, 19):
        place = rng.uniform(-40.0, 40.0, (members, 3)) * [1.0, 1.0, 0.2] + [0.0, 0.0, 20.0]
        still, upright = np.zeros((members, 3)), np.tile(np.eye(3), (members, 1, 1))
        fleet = lw.Ensemble.from_states(
            scene(field), place, upright, still, still, {"current_field.scenario": np.zeros(members)}
        )
        run = {"method": "rk4", "h": 0.1, "dtype": dtype}
        result, half = lw.solve(fleet, t1=2.0, **run), lw.solve(fleet, t1=1.0, **run)
        on = lw.solve(fleet, t1=2.0, **run, start=half.final)
        np.testing.assert_array_equal(on.position[-1], result.position[-1])
        alone = lw.solve(fleet.subset([members - 1]), t1=2.0, **run)
        np.testing.assert_array_equal(alone.position[-1, 0], result.position[-1, members - 1])
