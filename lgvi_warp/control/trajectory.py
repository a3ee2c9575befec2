# SPDX-License-Identifier: Apache-2.0
"""Guidance along a trajectory in time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import word
from lgvi_warp.common.errors import Faults
from lgvi_warp.control.base import Guidance, Numbers, Packed, PackingContext
from lgvi_warp.physics.notation import repeated
from lgvi_warp.physics.terms.base import number

INTERPOLATIONS = ("linear", "cubic", "steps")
# The largest rate between two times, in the unit of the numbers / s: beyond it squares of float32 are infinite.
FASTEST = 1e15


@dataclass(frozen=True, eq=False, kw_only=True)
class Trajectory(Guidance):
    """Wanted position over time, with velocity and heading rate as feedforward.

    Before the first time, the vehicle is to rest at the first position; after the last time, at the last position.

    Args:
        times: Times (k,) [s], rising, at least two.
        positions: Wanted positions (k, 3) [m], inertial axes.
        headings: Wanted headings (k,) [rad]; the heading turns the short way from each to the next. By default no
            heading is wanted.
        speed: Wanted forward speeds through the water (k,) [m/s]; by default the size of the wanted velocity. The
            speeds are interpolated linearly between times, or held with "steps".
        interpolation: "linear", the default, uses straight lines between positions. "cubic" uses natural cubic splines, whose
            velocities are continuous between the first and the last time. "steps" holds each position, at rest, until the
            next time.

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.control.Trajectory(times=[0.0, 10.0], positions=[[0.0, 0.0, 5.0], [15.0, 0.0, 5.0]]).gives
        ('position', 'depth', 'velocity', 'speed')
    """

    type: ClassVar[str] = "trajectory"
    foreseeable: ClassVar[bool] = True

    times: Any = number(("k",), "s", rising=True)
    positions: Any = number(("k", 3), "m")
    headings: Any = number(("k",), "rad", None, optional=True)
    speed: Any = number(("k",), "m/s", None, optional=True)
    interpolation: str = word("linear", known=INTERPOLATIONS)

    @property
    def ticks_before(self) -> int:
        # One: what is wanted depends on the time.
        return 1

    def check(self, faults: Faults) -> None:
        if len(self.times) < 2:
            faults.add("times", self.times, "are less than two", "give when the trajectory begins and when it ends")
        spans = np.diff(self.times)
        if self.interpolation == "steps":
            return
        for name in ("positions", "headings", "speed"):
            values = getattr(self, name)
            if values is not None:
                with np.errstate(over="ignore", divide="ignore"):
                    rates = np.abs(np.diff(values.reshape(len(self.times), -1), axis=0) / spans[:, None])
                if np.any(rates > FASTEST):
                    problem = f"change by more than {FASTEST:g} of their unit a second"
                    faults.add(name, values, problem, "give places that a vehicle can reach, or times further apart")

    @property
    def gives(self) -> tuple[str, ...]:
        # Position, depth, velocity and speed; with headings the attitude and its rate.
        heading = () if self.headings is None else ("heading", "attitude", "angular_velocity")
        return ("position", "depth", "velocity", "speed", *heading)

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # For each piece its time and the coefficients of its polynomials, of position, heading and speed; then the end.
        times, positions = numbers["times"], numbers["positions"]
        zero = np.zeros_like(times)
        columns = [positions, numbers.get("headings", zero)[..., None], numbers.get("speed", zero)[..., None]]
        columns[1] = np.unwrap(columns[1], axis=1)
        t, *columns = repeated(times, *columns)
        values = np.concatenate(columns, axis=2)
        rows = np.concatenate([_pieces(at, value, self.interpolation) for at, value in zip(t, values, strict=True)])
        rows = rows.reshape(len(t), -1)
        words = {
            "pieces": t.shape[1] - 1,
            "turns": int(self.headings is not None),
            "paced": int(self.speed is not None),
        }
        return Packed(words, rows)


def _pieces(t: np.ndarray, values: np.ndarray, interpolation: str) -> np.ndarray:
    """Rows (1, k, 21): time and four coefficients of each of five numbers, lowest power first. The last row is at rest."""
    k, d = values.shape
    coefficients = np.zeros((k, 4, d))
    coefficients[:, 0] = values
    if interpolation == "cubic":
        from scipy.interpolate import CubicSpline

        coefficients[:-1] = CubicSpline(t, values, bc_type="natural").c[::-1].transpose(1, 0, 2)
    elif interpolation == "linear":
        coefficients[:-1, 1] = np.diff(values, axis=0) / np.diff(t)[:, None]
    # A speed goes straight from one to the next.
    coefficients[:-1, 1:, -1] = 0.0
    if interpolation != "steps":
        coefficients[:-1, 1, -1] = np.diff(values[:, -1]) / np.diff(t)
    return np.concatenate([t[:, None], coefficients.reshape(k, -1)], axis=1)[None]
