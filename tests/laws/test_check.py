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
from lgvi_warp.physics import terms
from tests.laws.cases import CASES
from tests.support.refusals import says

BUILT_IN = [(f"{name} {i}", term) for name, case in CASES.items() for i, term in enumerate(case.terms)]
COUPLING = np.array([[0.0, 1.0, -0.5], [-1.0, 0.0, 0.2], [0.5, -0.2, 0.0]])
RIGID = np.block([[10.0 * np.eye(3), COUPLING], [COUPLING.T, np.diag([2.0, 3.0, 4.0])]])
FULL = lw.Vehicle(rigid_body_mass_matrix=RIGID, weight=98.0, buoyancy=97.0)


def names_of_failed(report):
    return [one.name for one in report.checks if not one.ok]


EACH = pytest.mark.parametrize("term", [term for _, term in BUILT_IN], ids=[name for name, _ in BUILT_IN])


@pytest.mark.ci
@EACH
def test_a_built_in_law_is_right(term):
    report = lw.laws.check_law(term)
    assert report.ok, str(report)
    assert len(report.checks) >= 4


@EACH
def test_a_scene_file_holds_it(term):
    (again,) = terms.from_list([term.to_dict()])
    assert type(again) is type(term)
    assert again.to_dict() == term.to_dict()
    for key, value in term.parameters().items():
        np.testing.assert_array_equal(getattr(again, key), value, err_msg=key)


@pytest.mark.ci
@pytest.mark.parametrize(
    "term",
    [lw.terms.Weight(), lw.terms.Restoring(), lw.events.Surface(), lw.events.StopTime(at=3.0)],
    ids=lambda t: t.type,
)
def test_what_follows_from_the_vehicle_and_events_are_right(term):
    assert lw.laws.check_law(term).ok
    # Another vehicle and environment, and no new kernel.
    other = lw.Scene(FULL, lw.Environment(gravity=3.7), start=lw.Start(position=[0.0, 0.0, 50.0]))
    assert lw.laws.check_law(term, scene=other, samples=5, seed=7).ok


@pytest.mark.ci
def test_a_law_may_remember_a_single_number():
    wing = dict(
        position=[[-0.5, 0.0, 0.0]], chord=[[1.0, 0.0, 0.0]], normal=[[0.0, 0.0, -1.0]], area=0.01, lift_slope=3.0
    )
    turning = dict(times=[0.0, 1.0], command_schedule=[[0.1], [-0.2]])
    fin = lw.terms.ControlFins(**wing, **turning, rate_limit=0.5, drag=0.0)
    assert fin.memory
    assert lw.laws.check_law(fin).ok


@pytest.mark.ci
@pytest.mark.parametrize("step", [1e-4, 1e-6])
def test_the_tolerance_follows_the_step(step):
    assert lw.laws.check_law(CASES["tether"].terms[0], step=step, samples=256).ok


@pytest.mark.ci
def test_a_report_is_a_table():
    report = lw.laws.check_law(CASES["tether"].terms[0])
    lines = str(report).splitlines()
    assert lines[0] == "Tether (tether): ok"
    assert len(lines) == len(report.checks) + 2
    assert "law: torque = -dU/dR" in str(report)


@pytest.mark.ci
def test_a_law_that_sleeps_is_noted():
    asleep = lw.laws.check_law(CASES["slack tether"].terms[0])
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
class Reversed(lw.terms.Restoring):
    type: ClassVar[str] = "reversed"
    device: ClassVar[Any] = ReversedDevice


class Unturned(lw.terms.Tether):
    """Forgets that the kernel's axes and origin are not the user's."""

    def packed(self, numbers, context):
        return lw.laws.Packed({key: numbers[key] for key in ("anchor", "attachment", "stiffness", "rest_length")})


class NoPotential(lw.terms.Tether):
    """Says it has a potential, and has none."""

    def potential(self, numbers, position, attitude, parameters):
        return 0.0


class Creating(lw.terms.DragMatrix):
    """Takes any matrix."""

    def check(self, faults):
        pass


class Lifting(Creating):
    """The same, and says so."""

    dissipative = False


@pytest.mark.ci
def test_damping_that_creates_energy():
    # Positive on the diagonal, and yet less than nothing along (1, -1, 0, 0, 0, 0).
    linear = np.eye(6)
    linear[0, 1] = linear[1, 0] = 1.001
    report = lw.laws.check_law(Creating(linear=linear))
    assert names_of_failed(report) == ["damping: power >= 0"]
    worst = next(one for one in report.checks if not one.ok)
    np.testing.assert_allclose(worst.worst, 0.001, rtol=1e-9)
    says(worst.text, "dissipative = False", "velocity")
    noted = lw.laws.check_law(Lifting(linear=linear))
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
class Stirred(lw.laws.Term):
    type: ClassVar[str] = "stirred"
    device: ClassVar[Any] = StirredDevice

    strength: Any = lw.laws.number((), "1/s")

    def packed(self, numbers, context):
        return lw.laws.Packed(dict(numbers))


def with_device(device, strength=0.3):
    """The same term with other device code."""
    return type("Bad", (Stirred,), {"device": device, "__annotations__": {}})(strength=strength)


def with_role(role, function, strength=0.3):
    return with_device(type("Device", (), {"params": staticmethod(stirred_params), role: function}), strength)


@pytest.mark.ci
def test_a_flow_whose_gradient_is_wrong():
    report = lw.laws.check_law(Stirred(strength=0.3))
    wrong = {"rate = du/dt", "by_depth = du/db3", "FLOW", "water()", "blind to time"}
    assert set(names_of_failed(report)) == {f"flow: {name}" for name in wrong}
    says(str(report), "Write FLOW = 'varying'", "timed = True")


@wp.func
def hasty_law(w: Any, view: Any, p: Any):
    w.force = w.force + to_body(view, p.strength * view.nu)
    return w


@wp.func
def dividing_law(w: Any, view: Any, p: Any):
    zero = p.strength - p.strength
    w.force = w.force + vec3(p.strength / zero, zero, zero)
    return w


@wp.func
def mixing_law(w: Any, view: Any, p: Any):
    w.force = w.force + view.b.x[0] * view.down
    return w


@wp.func
def step_law(w: Any, view: Any, p: Any):
    """A torque that grows with the step."""
    w.torque = w.torque + (view.h * p.strength) * view.down
    return w


@wp.func
def counting_law(w: Any, view: Any, p: Any):
    """A torque that grows from step to step."""
    w.torque = w.torque + (view.h.dtype(view.step) * p.strength) * view.down
    return w


@wp.func
def placed_law(w: Any, view: Any, p: Any):
    """A torque that depends on which members stand beside a member's own packet."""
    w.torque = w.torque + (view.h.dtype(view.packet) * p.strength) * view.down
    return w


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


@pytest.mark.ci
def test_damping_along_one_axis_is_right():
    report = lw.laws.check_law(with_role("damping", resisting_damping))
    assert "finite at rest, along axes" not in names_of_failed(report)


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
        return lw.laws.Packed({"strength": numbers["strength"]}, memory=np.zeros((1, 1)))


class Forgetful(Stirred):
    device = type("Hasty", (), {"params": staticmethod(stirred_params), "law": hasty_law})

    def packed(self, numbers, context):
        return lw.laws.Packed({"strange": numbers["strength"]})


class Shared(lw.terms.Wrench):
    def packed(self, numbers, context):
        return lw.laws.Packed({key: numbers[key].reshape(1, 3) for key in ("force", "torque")})


@wp.func
def energy_of_nothing(u: Any, view: Any, p: Any):
    return u + p.stiffness


class WrongEnergy(lw.terms.Tether):
    """A tether whose energy is not its potential."""

    device: ClassVar[Any] = type("Spring", (), {"law": tether.law, "energy": energy_of_nothing, "POTENTIAL": True})


AT_REST, STILL = "finite at rest, along axes", "velocity [0, 0, 0] m/s"
POINT = dict(anchor=(1.0, 2.0, 3.0), stiffness=5.0)
# What is wrong: the law, the checks that fail, all of them unless there is "...", and words of the report.
WRONG = {
    "a torque of the wrong sign": (Reversed(), ["law: torque = -dU/dR"], "at position", "potential()"),
    "a point that is not moved": (Unturned(**POINT, attachment=(0.5, 0.0, 0.0)), ["law: any axes"], "context.frame"),
    "no potential": (NoPotential(**POINT), ["law: force = -R^T dU/db", ...], "gives 0 everywhere"),
    "another energy": (WrongEnergy(**CASES["tether"].terms[0].parameters()), ["energy: as potential()"]),
    "looks at the velocity": (with_role("law", hasty_law), ["law: blind to velocity", ...]),
    "divides by zero": (with_role("law", dividing_law), ["finite", ...]),
    "looks at another lane": (with_role("law", mixing_law), ["law: lanes apart", "law: any axes", ...]),
    "looks at the step": (with_role("law", step_law), ["law: blind to the step"], "view.h, the length of the step"),
    "counts steps": (with_role("law", counting_law), ["law: blind to the step's number"], "timed = True in Bad"),
    "looks at its packet": (with_role("law", placed_law), ["law: lanes apart"], "must not look at others"),
    "no number at rest": (with_role("damping", constant_damping), [AT_REST, ...], STILL),
    "no number along an axis": (with_role("damping", slender_damping), [AT_REST, ...], STILL),
    "no number at the origin": (with_role("law", heading_law), [AT_REST, ...], "at position [0.0, 0.0, 0.0] m"),
    "infinite power": (
        with_role("damping", resisting_damping, 1e308), ["damping: power", ...], "power is not finite at velocity"),
    "a memory that depends on the state": (
        Drifting(strength=0.3), ["follow: blind to the state", "follow: exact"],
        "Leave follow() out", "by the exact solution over view.h"),
    "numbers that do not fit": (
        Forgetful(strength=0.3), ["numbers"],
        "strength is not in packed().values", "strange is not a field of params()"),
    "numbers that cannot vary": (
        Shared(force=(1.0, 2.0, 3.0)), ["law: varied numbers", ...], "one entry a member"),
}  # fmt: skip


@pytest.mark.ci
@pytest.mark.parametrize(("term", "failed", "words"), [(row[0], row[1], row[2:]) for row in WRONG.values()], ids=WRONG)
def test_what_is_wrong_is_said(term, failed, words):
    report = lw.laws.check_law(term)
    named = [name for name in failed if name is not ...]
    assert set(named) <= set(names_of_failed(report)) if ... in failed else named == names_of_failed(report)
    assert all(text in str(report) for text in words), str(report)


@wp.func
def short_law(w: Any, view: Any):
    return w


@wp.func
def unknown_law(w: Any, view: Any, p: Any):
    w.force = w.force + p.strength * view.upwards
    return w


def plain_law(w, view, p):
    return w


UNBUILT = {
    "signature": (with_role("law", short_law), "Write law(w, view, p)"),
    "not a Warp function": (with_role("law", plain_law), "Decorate it with @wp.func"),
    "no role": (with_role("other", None), "has none of law, damping"),
    "no such field": (with_role("law", unknown_law), "does not compile"),
    "no key": (with_device(SimpleNamespace(params=stirred_params, law=hasty_law)), "Give a module, or a class"),
    "no such name": (with_device("hasty"), "name of a built-in one"),
}


@pytest.mark.parametrize(("term", "words"), UNBUILT.values(), ids=UNBUILT)
def test_a_law_that_cannot_be_built(term, words, capfd):
    with pytest.raises(lw.SceneError) as error:
        lw.laws.check_law(term)
    assert words in str(error.value)
    assert "stirred." in str(error.value)


def test_what_is_no_term():
    with pytest.raises(lw.SceneError, match="not its class"):
        lw.laws.check_law(lw.terms.Tether)


@pytest.mark.ci
def test_a_second_check_builds_no_kernel():
    from lgvi_kernels.advance.examine import make_examine

    lw.laws.check_law(CASES["tether"].terms[0])
    before = make_examine.cache_info().misses
    lw.laws.check_law(lw.terms.Tether(anchor=(0.0, 0.0, 1.0), stiffness=1.0), seed=3, samples=16)
    assert make_examine.cache_info().misses == before
