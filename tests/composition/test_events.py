"""Events stop a member with status and time, and leave its packet alone."""

import functools
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
import warp as wp

import lgvi_warp as lw
from lgvi_kernels.lanes import lane, sub  # noqa: F401
from lgvi_kernels.state import struct
from lgvi_warp import events
from lgvi_warp.inertia import moved
from tests.tools import random_states

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
    # A stopped member keeps the last state before the event.
    last = r.position[-1, :, 2]
    assert (last > 0.0).all() and (last < 8.0).all()
    assert np.abs(last - depth - sink * 0.1 * np.floor(expected / 0.1 * (1 - 1e-12)))[stopped].max() < 1e-9


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
        radius: Any = lw.quantity((), "m")

    r = lw.solve(fleet(50, [FarAway(radius=2.0)]), h=0.05, t1=5.0)
    assert r.status.counts().keys() == {"ok", "condition"}
    away = r.position[0, :, 0] < 2.0
    assert away.sum() > 40 and (r.position[-1, away, 0] < 2.0).all()
    # A member that starts beyond stops at once.
    assert (r.failure_time[~away] == 0.0).all()


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
