"""A uniform current that is a sum of harmonics in time, such as tides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.terms.base import Numbers, Packed, Setting, Term, quantity


def above_zero(faults: Faults, key: str, values: np.ndarray, unit: str) -> None:
    """Note numbers that are not above 0."""
    if np.any(values <= 0.0):
        faults.add(key, values, "is not positive", f"give numbers above 0 [{unit}]")


def not_above_zero(values: np.ndarray) -> np.ndarray:
    """Which members' numbers, (n, ...), are not all above 0."""
    with np.errstate(invalid="ignore"):
        return ~np.all(values.reshape(len(values), -1) > 0.0, axis=1)


def zeros_like_first(values: Any) -> np.ndarray:
    """As many zeros as there are components."""
    return np.zeros(len(np.atleast_1d(np.asarray(values, dtype=object))))


@dataclass(frozen=True, eq=False, kw_only=True)
class CurrentHarmonics(Term):
    """u(t) = sum of amplitude cos(2 pi t / period + phase), everywhere the same.

    amplitudes: (k, 3) [m/s], inertial; periods: (k,) [s], above 0; phases: (k,) [rad].
    """

    type: ClassVar[str] = "current_harmonics"
    device: ClassVar[str] = "current_harmonics"
    timed: ClassVar[bool] = True

    amplitudes: Any = quantity(("k", 3), "m/s")
    periods: Any = quantity(("k",), "s")
    phases: Any = quantity(("k",), "rad", None)

    def __post_init__(self) -> None:
        if self.phases is None:
            object.__setattr__(self, "phases", zeros_like_first(self.amplitudes))
        super().__post_init__()

    def check(self, faults: Faults) -> None:
        """Periods must be positive."""
        above_zero(faults, "periods", self.periods, "s")

    def unphysical(self, own: Numbers) -> dict[str, np.ndarray]:
        """Periods must be positive."""
        bad = super().unphysical(own)
        return bad | {"periods": bad["periods"] | not_above_zero(own["periods"])}

    def present(self, own: Numbers) -> bool:
        """Whether some member has one."""
        return bool(np.any(own["amplitudes"]))

    def packed(self, own: Numbers, setting: Setting) -> Packed:
        """The table, harmonic by harmonic."""
        parts = [own["amplitudes"], 2.0 * np.pi / own["periods"][..., None], own["phases"][..., None]]
        n = max(len(part) for part in parts)
        rows = np.concatenate([np.broadcast_to(part, (n, *part.shape[1:])) for part in parts], axis=2)
        return Packed({"count": rows.shape[1]}, rows.reshape(n, -1))

    def water(self, own: Numbers, position: np.ndarray, time: np.ndarray, parameters: Numbers) -> np.ndarray:
        """Velocity of the water (k, n, 3) [m/s]."""
        total = np.zeros(position.shape)
        for j in range(own["periods"].shape[1]):
            angle = 2.0 * np.pi / own["periods"][:, j] * time[:, None] + own["phases"][:, j]
            total = total + np.cos(angle)[..., None] * own["amplitudes"][:, j]
        return total
