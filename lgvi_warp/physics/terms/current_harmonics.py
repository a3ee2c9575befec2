"""A uniform current that is a sum of harmonics in time, such as tides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number


def above_zero(faults: Faults, key: str, values: np.ndarray, unit: str) -> None:
    """Add a fault where some number is not above 0.

    Args:
        faults: Collects the faults.
        key: Name of the field.
        values: Numbers of any shape.
        unit: Unit of the numbers, for the message.
    """
    if np.any(values <= 0.0):
        faults.add(key, values, "is not positive", f"give numbers above 0 [{unit}]")


def not_above_zero(values: np.ndarray) -> np.ndarray:
    """Which members have a number that is not above 0.

    Args:
        values: Numbers (n, ...).

    Returns:
        Mask (n,), True also where a number is NaN.
    """
    with np.errstate(invalid="ignore"):
        return ~np.all(values.reshape(len(values), -1) > 0.0, axis=1)


def zeros_like_first(values: Any) -> np.ndarray:
    """Default phases: one zero for each component.

    Args:
        values: The components, a sequence of length k or one number.

    Returns:
        Zeros (k,).
    """
    return np.zeros(len(np.atleast_1d(np.asarray(values, dtype=object))))


@dataclass(frozen=True, eq=False, kw_only=True)
class CurrentHarmonics(Term):
    """A uniform current that is a sum of harmonics, u(t) = sum of amplitude cos(2 pi t / period + phase).

    Args:
        amplitudes: Amplitudes, (k, 3) [m/s], in inertial axes.
        periods: Periods, (k,) [s], above 0.
        phases: Phases at t = 0, (k,) [rad]; 0 by default.

    Raises:
        SceneError: Where a period is not above 0, and as `Term`.
    """

    type: ClassVar[str] = "current_harmonics"
    device: ClassVar[str] = "current_harmonics"
    timed: ClassVar[bool] = True

    amplitudes: Any = number(("k", 3), "m/s")
    periods: Any = number(("k",), "s")
    phases: Any = number(("k",), "rad", None)

    def __post_init__(self) -> None:
        if self.phases is None:
            object.__setattr__(self, "phases", zeros_like_first(self.amplitudes))
        super().__post_init__()

    def check(self, faults: Faults) -> None:
        """Adds a fault where a period is not above 0."""
        above_zero(faults, "periods", self.periods, "s")

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        """In addition, refuses members with a period that is not above 0."""
        bad = super().unphysical(numbers)
        return bad | {"periods": bad["periods"] | not_above_zero(numbers["periods"])}

    def present(self, numbers: Numbers) -> bool:
        """Whether some amplitude of some member is not zero."""
        return bool(np.any(numbers["amplitudes"]))

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        """Device rows of each harmonic: amplitude, angular frequency [rad/s], phase."""
        columns = [numbers["amplitudes"], 2.0 * np.pi / numbers["periods"][..., None], numbers["phases"][..., None]]
        n = max(len(column) for column in columns)
        rows = np.concatenate([np.broadcast_to(column, (n, *column.shape[1:])) for column in columns], axis=2)
        return Packed({"count": rows.shape[1]}, rows.reshape(n, -1))

    def water(self, numbers: Numbers, position: np.ndarray, time: np.ndarray, parameters: Numbers) -> np.ndarray:
        # Velocity (k, n, 3) [m/s] at each time, the same at all positions.
        total = np.zeros(position.shape)
        for j in range(numbers["periods"].shape[1]):
            angle = 2.0 * np.pi / numbers["periods"][:, j] * time[:, None] + numbers["phases"][:, j]
            total = total + np.cos(angle)[..., None] * numbers["amplitudes"][:, j]
        return total
