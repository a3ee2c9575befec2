# SPDX-License-Identifier: Apache-2.0
"""Entry of each member into its dock."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from lgvi_warp.common.arguments import flag
from lgvi_warp.common.errors import Faults, closest, refusal
from lgvi_warp.statistics.metrics.metric import Metric, State, Ticks
from lgvi_warp.statistics.values.quantity import Quantity

if TYPE_CHECKING:
    from lgvi_warp.sampling.members import Members
    from lgvi_warp.statistics.values.samples import Fields

# What is known at the dock's plane, and the unit of each.
KNOWN = {"speed": "m/s", "offset": "m", "heading_error": "rad", "time": "s"}
# Numbers at a tick: the way to the plane, that to starboard of the centre line and that below it; their rates; the heading
# less the dock's; the radius of the mouth.
NUMBERS = ("left", "aside", "below", "left rate", "aside rate", "below rate", "heading error", "mouth")
# How often the part of an interval in which the plane lies is halved: to round-off.
HALVINGS = 50
FIELDS = ("position", "attitude", "velocity")


@dataclass(frozen=True, eq=False)
class DockContact(Metric):
    """Metric: one number of a member's first passage through the plane of its dock, within the radius of the mouth.

    A guidance `lw.control.Docking` defines the dock. Between two ticks the path is the cubic through their positions
    and velocities. A member that did not dock has no number (NaN), and is left out of statistics.

    Args:
        of: "speed": speed over ground along the centre line [m/s]; "offset": distance of the body's origin from the
            centre line [m]; "heading_error": heading minus the dock's heading, in [-pi, pi] [rad]; "time": time of the
            passage [s].
        docking: name of the guidance; by default "docking".

    Raises:
        SceneError: if `of` is none of these names; or, at the start of a run, if the scene has no such guidance.

    Examples:
        >>> import lgvi_warp as lw
        >>> metric = lw.metrics.DockContact("speed", then=[lw.statistics.Quantiles(levels=(0.95,))])
        >>> metric.unit
        'm/s'
    """

    type: ClassVar[str] = "dock_contact"

    docking: str = "docking"

    def check(self, faults: Faults) -> None:
        super().check(faults)
        if flag("dock_contact.measured", self.measured):
            faults.add("measured", self.measured, "has no meaning at a dock, which meets the vehicle", "leave it out")

    def meant(self) -> Quantity:
        if not isinstance(self.of, str) or self.of not in KNOWN:
            raise refusal(
                "dock_contact.of", self.of, "is nothing that is known at a dock", closest(str(self.of), KNOWN)
            )
        key = self.docking

        def numbers(samples: Fields, members: Members) -> np.ndarray:
            position, R, v = (samples[field].astype(np.float64, copy=False) for field in FIELDS)
            own = {name: members.parameters[f"{key}.{name}"] for name in ("position", "heading", "mouth")}
            heading, over_ground = own["heading"], np.einsum("...ij,...j", R, v)
            error = np.arctan2(R[..., 1, 0], R[..., 0, 0]) - heading
            columns = [
                *_along(position - own["position"], heading),
                *_along(over_ground, heading),
                np.arctan2(np.sin(error), np.cos(error)),
                np.broadcast_to(own["mouth"], error.shape),
            ]
            return np.stack(columns, axis=-1)

        labels = tuple(f"{what} of {key}" for what in NUMBERS)
        return Quantity(self.of, numbers, KNOWN[self.of], FIELDS, labels, needs_limit=True)

    def begin(self, x: np.ndarray) -> State:
        return {"contact": np.full(x.shape[-1], np.nan)}

    def follow(self, state: State, ticks: Ticks) -> State:
        contact, before = state["contact"].copy(), ticks.before
        through = (before[:, 0] > 0.0) & (ticks.x[:, 0] <= 0.0) & np.isnan(contact)
        if ticks.alive is not None:
            through &= ticks.alive
        when, which = np.nonzero(through)
        if len(when):
            values, off, mouth = self._at_plane(
                before[when, :, which].T, ticks.x[when, :, which].T, ticks.t[when], ticks.dt[when]
            )
            # The first of each member: the later ones are overwritten.
            for i in np.flatnonzero(off <= mouth)[::-1]:
                contact[which[i]] = values[i]
        return {"contact": contact}

    def _at_plane(self, a: np.ndarray, b: np.ndarray, t: np.ndarray, dt: np.ndarray) -> tuple[np.ndarray, ...]:
        """Requested quantity, distance from the centre line and radius of the mouth, at the passage through the plane.

        a, b: numbers at the ticks before and after it (8, m); t: time of the later tick (m,) [s]; dt: time between them
            (m,) [s].
        """
        low, high = np.zeros(len(t)), np.ones(len(t))
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            ahead = _between(a[:3], b[:3], dt * a[3:6], dt * b[3:6], middle)[0] > 0.0
            low, high = np.where(ahead, middle, low), np.where(ahead, high, middle)
        _, aside, below = _between(a[:3], b[:3], dt * a[3:6], dt * b[3:6], high)
        off = np.hypot(aside, below)
        rates, turn = a[3] + high * (b[3] - a[3]), np.arctan2(np.sin(b[6] - a[6]), np.cos(b[6] - a[6]))
        known: dict[str, Any] = {
            "speed": -rates, "offset": off, "heading_error": a[6] + high * turn, "time": t - (1.0 - high) * dt
        }  # fmt: skip
        return known[self.of], off, b[7]

    def finish(self, state: State) -> np.ndarray:
        return state["contact"]


def _along(v: np.ndarray, heading: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Components of inertial vectors (..., n, 3) opposite to a heading (1 or n,), to starboard of it, and downward."""
    c, s = np.cos(heading), np.sin(heading)
    return -(c * v[..., 0] + s * v[..., 1]), c * v[..., 1] - s * v[..., 0], v[..., 2]


def _between(a: np.ndarray, b: np.ndarray, rate_a: np.ndarray, rate_b: np.ndarray, s: np.ndarray) -> np.ndarray:
    """The cubic from a to b with given slopes at the ends of an interval of length 1, evaluated at s."""
    rise = b - a
    cubic, square = rate_a + rate_b - 2.0 * rise, 3.0 * rise - 2.0 * rate_a - rate_b
    return a + s * (rate_a + s * (square + s * cubic))
