"""A uniform current that varies at random in time, independently for each member."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.common.random import uniforms_of
from lgvi_warp.physics.terms.base import Numbers, Packed, Setting, Term, quantity
from lgvi_warp.physics.terms.current_harmonics import above_zero, not_above_zero
from lgvi_warp.physics.terms.wrench_noise import noise_key

STARTS = ("zero", "stationary")


@dataclass(frozen=True, eq=False, kw_only=True)
class GaussMarkovCurrent(Term):
    """A uniform current u' = -u / time_constant + noise: a first-order Gauss-Markov process for each member.

    Args:
        standard_deviation: Standard deviation of u in the long run, (3,) [m/s], in inertial axes.
        time_constant: Correlation time [s], above 0.
        start: "zero", the default: u = 0 at t = 0; or "stationary": u is drawn with the standard deviation.

    Raises:
        SceneError: Where the time constant is not above 0, and as `Term`.
    """

    type: ClassVar[str] = "gauss_markov_current"
    device: ClassVar[str] = "gauss_markov_current"
    timed: ClassVar[bool] = True

    standard_deviation: Any = quantity((3,), "m/s", least=0.0)
    time_constant: Any = quantity((), "s")
    start: str = "zero"

    def check(self, faults: Faults) -> None:
        """Adds a fault where the time constant is not above 0, or `start` is unknown."""
        above_zero(faults, "time_constant", self.time_constant, "s")
        faults.choice("start", self.start, STARTS)

    def unphysical(self, own: Numbers) -> dict[str, np.ndarray]:
        """In addition, refuses members whose time constant is not above 0."""
        bad = super().unphysical(own)
        return bad | {"time_constant": bad["time_constant"] | not_above_zero(own["time_constant"])}

    def present(self, own: Numbers) -> bool:
        """Whether some standard deviation is not zero."""
        return bool(np.any(own["standard_deviation"]))

    @property
    def memory(self) -> bool:
        """Always true: the current itself is remembered."""
        return True

    def packed(self, own: Numbers, setting: Setting) -> Packed:
        """Decay and spread of the process over one step, exact; the memory holds u twice and du/dt."""
        steps = setting.h / own["time_constant"]
        spread = own["standard_deviation"] * np.sqrt(-np.expm1(-2.0 * steps))[:, None]
        first = self._first(own, setting)
        values = {"decay": np.exp(-steps), "spread": spread} | noise_key(self.key, setting)
        return Packed(values, memory=np.concatenate([first, first, np.zeros_like(first)], axis=1))

    def water_at_start(self, own: Numbers, position: np.ndarray, setting: Setting) -> np.ndarray:
        """The current (n, 3) [m/s] of each member at t = 0."""
        return np.broadcast_to(self._first(own, setting), position.shape)

    def _first(self, own: Numbers, setting: Setting) -> np.ndarray:
        """u at t = 0, (1 or n, 3) [m/s], drawn by seed, member and the term's name, as every number that varies by member."""
        from scipy.special import ndtri

        if self.start == "zero":
            return np.zeros((1, 3))
        name, members = f"{self.key}.start", setting.members
        u = uniforms_of(setting.seed, name, members, 3)
        return np.asarray(own["standard_deviation"] * ndtri(u))
