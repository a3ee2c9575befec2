"""Events stop a member with status and time, and leave its packet alone."""

import functools
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
import warp as wp

import lgvi_warp as lw
from lgvi_kernels.lanes.arithmetic import lane, sub  # noqa: F401
from lgvi_kernels.lanes.state import struct
from lgvi_warp.methods.method import PROGRAMS
from lgvi_warp.physics.inertia import moved
from lgvi_warp.physics.terms import events
from lgvi_warp.reference import advance
from tests.support.tools import (
    TURN,
    body_of,
    chosen,
    difference,
    from_state,
    last,
    one,
    random_states,
    slope,
    to_state,
    vehicle,
)

GRAVITY = 10.0
VEHICLE = lw.Vehicle(20.0, (1.0, 1.2, 1.4), (10.0, 10.0, 10.0), 20.0 * GRAVITY)
FIELDS = ("position", "attitude", "velocity", "angular_velocity")


def fleet(n, stops, vehicle=VEHICLE, parameters=None, speed=1.0):
    """n members about depth 5 with random velocities."""
    b, R, nu, Om = random_states(2, n, speed=speed)
    scene = lw.Scene(vehicle, lw.Environment(gravity=GRAVITY), events=stops)
    return lw.Ensemble.from_states(scene, b + np.array([0.0, 0.0, 5.0]), R, nu, Om, parameters)


def test_surface_and_floor_at_the_crossing():
    # Neutrally buoyant with M = m I: straight lines, so that the crossing is known, and the interpolation exact.
    ensemble = fleet(200, [lw.Surface(), lw.Floor(depth=8.0)])
    r = lw.solve(ensemble, h=0.1, t1=20.0)
    start = ensemble.select(0, 200)
    sink = np.einsum("nij,nj->ni", start.attitude, start.velocity)[:, 2]
    depth = start.position[:, 2]
    expected = np.where(
        sink < 0.0, -depth / np.where(sink < 0.0, sink, 1.0), (8.0 - depth) / np.where(sink > 0.0, sink, 1.0)
    )
    stopped = expected < 20.0 - 0.1
    assert stopped.sum() > 50 and set(np.unique(r.status)) == {0, lw.Status.SURFACE, lw.Status.FLOOR}
    np.testing.assert_allclose(r.failure_time[stopped], expected[stopped], rtol=1e-9)
    np.testing.assert_array_equal(r.status[stopped & (sink < 0)], lw.Status.SURFACE)
    np.testing.assert_array_equal(r.status[stopped & (sink > 0)], lw.Status.FLOOR)
    # A stopped member stands at the event, and a spacing of its numbers beyond it.
    last = r.position[-1, stopped, 2]
    beyond = np.where(sink[stopped] < 0.0, -last, last - 8.0)
    assert (beyond > 0.0).all() and beyond.max() < 1e-13
    np.testing.assert_allclose(last, (depth + sink * expected)[stopped], atol=1e-12)
    np.testing.assert_array_equal(r.end_time[stopped], r.failure_time[stopped])
    assert (r.end_time[r.status == lw.Status.OK] == 20.0).all()


@pytest.mark.slow_but("float32-psi_x", "float64-kl6(psi_s)", "float64-psi_s")
@pytest.mark.parametrize("method", ["psi_s", "psi_1", "psi", "psi_x", "kl6(psi_s)"])
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_the_others_do_not_change_by_a_bit(method, dtype):
    # Those that are never stopped make the same steps as in a scene whose event is far away.
    near = lw.solve(fleet(100, [lw.Box(lower=(-3, -3, 0), upper=(3, 3, 9))]), method, h=0.05, t1=3.0, dtype=dtype)
    far = lw.solve(fleet(100, [lw.Box(lower=(-1e6,) * 3, upper=(1e6,) * 3)]), method, h=0.05, t1=3.0, dtype=dtype)
    well = np.asarray(near.status) == 0
    assert 10 < well.sum() < 90
    for name in FIELDS:
        assert getattr(near, name)[:, well].tobytes() == getattr(far, name)[:, well].tobytes()


def test_the_time_may_vary_by_member():
    at = np.linspace(0.02, 1.5, 64)
    ensemble = fleet(64, [lw.StopTime(at=9.0)], parameters={"time.at": at})
    r = lw.solve(ensemble, h=0.05, t1=1.0, save=lw.SaveAt(every=0.25))
    stopped = at <= 1.0
    np.testing.assert_array_equal(r.status == lw.Status.TIME, stopped)
    np.testing.assert_allclose(r.failure_time[stopped], at[stopped], atol=1e-12)
    assert np.isnan(r.failure_time[~stopped]).all()


def test_events_look_at_the_users_origin():
    # The same vehicle told about an origin 2 m above: the same path of that origin stops it.
    rigid = np.diag([20.0, 20, 20, 1, 1.2, 1.4])
    d = np.array([0.0, 0.0, 2.0])
    shifted = moved(rigid[None], -d[None], np.eye(3)[None])[0]
    vehicle = lw.Vehicle(rigid_body_mass_matrix=shifted, buoyancy=200.0, weight=200.0, center_of_buoyancy=d)
    scene = lw.Scene(
        vehicle,
        lw.Environment(gravity=GRAVITY),
        events=[lw.Surface()],
        start=lw.Start(position=(0, 0, 1.0), velocity=(0, 0, -1.0)),
    )
    for method in ("psi_s", "psi_x", "psi_w"):
        r = lw.solve(scene, method, h=0.03, t1=3.0)
        assert r.status[0] == lw.Status.SURFACE and r.failure_time[0] == pytest.approx(1.0, abs=1e-9)


class FarFromHome:
    """A user's event: more than `radius` metres north of the start."""

    @staticmethod
    @functools.cache
    def params(width, real):
        return struct("Far", radius=lane(width, real))

    @staticmethod
    @wp.func
    def distance(view: Any, p: Any):
        return p.radius - view.b.x


def test_a_users_condition():

    @dataclass(frozen=True, eq=False, kw_only=True)
    class FarAway(events.Event):
        type: ClassVar[str] = "far"
        device: ClassVar[Any] = FarFromHome
        radius: Any = lw.number((), "m")

    r = lw.solve(fleet(50, [FarAway(radius=2.0)]), h=0.05, t1=5.0)
    assert r.status.counts().keys() == {"ok", "condition"}
    away = r.position[0, :, 0] < 2.0
    hit = away & (r.status == lw.Status.CONDITION)
    assert hit.sum() > 10 and np.abs(r.position[-1, hit, 0] - 2.0).max() < 1e-13
    # A member that starts beyond stops at once, where it is.
    assert (r.failure_time[~away] == 0.0).all()
    np.testing.assert_array_equal(r.position[-1, ~away], r.position[0, ~away])


# Gravity and a righting moment, so that paths are curved; a floor 1.5 m below the start.
HEAVY = vehicle(M=(18.0, 20.0, 25.0), J=(1.0, 1.2, 1.4), net=9.0, moment=(0.0, 0.0, -3.0))
FALL = {"b": (0.0, 0.0, 5.0), "R": TURN, "nu": (0.3, 0.1, 0.5), "Om": (0.4, -0.3, 0.2)}
FALLING = lw.Scene(HEAVY, lw.Environment(gravity=9.8), events=[lw.Floor(depth=6.5)])


def test_the_twin_arrives_where_the_kernel_does():
    h = 0.05
    for method in ("psi_s", "psi"):
        r = lw.solve(one(FALLING, **FALL), method, h=h, t1=4.0)
        body = body_of(FALLING)
        x = to_state(body, *(np.array(value) for value in FALL.values()))
        steps = int(r.end_time[0] / h)
        x = advance.advance(x, body, PROGRAMS[method], h, steps)
        x, part = advance.arrival(x, body, PROGRAMS[method], h, lambda x: 6.5 - x.b[2])
        # As parity after 5 s (tests/methods/test_kernel_and_twin.py).
        assert difference(last(r), from_state(body, x)) < 1e-11
        assert r.end_time[0] == pytest.approx((steps + part) * h, abs=1e-12)


@pytest.mark.parametrize(
    ("method", "order", "steps"),
    chosen(
        [
            ("psi_s", 2, (20, 40, 80)),
            ("psi_x", 2, (20, 40, 80)),
            ("kl6(psi_s)", 6, (10, 16, 24)),
            ("rk4", 4, (20, 40, 80)),
            ("phi", 1, (40, 80, 160)),
            ("psi", 2, (20, 40, 80)),
            ("psi_1", 2, (20, 40, 80)),
            ("psi_w", 2, (20, 40, 80)),
            ("su4(psi_s)", 4, (20, 40, 80)),
            ("bm6(psi_x)", 6, (10, 16, 24)),
            ("rkn6_11", 6, (8, 12, 16)),
            ("gauss4", 4, (20, 40, 80)),
            ("gauss6", 6, (10, 20, 40)),
            ("cg3", 3, (20, 40, 80)),
            ("rkmk4", 4, (20, 40, 80)),
            ("rk8", 8, (4, 6, 8)),
        ],
        lambda method, order, steps: method in ("psi_s", "psi_x", "kl6(psi_s)", "rk4"),
    ),
)
def test_the_order_holds_up_to_the_event(method, order, steps):
    # The true arrival, by a method whose error is far below those compared.
    true = lw.solve(one(FALLING, **FALL), "rk8", h=0.01, t1=2.0)
    assert true.status[0] == lw.Status.FLOOR
    errors = []
    for n in steps:
        r = lw.solve(one(FALLING, **FALL), method, h=2.0 / n, t1=2.0)
        assert abs(r.position[-1, 0, 2] - 6.5) < 1e-13
        errors.append(max(difference(last(r), last(true)), abs(r.end_time[0] - true.end_time[0])))
    # At least the order: at these steps some methods still gain on it (rkn6_11, rk8), and none may fall a third of one behind.
    assert slope([2.0 / n for n in steps], errors) > order - 0.35


def test_an_adaptive_method_arrives_within_its_tolerance():
    true = lw.solve(one(FALLING, **FALL), "rk8", h=0.01, t1=2.0)
    r = lw.solve(one(FALLING, **FALL), lw.Method("rk8", rtol=1e-10, atol=1e-12), h=0.5, t1=2.0)
    assert difference(last(r), last(true)) < 1e-9 and abs(r.end_time[0] - true.end_time[0]) < 1e-9


@pytest.mark.parametrize("dtype", ["float32", "float32_compensated"])
def test_single_precision_stands_at_the_event(dtype):
    ensemble = fleet(200, [lw.Floor(depth=8.0), lw.Surface()])
    statistics = [lw.Exceedance("depth", above=8.0, name="deep"), lw.Exceedance("depth", below=0.0, name="out")]
    r = lw.solve(ensemble, h=0.1, t1=20.0, dtype=dtype, statistics=statistics)
    counts = r.status.counts()
    assert round(float(r.statistics["deep"].value[-1, 0]) * 200) == counts["floor"] > 20
    assert round(float(r.statistics["out"].value[-1, 0]) * 200) == counts["surface"] > 20
    floor = r.position[-1, r.status == lw.Status.FLOOR, 2]
    # Positions of some 30 m are known to 4e-6 m; the margin is a few spacings of the sum of their sizes.
    assert (floor > 8.0).all() and floor.max() < 8.0 + 1e-4


def test_the_first_of_two_events_in_a_step():
    # Straight paths: the floor is 1 mm nearer in time than the end of the box, or the other way round.
    for depth, east, status in ((6.0, 1.001, "floor"), (6.001, 1.0, "box")):
        scene = lw.Scene(
            VEHICLE,
            lw.Environment(gravity=GRAVITY),
            events=[lw.Box(lower=(-9, -9, -9), upper=(9, east, 9)), lw.Floor(depth=depth)],
            start=lw.Start(position=(0, 0, 5.0), velocity=(0, 1.0, 1.0)),
        )
        r = lw.solve(scene, h=0.3, t1=3.0)
        assert r.status.counts() == {status: 1}
        assert r.end_time[0] == pytest.approx(1.0, abs=1e-12)


def test_what_is_no_number_is_no_event():
    b, R, nu, Om = random_states(2, 8)
    Om[3] = 1e200
    scene = lw.Scene(VEHICLE, lw.Environment(gravity=GRAVITY), events=[lw.Floor(depth=1e9)])
    r = lw.solve(lw.Ensemble.from_states(scene, b, R, nu, Om), "rk4", h=0.05, t1=1.0)
    assert r.status.counts() == {"ok": 7, "non_finite": 1}


# A tidal current, thrusters with a lag, and noise: water that changes, and laws that remember.
TERMS = {
    "water": [{"type": "current_harmonics", "amplitudes": [[0.3, 0.1, 0.0]], "periods": [8.0]}],
    "wandering": [{"type": "gauss_markov_current", "standard_deviation": [0.2, 0.2, 0.0], "time_constant": 5.0}],
    "noise": [{"type": "wrench_noise", "force": [2.0, 2.0, 2.0], "torque": [0.1, 0.1, 0.1]}],
}


@pytest.mark.parametrize("terms", TERMS)
def test_a_stopped_member_stays_and_the_others_do_not_notice(terms):
    b, R, nu, Om = random_states(2, 40)

    def run(depth):
        scene = lw.Scene(VEHICLE, lw.Environment(gravity=GRAVITY), terms=TERMS[terms], events=[lw.Floor(depth=depth)])
        return lw.solve(
            lw.Ensemble.from_states(scene, b, R, nu, Om), "psi_s", h=0.05, t1=4.0, save=lw.SaveAt(every=0.5)
        )

    near, far = run(1.5), run(1e6)
    stopped = np.asarray(near.status) == lw.Status.FLOOR
    assert 5 < stopped.sum() < 35
    for name in FIELDS:
        values = getattr(near, name)
        assert values[:, ~stopped].tobytes() == getattr(far, name)[:, ~stopped].tobytes()
        # Sample 0 is the start as it was given: velocities of the others went through momenta.
        after = (near.time[:, None] >= near.end_time[stopped]) & (near.time[:, None] > 0.0)
        held = np.broadcast_to(values[-1, stopped], values[:, stopped].shape)
        np.testing.assert_array_equal(values[:, stopped][after], held[after])
    # The path does not jump: where it stands lies between the samples of the one that goes on.
    begun = (b[:, 2] <= 1.5) & stopped
    np.testing.assert_allclose(near.position[-1, begun, 2], 1.5, atol=1e-12)
    for member in np.flatnonzero(begun):
        i = int(near.end_time[member] / 0.5)
        step = near.position[-1, member] - far.position[i, member]
        share = (near.end_time[member] - 0.5 * i) / 0.5
        whole = far.position[i + 1, member] - far.position[i, member]
        # Half a second of speeds that change by some 0.3 m/s.
        np.testing.assert_allclose(step, share * whole, atol=0.1)


def test_an_event_in_a_step_that_was_divided():
    # Too fast a turn for the step: divided steps get on, and arrive.
    b, R, nu, Om = random_states(2, 8, spin=0.1)
    Om[:4] *= 400.0
    scene = lw.Scene(
        lw.Vehicle(20.0, (1.0, 1.2, 1.4), (0.0, 0.0, 0.0), 20.0 * GRAVITY),
        lw.Environment(gravity=GRAVITY),
        events=[lw.Floor(depth=2.0), lw.Surface(depth=-2.0)],
    )
    r = lw.solve(lw.Ensemble.from_states(scene, b, R, nu, Om), h=0.1, t1=20.0, on_failure="substep")
    hit = np.asarray(r.status) >= lw.Status.SURFACE
    inside = np.abs(b[:, 2]) < 2.0
    assert hit[:4].sum() >= 2 and (r.substeps[:4] > 0).all()
    np.testing.assert_allclose(np.abs(r.position[-1, hit & inside, 2]), 2.0, atol=1e-12)


def test_events_need_checks():
    with pytest.raises(lw.SceneError, match="events"):
        lw.solve(fleet(4, [lw.Surface()]), h=0.05, t1=1.0, checks="none")


@pytest.mark.parametrize(
    ("event", "words"),
    [
        ({"type": "box", "lower": [0, 0, 0], "upper": [1, -1, 1]}, ("upper", "lower")),
        ({"type": "flor", "depth": 3}, ("flor", "floor")),
        ({"type": "floor"}, ("depth", "missing")),
        ({"type": "time", "at": -1.0}, ("at", "-1.0", "from 0")),
        ("surface", ("surface",)),
    ],
)
def test_a_bad_event_is_refused(event, words):
    with pytest.raises(lw.SceneError) as error:
        lw.Scene(VEHICLE, events=[event])
    assert all(word in str(error.value) for word in words)
