# SPDX-License-Identifier: Apache-2.0
"""A law of a user's own sees its own rows and no others, whatever it indexes; events have rows as terms have."""

import functools
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
import warp as wp

import lgvi_warp as lw
from lgvi_kernels import built_in
from lgvi_kernels.law import (  # noqa: F401
    add,
    below,
    div,
    dot,
    gather1,
    gather3,
    lane,
    mul,
    ones,
    positive,
    remember,
    remembered,
    row1,
    row3,
    struct,
    sub,
    table1,
    table3,
    whole,
)
from tests.support.tools import GRAVITY, one

BODY = lw.Vehicle(mass=20.0, inertia=(1.5, 4.0, 4.5), added_mass=(4.0, 4.0, 4.0), buoyancy=20.0 * 9.80665)
# What no law of these tests has in its own rows.
FOREIGN = 1e6


@functools.cache
def wild_params(width, real):
    # Which row, how many, which index of memory, how far lanes are spread: numbers of the ensemble.
    words = dict.fromkeys(("first", "memory", "row", "count", "place"), wp.int32)
    return struct("Wild", **words, spread=lane(width, real))


@wp.func
def seen(view: Any, p: Any):
    """Every way to read a table, at rows that the host chose without sense."""
    x = p.spread * view.b.x
    at = p.first + p.row
    index = whole(x) + p.row * whole(ones(x))
    v = row3(view, at) + gather3(view, p.first, index) + table3(view, at, p.count, x)
    return row1(view, at) + gather1(view, p.first, index) + table1(view, at, p.count, x) + v.x + v.y + v.z


@wp.func
def wild_law(w: Any, view: Any, p: Any):
    w.force.x = w.force.x + view.h.dtype(1e-3) * (seen(view, p) + remembered(view, p.memory + p.place))
    return w


@wp.func
def wild_evolve(state: Any, view: Any, p: Any):
    remember(view, p.memory + p.place, remembered(view, p.place) + ones(view.b.x))
    return state


@wp.func
def wild_distance(view: Any, p: Any):
    # Own rows lie between -1 and 1: so the sum of twelve of them is above -25, and this stays positive.
    return seen(view, p) + view.h.dtype(1e3) * ones(view.b.x)


@dataclass(frozen=True, eq=False, kw_only=True)
class Reading(lw.laws.Term):
    """The numbers of both."""

    values: Any = lw.laws.number(("k",), "1")
    row: Any = lw.laws.number((), "1")
    count: Any = lw.laws.number((), "1")
    place: Any = lw.laws.number((), "1")
    spread: Any = lw.laws.number((), "1")

    def packed(self, numbers, context):
        words = {name: int(numbers[name].flat[0]) for name in ("row", "count", "place")}
        rows = np.atleast_2d(numbers["values"])
        memory = None if "memory" not in vars(type(self)) else 0.5 * rows[:1, :2]
        return lw.laws.Packed({**words, "spread": numbers["spread"]}, rows, memory)


WILD = dict(values=np.linspace(-1.0, 1.0, 11), row=0, count=1, place=0, spread=0.0)


class TermDevice:
    params, law, evolve = wild_params, wild_law, wild_evolve


@dataclass(frozen=True, eq=False, kw_only=True)
class WildTerm(Reading):
    type: ClassVar[str] = "wild_term"
    device: ClassVar[Any] = TermDevice
    memory: ClassVar[bool] = True


@functools.cache
def wild_event_params(width, real):
    words = dict.fromkeys(("first", "row", "count", "place"), wp.int32)
    return struct("WildEvent", **words, spread=lane(width, real))


class EventDevice:
    params, distance = wild_event_params, wild_distance


@dataclass(frozen=True, eq=False, kw_only=True)
class WildEvent(lw.laws.Event, Reading):
    type: ClassVar[str] = "wild_event"
    device: ClassVar[Any] = EventDevice


def foreign(shared):
    """A table that is not the wild ones': no force before a time that no run reaches, and then one that would show."""
    n = 3000 if shared else 3
    force = np.full((n, 3), FOREIGN)
    force[0] = 0.0
    return lw.terms.WrenchSchedule(name="foreign", times=1e9 + np.arange(n), force=force, torque=force)


def wild_numbers(rng):
    """Rows, counts and places from the near to the largest int32, a number that no lane can count, and none at all."""
    whole_ones = [0, 1, -1, 2, 10, 11, 12, -7, 1000, -1000, 10**6, -(10**6), 2**31 - 1, -(2**31)]
    row, count, place = (int(rng.choice([*whole_ones, rng.integers(-50, 50)])) for _ in range(3))
    spread = float(rng.choice([0.0, 1.0, -3.7, 1e3, -1e6, 1e12, -1e30, 1e30]))
    return dict(row=row, count=count, place=place, spread=spread)


def indexed_wildly(draws, shared, dtype, seed):
    """Runs of a wild term and a wild event beside a law with other rows, and one that remembers."""
    rng = np.random.default_rng(seed)
    b = np.random.default_rng(1).normal(size=(5, 3))
    for _ in range(draws):
        odd = WILD | wild_numbers(rng)
        terms = [foreign(shared), WildTerm(**odd), Keeper(kept=np.array([0.25, 0.25]))]
        scene = lw.Scene(BODY, terms=terms, events=[WildEvent(**WILD | wild_numbers(rng))])
        result = lw.solve(one(scene, b=b), "psi_s", h=0.1, t1=0.8, dtype=dtype)
        assert result.status.counts() == {"ok": 5}, odd
        velocity = result.velocity[-1]
        # 18 of the table, and of the memory the start's 0.5 with 1 more each half step; the force is a thousandth of it.
        assert np.abs(velocity[:, 0]).max() <= 1e-3 * (18.0 + 0.5 + 2 * 8 + 1.0) * 0.8 / 24.0, odd
        np.testing.assert_allclose(velocity[:, 1], 0.25 * 0.8 / 24.0, rtol=1e-5, err_msg=str(odd))
        np.testing.assert_allclose(velocity[:, 2], 0.0, atol=1e-6, err_msg=str(odd))


@pytest.mark.slow
@pytest.mark.parametrize(("shared", "dtype"), [(False, "float64"), (True, "float32")])
def test_laws_that_index_wildly_see_their_own_rows(shared, dtype):
    indexed_wildly(16, shared, dtype, 3)


@pytest.mark.slow
@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_a_thousand_laws_that_index_wildly(shared, dtype):
    indexed_wildly(250, shared, dtype, 11)


@functools.cache
def keeper_params(width, real):
    return struct("Keeper", memory=wp.int32)


@wp.func
def keeper_law(w: Any, view: Any, p: Any):
    w.force.y = w.force.y + remembered(view, p.memory + 1)
    return w


@wp.func
def keeper_evolve(state: Any, view: Any, p: Any):
    remember(view, p.memory + 1, remembered(view, p.memory))
    return state


class KeeperDevice:
    params, law, evolve = keeper_params, keeper_law, keeper_evolve


@dataclass(frozen=True, eq=False, kw_only=True)
class Keeper(lw.laws.Term):
    """A force that it remembers."""

    type: ClassVar[str] = "keeper"
    device: ClassVar[Any] = KeeperDevice
    memory: ClassVar[bool] = True
    kept: Any = lw.laws.number((2,), "N")

    def packed(self, numbers, context):
        return lw.laws.Packed({}, memory=numbers["kept"])


@functools.cache
def copied(name):
    """The device code of an actuator of the package, as a user's own."""
    law = built_in("laws", name)
    roles = {role: getattr(law, role) for role in ("law", "evolve", "follow", "report")}
    return type("Copied", (), roles | {"params": staticmethod(law.params)})


@dataclass(frozen=True, eq=False, kw_only=True)
class OwnActuator(lw.terms.ControlWrench):
    type: ClassVar[str] = "own_actuator"

    def device_in(self, aligned):
        return copied(super().device_in(aligned))


@pytest.mark.slow
def test_an_actuator_of_a_users_own_reports_where_it_is():
    # A torque that lags behind a command that never changes: 1 - e^(-t / T) of it.
    lag, t1 = 0.5, 1.5
    controller = lw.Controller(
        period=0.1, guidance=[lw.control.SetPoint(heading=1.0)], laws=[lw.control.HeadingPID(kp=2.0)]
    )
    still = lw.Vehicle(1e9, inertia=(1e9,) * 3, added_mass=(0.0,) * 3, buoyancy=1e9 * GRAVITY)
    scene = lw.Scene(still, terms=[OwnActuator(time_constant=lag)], controller=controller)
    result = lw.solve(one(scene), "psi_s", h=0.05, t1=t1, save=lw.SaveAt(every=0.5, fields=("actuator", "command")))
    torque = 2.0 * (1.0 - np.exp(-np.array([0.5, 1.0, 1.5]) / lag))
    np.testing.assert_allclose(result.actuator[1:, 0, 5], torque, rtol=1e-7)


@functools.cache
def picked_params(width, real):
    return struct("Picked", first=wp.int32)


@wp.func
def picked_law(w: Any, view: Any, p: Any):
    # The place to the east, which this force does not change.
    v = gather3(view, p.first, whole(view.b.y))
    ten = view.h.dtype(10.0)
    w.force.x = w.force.x + gather1(view, p.first, whole(view.b.y)) + ten * (v.x + ten * (v.y + ten * v.z))
    return w


class PickedDevice:
    params, law = picked_params, picked_law


@dataclass(frozen=True, eq=False, kw_only=True)
class Picked(lw.laws.Term):
    """A force of four readings, at the index that is the place to the east [m]."""

    type: ClassVar[str] = "picked"
    device: ClassVar[Any] = PickedDevice
    values: Any = lw.laws.number(("k",), "1")

    def packed(self, numbers, context):
        return lw.laws.Packed({}, numbers["values"])


OTHERS = [(40, 9, dtype, False, width) for dtype in ("float64", "float32") for width in (1, 2, 4, 8, 16, 32)]
OTHERS += [(40, 9, "float32", True, None), (40, 5000, "float32", False, 1), (40, 5000, "float64", False, 32)]


@pytest.mark.ci
@pytest.mark.parametrize(("members", "rows", "dtype", "varied", "width"), [
    (1, 9, "float64", False, None), (40, 9, "float64", True, None), (40, 5000, "float64", False, None),
    (40, 5000, "float32", False, None), *(pytest.param(*other, marks=pytest.mark.slow) for other in OTHERS),
])  # fmt: skip
def test_a_gather_reads_each_lane_at_its_own_index(members, rows, dtype, varied, width):
    rng = np.random.default_rng(members)
    values = rng.integers(0, 10, (members if varied else 1, rows)).astype(float)
    index = np.float32(rng.uniform(-0.2, 1.2, members) * rows).astype(float)
    index[: min(members, 4)] = [rows - 0.5, 1e12, -1e12, rows - 2.0][: min(members, 4)]
    scene = lw.Scene(BODY, terms=[foreign(False), Picked(values=values[0])])
    fleet = one(scene, b=np.stack([0.0 * index, index, 0.0 * index], axis=1))
    if varied:
        ends = fleet.select(0, members)
        start = ends.position, ends.attitude, ends.velocity, ends.angular_velocity
        fleet = lw.Ensemble.from_states(scene, *start, {"picked.values": values})
    result = lw.solve(fleet, "psi_s", h=0.1, t1=0.5, dtype=dtype, width=width)
    # By NumPy: floor, then the nearest of the rows that there are.
    at = np.clip(np.floor(np.clip(index, -1e9, 1e9)).astype(int)[:, None] + [0, 0, 1, 2], 0, rows - 1)
    digits = np.take_along_axis(np.broadcast_to(values, (members, rows)), at, axis=1)
    # Four digits: a force in newtons that float32 holds, and constant on a body that does not turn.
    force = digits @ [1.0, 10.0, 100.0, 1000.0]
    np.testing.assert_allclose(
        result.velocity[-1, :, 0], force * 0.5 / 24.0, rtol=2e-6 if dtype == "float32" else 1e-13
    )


@functools.cache
def profile_params(width, real):
    return struct("Profile", first=wp.int32, last=lane(width, real), inverse=lane(width, real))


@wp.func
def profile_distance(view: Any, p: Any):
    zero = p.last - p.last
    u = view.b.x * p.inverse
    u = positive(u, positive(u - p.last, p.last, u), zero)
    i = below(u)
    here = gather1(view, p.first, whole(i))
    there = gather1(view, p.first, whole(i) + whole(ones(u)))
    return here + (u - i) * (there - here) - view.b.z


class ProfileDevice:
    params, distance = profile_params, profile_distance


@dataclass(frozen=True, eq=False, kw_only=True)
class Profile(lw.laws.Event):
    """A sea floor whose depth changes to the north."""

    type: ClassVar[str] = "profile"
    device: ClassVar[Any] = ProfileDevice
    depth: Any = lw.laws.number(("k",), "m")
    spacing: Any = lw.laws.number((), "m", above=0.0)

    def packed(self, numbers, context):
        last = np.full(1, numbers["depth"].shape[1] - 1.0)
        return lw.laws.Packed({"last": last, "inverse": 1.0 / numbers["spacing"]}, numbers["depth"])


@pytest.mark.slow
@pytest.mark.parametrize("knots", [7, 4000])
def test_an_event_with_rows_stops_at_the_table(knots):
    rng = np.random.default_rng(7)
    north = 5.0 * np.arange(knots)
    depth = 60.0 + rng.uniform(-4.0, 4.0, knots)
    profile = Profile(depth=depth, spacing=5.0)
    assert lw.laws.check_law(profile).ok
    n = 20
    b = np.stack([rng.uniform(-10.0, 25.0, n), np.zeros(n), rng.uniform(40.0, 50.0, n)], axis=1)
    nu = np.stack([rng.uniform(-1.0, 1.0, n), np.zeros(n), rng.uniform(0.5, 1.5, n)], axis=1)
    # Another term with rows before it, and another event beside it.
    scene = lw.Scene(BODY, terms=[foreign(False)], events=[lw.events.Surface(), profile])
    result = lw.solve(one(scene, b=b, nu=nu), "psi_s", h=0.05, t1=60.0)
    assert result.status.counts() == {"condition": n}
    # Straight lines: the first crossing lies on a fine grid of times, then by halving.
    for i in range(n):

        def left(t, i=i):
            return np.interp(b[i, 0] + nu[i, 0] * t, north, depth) - (b[i, 2] + nu[i, 2] * t)

        times = np.linspace(0.0, 60.0, 60_001)
        k = int(np.argmax(left(times) <= 0.0))
        low, high = times[k - 1], times[k]
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if left(middle) > 0.0 else (low, middle)
        assert abs(result.failure_time[i] - high) < 1e-10


@wp.func
def nose_distance(view: Any, p: Any):
    return p.depth - view.b.z - dot(view.down, p.nose)


class NoseDevice:
    distance = nose_distance


@dataclass(frozen=True, eq=False, kw_only=True)
class Nose(lw.laws.Event):
    """The floor, where a point of the body touches it."""

    type: ClassVar[str] = "nose"
    device: ClassVar[Any] = NoseDevice
    depth: Any = lw.laws.number((), "m")
    nose: Any = lw.laws.number((3,), "m", axes="point")


@dataclass(frozen=True, eq=False, kw_only=True)
class NoseAsItStands(Nose):
    """The same, which forgets that the kernel's axes may be others."""

    type: ClassVar[str] = "nose_as_it_stands"

    def packed(self, numbers, context):
        return lw.laws.Packed({"depth": numbers["depth"], "nose": numbers["nose"]})


@pytest.mark.slow
def test_a_point_of_the_body_is_that_of_an_event_in_all_axes():
    point = dict(depth=60.0, nose=[0.8, 0.1, -0.05])
    assert lw.laws.check_law(Nose(**point)).ok
    wrong = lw.laws.check_law(NoseAsItStands(**point))
    assert [check.name for check in wrong.checks if not check.ok] == ["distance: any axes"]
    # A coupled body, whose forces act about another origin than the user's, at rest but for its sinking.
    C = np.array([[0.0, 4.0, 0.0], [-4.0, 0.0, 6.0], [0.0, -6.0, 0.0]])
    matrix = np.block([[20.0 * np.eye(3), C], [C.T, np.diag([6.0, 9.0, 8.0])]])
    body = lw.Vehicle(rigid_body_mass_matrix=matrix, weight=196.0, buoyancy=196.0)
    scene = lw.Scene(body, events=[Nose(**point)])
    result = lw.solve(one(scene, b=(0.0, 0.0, 58.0), nu=(0.0, 0.0, 1.0), Om=(0.2, 0.1, 0.0)), "psi_x", h=0.01, t1=5.0)
    touch = result.position[-1, 0, 2] + result.attitude[-1, 0, 2] @ point["nose"]
    assert result.status.counts() == {"condition": 1}
    assert abs(touch - 60.0) < 1e-9
