# SPDX-License-Identifier: Apache-2.0
"""A tide: the height of the surface from harmonic constituents, a table, or both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.notation import repeated
from lgvi_warp.physics.terms.base import CONSERVED, Array, Numbers, knots, number, rows_of, side_by_side
from lgvi_warp.physics.terms.surface_level import SurfaceLevel

# Seconds of a constituent of 1 deg/h.
PERIOD = 360.0 * 3600.0
HIGHEST = 12.0
WHY = "the largest tides are 8 m above their mean: is it in feet or cm?"


@dataclass(frozen=True, eq=False, kw_only=True)
class Tide(SurfaceLevel):
    """A tide, which moves the surface; the floor and the inertial axes stay in place.

    The height of the surface above the depth 0 is mean + sum of amplitude cos(2 pi t / period + phase) + table value. The
    tide shifts the surface of `surface_buoyancy`, waves, pressure cells and the event `surface`, and the depths at which a
    buoyancy engine reverses.

    Args:
        amplitudes: Amplitudes of the constituents, (k,) [m].
        periods: Periods of the constituents, (k,) [s], above 0; or give `speeds`.
        speeds: Speeds of the constituents, (k,) [deg/h], above 0: M2 28.984, S2 30, K1 15.041, O1 13.943.
        phases: Phases of the constituents at t = 0, (k,) [rad]; 0 by default. For a phase lag g at t = 0, give -g.
        times: Times of a table, (m,) [s], rising.
        heights: Heights at these times, (m,) [m], added to the constituents; linear between the times, constant outside.
        mean: Height of the mean surface above the depth 0 [m], for example if the depths of a chart are relative to the
            lowest tide; 0 if omitted.

    Raises:
        SceneError: If amplitudes have neither periods nor speeds, or both; if only one of `times` and `heights` is given; or
            if a number is invalid (see `Term`).

    Examples:
        >>> import lgvi_warp as lw
        >>> tide = lw.terms.Tide(amplitudes=[1.5, 0.5], speeds=[28.984, 30.0], mean=2.1)
        >>> tide.at([0.0, 22357.0]).round(2)
        array([4.1, 0.1])
    """

    type: ClassVar[str] = "tide"
    usual: ClassVar[Mapping[str, Any]] = {
        **dict.fromkeys(("amplitudes", "heights", "mean"), (HIGHEST, WHY)),
        "periods": "constituents have periods of hours to years",
        "speeds": "constituents have speeds from 0 to 180 deg/h",
        "phases": "an angle may be any number",
    }

    amplitudes: Any = number(("k",), "m", None, optional=True)
    periods: Any = number(("k",), "s", None, above=0.0, optional=True)
    speeds: Any = number(("k",), "deg/h", None, above=0.0, optional=True)
    phases: Any = number(("k",), "rad", None, optional=True)
    times: Any = number(("m",), "s", None, rising=True, optional=True)
    heights: Any = number(("m",), "m", None, optional=True)
    mean: Any = number((), "m", None, optional=True)

    def __post_init__(self) -> None:
        if self.phases is None and self.amplitudes is not None:
            object.__setattr__(self, "phases", np.zeros(rows_of(self.amplitudes)))
        super().__post_init__()

    def check(self, faults: Faults) -> None:
        constituents = [name for name in ("periods", "speeds") if getattr(self, name) is not None]
        if self.amplitudes is None:
            for name in (*constituents, *("phases",) * (self.phases is not None)):
                faults.add(name, getattr(self, name), "has no amplitudes", "give amplitudes [m], or leave it out")
        elif len(constituents) != 1:
            problem = "have both periods and speeds" if constituents else "have neither periods nor speeds"
            faults.add("amplitudes", self.amplitudes, problem, "give periods [s] or speeds [deg/h]")
        for name, other in (("times", "heights"), ("heights", "times")):
            if getattr(self, name) is not None and getattr(self, other) is None:
                faults.add(name, getattr(self, name), f"has no {other}", f"give {other} as well, or leave it out")
        if self.amplitudes is None and self.heights is None and self.mean is None:
            remedy = "give amplitudes and periods, times and heights, or mean"
            faults.add("amplitudes", None, "is missing, and so are heights", remedy)

    @property
    def conserves(self) -> frozenset[str]:
        # It does nothing to the motion by itself.
        return CONSERVED

    def constituents(self, numbers: Numbers) -> Array:
        """Rows of the constituents.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).

        Returns:
            (n, k, 3): amplitude [m], angular frequency [rad/s] and phase [rad].
        """
        if "amplitudes" not in numbers:
            return np.zeros((1, 0, 3))
        periods = numbers["periods"] if "periods" in numbers else PERIOD / numbers["speeds"]
        rows = repeated(numbers["amplitudes"], 2.0 * np.pi / periods, numbers["phases"])
        return np.stack(rows, axis=-1)

    def at(self, time: Any) -> Array:
        """Heights of the surface, from the term's own numbers.

        Args:
            time: Times (k,) [s].

        Returns:
            Heights above the depth 0, (k,) [m].

        Examples:
            >>> import lgvi_warp as lw
            >>> lw.terms.Tide(times=[0.0, 3600.0], heights=[0.2, 0.8]).at([1800.0, 7200.0])
            array([0.5, 0.8])
        """
        return self.height({name: value[None] for name, value in self.parameters().items()}, np.asarray(time))[:, 0]

    def height(self, numbers: Numbers, time: Array) -> Array:
        time = np.asarray(time, np.float64)
        total = np.zeros((len(time), 1)) + numbers.get("mean", np.zeros(1))
        for amplitude, omega, phase in np.moveaxis(self.constituents(numbers), (1, 2), (0, 1)):
            total = total + amplitude * np.cos(omega * time[:, None] + phase)
        if "heights" in numbers:
            times, heights = repeated(numbers["times"], numbers["heights"])
            total = total + np.stack([np.interp(time, *each) for each in zip(times, heights, strict=True)], axis=1)
        return total

    def mean_height(self, numbers: Numbers) -> Array:
        # A table's mean is that between its first and its last time.
        mean = numbers.get("mean", np.zeros(1))
        if "heights" in numbers:
            times, heights, mean = repeated(numbers["times"], numbers["heights"], mean)
            span = np.diff(times)
            within = (span * 0.5 * (heights[:, 1:] + heights[:, :-1])).sum(axis=1) / np.maximum(
                span.sum(axis=1), 1e-300
            )
            mean = mean + (within if span.size else heights[:, 0])
        return np.asarray(mean)

    def highest(self, numbers: Numbers) -> Array:
        parts = [numbers["mean"]] if "mean" in numbers else []
        parts += [np.abs(numbers["amplitudes"]).sum(axis=1)] if "amplitudes" in numbers else []
        parts += [numbers["heights"].max(axis=1)] if "heights" in numbers else []
        return np.asarray(sum(parts[1:], parts[0]))

    def level_rows(self, numbers: Numbers) -> tuple[Array, dict[str, int]]:
        waves = self.constituents(numbers)
        mean, count = numbers.get("mean", np.zeros(1)), 0
        table = mean[:, None]
        if "heights" in numbers:
            times, heights, mean = repeated(numbers["times"], numbers["heights"], mean)
            count, heights = times.shape[1] - 1, heights + mean[:, None]
            table = knots(times, heights[..., None]) if count else heights
        rows = side_by_side(table, waves.reshape(len(waves), -1))
        return rows, {"tide_knots": count, "tide_harmonics": waves.shape[1]}
