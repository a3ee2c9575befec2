# SPDX-License-Identifier: Apache-2.0
"""Observations of a learner.

Names of measured and wanted numbers of a controller, including the inputs of `lw.control.Policy`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import Faults, closest
from lgvi_warp.engine.host_callback import CallbackInput
from lgvi_warp.physics.terms.events import Box, Surface
from lgvi_warp.physics.terms.floor import Floor
from lgvi_warp.scene.ensemble import Ensemble


def heading_error(y: CallbackInput, r: CallbackInput) -> np.ndarray:
    """The wanted minus the measured heading.

    Returns: (m,) [rad], in (-pi, pi], computed from the forward axes, without Euler angles.
    """
    s, c = r.attitude[:, :2, 0], y.attitude[:, :2, 0]
    return np.arctan2(s[:, 1] * c[:, 0] - s[:, 0] * c[:, 1], s[:, 0] * c[:, 0] + s[:, 1] * c[:, 1])


def attitude_error(y: CallbackInput, r: CallbackInput) -> np.ndarray:
    """e_R = vee(R_d^T R - R^T R_d) / 2, as in `lw.control.PosePID`: (m, 3) [1], body axes."""
    return 0.5 * np.cross(y.attitude, r.attitude).sum(axis=1)


def position_error(y: CallbackInput, r: CallbackInput) -> np.ndarray:
    """The wanted minus the measured position, (m, 3) [m], body axes."""
    return np.einsum("nji,nj->ni", y.attitude, r.position - y.position)


def water_velocity(y: CallbackInput) -> np.ndarray:
    """The measured velocity through the water, (m, 3) [m/s], body axes."""
    assert y.water_velocity is not None
    return y.water_velocity


class ObservedNumber(NamedTuple):
    """One or several numbers that a learner may observe.

    wish: Quantity that guidance must set for this observation; None for no quantity.
    of: Function of the measured and the wanted motion of m members that returns (m,) or (m, length).
    most: Largest size of each number that its definition allows; infinite by default.
    """

    length: int
    wish: str | None
    of: Callable[[CallbackInput, CallbackInput], Any]
    most: float = np.inf


OBSERVATIONS = {
    "depth_error": ObservedNumber(1, "depth", lambda y, r: r.depth - y.depth),
    "heading_error": ObservedNumber(1, "heading", heading_error, np.pi),
    "speed_error": ObservedNumber(1, "speed", lambda y, r: r.speed - water_velocity(y)[:, 0]),
    "depth": ObservedNumber(1, None, lambda y, r: y.depth),
    "position_error": ObservedNumber(3, "position", position_error),
    "attitude_error": ObservedNumber(3, "attitude", attitude_error, 1.0),
    "velocity": ObservedNumber(3, None, lambda y, r: y.velocity),
    "water_velocity": ObservedNumber(3, None, lambda y, r: water_velocity(y)),
    "angular_velocity": ObservedNumber(3, None, lambda y, r: y.angular_velocity),
    "down": ObservedNumber(3, None, lambda y, r: y.attitude[:, 2], 1.0),
    "measured_position": ObservedNumber(3, None, lambda y, r: y.position),
    "measured_attitude": ObservedNumber(9, None, lambda y, r: y.attitude, 1.0),
    "measured_heading": ObservedNumber(1, None, lambda y, r: y.heading, np.pi),
    "reference_position": ObservedNumber(3, None, lambda y, r: r.position),
    "reference_attitude": ObservedNumber(9, None, lambda y, r: r.attitude, 1.0),
    "reference_velocity": ObservedNumber(3, None, lambda y, r: r.velocity),
    "reference_angular_velocity": ObservedNumber(3, None, lambda y, r: r.angular_velocity),
    "reference_heading": ObservedNumber(1, None, lambda y, r: r.heading, np.pi),
    "reference_depth": ObservedNumber(1, None, lambda y, r: r.depth),
    "reference_speed": ObservedNumber(1, None, lambda y, r: r.speed),
}  # fmt: skip
# Signals of a controller that are the same as one above.
OBSERVATIONS |= {
    f"measured_{name}": OBSERVATIONS[name] for name in ("depth", "velocity", "water_velocity", "angular_velocity")
}


# Name of a number -> which number of the position it is.
_PLACES = {"depth": (2,), "measured_depth": (2,), "measured_position": (0, 1, 2)}


def bounds(names: Sequence[str], fleet: Ensemble) -> np.ndarray | None:
    """Least and largest values of named numbers, (2, k); None if none of them has a bound.

    Angles and numbers of rotations are bounded by definition. Depth and position are bounded if events of the scene stop the
    vehicle at bounds and they are measured without error.
    """
    corners, columns = _sea(fleet), []
    for entry in names:
        name, _, index = entry.partition("[")
        each = OBSERVATIONS[name]
        ends = np.full((2, each.length), [[-each.most], [each.most]])
        if name in _PLACES:
            ends = corners[:, _PLACES[name]]
        columns.append(ends[:, [int(index[:-1])]] if index else ends)
    both = np.concatenate(columns, axis=1)
    return both if np.isfinite(both).any() else None


def _sea(fleet: Ensemble) -> np.ndarray:
    """Corners (2, 3) [m] of the box within which all members measure their position; infinite without a bound."""
    low, high = np.full(3, -np.inf), np.full(3, np.inf)
    controller: Any = fleet.scene.controller
    if controller.sensors or controller.faults:
        return np.array([low, high])
    for event in fleet.scene.events:
        if any(name.startswith(f"{event.key}.") for name in fleet.varied_names):
            continue
        if isinstance(event, Surface):
            low[2] = max(low[2], event.depth)
        elif isinstance(event, Floor):
            high[2] = min(high[2], np.max(event.depth) - (event.clearance or 0.0))
        elif isinstance(event, Box):
            low, high = np.maximum(low, event.lower), np.minimum(high, event.upper)
    return np.array([low, high])


def observer(
    faults: Faults, names: Any, wishes: Sequence[str]
) -> Callable[[float, CallbackInput, CallbackInput], np.ndarray]:
    """A function of the time and of the measured and wanted motion of m members that returns named numbers (m, k)."""
    chosen: list[tuple[ObservedNumber, int | None]] = []
    known: Mapping[str, tuple[str, int | None]] = {
        (name if i is None else f"{name}[{i}]"): (name, i)
        for name, each in OBSERVATIONS.items()
        for i in (None, *(range(each.length) if each.length > 1 else ()))
    }
    listed = items_of(names)
    if not listed:
        faults.add("observe", names, "is not a list of names and no function", "give names such as depth_error")
    for i, entry in enumerate(listed or ()):
        if not isinstance(entry, str) or entry not in known:
            faults.add(f"observe[{i}]", entry, "is not known", closest(entry, known))
            continue
        name, index = known[entry]
        wish = OBSERVATIONS[name].wish
        if wish is not None and wish not in wishes:
            remedy = "give guidance that wants it, such as lw.control.SetPoint"
            faults.add(f"observe[{i}]", entry, f"needs a wanted {wish}, which no guidance gives", remedy)
        chosen.append((OBSERVATIONS[name], index))

    def observe(t: float, y: CallbackInput, r: CallbackInput) -> np.ndarray:
        columns = [np.reshape(each.of(y, r), (len(y.heading), each.length)) for each, _ in chosen]
        return np.concatenate(
            [c if i is None else c[:, i : i + 1] for c, (_, i) in zip(columns, chosen, strict=True)], axis=1
        )

    return observe
