# SPDX-License-Identifier: Apache-2.0
"""A uniform current that varies at random in time, independently for each member."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import word
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, number
from lgvi_warp.physics.terms.noisy import NoisyTerm, normals_at_start

if TYPE_CHECKING:
    from lgvi_warp.physics.given_draws import Stream

STARTS = ("zero", "stationary")


@dataclass(frozen=True, eq=False, kw_only=True)
class GaussMarkovCurrent(NoisyTerm):
    """A uniform current u with u' = -u / time_constant + noise, a first-order Gauss-Markov process for each member.

    Args:
        standard_deviation: Standard deviation of u in the long run, (3,) [m/s], in inertial axes.
        time_constant: Correlation time [s], above 0.
        start: "zero", the default, for u = 0 at t = 0; or "stationary", to draw u at t = 0 with `standard_deviation`.

    Raises:
        SceneError: If the time constant is not above 0, or a number is invalid (see `Term`).
    """

    type: ClassVar[str] = "gauss_markov_current"
    strengths: ClassVar[tuple[str, ...]] = ("standard_deviation",)

    standard_deviation: Any = number((3,), "m/s", least=0.0)
    time_constant: Any = number((), "s", above=0.0)
    start: str = word("zero", known=STARTS)

    @property
    def memory(self) -> bool:
        # Always true: the current itself is remembered.
        return True

    def streams(self, acting: Collection[str]) -> tuple[Stream, ...]:
        from lgvi_warp.physics.given_draws import Stream

        if not any(name in acting for name in self.strengths):
            return ()
        start = (Stream("start", at_start=True),) if self.start == "stationary" else ()
        return (Stream("current"), *start)

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Decay and spread of the process over one draw, exact; the memory holds u twice and du/dt.
        steps = context.h / self.draws(context.h) / numbers["time_constant"]
        spread = numbers["standard_deviation"] * np.sqrt(-np.expm1(-2.0 * steps))[:, None]
        first = self._first(numbers, context)
        values = {"decay": np.exp(-steps), "spread": spread} | self.noise_key(context)
        return Packed(values, memory=np.concatenate([first, first, np.zeros_like(first)], axis=1))

    def water_at_start(self, numbers: Numbers, position: np.ndarray, context: PackingContext) -> np.ndarray:
        if context.remembered is not None:
            return np.asarray(context.remembered[:, :3], dtype=np.float64)
        return np.broadcast_to(self._first(numbers, context), position.shape)

    def _first(self, numbers: Numbers, context: PackingContext) -> np.ndarray:
        """u at t = 0, (1 or n, 3) [m/s], drawn from the seed, the member and the term's name."""
        if self.start == "zero":
            return np.zeros((1, 3))
        if context.given is not None:
            xi = context.given.of_stream(self.key, "start")
        else:
            xi = normals_at_start(context.seed, self.key, context.members)
        return np.asarray(numbers["standard_deviation"] * xi)
