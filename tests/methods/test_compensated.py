# SPDX-License-Identifier: Apache-2.0
"""Compensated float32: round-off of the size of a step's changes instead of the state's, and everything else as before."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.engine import launches
from lgvi_warp.physics import terms
from lgvi_warp.physics.inertia import moved
from tests.support.tools import difference, free_scene, last, one, random_states, scene_of

# Each method of another program is a kernel of its own to compile.
SLOW = pytest.mark.slow

METHODS = ("psi", "psi_s", "psi_1", "psi_x", "psi_x8", "psi_w", "kl6(psi_s)")
FIELDS = ("position", "attitude", "velocity", "angular_velocity")
COMPENSATED = "float32_compensated"
UNIT = 2.0**-24  # largest relative round-off of one float32 operation
STRAIGHT = scene_of((10.0,) * 3, (1.0, 2.0, 2.5))
GENERAL = scene_of((10.0, 12.0, 15.0), (1.0, 2.0, 2.5), net=-0.3, moment=(0.0, 0.1, -0.5))


def run(fleet, method="psi_s", h=0.01, t1=1.0, dtype=COMPENSATED, **named):
    """A run on one thread."""
    return lw.solve(fleet, method, h=h, t1=t1, dtype=dtype, threads=1, **named)


def member_errors(scene, states, *arguments, width=None):
    """Errors (n,) at the end with compensation, without, and what rounding the data to float32 makes in float64."""
    fleet = one(scene, *states)
    truth = run(fleet, *arguments, dtype="float64")

    def error(second):
        return np.array([difference(last(second, i), last(truth, i)) for i in range(fleet.members)])

    compensated, plain = (error(run(fleet, *arguments, dtype=dtype, width=width)) for dtype in (COMPENSATED, "float32"))
    return compensated, plain, error(run(one(rounded(scene), *states), *arguments, dtype="float64"))


def errors(scene, states, *arguments):
    """The largest of them."""
    return [one.max() for one in member_errors(scene, states, *arguments)]


def rounded(scene):
    """The scene with masses and moments of inertia off by one round-off, to all sides."""
    v = scene.vehicle
    signs = np.diag([1.0, -1.0, 1.0])
    inertia, added_mass = v.inertia @ (np.eye(3) + UNIT * signs), v.added_mass @ (np.eye(3) - UNIT * signs)
    changed = lw.Vehicle(v.mass, inertia=inertia, added_mass=added_mass,
                         buoyancy=v.buoyancy, center_of_buoyancy=v.center_of_buoyancy)  # fmt: skip
    return lw.Scene(changed, scene.environment, terms=scene.terms)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["psi_s", *(pytest.param(name, marks=SLOW) for name in METHODS if name != "psi_s")])
def test_far_from_the_origin(method):
    # M = m I: a straight line of 100 m in 1e5 steps of 1 mm, 1e7 m from the origin, where float32 has a metre's digits.
    # Each step's change is rounded where b's low part, below half a metre, has its digits: 1e5 * 0.5 * 2^-24 if all
    # have one sign. The velocity, h and the inertia are rounded too, 4 * 2^-24 of the 100 m.
    h, steps, stages = 1e-3, 100_000, len(lw.Method(method).stages)
    b, R, nu, Om = random_states(3, 4, 1.0, 0.5)
    b = 1e7 * np.sign(b)
    nu /= np.linalg.norm(nu, axis=1)[:, None]
    fleet = one(STRAIGHT, b, R, nu, Om)
    expected = b + h * steps * np.einsum("nij,nj->ni", R, nu)
    result = run(fleet, method, h, h * steps)
    assert np.abs(result.position[-1] - expected).max() < stages * steps * 0.5 * UNIT + 4 * UNIT * h * steps
    # Without compensation nothing moves at all.
    plain = run(fleet, method, h, h * steps, "float32")
    assert np.abs(plain.position[-1] - expected).max() > 50.0


@pytest.mark.ci
@pytest.mark.slow_but("psi_s")
@pytest.mark.parametrize(
    "method", ["psi_s", "psi_x", *(pytest.param(name, marks=SLOW) for name in ("psi", "psi_1", "psi_w"))]
)
def test_many_short_steps(method):
    # 1e5 steps of 1 ms. What a step rounds is some 1e-3 of the state, 2^-24 of that: all together as much as rounding the
    # data once if every step errs to the same side, 100 times 2^-24 of the state. Some ten numbers are so rounded.
    # Plain sums round the state itself in each of 1e5 steps.
    compensated, plain, data = errors(GENERAL, random_states(3, 4, 0.5, 0.5), method, 1e-3, 100.0)
    assert compensated < 20 * data
    assert plain > 30 * compensated


@pytest.mark.ci
def test_energy_is_kept():
    # Float32 loses or gains energy step by step; what is left with compensation is the rounding of the samples.
    fleet = one(GENERAL, *random_states(3, 4, 0.5, 0.5))
    result, truth = (run(fleet, "psi_s", 1e-3, 100.0, dtype) for dtype in (COMPENSATED, "float64"))
    size = np.abs(truth.energy).max()
    assert np.abs(result.energy[-1] - truth.energy[-1]).max() < 20 * UNIT * size


LAWS = {
    "current": [terms.Current(velocity=(0.3, -0.2, 0.1))],
    "tether": [terms.Tether(anchor=(2.0, 0.0, -3.0), stiffness=4.0, rest_length=1.0)],
    "drag": [terms.Drag(linear=(0.3, 0.4, 0.5, 0.03, 0.04, 0.05), quadratic=(1e-30,) * 6)],
    "shear": [terms.CurrentProfile(depths=(-100.0, 100.0), velocities=((-3.0, 2.0, -1.0), (3.0, -2.0, 1.0)))],
    "noise": [terms.GaussMarkovCurrent(standard_deviation=(0.1, 0.1, 0.1), time_constant=5.0)],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("method", ["psi_s", "psi_x"])
def test_laws(name, method):
    # As above, with some ten numbers of the laws rounded as well. One lane, which is sooner compiled.
    scene = lw.Scene(GENERAL.vehicle, GENERAL.environment, terms=LAWS[name])
    compensated, plain, data = member_errors(scene, random_states(3, 16, 0.5, 0.5), method, 2e-3, 20.0, width=1)
    assert compensated.max() < 40 * max(data.max(), UNIT)
    # Member by member, since both errors grow as much as that member's own do. The wandering current is itself a sum of some
    # 2,500 steps in float32, with compensation and without: a law's memory has no low part.
    assert np.median(plain / compensated) > (3 if name == "noise" else 10)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["psi_x", *(pytest.param(name, marks=SLOW) for name in ("psi_x8", "psi_w"))])
def test_coupled_inertia(method):
    # The origin is 0.3 m from the centre of mass: psi_x hops between the origins of the axes at every step.
    rigid = np.diag([20.0, 20.0, 20.0, 1.5, 4.0, 4.5])
    shifted = moved(rigid[None], np.array([[0.1, 0.2, -0.3]]), np.eye(3)[None])[0]
    vehicle = lw.Vehicle(
        rigid_body_mass_matrix=shifted, added_mass_matrix=np.diag([5.0, 22.0, 25.0, 0.1, 0.2, 0.3]), buoyancy=196.0
    )
    fleet = one(lw.Scene(vehicle, lw.Environment(gravity=9.8)), *random_states(3, 4, 0.5, 0.5))
    truth, compensated, plain = (run(fleet, method, 1e-3, 20.0, d) for d in ("float64", COMPENSATED, "float32"))
    error = [max(difference(last(r, i), last(truth, i)) for i in range(4)) for r in (compensated, plain)]
    assert error[1] > 10 * error[0]


@pytest.mark.ci
def test_events_stop_where_they_do():
    # Straight lines from 5 m to the surface, 1e7 m north: the crossing is known.
    scene = lw.Scene(STRAIGHT.vehicle, STRAIGHT.environment, events=[lw.events.Surface()])
    n = 40
    nu = np.stack([np.ones(n), np.zeros(n), -np.linspace(0.4, 2.0, n)], axis=1)
    fleet = one(scene, np.array([1e7, 0.0, 5.0]), nu=nu)
    result = run(fleet, h=1e-3, t1=6.0, width=1)
    time = -5.0 / nu[:, 2]
    stopped = time < 6.0
    assert 10 < stopped.sum() < n
    np.testing.assert_array_equal(result.status == lw.Status.SURFACE, stopped)
    np.testing.assert_allclose(result.failure_time[stopped], time[stopped], atol=2e-5)
    # Both parts of a stopped member's position are kept: it is where it was at the event, whatever its place in the north.
    at = np.where(stopped, time, 6.0)
    np.testing.assert_allclose(result.position[-1, :, 0], 1e7 + at, atol=2e-5)
    np.testing.assert_allclose(result.position[-1, stopped, 2], 0.0, atol=1e-6)
    # Those that go on make the same steps as where the event is far away.
    far = lw.Scene(STRAIGHT.vehicle, STRAIGHT.environment, events=[lw.events.Surface(depth=-1e6)])
    alone = run(one(far, np.array([1e7, 0.0, 5.0]), nu=nu), h=1e-3, t1=6.0, width=1)
    for name in FIELDS:
        assert getattr(result, name)[:, ~stopped].tobytes() == getattr(alone, name)[:, ~stopped].tobytes()


@pytest.mark.ci
@pytest.mark.parametrize("method", ["psi_s", pytest.param("psi_x", marks=SLOW)])
def test_a_failure_beside_changes_nothing(method):
    # Chunks with a failing lane are repeated one step at a time: the low parts too start where the chunk did.
    b, R, nu, Om = random_states(3, 40, 0.5, 0.5)
    sick = nu.copy()
    sick[[2, 17, 38]] = np.nan
    well = np.isfinite(sick).all(axis=1)
    one_of_them, all_well = (run(one(GENERAL, 1e4 * b, R, v, Om), method, t1=3.0) for v in (sick, nu))
    np.testing.assert_array_equal(one_of_them.status == 0, well)
    for name in FIELDS:
        assert getattr(one_of_them, name)[:, well].tobytes() == getattr(all_well, name)[:, well].tobytes()


@pytest.mark.ci
@pytest.mark.parametrize("method", ["psi_s", *(pytest.param(name, marks=SLOW) for name in ("psi_x", "psi_1"))])
def test_launches_and_samples_do_not_change_the_path(method, monkeypatch):
    # The low parts are part of a packet's state: many short launches end where one does, to the bit.
    fleet = one(GENERAL, *random_states(3, 9, 0.5, 0.5))
    whole = run(fleet, method, 1e-3, 1.5)
    monkeypatch.setattr(launches, "SEGMENT_VEHICLE_STEPS", 1)
    parts = run(fleet, method, 1e-3, 1.5, save=lw.SaveAt(every=0.05))
    for name in FIELDS:
        assert getattr(whole, name)[-1].tobytes() == getattr(parts, name)[-1].tobytes()


@pytest.mark.ci
def test_types_of_the_result():
    b = np.array([1e7 + 0.123456789, 0.1, -1e-3])
    result = run(one(free_scene((10.0, 12.0, 15.0)), b), t1=0.1)
    assert result.provenance["dtype"] == COMPENSATED
    assert [getattr(result, name).dtype for name in FIELDS] == [np.float64] + 3 * [np.float32]
    # Both parts together hold twice float32's digits, and leave the packet unharmed.
    np.testing.assert_allclose(result.position[-1, 0], b, rtol=2.0**-48)
