# SPDX-License-Identifier: Apache-2.0
"""Events stop a member with status and time, and leave its packet alone."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lgvi_warp as lw
from lgvi_warp.methods.method import PROGRAMS
from lgvi_warp.physics.inertia import moved
from lgvi_warp.reference import advance, explicit
from tests.support.stops import stops
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
VEHICLE = lw.Vehicle(20.0, inertia=(1.0, 1.2, 1.4), added_mass=(10.0, 10.0, 10.0), buoyancy=20.0 * GRAVITY)
# Gravity and a righting moment, so that paths are curved.
HEAVY = vehicle(M=(18.0, 20.0, 25.0), J=(1.0, 1.2, 1.4), net=9.0, moment=(0.0, 0.0, -3.0))
FIELDS = ("position", "attitude", "velocity", "angular_velocity")


def fleet(n, events, vehicle=VEHICLE, parameters=None, speed=1.0):
    """n members about depth 5 with random velocities."""
    b, R, nu, Om = random_states(2, n, speed=speed)
    scene = lw.Scene(vehicle, lw.Environment(gravity=GRAVITY), events=events)
    return lw.Ensemble.from_states(scene, b + np.array([0.0, 0.0, 5.0]), R, nu, Om, parameters)


@pytest.mark.slow
def test_surface_and_floor_at_the_crossing():
    # Neutrally buoyant with M = m I: straight lines, so that the crossing is known, and the interpolation exact.
    ensemble = fleet(200, stops(surface=0.0, floor=8.0))
    r = lw.solve(ensemble, h=0.1, t1=20.0)
    start = ensemble.select(0, 200)
    sink = np.einsum("nij,nj->ni", start.attitude, start.velocity)[:, 2]
    depth = start.position[:, 2]
    expected = np.where(
        sink < 0.0, -depth / np.where(sink < 0.0, sink, 1.0), (8.0 - depth) / np.where(sink > 0.0, sink, 1.0)
    )
    stopped = expected < 20.0 - 0.1
    assert stopped.sum() > 50
    assert set(np.unique(r.status)) == {0, lw.Status.SURFACE, lw.Status.FLOOR}
    np.testing.assert_allclose(r.failure_time[stopped], expected[stopped], rtol=1e-9)
    np.testing.assert_array_equal(r.status[stopped & (sink < 0)], lw.Status.SURFACE)
    np.testing.assert_array_equal(r.status[stopped & (sink > 0)], lw.Status.FLOOR)
    # A stopped member stands at the event, and a spacing of its numbers beyond it.
    last = r.position[-1, stopped, 2]
    beyond = np.where(sink[stopped] < 0.0, -last, last - 8.0)
    assert (beyond > 0.0).all()
    assert beyond.max() < 1e-13
    np.testing.assert_allclose(last, (depth + sink * expected)[stopped], atol=1e-12)
    np.testing.assert_array_equal(r.end_time[stopped], r.failure_time[stopped])
    assert (r.end_time[r.status == lw.Status.OK] == 20.0).all()


@pytest.mark.ci
@pytest.mark.slow_but("float32-psi_s", "float64-kl6(psi_s)", "float64-psi_s")
@pytest.mark.parametrize("method", ["psi_s", "psi_1", "psi", "psi_x", "kl6(psi_s)"])
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_the_others_do_not_change_by_a_bit(method, dtype):
    # Those that are never stopped make the same steps as in a scene whose event is far away.
    # Each with the kernel of another test.
    vehicle = VEHICLE if dtype == "float32" else HEAVY
    near, far = (
        lw.solve(fleet(100, events, vehicle), method, h=0.05, t1=3.0, dtype=dtype)
        for events in (stops(lower=(-3, -3, 0), upper=(3, 3, 9)), stops())
    )
    well = np.asarray(near.status) == 0
    assert 10 < well.sum() < 90
    for name in FIELDS:
        assert getattr(near, name)[:, well].tobytes() == getattr(far, name)[:, well].tobytes()


@pytest.mark.ci
def test_the_time_may_vary_by_member():
    at = np.linspace(0.02, 1.5, 64)
    ensemble = fleet(64, stops(at=9.0), parameters={"time.at": at})
    r = lw.solve(ensemble, h=0.05, t1=1.0, save=lw.SaveAt(every=0.25))
    stopped = at <= 1.0
    np.testing.assert_array_equal(r.status == lw.Status.TIME, stopped)
    np.testing.assert_allclose(r.failure_time[stopped], at[stopped], atol=1e-12)
    assert np.isnan(r.failure_time[~stopped]).all()


@pytest.mark.ci
@pytest.mark.slow_but("psi_s")
@pytest.mark.parametrize("method", ["psi_s", "psi_x", "psi_w"])
def test_events_look_at_the_users_origin(method):
    # The same vehicle told about an origin 2 m above: the same path of that origin stops it.
    rigid = np.diag([20.0, 20, 20, 1, 1.2, 1.4])
    d = np.array([0.0, 0.0, 2.0])
    shifted = moved(rigid[None], -d[None], np.eye(3)[None])[0]
    vehicle = lw.Vehicle(rigid_body_mass_matrix=shifted, buoyancy=200.0, weight=200.0, center_of_buoyancy=d)
    scene = lw.Scene(vehicle, lw.Environment(gravity=GRAVITY), events=[lw.events.Surface()],
                     start=lw.Start(position=(0, 0, 1.0), velocity=(0, 0, -1.0)))  # fmt: skip
    r = lw.solve(scene, method, h=0.03, t1=3.0)
    assert r.status[0] == lw.Status.SURFACE
    assert r.failure_time[0] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.ci
def test_a_users_condition():
    r = lw.solve(fleet(50, stops(radius=2.0)), h=0.05, t1=5.0)
    assert r.status.counts().keys() == {"ok", "condition"}
    away = r.position[0, :, 0] < 2.0
    hit = away & (r.status == lw.Status.CONDITION)
    assert hit.sum() > 10
    assert np.abs(r.position[-1, hit, 0] - 2.0).max() < 1e-13
    # A member that starts beyond stops at once, where it is.
    assert (r.failure_time[~away] == 0.0).all()
    np.testing.assert_array_equal(r.position[-1, ~away], r.position[0, ~away])


@pytest.mark.ci
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_all_that_begin_beyond_an_event_are_stopped_at_once(method, dtype):
    """Half of the members about the floor rise at 20 m/s: through it within the first step of 0.1 s, if they began below."""
    depth = np.array([6.9, 7.0, 7.1, 7.5, 8.5, 30.0])
    b = np.stack([np.zeros(12), np.zeros(12), np.repeat(depth, 2)], axis=1)
    nu = np.zeros((12, 3))
    nu[:, 2] = np.tile([-20.0, 1.0], 6)
    scene = lw.Scene(VEHICLE, lw.Environment(gravity=GRAVITY), events=stops(floor=7.0))
    members = lw.Ensemble.from_states(scene, b, np.tile(np.eye(3), (12, 1, 1)), nu, np.zeros((12, 3)))
    asked = [lw.statistics.Outcome("floor"), lw.statistics.EndTime("floor", lw.statistics.Mean())]
    r = lw.solve(members, method, h=0.1, t1=0.3, dtype=dtype, statistics=asked)
    beyond = b[:, 2] > 7.0
    assert beyond.sum() == 8
    assert (r.status[beyond] == lw.Status.FLOOR).all()
    assert (r.end_time[beyond] == 0.0).all()
    # Momenta are rounded once, and positions to their spacing; an arrival is sought to three spacings.
    spacing = float(np.finfo(dtype).eps)
    for field in FIELDS:
        first, final = (getattr(r, field)[k, beyond] for k in (0, -1))
        np.testing.assert_allclose(final, first, rtol=2.0 * spacing, atol=spacing)
    # One that begins on the floor goes on if it rises. Of the four others the two that sink arrive within the run.
    assert (r.status[~beyond] == [0, lw.Status.FLOOR] * 2).all()
    assert r.end_time[~beyond][1] == pytest.approx(0.1, abs=3 * 3 * 7.0 * spacing)
    text = "8 of 12 members begin at or beyond an event (floor 8; the first: member 4) and count as stopped at t = 0"
    assert any(message.startswith(text) for message in r.messages)
    assert r.statistics["outcome floor"].value.tolist() == [8 / 12, 10 / 12] == [
        (r.end_time[r.status == lw.Status.FLOOR] <= t).sum() / 12 for t in r.time]  # fmt: skip


@pytest.mark.ci
def test_a_start_at_the_surface_is_no_end():
    scene = lw.Scene(
        VEHICLE, lw.Environment(gravity=GRAVITY), events=stops(surface=0.0), start=lw.Start(velocity=(0, 0, 1.0))
    )
    r = lw.solve(scene, "psi_s", h=0.1, t1=0.3)
    assert r.status[0] == lw.Status.OK
    assert not any("begin" in message for message in r.messages)


@pytest.mark.slow
def test_what_begins_beyond_in_moving_water_or_under_control_keeps_its_start(tmp_path):
    """The state of such a kernel is relative to the water, which goes on moving; a controller has measured at t = 0."""
    start = {"position": [0.0, 0.0, 21.0], "velocity": [0.5, 0.0, -3.0]}
    scene = lw.Scene.named("remus_100", start=start, events=[{"type": "floor", "depth": 20.0}],
                           terms=[lw.terms.GaussMarkovCurrent(standard_deviation=(0.3, 0.3, 0.0),
                                                              time_constant=2.0)])  # fmt: skip
    r = lw.solve(lw.Ensemble(scene, 20, 1, {"start.position[2]": lw.distributions.Uniform(low=19.0, high=23.0)}),
                 h=0.05, t1=2.0,
                 save=lw.SaveAt(every=0.5), store=tmp_path / "run.zarr")  # fmt: skip
    beyond = r.position[0, :, 2] > 20.0
    assert 5 < beyond.sum() < 20
    assert (r.end_time[beyond] == 0.0).all()
    assert (r.end_time[~beyond] > 0.0).all()
    for field in FIELDS:
        whole = np.asarray(getattr(r, field))
        np.testing.assert_allclose(
            whole[:, beyond], np.broadcast_to(whole[:1, beyond], whole[:, beyond].shape), atol=1e-12
        )
    assert sum("begin at or beyond" in message for message in lw.open_run(tmp_path / "run.zarr").messages) == 1


# A floor 1.5 m below the start.
FALL = {"b": (0.0, 0.0, 5.0), "R": TURN, "nu": (0.3, 0.1, 0.5), "Om": (0.4, -0.3, 0.2)}
FALLING = lw.Scene(HEAVY, lw.Environment(gravity=9.8), events=stops(floor=6.5))
BODY = body_of(FALLING)
START = to_state(BODY, *(np.array(value) for value in FALL.values()))


@pytest.mark.ci
@pytest.mark.slow_but("psi_s")
@pytest.mark.parametrize("method", ["psi_s", "psi"])
def test_the_twin_arrives_where_the_kernel_does(method):
    h = 0.05
    r = lw.solve(one(FALLING, **FALL), method, h=h, t1=4.0)
    steps = int(r.end_time[0] / h)
    x = advance.advance(START, BODY, PROGRAMS[method], h, steps)
    x, part = advance.arrival(x, BODY, PROGRAMS[method], h, lambda x: 6.5 - x.b[2])
    # As parity after 5 s (tests/methods/test_kernel_and_twin.py).
    assert difference(last(r), from_state(BODY, x)) < 1e-11
    assert r.end_time[0] == pytest.approx((steps + part) * h, abs=1e-12)


@pytest.fixture(scope="module")
def true():
    """b, R, nu, Om at the true arrival, and its time: SciPy on the twin's rates."""

    def height(t, y):
        return 6.5 - y[2]

    def rates(t, y):
        return explicit.rates(explicit.unpack(y, START, t), BODY, 1.0)

    height.terminal = True
    found = solve_ivp(
        rates, (0.0, 2.0), explicit.pack(START), "DOP853", rtol=1e-13, atol=1e-14, max_step=0.02, events=height
    )
    assert found.status == 1
    return from_state(BODY, explicit.unpack(found.y[:, -1], START, found.t[-1])), found.t[-1]


def error(result, true):
    """Error of a member's arrival, in place and in time."""
    assert result.status[0] == lw.Status.FLOOR
    assert abs(result.position[-1, 0, 2] - 6.5) < 1e-13
    return max(difference(last(result), true[0]), abs(result.end_time[0] - true[1]))


@pytest.mark.ci
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
        lambda method, order, steps: method in ("psi_s", "kl6(psi_s)", "rk4"),
    ),
)
def test_the_order_holds_up_to_the_event(method, order, steps, true):
    errors = [error(lw.solve(one(FALLING, **FALL), method, h=2.0 / n, t1=2.0), true) for n in steps]
    # At least the order: at these steps some methods still gain on it (rkn6_11, rk8), and none may fall a third of one behind.
    assert slope([2.0 / n for n in steps], errors) > order - 0.35


@pytest.mark.slow
@pytest.mark.parametrize("method", ["rk5", "rk8"])
def test_an_adaptive_method_arrives_within_its_tolerance(method, true):
    assert error(lw.solve(one(FALLING, **FALL), lw.Method(method, rtol=1e-10, atol=1e-12), h=0.5, t1=2.0), true) < 1e-9


@pytest.mark.ci
@pytest.mark.slow_for("float32_compensated")
@pytest.mark.parametrize("dtype", ["float32", "float32_compensated"])
def test_single_precision_stands_at_the_event(dtype):
    ensemble = fleet(200, stops(floor=8.0, surface=0.0))
    statistics = [
        lw.statistics.Exceedance("depth", above=8.0, name="deep"),
        lw.statistics.Exceedance("depth", below=0.0, name="out"),
    ]
    r = lw.solve(ensemble, h=0.1, t1=20.0, dtype=dtype, statistics=statistics)
    counts = r.status.counts()
    assert round(float(r.statistics["deep"].value[-1, 0]) * 200) == counts["floor"] > 20
    assert round(float(r.statistics["out"].value[-1, 0]) * 200) == counts["surface"] > 20
    floor = r.position[-1, r.status == lw.Status.FLOOR, 2]
    # Positions of some 30 m are known to 4e-6 m; the margin is a few spacings of the sum of their sizes.
    assert (floor > 8.0).all()
    assert floor.max() < 8.0 + 1e-4


@pytest.mark.ci
def test_the_first_of_two_events_in_a_step():
    # Straight paths: the floor is 1 mm nearer in time than the end of the box, or the other way round.
    for depth, east, status in ((6.0, 1.001, "floor"), (6.001, 1.0, "box")):
        scene = lw.Scene(VEHICLE, lw.Environment(gravity=GRAVITY),
                         events=stops(lower=(-9, -9, -9), upper=(9, east, 9), floor=depth),
                         start=lw.Start(position=(0, 0, 5.0), velocity=(0, 1.0, 1.0)))  # fmt: skip
        r = lw.solve(scene, h=0.3, t1=3.0)
        assert r.status.counts() == {status: 1}
        assert r.end_time[0] == pytest.approx(1.0, abs=1e-12)


@pytest.mark.ci
def test_what_is_no_number_is_no_event():
    b, R, nu, Om = random_states(2, 8)
    Om[3] = 1e200
    scene = lw.Scene(HEAVY, lw.Environment(gravity=GRAVITY), events=stops())
    r = lw.solve(lw.Ensemble.from_states(scene, b, R, nu, Om), "rk4", h=0.05, t1=1.0)
    assert r.status.counts() == {"ok": 7, "non_finite": 1}


# A tidal current, one that wanders, and noise: water that changes, and laws that remember.
TERMS = {"water": [{"type": "current_harmonics", "amplitudes": [[0.3, 0.1, 0.0]], "periods": [8.0]}],
         "wandering": [{"type": "gauss_markov_current", "standard_deviation": [0.2, 0.2, 0.0], "time_constant": 5.0}],
         "noise": [{"type": "wrench_noise", "force": [2.0, 2.0, 2.0], "torque": [0.1, 0.1, 0.1]}]}  # fmt: skip
TERMS["all"] = [table for tables in TERMS.values() for table in tables]


@pytest.mark.slow
@pytest.mark.parametrize("terms", TERMS)
def test_a_stopped_member_stays_and_the_others_do_not_notice(terms):
    b, R, nu, Om = random_states(2, 40)

    def run(depth):
        scene = lw.Scene(
            VEHICLE, lw.Environment(gravity=GRAVITY), terms=TERMS[terms], events=[lw.events.Floor(depth=depth)]
        )
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


@pytest.mark.slow
def test_an_event_in_a_step_that_was_divided():
    # Too fast a turn for the step: divided steps get on, and arrive.
    b, R, nu, Om = random_states(2, 8, spin=0.1)
    Om[:4] *= 400.0
    scene = lw.Scene(lw.Vehicle(20.0, inertia=(1.0, 1.2, 1.4), added_mass=(0.0, 0.0, 0.0), buoyancy=20.0 * GRAVITY),
                     lw.Environment(gravity=GRAVITY),
                     events=[lw.events.Floor(depth=2.0), lw.events.Surface(depth=-2.0)])  # fmt: skip
    r = lw.solve(lw.Ensemble.from_states(scene, b, R, nu, Om), h=0.1, t1=20.0, on_failure="substep")
    hit = np.asarray(r.status) >= lw.Status.SURFACE
    inside = np.abs(b[:, 2]) < 2.0
    assert hit[:4].sum() >= 2
    assert ((r.substeps[:4] > 0) == inside[:4]).all()
    assert inside[:4].sum() >= 2
    np.testing.assert_allclose(np.abs(r.position[-1, hit & inside, 2]), 2.0, atol=1e-12)


def test_events_need_checks():
    with pytest.raises(lw.SceneError, match="events"):
        lw.solve(fleet(4, [lw.events.Surface()]), h=0.05, t1=1.0, checks="none")
