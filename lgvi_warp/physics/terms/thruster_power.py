# SPDX-License-Identifier: Apache-2.0
"""The electrical power of thrusters on the host, from a table of watts or from the propeller's torque and shaft speed."""

from __future__ import annotations

from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.terms.base import Numbers, knots, side_by_side
from lgvi_warp.physics.terms.thrust_curves import table_values

# Fields of the power; of a shaft with one number for each thruster.
SHAFT = ("shaft_speed", "efficiency")


def kind_of(term: Any) -> str:
    """Relation of power to command: "watts" for a table, "shaft" for torque times shaft speed, "" if none is given."""
    if term.power is not None:
        return "watts"
    return "shaft" if term.shaft_speed is not None else ""


def settle(term: Any, count: int) -> None:
    """Fill in fields that follow from other fields; for use before the fields are checked."""
    if term.power is not None:
        if term.power_commands is None:
            object.__setattr__(term, "power_commands", term.table_commands)
        if np.ndim(np.asarray(term.power, dtype=object)) == 1:
            object.__setattr__(term, "power", [[value] * count for value in term.power])
    term.repeat(count, *SHAFT)
    if term.shaft_speed is not None and term.efficiency is None:
        object.__setattr__(term, "efficiency", np.ones(count))


def check(term: Any, faults: Faults) -> None:
    """Add a fault for each field of the power that has no effect, or that needs another field."""
    if term.power is not None and term.shaft_speed is not None:
        faults.add("power", term.power, "is given beside shaft_speed", "keep one of them")
    if term.power is not None and term.power_commands is None:
        faults.add("power", term.power, "is given without power_commands", "give the commands (q,) of the table")
    if term.power is None and term.power_commands is not None:
        faults.add("power_commands", term.power_commands, "is given without power", "give the power (q, n) [W]")
    if term.shaft_speed is not None and term.torque_coefficient is None:
        remedy = "give the propeller's torque, or a table: power_commands and power"
        faults.add("shaft_speed", term.shaft_speed, "is given without torque_coefficient", remedy)
    if term.shaft_speed is None and term.efficiency is not None:
        faults.add("efficiency", term.efficiency, "is given without shaft_speed", "give both, or a table of the power")


def shaft_rows(numbers: Numbers) -> tuple[np.ndarray, np.ndarray]:
    """Power per |n|^3, and loss of power per n |n| and advance speed, (1 or n, units)."""
    k = numbers["torque_coefficient"]
    speed = numbers["shaft_speed"] / numbers["efficiency"]
    loss = numbers.get("torque_loss", np.zeros_like(k))
    return speed * np.abs(k), speed * np.sign(k) * loss


def rows(term: Any, numbers: Numbers) -> tuple[np.ndarray, int]:
    """Rows (1 or n, rows) of all thrusters for their device code, and the number of intervals of a table."""
    if kind_of(term) == "watts":
        at, values = numbers["power_commands"], numbers["power"]
        tables = [knots(at, values[:, :, i : i + 1]) for i in range(values.shape[2])]
        return side_by_side(*tables), at.shape[1] - 1
    pair = np.stack(np.broadcast_arrays(*shaft_rows(numbers)), axis=-1)
    return pair.reshape(len(pair), -1), 0


def at_rest(term: Any, numbers: Numbers, w: np.ndarray) -> np.ndarray:
    """Power (1 or n, units) [W] at commands w (1 or n, units) beyond the dead band, at zero speed through the water."""
    if kind_of(term) == "watts":
        return table_values(numbers["power_commands"], numbers["power"], w)
    per_cube, _ = shaft_rows(numbers)
    return np.asarray(per_cube * np.abs(w) ** 3)
