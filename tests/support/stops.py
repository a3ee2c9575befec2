# SPDX-License-Identifier: Apache-2.0
"""Every kind of event at once, one of the user's own among them: tests whose scenes have all share a kernel."""

import functools
from dataclasses import dataclass
from typing import Any, ClassVar

import warp as wp

import lgvi_warp as lw
from lgvi_kernels.lanes.arithmetic import lane, sub  # noqa: F401
from lgvi_kernels.lanes.state import struct
from lgvi_warp.physics.terms import events


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


@dataclass(frozen=True, eq=False, kw_only=True)
class FarAway(events.Event):
    type: ClassVar[str] = "far"
    device: ClassVar[Any] = FarFromHome
    radius: Any = lw.laws.number((), "m")


def stops(floor=1e6, surface=-1e6, lower=(-1e6,) * 3, upper=(1e6,) * 3, at=1e6, radius=1e6):
    """Every kind of event, those not asked for far away."""
    return [lw.events.Surface(depth=surface), lw.events.Floor(depth=floor), lw.events.Box(lower=lower, upper=upper),
            lw.events.StopTime(at=at),
            FarAway(radius=radius)]  # fmt: skip
