# SPDX-License-Identifier: Apache-2.0
"""A sea floor on a grid: places and times of arrival in closed form and by SciPy, several events, edges, and bad input."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import RegularGridInterpolator

import lgvi_warp as lw
from tests.support.tools import one, slope

GRAVITY = 10.0
# Neutral, and as heavy in all directions: it goes straight on.
STRAIGHT = lw.Vehicle(20.0, inertia=(1.0, 1.2, 1.4), added_mass=(10.0, 10.0, 10.0), buoyancy=20.0 * GRAVITY)
NODES = [np.linspace(-40.0, 60.0, 6), np.linspace(-30.0, 30.0, 4)]


def grid_of(depth, nodes=NODES, **more):
    """A floor from a function of north and east."""
    places = np.meshgrid(*nodes, indexing="ij")
    values = np.broadcast_to(depth(*places), places[0].shape)
    origin, spacing = [x[0] for x in nodes], [x[1] - x[0] for x in nodes]
    return lw.events.Floor(depth=values, origin=origin, spacing=spacing, **more)


def scene(*events, vehicle=STRAIGHT, **more):
    return lw.Scene(vehicle, lw.Environment(gravity=GRAVITY), events=list(events), **more)


def runs(count=40):
    """Places and velocities of members that sink."""
    rng = np.random.default_rng(3)
    b = np.column_stack(
        [rng.uniform(-20.0, 20.0, count), rng.uniform(-20.0, 20.0, count), rng.uniform(0.0, 5.0, count)]
    )
    v = np.column_stack([rng.uniform(-1.0, 1.0, count), rng.uniform(-0.3, 0.3, count), rng.uniform(0.7, 1.2, count)])
    return b, v


@pytest.mark.slow
def test_a_tilted_plane_is_met_where_geometry_says():
    a = np.array([0.2, -0.1])
    b, v = runs()
    expected = (20.0 + b[:, :2] @ a - b[:, 2]) / (v[:, 2] - v[:, :2] @ a)
    r = lw.solve(one(scene(grid_of(lambda x, y: 20.0 + a[0] * x + a[1] * y)), b=b, nu=v), "rk4", h=0.3, t1=60.0)
    assert (r.status == lw.Status.FLOOR).all()
    np.testing.assert_allclose(r.end_time, expected, rtol=1e-12)
    # Place and speed of arrival are the last sample.
    np.testing.assert_allclose(r.position[-1], b + expected[:, None] * v, atol=1e-11)
    np.testing.assert_allclose(r.velocity[-1], v, rtol=1e-12)


@pytest.mark.ci
def test_a_twist_within_a_cell_is_met_exactly():
    # 20 + t x y is bilinear in each cell, and quadratic along a straight run.
    twist = 2e-3
    b, v = runs()
    r = lw.solve(one(scene(grid_of(lambda x, y: 20.0 + twist * x * y)), b=b, nu=v), "rk4", h=0.3, t1=60.0)
    met = r.status == lw.Status.FLOOR
    assert met.all()
    expected = np.empty(len(b))
    for i in range(len(b)):
        roots = np.roots([
            twist * v[i, 0] * v[i, 1],
            twist * (b[i, 0] * v[i, 1] + b[i, 1] * v[i, 0]) - v[i, 2],
            20.0 + twist * b[i, 0] * b[i, 1] - b[i, 2],
        ])  # fmt: skip
        expected[i] = min(roots[roots > 0.0])
    inside = [(x[0] < end) & (end < x[-1]) for x, end in zip(NODES, (b + expected[:, None] * v).T[:2], strict=True)]
    assert np.all(inside)
    np.testing.assert_allclose(r.end_time, expected, rtol=1e-12)


# As heavy in all directions, so that nothing turns it; drag along each axis bends its way down.
SINKING = lw.Vehicle(20.0, inertia=(1.0, 1.2, 1.4), added_mass=(10.0, 10.0, 10.0), buoyancy=20.0 * GRAVITY - 9.0)
LINEAR, QUADRATIC = np.array([3.0, 4.0, 6.0]), np.array([5.0, 9.0, 12.0])
START, VELOCITY = (1.0, 2.0, 3.0), (1.8, -0.7, 0.1)
FINE = [np.linspace(-10.0, 30.0, 161), np.linspace(-10.0, 10.0, 81)]


def hills(x, y):
    return 7.0 + 0.8 * np.sin(0.9 * x) * np.cos(0.4 * y)


def arrival(depth):
    """Time and state of arrival at a floor: (m + a) dv/dt = W - B - d v - e |v| v along each axis, by SciPy."""

    def height(t, y):
        return depth(y[0], y[1]) - y[2]

    def rates(t, y):
        v = y[3:]
        return np.concatenate([v, (np.array([0.0, 0.0, 9.0]) - LINEAR * v - QUADRATIC * np.abs(v) * v) / 30.0])

    height.terminal, height.direction = True, -1
    way = solve_ivp(
        rates, (0.0, 60.0), [*START, *VELOCITY], "DOP853", rtol=1e-13, atol=1e-13, max_step=0.01, events=height
    )
    return way.t_events[0][0], way.y_events[0][0]


def off(result, true):
    """Errors of time, place and velocity of a member's arrival."""
    assert result.status[0] == lw.Status.FLOOR
    state = np.concatenate([result.position[-1, 0], result.velocity[-1, 0]])
    return max(abs(result.end_time[0] - true[0]), np.abs(state - true[1]).max())


@pytest.mark.slow
@pytest.mark.parametrize(("method", "order", "steps"), [("rk4", 4, (0.4, 0.2, 0.1)), ("psi_s", 2, (0.2, 0.1, 0.05))])
def test_the_arrival_on_hills_has_the_order_of_the_method(method, order, steps):
    # Cells of 0.25 m: the way goes through tens of them, and ends within one.
    floor = grid_of(hills, FINE)
    drag = lw.terms.Drag(linear=[*LINEAR, 0.0, 0.0, 0.0], quadratic=[*QUADRATIC, 0.0, 0.0, 0.0])
    fleet = one(scene(floor, vehicle=SINKING, terms=[drag]), b=START, nu=VELOCITY)
    # The truth is that of the bilinear floor, looked up by another program.
    table = RegularGridInterpolator(FINE, floor.depth)
    true = arrival(lambda x, y: table((x, y)))
    errors = [off(lw.solve(fleet, method, h=h, t1=60.0), true) for h in steps]
    assert slope(steps, errors) > order - 0.35
    # Beside the hills themselves it is what the grid leaves out, at most k^2 dx^2 / 8 of the height along each axis.
    smooth = arrival(hills)
    left_out = 0.8 * (0.9**2 + 0.4**2) * 0.25**2 / 8.0
    assert abs(true[1][2] - smooth[1][2]) < 4.0 * left_out


@pytest.mark.slow
def test_of_two_floors_and_a_box_the_first_counts():
    # Straight down from 5 m at 1 m/s, and to the east: one millisecond apart, within one step of 0.3 s.
    for flat, grid, east, name in (
        (6.0, 6.001, 1.001, "flat"),
        (6.001, 6.0, 1.001, "hills"),
        (6.001, 6.001, 1.0, "box"),
    ):
        events = (lw.events.Floor(depth=flat, name="flat"), grid_of(lambda x, y, d=grid: d + 0.01 * x, name="hills"),
                  lw.events.Box(lower=(-9, -9, -9), upper=(9, east, 9)))  # fmt: skip
        asked = [lw.statistics.Outcome(key) for key in ("flat", "hills", "box")]
        r = lw.solve(one(scene(*events), b=(0, 0, 5.0), nu=(0, 1.0, 1.0)), "rk4", h=0.3, t1=3.0, statistics=asked)
        assert r.end_time[0] == pytest.approx(1.0, abs=1e-12)
        ended = {key: r.statistics[f"outcome {key}"].value[-1] for key in ("flat", "hills", "box")}
        assert ended == {key: float(key == name) for key in ended}


@pytest.mark.ci
def test_members_have_a_clearance_or_a_floor_of_their_own():
    b, v = runs(11)
    clearance = np.linspace(0.0, 5.0, 11)
    level = np.linspace(15.0, 25.0, 11)
    floor = grid_of(lambda x, y: 20.0 + 0.1 * x, clearance=0.0)
    fleet = one(scene(floor), b=b, nu=v, parameters={"floor.clearance": clearance})
    r = lw.solve(fleet, "rk4", h=0.3, t1=60.0)
    expected = (20.0 + 0.1 * b[:, 0] - clearance - b[:, 2]) / (v[:, 2] - 0.1 * v[:, 0])
    np.testing.assert_allclose(r.end_time, expected, rtol=1e-12)
    depths = floor.depth + (level - 20.0)[:, None, None]
    r = lw.solve(one(scene(floor), b=b, nu=v, parameters={"floor.depth": depths}), "rk4", h=0.3, t1=60.0)
    expected = (level + 0.1 * b[:, 0] - b[:, 2]) / (v[:, 2] - 0.1 * v[:, 0])
    np.testing.assert_allclose(r.end_time, expected, rtol=1e-12)
    known = floor.depth_at(r.position[..., 0], r.position[..., 1], {"depth": depths, "origin": floor.origin[None],
                                                                    "spacing": floor.spacing[None]})  # fmt: skip
    np.testing.assert_allclose(known[-1], r.position[-1, :, 2], atol=1e-12)


@pytest.mark.slow
def test_outside_the_edge_holds_and_edges_stop():
    floor = grid_of(lambda x, y: 20.0 + 0.1 * x)
    far = one(scene(floor), b=[(900.0, 0.0, 1.0), (-900.0, 700.0, 1.0)], nu=(0.0, 0.0, 1.0))
    np.testing.assert_allclose(lw.solve(far, "rk4", h=0.3, t1=60.0).end_time, [25.0, 15.0], rtol=1e-12)
    leaving = one(scene(floor, floor.edges()), b=(50.0, 0.0, 1.0), nu=(1.0, 0.0, 0.0))
    r = lw.solve(leaving, "rk4", h=0.3, t1=60.0)
    assert r.status.counts() == {"box": 1}
    assert r.end_time[0] == pytest.approx(10.0, abs=1e-9)


@pytest.mark.ci
def test_a_member_below_the_floor_or_that_is_no_number():
    floor = grid_of(lambda x, y: 20.0 + 0.1 * x)
    b = np.array([[0.0, 0.0, 19.0], [0.0, 0.0, 21.0], [-30.0, 0.0, 19.0], [0.0, 0.0, 1.0]])
    spin = np.zeros((4, 3))
    nu = np.tile([0.0, 0.0, -1.0], (4, 1))
    spin[3] = 1e200
    r = lw.solve(one(scene(floor), b=b, nu=nu, Om=spin), "rk4", h=0.3, t1=3.0)
    assert [status.name for status in map(lw.Status, r.status)] == ["OK", "FLOOR", "FLOOR", "NON_FINITE"]
    assert (r.end_time[1:3] == 0.0).all()
    assert any("2 of 4 members begin at or beyond an event (floor 2; the first: member 1)" in m for m in r.messages)


@pytest.mark.ci
def test_a_ridge_that_one_step_leaps_over_is_not_seen_and_half_the_step_sees_it():
    # A ridge one cell wide, 0.3 m above the way; the step is 4 m long, the way within the ridge 1.2 m.
    nodes = [np.arange(0.0, 42.0, 2.0), np.array([0.0, 1.0])]
    ridge = grid_of(lambda x, y: 10.0 - 1.0 * (np.abs(x - 20.0) < 0.5), nodes)
    fleet = one(scene(ridge), b=(0.0, 0.5, 9.7), nu=(1.0, 0.0, 0.0))
    ends = {h: lw.solve(fleet, "rk4", h=h, t1=36.0).status.counts() for h in (4.0 * 36 / 37, 1.0)}
    assert ends == {4.0 * 36 / 37: {"ok": 1}, 1.0: {"floor": 1}}


@pytest.mark.ci
def test_a_run_in_two_pieces_has_the_bits_of_one():
    b, v = runs(16)
    fleet = one(scene(grid_of(lambda x, y: 20.0 + 2e-3 * x * y)), b=b, nu=v)
    whole = lw.solve(fleet, "rk4", h=0.25, t1=30.0, save=lw.SaveAt(at=[15.0, 30.0]))
    first = lw.solve(fleet, "rk4", h=0.25, t1=15.0)
    second = lw.solve(fleet, "rk4", h=0.25, t1=30.0, start=first.final)
    assert 0 < (first.status == lw.Status.FLOOR).sum() < 16
    assert second.position[-1].tobytes() == whole.position[-1].tobytes()
    assert second.end_time.tobytes() == whole.end_time.tobytes()


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"depth": [[1.0, 2.0]]}, "floor.spacing = None is missing for a grid of depths"),
        ({"depth": 3.0, "spacing": [1.0, 1.0]}, "floor.spacing = .* is given for a floor of one depth"),
        ({"depth": [1.0, 2.0], "spacing": [1.0, 1.0]}, "floor.depth = .* has shape"),
        ({"depth": [[1.0, np.nan]], "spacing": [1.0, 1.0]}, "floor.depth = .* is not finite"),
        ({"depth": [[1.0, 2.0]], "spacing": [1.0, 0.0]}, "floor.spacing = .* is not positive"),
    ],
)
def test_bad_input(wrong, words):
    with pytest.raises(lw.SceneError, match=words):
        lw.events.Floor(**wrong)


def test_a_flat_floor_has_no_edges():
    with pytest.raises(lw.SceneError, match=r"has no edges. Give a grid, or lw\.events\.Box"):
        lw.events.Floor(depth=3.0).edges()


def test_a_scene_keeps_its_floor_in_tables():
    held = scene(grid_of(lambda x, y: 20.0 + 0.1 * x, clearance=0.5))
    again = lw.Scene.from_dict(held.to_dict()).events[0]
    for name, value in held.events[0].parameters().items():
        np.testing.assert_array_equal(getattr(again, name), value)


@pytest.mark.ci
def test_the_altitude_is_a_quantity_everywhere():
    b, v = runs(12)
    hills_floor, flat = grid_of(lambda x, y: 20.0 + 0.1 * x), lw.events.Floor(depth=19.0, name="flat", clearance=-50.0)
    clearance = np.linspace(0.0, 3.0, 12)
    fleet = one(scene(grid_of(lambda x, y: 20.0 + 0.1 * x, clearance=0.0), flat), b=b, nu=v,
                parameters={"floor.clearance": clearance})  # fmt: skip
    asked = [lw.statistics.Mean("altitude"), lw.statistics.PathMinimum("altitude", then=lw.statistics.Mean()),
             lw.statistics.Mean("altitude", at="floor")]  # fmt: skip
    r = lw.solve(fleet, "rk4", h=0.25, t1=30.0, save=lw.SaveAt(every=0.25), statistics=asked)
    # Above the higher of the two: the flat one is the higher where the slope lies below 19 m.
    true = np.minimum(20.0 + 0.1 * r.position[..., 0], 19.0) - r.position[..., 2]
    assert np.any(true < 20.0 + 0.1 * r.position[..., 0] - r.position[..., 2] - 0.1)
    np.testing.assert_allclose(r.altitude, true, atol=1e-12)
    np.testing.assert_allclose(r.statistics["mean altitude"].value[-1], true[-1].mean(), atol=1e-12)
    np.testing.assert_allclose(
        r.statistics["mean path_minimum altitude"].value[-1], true.min(axis=0).mean(), atol=1e-12
    )
    arrived = np.asarray(r.status) == lw.Status.FLOOR
    assert arrived.any()
    np.testing.assert_allclose(hills_floor.depth_at(*r.position[-1, arrived, :2].T) - r.position[-1, arrived, 2],
                               clearance[arrived], atol=1e-11)  # fmt: skip
    later = lw.gather(r, [lw.statistics.Mean("altitude")])
    np.testing.assert_array_equal(later["mean altitude"].value[-1], r.statistics["mean altitude"].value[-1])


@pytest.mark.ci
def test_the_altitude_needs_a_floor():
    with pytest.raises(lw.SceneError, match=r"of = 'altitude' needs a floor. Give the scene one"):
        lw.solve(scene(), "rk4", h=0.5, t1=1.0, statistics=[lw.statistics.Mean("altitude")])


@pytest.mark.ci
def test_how_near_members_came_to_the_hills():
    # Level runs over waves of the floor: the least distance is that of the nodes on the way and between them.
    floor = grid_of(lambda x, y: 20.0 + 2.0 * np.sin(x / 7.0), [np.arange(-10.0, 80.0, 2.0), np.array([-50.0, 50.0])])
    b = np.column_stack([np.zeros((6, 2)), np.linspace(10.0, 18.5, 6)])
    fleet = one(scene(floor), b=b, nu=(1.5, 0.0, 0.0))
    r = lw.solve(fleet, "rk4", h=0.25, t1=40.0, save=lw.SaveAt(every=0.25),
                 statistics=[lw.metrics.Nearest("floor", then=lw.statistics.Extremes())])  # fmt: skip
    shallowest = 20.0 + 2.0 * np.sin(np.arange(0.0, 61.0, 2.0) / 7.0).min()
    nearest = lw.gather(r, [lw.metrics.Nearest("floor", then=lw.statistics.Mean())])["mean nearest floor"].value[-1, 0]
    met = b[:, 2] > shallowest
    assert 0 < met.sum() < 6
    true = np.where(met, 0.0, shallowest - b[:, 2])
    # Looks lie 0.4 m apart, and the slope changes by 0.16 at most between two cells.
    assert nearest == pytest.approx(true.mean(), abs=0.16 * 0.4 / 4.0)
    assert (np.asarray(r.status) == lw.Status.FLOOR).tolist() == met.tolist()
