# SPDX-License-Identifier: Apache-2.0
"""Measurements: one instrument's values at its times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import explained
from lgvi_warp.common.errors import Faults
from lgvi_warp.common.times import rows_at
from lgvi_warp.results.quantities import OfResult, quantities

# Quantities that are angles: a measurement differs from a prediction by less than half a turn.
ANGLES = ("euler", "euler[0]", "euler[1]", "euler[2]", "heading")


@explained
@dataclass(frozen=True, eq=False)
class Series:
    """Values that an instrument measured, with independent normal errors.

    Args:
        of: Measured quantity: "position", "depth", "velocity", "euler[2]", a Quantity or a function, as in `lw.prepare`.
        time: Rising times (k,) [s], at least 0.
        values: Measured values, (k,) or (k, m) of m numbers; NaN for a missing value.
        std: Standard deviation of the errors, a number or (m,), in the unit of the values.
        name: Name of the series in the result; by default the name of the quantity.

    Raises:
        SceneError: If an argument is invalid; the message lists every fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> fixes = lw.studies.Series("position", [10.0, 20.0], [[15.0, 0.2, 3.0], [30.1, 0.3, 3.1]], std=[0.5, 0.5, 0.1])
        >>> fixes.values.shape
        (2, 3)
    """

    of: Any
    time: Any
    values: Any
    std: Any
    name: str | None = None

    def __post_init__(self) -> None:
        faults = Faults("series.")
        time, values, std = (faults.real(name, getattr(self, name)) for name in ("time", "values", "std"))
        if time is not None and (time.ndim != 1 or not len(time) or np.any(np.diff(time) <= 0.0) or time[0] < 0.0):
            faults.add("time", self.time, "is not a rising list of times >= 0", "sort it and drop repetitions")
        if values is not None and time is not None and (values.ndim not in (1, 2) or len(values) != time.size):
            faults.add("values", self.values, f"has shape {values.shape}", f"give {time.size} rows, one for each time")
        if values is not None and np.isinf(values).any():
            faults.add("values", self.values, "has values that are infinite", "give NaN for one that is missing")
        if std is not None and (std.ndim > 1 or not np.all(std > 0.0)):
            faults.add("std", self.std, "is not positive", "give the standard deviation of the error")
        with faults.including():
            if len(quantities(self.of)) != 1:
                faults.add("of", self.of, "names several quantities", "give a Series for each instrument")
        faults.raise_if_any()
        assert time is not None
        assert values is not None
        assert std is not None
        columns = values.reshape(len(values), -1)
        if std.ndim and len(std) != columns.shape[1]:
            faults.add("std", self.std, f"has {len(std)} numbers", f"give one, or {columns.shape[1]}")
            faults.raise_if_any()
        for name, array in (("time", time), ("values", columns), ("std", np.broadcast_to(std, columns.shape[1]))):
            object.__setattr__(self, name, np.array(array))

    @property
    def quantity(self) -> OfResult:
        """The measured quantity, as a quantity of a result."""
        return quantities(self.of)[0]

    @property
    def label(self) -> str:
        """The name of the series."""
        return self.name or self.quantity.label

    def at(self, time: float) -> np.ndarray | None:
        """Select the values that were measured at a time.

        Args:
            time: The time [s].

        Returns:
            Values (m,), or None if there is no measurement at this time.
        """
        rows = rows_at(self.time, time)
        return np.asarray(self.values[rows[0]]) if len(rows) else None

    def near(self, measured: np.ndarray, predicted: np.ndarray) -> np.ndarray:
        """Shift predictions of angles by whole turns, to within half a turn of the measured values.

        Args:
            measured: Measured values (m,).
            predicted: Predictions of the values by n members, (m, n).

        Returns:
            The shifted predictions, (m, n); predictions of other quantities are unchanged.
        """
        if self.quantity.label not in ANGLES:
            return predicted
        apart = predicted - measured[:, None]
        return np.asarray(predicted - 2.0 * np.pi * np.rint(apart / (2.0 * np.pi)))
