# SPDX-License-Identifier: Apache-2.0
"""Laws of a user's own that look at the water: friction on the floor in a current, and what a wrong one is told."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
import warp as wp

import lgvi_warp as lw
from lgvi_kernels.law import add, add_drag_at, cross, lane3, mul, row1, struct, sub, to_body  # noqa: F401
from tests.support.linear_flow import LinearFlow
from tests.support.tools import GRAVITY, last, one


def seeing(water_at):
    @wp.func
    def friction(D: Any, w: Any, view: Any, p: Any, sea: Any):
        """-k times the velocity over the ground: that through the water, which D takes, plus the water's."""
        k = row1(view, p.first)
        push = k * to_body(view, water_at(view, p.origin, sea).velocity)
        w.force = w.force - push
        w.torque = w.torque - cross(p.origin, push)
        return add_drag_at(D, k, p.origin), w

    return {"load": friction}


class FrictionDevice:
    seeing = staticmethod(seeing)

    @staticmethod
    def params(width, real):
        return struct("Friction", origin=lane3(width, real), first=wp.int32)


@dataclass(frozen=True, eq=False, kw_only=True)
class GroundFriction(lw.laws.Term):
    """Friction on the ground."""

    type: ClassVar[str] = "ground_friction"
    device: ClassVar[Any] = FrictionDevice
    coefficient: Any = lw.laws.number((), "N s/m")

    def packed(self, numbers, context):
        return lw.laws.Packed({"origin": context.frame.point(np.zeros((1, 3)))}, numbers["coefficient"][:, None])


def scene(k, *water):
    body = lw.Vehicle(10.0, inertia=(1.0, 1.0, 1.0), added_mass=(10.0,) * 3, buoyancy=10.0 * GRAVITY)
    return lw.Scene(body, lw.Environment(GRAVITY), terms=[GroundFriction(coefficient=k), *water])


@pytest.mark.ci
@pytest.mark.parametrize(("method", "h", "allowed"), [("rk8", 0.05, 1e-12), ("psi_s", 0.01, 2e-5), ("psi", 0.01, 2e-5)])
@pytest.mark.parametrize(
    "water",
    [lw.terms.Current(velocity=[0.4, -0.3, 0.0]), LinearFlow(velocity=(0.4, -0.3, 0.0))],
    ids=("everywhere", "as if it varied"),
)
def test_friction_stops_a_vehicle_over_the_ground(water, method, h, allowed):
    # (m + A) dv/dt = -k v, whatever the current: it pushes by nothing.
    b, R, nu, _ = last(lw.solve(one(scene(30.0, water), nu=(1.0, 0.5, 0.0)), method, h=h, t1=1.0))
    np.testing.assert_allclose(R @ nu, np.array([1.0, 0.5, 0.0]) * np.exp(-30.0 / 20.0), atol=allowed)
    np.testing.assert_allclose(b, np.array([1.0, 0.5, 0.0]) * (1.0 - np.exp(-1.5)) * 20.0 / 30.0, atol=allowed)


@pytest.mark.ci
def test_friction_however_strong_is_stable():
    b, _, nu, _ = last(
        lw.solve(
            one(scene(1e6, lw.terms.Current(velocity=[0.4, 0.0, 0.0])), nu=(1.0, 0.0, 0.0)), "psi_s", h=0.1, t1=2.0
        )
    )
    assert np.abs(nu).max() < 1e-9
    assert np.abs(b).max() < 0.2


@pytest.mark.ci
def test_it_is_checked_like_any_law():
    report = lw.laws.check_law(GroundFriction(coefficient=30.0))
    assert report.ok, report
    assert any("load" in check.name for check in report.checks)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda water_at: {"push": None}, "is not a dict with load"),
        (lambda water_at: {"load": len}, "is not a Warp function. Decorate it with @wp.func"),
        (lambda water_at: {"load": LinearFlow.device.flow}, "takes 3 arguments. Write load(D, w, view, p, sea)"),
    ],
)
def test_what_is_wrong_is_said(make, words):
    class Device:
        seeing = staticmethod(make)

    @dataclass(frozen=True, eq=False, kw_only=True)
    class Wrong(lw.laws.Term):
        type: ClassVar[str] = ""
        device: ClassVar[Any] = Device
        k: Any = lw.laws.number((), "1", 1.0)

    with pytest.raises(lw.SceneError, match=words.replace("(", r"\(").replace(")", r"\)")):
        lw.laws.check_law(Wrong(name="wrong"))
