# SPDX-License-Identifier: Apache-2.0
"""Water whose velocity is linear in space and time, as a law of the user's own."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

import lgvi_warp as lw
from lgvi_kernels.law import add, mul, ones  # noqa: F401


@wp.func
def linear_flow(f: Any, view: Any, p: Any):
    """u = v + a t + (1 + s t) G b, the columns of G being `north`, `east` and `down`."""
    still = view.b.x * p.north + view.b.y * p.east + view.b.z * p.down
    growth = ones(p.growth) + view.t * p.growth
    f.velocity = f.velocity + p.velocity + view.t * p.acceleration + growth * still
    f.rate = f.rate + p.acceleration + p.growth * still
    f.by_north = f.by_north + growth * p.north
    f.by_east = f.by_east + growth * p.east
    f.by_depth = f.by_depth + growth * p.down
    return f


class Device:
    FLOW = "varying"
    flow = linear_flow


@dataclass(frozen=True, eq=False, kw_only=True)
class LinearFlow(lw.laws.Term):
    """velocity [m/s] at t = 0 at the origin; acceleration [m/s2]; the columns of G [1/s]; growth of G [1/s]: inertial axes."""

    type: ClassVar[str] = "linear_flow"
    device: ClassVar[Any] = Device
    timed: ClassVar[bool] = True

    velocity: Any = lw.laws.number((3,), "m/s", (0.0, 0.0, 0.0))
    acceleration: Any = lw.laws.number((3,), "m/s2", (0.0, 0.0, 0.0))
    north: Any = lw.laws.number((3,), "1/s", (0.0, 0.0, 0.0))
    east: Any = lw.laws.number((3,), "1/s", (0.0, 0.0, 0.0))
    down: Any = lw.laws.number((3,), "1/s", (0.0, 0.0, 0.0))
    growth: Any = lw.laws.number((), "1/s", 0.0)

    def water(self, numbers, position, time, parameters):
        t = time[:, None, None]
        G = np.stack([numbers["north"], numbers["east"], numbers["down"]], axis=-1)
        still = np.einsum("nij,...nj->...ni", np.broadcast_to(G, (*position.shape[-2:], 3)), position)
        return numbers["velocity"] + t * numbers["acceleration"] + (1.0 + t * numbers["growth"][:, None]) * still


def columns(G):
    """The numbers of a gradient G (..., 3, 3), G_ij = du_i/db_j."""
    return {name: G[..., i] for i, name in enumerate(("north", "east", "down"))}
