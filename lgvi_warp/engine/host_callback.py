# SPDX-License-Identifier: Apache-2.0
"""Exchange with a Python function at a controller's ticks: its inputs, and its answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.real_numbers import answered
from lgvi_warp.engine.packets import Packets


@dataclass(frozen=True)
class CallbackInput:
    """Measured or reference values of m members at a tick.

    Args:
        position: Positions (m, 3) [m], inertial axes.
        attitude: Attitudes (m, 3, 3), body to inertial axes.
        velocity: Velocities (m, 3) [m/s]: measured over ground in body axes, or reference in inertial axes.
        angular_velocity: Angular velocities (m, 3) [rad/s], body axes.
        heading: Headings (m,) [rad].
        water_velocity: Measured velocities through the water (m, 3) [m/s], body axes; None (default) in reference values.
        speed: Reference speed ahead (m,) [m/s]; None (default) in measured values.
        angular_acceleration: Reference angular accelerations (m, 3) [rad/s^2], axes of the reference attitude; None
            (default) in measured values.
    """

    position: np.ndarray
    attitude: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    heading: np.ndarray
    water_velocity: np.ndarray | None = None
    speed: np.ndarray | None = None
    angular_acceleration: np.ndarray | None = None

    @property
    def depth(self) -> np.ndarray:
        """Depths of the members, shape (m,) [m]."""
        return self.position[:, 2]


def last_tick(packets: Packets, members: np.ndarray | None = None) -> tuple[CallbackInput, CallbackInput]:
    """Copies of the values at the last tick: (measured, reference).

    members: indices of the members in the packets (m,); None (default) for all.
    """
    y, r = (_numbers(packets, packets.plan.layout.noted_rows[name], members) for name in ("measured", "reference"))
    measured_attitude, wanted_attitude = (rows[:, 3:12].reshape(-1, 3, 3) for rows in (y, r))
    headings = [np.arctan2(R[:, 1, 0], R[:, 0, 0]) for R in (measured_attitude, wanted_attitude)]
    measured = CallbackInput(
        y[:, :3], measured_attitude, y[:, 12:15], y[:, 18:21], headings[0], water_velocity=y[:, 15:18]
    )
    rates = {"speed": r[:, 19], "angular_acceleration": r[:, 20:23]}
    return measured, CallbackInput(r[:, :3], wanted_attitude, r[:, 12:15], r[:, 15:18], headings[1], **rates)


def _numbers(packets: Packets, places: range, members: np.ndarray | None) -> np.ndarray:
    """Rows of the memory by member, (m, rows) of float64."""
    rows = packets.laws.memory.view[:, places.start : places.stop]
    if members is not None:
        packet, lane = np.divmod(members, rows.shape[2])
        return rows[packet, :, lane].astype(np.float64)
    copied = np.array(rows.transpose(0, 2, 1), np.float64, order="C")
    return copied.reshape(-1, len(places))[: packets.members.count]


def write_answer(packets: Packets, values: np.ndarray) -> None:
    """Write the function's answer to the last tick: demands (m, 6), or commands (m, channels)."""
    controller = packets.plan.kernel_choice.controller
    assert controller is not None
    view, first = packets.laws.memory.view, controller.bus.answer
    count, width = values.shape[1], view.shape[2]
    padded = np.empty((view.shape[0] * width, count))
    padded[: len(values)], padded[len(values) :] = values, values[-1]
    view[:, first : first + count] = padded.reshape(-1, width, count).transpose(0, 2, 1)


def call_host(packets: Packets, t: float) -> None:
    """Call the function of a plan's controller with the last tick, at t [s], and write its answer."""
    controller = packets.plan.kernel_choice.controller
    assert controller is not None
    callback: Any = controller.callback
    measured, wanted = last_tick(packets)
    members = packets.members.indices
    where = f"callback {callback.key!r} at t = {t:.9g} s, members {members[0]} to {members[-1]}"
    try:
        returned = callback.function(t, measured, wanted, members)
    except Exception as error:
        error.add_note(where)
        raise
    channels = {key: count for key, (_, count) in controller.bus.commands.items()}
    values, shape = answered(where, returned), (packets.members.count, callback.answers(channels))
    if values.shape != shape:
        raise ValueError(f"{where}: returned shape {values.shape}. Return {shape}, a row for each member")
    write_answer(packets, values)
