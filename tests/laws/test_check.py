# SPDX-License-Identifier: Apache-2.0
"""check_law passes what is right, and says of each wrong law what is wrong and what to do."""

import functools
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest
import warp as wp

import lgvi_warp as lw
from lgvi_kernels.lanes.arithmetic import add, cross, div, dot, lane, mul, ones, sub, vec3  # noqa: F401
from lgvi_kernels.lanes.state import struct
from lgvi_kernels.lanes.view import remember, remembered, to_body
from lgvi_kernels.laws import restoring, tether
from tests.laws.cases import CASES

BUILT_IN = [(f"{name} {i}", term) for name, case in CASES.items() for i, term in enumerate(case.terms)]
FULL = lw.Vehicle(
    rigid_body_mass_matrix=np.block(
        [
            [10.0 * np.eye(3), np.array([[0.0, 1.0, -0.5], [-1.0, 0.0, 0.2], [0.5, -0.2, 0.0]])],
            [np.array([[0.0, -1.0, 0.5], [1.0, 0.0, -0.2], [-0.5, 0.2, 0.0]]), np.diag([2.0, 3.0, 4.0])],
        ]
    ),
    weight=98.0,
    buoyancy=97.0,
)


def names_of_failed(report):
    return [one.name for one in report.checks if not one.ok]


@pytest.mark.parametrize("term", [term for _, term in BUILT_IN], ids=[name for name, _ in BUILT_IN])
def test_a_built_in_law_is_right(term):
    report = lw.check_law(term)
    assert report.ok, str(report)
    assert len(report.checks) >= 4


@pytest.mark.parametrize("term", [lw.Weight(), lw.Restoring(), lw.Surface(), lw.StopTime(at=3.0)], ids=lambda t: t.type)
def test_what_follows_from_the_vehicle_and_events_are_right(term):
    assert lw.check_law(term).ok
    # Another vehicle and environment, and no new kernel.
    other = lw.Scene(FULL, lw.Environment(gravity=3.7), start=lw.Start(position=[0.0, 0.0, 50.0]))
    assert lw.check_law(term, scene=other, samples=5, seed=7).ok


def test_a_law_may_remember_a_single_number():
    wing = dict(
        position=[[-0.5, 0.0, 0.0]], chord=[[1.0, 0.0, 0.0]], normal=[[0.0, 0.0, -1.0]], area=0.01, lift_slope=3.0
    )
    fin = lw.ControlFins(**wing, command=[0.1], rate_limit=0.5, drag=0.0)
    assert fin.memory
    assert lw.check_law(fin).ok


@pytest.mark.parametrize("step", [1e-4, 1e-6])
def test_the_tolerance_follows_the_step(step):
    assert lw.check_law(CASES["tether"].terms[0], step=step, samples=256).ok


def test_a_report_is_a_table():
    report = lw.check_law(CASES["tether"].terms[0])
    lines = str(report).splitlines()
    assert lines[0] == "Tether (tether): ok"
    assert len(lines) == len(report.checks) + 2
    assert "law: torque = -dU/dR" in str(report)


def test_a_law_that_sleeps_is_noted():
    asleep = lw.check_law(CASES["slack tether"].terms[0])
    assert asleep.ok
    assert "zero at every view" in str(asleep)


@wp.func
def torque_reversed(w: Any, view: Any, p: Any):
    w.torque = w.torque + cross(p.moment, view.down)
    return w


class ReversedDevice:
    POTENTIAL = True
    params = restoring.params
    law = torque_reversed


@dataclass(frozen=True, eq=False, kw_only=True)
class Reversed(lw.Restoring):
    type: ClassVar[str] = "reversed"
    device: ClassVar[Any] = ReversedDevice


def test_a_torque_of_the_wrong_sign():
    report = lw.check_law(Reversed())
    assert names_of_failed(report) == ["law: torque = -dU/dR"]
    assert "at position" in str(report)
    assert "potential()" in str(report)


class Unturned(lw.Tether):
    """Forgets that the kernel's axes and origin are not the user's."""

    def packed(self, numbers, context):
        return lw.Packed({key: numbers[key] for key in ("anchor", "attachment", "stiffness", "rest_length")})


def test_a_point_that_is_not_moved():
    report = lw.check_law(Unturned(anchor=(1.0, 2.0, 3.0), stiffness=5.0, attachment=(0.5, 0.0, 0.0)))
    assert names_of_failed(report) == ["law: any axes"]
    assert "context.frame" in str(report)


class NoPotential(lw.Tether):
    """Says it has a potential, and has none."""

    def potential(self, numbers, position, attitude, parameters):
        return 0.0


def test_a_missing_potential():
    report = lw.check_law(NoPotential(anchor=(1.0, 2.0, 3.0), stiffness=5.0))
    assert "law: force = -R^T dU/db" in names_of_failed(report)
    assert "gives 0 everywhere" in str(report)


class Creating(lw.DragMatrix):
    """Takes any matrix."""

    def check(self, faults):
        pass


class Lifting(Creating):
    """The same, and says so."""

    dissipative = False


def test_damping_that_creates_energy():
    # Positive on the diagonal, and yet less than nothing along (1, -1, 0, 0, 0, 0).
    linear = np.eye(6)
    linear[0, 1] = linear[1, 0] = 1.001
    report = lw.check_law(Creating(linear=linear))
    assert names_of_failed(report) == ["damping: power >= 0"]
    worst = next(one for one in report.checks if not one.ok)
    np.testing.assert_allclose(worst.worst, 0.001, rtol=1e-9)
    assert "dissipative = False" in worst.text
    assert "velocity" in worst.text
    noted = lw.check_law(Lifting(linear=linear))
    assert noted.ok
    assert "note: least power -0.001 W" in str(noted)


@functools.cache
def stirred_params(width, real):
    return struct("Stirred", strength=lane(width, real))


@wp.func
def stirred_flow(f: Any, view: Any, p: Any):
    """u = s (b2, b3 t, 0), with du2/db3 forgotten and du/dt of the wrong size."""
    zero = p.strength - p.strength
    f.velocity = f.velocity + p.strength * vec3(view.b.y, view.t * view.b.z, zero)
    f.rate = f.rate + p.strength * vec3(zero, view.h.dtype(2.0) * view.b.z, zero)
    f.by_east = f.by_east + p.strength * vec3(ones(zero), zero, zero)
    return f


class StirredDevice:
    FLOW = "uniform"
    params = staticmethod(stirred_params)
    flow = stirred_flow


@dataclass(frozen=True, eq=False, kw_only=True)
class Stirred(lw.Term):
    type: ClassVar[str] = "stirred"
    device: ClassVar[Any] = StirredDevice

    strength: Any = lw.number((), "1/s")

    def packed(self, numbers, context):
        return lw.Packed(dict(numbers))


def test_a_flow_whose_gradient_is_wrong():
    report = lw.check_law(Stirred(strength=0.3))
    wrong = {"rate = du/dt", "by_depth = du/db3", "FLOW", "water()", "blind to time"}
    assert set(names_of_failed(report)) == {f"flow: {name}" for name in wrong}
    assert "write FLOW = 'varying'" in str(report)
    assert "timed = True" in str(report)


@wp.func
def hasty_law(w: Any, view: Any, p: Any):
    w.force = w.force + to_body(view, p.strength * view.nu)
    return w


class HastyDevice:
    params = staticmethod(stirred_params)
    law = hasty_law


@wp.func
def dividing_law(w: Any, view: Any, p: Any):
    zero = p.strength - p.strength
    w.force = w.force + vec3(p.strength / zero, zero, zero)
    return w


class DividingDevice:
    params = staticmethod(stirred_params)
    law = dividing_law


@wp.func
def mixing_law(w: Any, view: Any, p: Any):
    w.force = w.force + view.b.x[0] * view.down
    return w


class MixingDevice:
    params = staticmethod(stirred_params)
    law = mixing_law


@pytest.mark.parametrize(
    ("device", "expected"),
    [
        (HastyDevice, {"law: blind to velocity"}),
        (DividingDevice, {"finite"}),
        (MixingDevice, {"law: lanes apart", "law: any axes"}),
    ],
    ids=["looks at the velocity", "divides by zero", "looks at another lane"],
)
def test_what_a_law_must_not_do(device, expected):
    term = type("Bad", (Stirred,), {"device": device, "__annotations__": {}})(strength=0.3)
    assert expected <= set(names_of_failed(lw.check_law(term)))


@wp.func
def resisting_damping(D: Any, view: Any, p: Any):
    """Along x alone, of one number."""
    zero = p.strength - p.strength
    D.force_velocity.row0 = D.force_velocity.row0 + vec3(p.strength, zero, zero)
    return D


@wp.func
def constant_damping(D: Any, view: Any, p: Any):
    """A force of one size against the velocity: divides by the speed squared."""
    zero = p.strength - p.strength
    D.force_velocity.row0 = D.force_velocity.row0 + vec3(div(p.strength, dot(view.nu, view.nu)), zero, zero)
    return D


@wp.func
def slender_damping(D: Any, view: Any, p: Any):
    """Divides by the square of one velocity."""
    zero = p.strength - p.strength
    D.force_velocity.row0 = D.force_velocity.row0 + vec3(div(p.strength, view.nu.y * view.nu.y), zero, zero)
    return D


@wp.func
def heading_law(w: Any, view: Any, p: Any):
    """Away from the origin: divides by the distance squared."""
    w.force = w.force + to_body(view, div(p.strength, dot(view.b, view.b)) * view.b)
    return w


def device_of(role, function):
    return type("Device", (), {"params": staticmethod(stirred_params), role: function})


@pytest.mark.parametrize(
    ("device", "strength", "failed", "words"),
    [
        (device_of("damping", constant_damping), 0.3, "finite at rest, along axes", "velocity [0, 0, 0] m/s"),
        (device_of("damping", slender_damping), 0.3, "finite at rest, along axes", "velocity [0, 0, 0] m/s"),
        (device_of("law", heading_law), 0.3, "finite at rest, along axes", "at position [0.0, 0.0, 0.0] m"),
        (device_of("damping", resisting_damping), 1e308, "damping: power", "power is not finite at velocity"),
    ],
    ids=["no number at rest", "no number along an axis", "no number at the origin", "infinite power"],
)
def test_a_law_that_is_no_number_where_vehicles_are(device, strength, failed, words):
    kind = type("Bad", (Stirred,), {"device": device, "__annotations__": {}})
    report = lw.check_law(kind(strength=strength))
    assert failed in names_of_failed(report)
    assert words in str(report)


def test_damping_along_one_axis_is_right():
    kind = type("Good", (Stirred,), {"device": device_of("damping", resisting_damping), "__annotations__": {}})
    assert "finite at rest, along axes" not in names_of_failed(lw.check_law(kind(strength=0.3)))


@wp.func
def drifting_law(w: Any, view: Any, p: Any):
    w.force = w.force + remembered(view, p.memory) * view.down
    return w


@wp.func
def held_evolve(state: Any, view: Any, p: Any):
    return state


@wp.func
def drifting_follow(state: Any, view: Any, p: Any):
    """By Euler's method, and pushed by the vehicle's depth."""
    n = remembered(view, p.memory)
    remember(view, p.memory, n + view.h * (p.strength - n + view.b.z))
    return state


@functools.cache
def drifting_params(width, real):
    return struct("Drifting", strength=lane(width, real), memory=wp.int32)


class DriftingDevice:
    params = staticmethod(drifting_params)
    law = drifting_law
    evolve = held_evolve
    follow = drifting_follow


class Drifting(Stirred):
    device = DriftingDevice
    memory = True

    def packed(self, numbers, context):
        return lw.Packed({"strength": numbers["strength"]}, memory=np.zeros((1, 1)))


def test_a_memory_that_depends_on_the_state():
    report = lw.check_law(Drifting(strength=0.3))
    assert names_of_failed(report) == ["follow: blind to the state", "follow: exact"]
    assert "leave follow() out" in str(report)
    assert "by the exact solution over view.h" in str(report)


def test_numbers_that_do_not_fit():
    class Forgetful(Stirred):
        device = HastyDevice

        def packed(self, numbers, context):
            return lw.Packed({"strange": numbers["strength"]})

    report = lw.check_law(Forgetful(strength=0.3))
    assert names_of_failed(report) == ["numbers"]
    assert "strength is not in packed().values" in str(report)
    assert "strange is no field of params()" in str(report)


def test_numbers_that_cannot_vary():
    class Shared(lw.Wrench):
        def packed(self, numbers, context):
            return lw.Packed({key: numbers[key].reshape(1, 3) for key in ("force", "torque")})

    report = lw.check_law(Shared(force=(1.0, 2.0, 3.0)))
    assert "law: varied numbers" in names_of_failed(report)
    assert "one entry a member" in str(report)


@wp.func
def short_law(w: Any, view: Any):
    return w


@wp.func
def unknown_law(w: Any, view: Any, p: Any):
    w.force = w.force + p.strength * view.upwards
    return w


def plain_law(w, view, p):
    return w


@pytest.mark.parametrize(
    ("device", "words"),
    [
        (type("Short", (), {"params": staticmethod(stirred_params), "law": short_law}), "write law(w, view, p)"),
        (type("Plain", (), {"params": staticmethod(stirred_params), "law": plain_law}), "decorate it with @wp.func"),
        (type("Roleless", (), {"params": staticmethod(stirred_params)}), "has none of law, damping"),
        (type("Unknown", (), {"params": staticmethod(stirred_params), "law": unknown_law}), "does not compile"),
        (SimpleNamespace(params=stirred_params, law=hasty_law), "give a module, or a class"),
        ("hasty", "name of a built-in one"),
    ],
    ids=["signature", "no Warp function", "no role", "no such field", "no key", "no such name"],
)
def test_a_law_that_cannot_be_built(device, words, capfd):
    term = type("Bad", (Stirred,), {"device": device, "__annotations__": {}})(strength=0.3)
    with pytest.raises(lw.SceneError) as error:
        lw.check_law(term)
    assert words in str(error.value)
    assert "stirred." in str(error.value)


def test_what_is_no_term():
    with pytest.raises(lw.SceneError, match="not its class"):
        lw.check_law(lw.Tether)


def test_a_second_check_builds_no_kernel():
    from lgvi_kernels.advance.examine import make_examine

    lw.check_law(CASES["tether"].terms[0])
    before = make_examine.cache_info().misses
    lw.check_law(lw.Tether(anchor=(0.0, 0.0, 1.0), stiffness=1.0), seed=3, samples=16)
    assert make_examine.cache_info().misses == before


@wp.func
def energy_of_nothing(u: Any, view: Any, p: Any):
    return u + p.stiffness


class Spring:
    """A tether whose energy is not its potential."""

    law, energy, POTENTIAL = tether.law, energy_of_nothing, True


def test_an_energy_that_is_not_the_potential_is_found():
    class Wrong(lw.Tether):
        device: ClassVar[Any] = Spring

    report = lw.check_law(Wrong(**CASES["tether"].terms[0].parameters()))
    assert names_of_failed(report) == ["energy: as potential()"]
