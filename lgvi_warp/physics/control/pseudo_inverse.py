"""Allocation by a weighted pseudo-inverse of the actuators' effect."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.control.base import Allocation, rest_rows
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, number, side_by_side


@dataclass(frozen=True, eq=False, kw_only=True)
class PseudoInverse(Allocation):
    """Commands for the efforts t of least sum of weight t^2 whose wrench B t is nearest to the demand (Fossen 2021, 11.2).

    t = W^-1 B^T (B W^-1 B^T)^+ w. Effort is thrust of thrusters, by the inverse of their curve; angle of fins, whose effect B
    is that at `speed`; force or moment of a control_wrench.

    Args:
        to: Key of the term that takes the commands.
        weights: Cost of each effort, (channels,), above 0; 1 by default.
        speed: Speed ahead [m/s] at which fins are judged; 1 by default.
    """

    type: ClassVar[str] = "pseudo_inverse"

    weights: Any = number(("n",), "1", None, above=0.0, optional=True)
    speed: Any = number((), "m/s", 1.0, above=0.0)

    def check_actuator(self, faults: Faults) -> None:
        """Adds a fault where there are other weights than channels."""
        count = self.actuator.channels
        if self.weights is not None and len(self.weights) != count:
            fault = f"has {len(self.weights)} numbers"
            faults.add(f"{self.key}.weights", self.weights, fault, f"give {count}, one for each channel of {self.to}")

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        """For each channel its line of the pseudo-inverse, its wrench, and the inverse of its curve."""
        own = context.own(self.actuator)
        B = self.actuator.effect(own, context.parameters, numbers["speed"])
        weights = numbers.get("weights", np.ones((1, B.shape[2])))
        scaled = B / np.sqrt(weights)[:, None, :]
        lines = np.linalg.pinv(scaled, rcond=1e-10) / np.sqrt(weights)[:, :, None]
        limit = own["limit"]
        curve = self.actuator.curve(own)
        parts = [np.asarray(part)[..., None] + np.zeros_like(limit)[..., None] for part in curve]
        rows = side_by_side(lines, np.swapaxes(B, -1, -2), limit[..., None], *parts)
        assert self.bus is not None
        first, count = self.bus.commands[self.to]
        values = {"commands": first, "count": count, "square": int(self.actuator.has_square_curve)}
        return Packed(values, side_by_side(rest_rows(B @ lines), rows.reshape(len(rows), -1)))
