"""A uniform current that wanders at random, each member's its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from scipy.special import ndtri

from lgvi_warp.common.errors import Faults
from lgvi_warp.common.random import uniforms_of
from lgvi_warp.physics.terms.base import Numbers, Packed, Setting, Term, quantity
from lgvi_warp.physics.terms.current_harmonics import above_zero, not_above_zero
from lgvi_warp.physics.terms.wrench_noise import noise_key

STARTS = ("zero", "stationary")


@dataclass(frozen=True, eq=False, kw_only=True)
class GaussMarkovCurrent(Term):
    """u' = -u / time_constant + noise, everywhere the same: a first-order Gauss-Markov process.

    standard_deviation: (3,) [m/s], inertial, of u in the long run; time_constant [s], above 0. start: "zero", u = 0 at
    t = 0, or "stationary", u drawn with the standard deviation.
    """

    type: ClassVar[str] = "gauss_markov_current"
    device: ClassVar[str] = "gauss_markov_current"
    timed: ClassVar[bool] = True

    standard_deviation: Any = quantity((3,), "m/s", least=0.0)
    time_constant: Any = quantity((), "s")
    start: str = "zero"

    def check(self, faults: Faults) -> None:
        """The time constant must be positive."""
        above_zero(faults, "time_constant", self.time_constant, "s")
        faults.choice("start", self.start, STARTS)

    def unphysical(self, own: Numbers) -> dict[str, np.ndarray]:
        """The time constant must be positive."""
        bad = super().unphysical(own)
        return bad | {"time_constant": bad["time_constant"] | not_above_zero(own["time_constant"])}

    def present(self, own: Numbers) -> bool:
        """Whether some member has one."""
        return bool(np.any(own["standard_deviation"]))

    @property
    def memory(self) -> bool:
        """It remembers the current."""
        return True

    def packed(self, own: Numbers, setting: Setting) -> Packed:
        """The process over one step, exactly; what it remembers: u, u and du/dt."""
        steps = setting.h / own["time_constant"]
        spread = own["standard_deviation"] * np.sqrt(-np.expm1(-2.0 * steps))[:, None]
        first = self._first(own, setting)
        values = {"decay": np.exp(-steps), "spread": spread} | noise_key(self.key, setting)
        return Packed(values, memory=np.concatenate([first, first, np.zeros_like(first)], axis=1))

    def water_at_start(self, own: Numbers, position: np.ndarray, setting: Setting) -> np.ndarray:
        """Velocity of the water (m, 3) [m/s] where members start."""
        return np.broadcast_to(self._first(own, setting), position.shape)

    def _first(self, own: Numbers, setting: Setting) -> np.ndarray:
        """u at t = 0, (1 or m, 3): keyed by seed, member and the term's name, as what varies from member to member."""
        if self.start == "zero":
            return np.zeros((1, 3))
        name, members = f"{self.key}.start", setting.members
        u = uniforms_of(setting.seed, name, members, 3)
        return np.asarray(own["standard_deviation"] * ndtri(u))
