# SPDX-License-Identifier: Apache-2.0
"""Third-order reference model, a filter of the wanted motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.control.base import Guidance, Numbers, Packed, PackingContext
from lgvi_warp.physics.notation import repeated
from lgvi_warp.physics.terms.base import number

# What may be filtered, by the number of frequencies.
FILTERED = {2: "depth and heading", 4: "north, east, depth and heading"}

# Terms of the series of e^A for a matrix of norm 1/8: the next one is below 1e-20.
TERMS = 13


@dataclass(frozen=True, eq=False, kw_only=True)
class ReferenceModel(Guidance):
    """Smooth path from the measured state to the values that the guidance before this part sets (Fossen 2021, 12.1.1).

    Each coordinate x follows its target s: x''' + (2 zeta + 1) omega x'' + (2 zeta + 1) omega^2 x' + omega^3 (x - s) = 0.
    The path starts at the measured position, heading and rates. Between ticks the target is held and the equation is solved
    exactly. If x' would then exceed its limit, x moves at the limit over the whole period, and x'' is 0. A heading turns the
    short way to its target and may pass pi. Wanted roll and pitch are not changed.

    Args:
        natural_frequency: omega (2,) [rad/s] of depth and heading, or (4,) of north, east, depth and heading.
        damping_ratio: zeta, one for each natural frequency; 1 by default.
        rate_limit: Largest rates x', one for each natural frequency [m/s; rad/s for the heading]; by default no limit.
    """

    type: ClassVar[str] = "reference_model"

    natural_frequency: Any = number(("n",), "rad/s", above=0.0)
    damping_ratio: Any = number(("n",), "1", None, above=0.0, optional=True)
    rate_limit: Any = number(("n",), "m/s, rad/s", None, above=0.0, optional=True)

    def check(self, faults: Faults) -> None:
        count = len(self.natural_frequency)
        if count not in FILTERED:
            which = " or ".join(f"{n} numbers, of {names}" for n, names in FILTERED.items())
            faults.add("natural_frequency", self.natural_frequency, f"has {count} numbers", f"give {which}")

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # For each number its map over a period, (3, 3), line by line, and its limit; x, x' and x'' in the memory.
        omega = numbers["natural_frequency"]
        zeta = numbers.get("damping_ratio", np.ones_like(omega))
        limit = numbers.get("rate_limit", np.full_like(omega, 1e30))
        omega, zeta, limit = repeated(omega, zeta, limit)
        maps = _maps(omega, zeta, self.bus.period)
        count = omega.shape[1]
        rows = np.concatenate([maps.reshape(*omega.shape, 9), limit[..., None]], axis=2).reshape(len(omega), -1)
        return Packed({"count": count}, rows, np.zeros((1, 3 * count)))


def _maps(omega: np.ndarray, zeta: np.ndarray, period: float) -> np.ndarray:
    """Transition matrices (n, count, 3, 3) of (x - s, x', x'') over a period: exponentials of the model's matrix."""
    # In units of 1 / omega, so that all entries are of one size: halved until small, a series, and squared as often.
    A = np.zeros((*omega.shape, 3, 3))
    A[..., 0, 1] = A[..., 1, 2] = 1.0
    A[..., 2, 0] = -1.0
    A[..., 2, 1] = A[..., 2, 2] = -(2.0 * zeta + 1.0)
    A *= (omega * period)[..., None, None]
    size = np.abs(A).sum(axis=-1).max()
    halvings = max(0, int(np.ceil(np.log2(max(size, 1e-300)))) + 3)
    A /= 2.0**halvings
    power = total = np.broadcast_to(np.eye(3), A.shape)
    for k in range(1, TERMS):
        power = power @ A / k
        total = total + power
    for _ in range(halvings):
        total = total @ total
    places = np.arange(3)
    return total * omega[..., None, None] ** (places[:, None] - places)
