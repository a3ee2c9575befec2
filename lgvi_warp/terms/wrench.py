"""A wrench that is held, or follows a schedule, in body axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.errors import Faults
from lgvi_warp.terms.base import Numbers, Packed, Setting, Term, knots, quantity

SHAPES = ("linear", "steps")


@dataclass(frozen=True, eq=False, kw_only=True)
class Wrench(Term):
    """Constant force and torque in body axes, about the body's origin.

    force: (3,) [N]; torque: (3,) [N m].
    """

    type: ClassVar[str] = "wrench"
    device: ClassVar[str] = "wrench"

    force: Any = quantity((3,), "N", (0.0, 0.0, 0.0))
    torque: Any = quantity((3,), "N m", (0.0, 0.0, 0.0))

    def present(self, own: Numbers) -> bool:
        """Whether some member has one."""
        return bool(np.any(own["force"]) or np.any(own["torque"]))

    def packed(self, own: Numbers, setting: Setting) -> Packed:
        """About the origin of the forces."""
        force, torque = own["force"], own["torque"]
        return Packed({"force": setting.frame.vector(force), "torque": setting.frame.torque(torque, force)})


@dataclass(frozen=True, eq=False, kw_only=True)
class WrenchSchedule(Term):
    """Force and torque in body axes from a table over time.

    times: (k,) [s], rising; force: (k, 3) [N]; torque: (k, 3) [N m]. interpolation: "linear" between the times, or
    "steps", each value held until the next time; constant before the first and after the last.
    """

    type: ClassVar[str] = "wrench_schedule"
    device: ClassVar[str] = "wrench_schedule"
    timed: ClassVar[bool] = True

    times: Any = quantity(("k",), "s")
    force: Any = quantity(("k", 3), "N")
    torque: Any = quantity(("k", 3), "N m", None)
    interpolation: str = "linear"

    def __post_init__(self) -> None:
        if self.torque is None:
            object.__setattr__(self, "torque", np.zeros(np.shape(self.force)))
        super().__post_init__()

    def check(self, faults: Faults) -> None:
        """Times must rise."""
        rising(faults, "times", self.times)
        faults.choice("interpolation", self.interpolation, SHAPES)

    def packed(self, own: Numbers, setting: Setting) -> Packed:
        """Two tables, of the force and of the torque about the origin of the forces."""
        force = setting.frame.vector(own["force"])
        torque = setting.frame.torque(own["torque"] + 0.0 * own["force"], own["force"] + 0.0 * own["torque"])
        tables = [knots(own["times"], values, self.interpolation == "steps") for values in (force, torque)]
        n = max(len(table) for table in tables)
        rows = np.concatenate([np.broadcast_to(table, (n, table.shape[1])) for table in tables], axis=1)
        return Packed({"count": own["times"].shape[1] - 1}, rows)


def rising(faults: Faults, key: str, values: np.ndarray) -> None:
    """Note a table whose places do not rise."""
    if np.any(np.diff(values) <= 0.0):
        faults.add(key, values, "is not rising", "sort the table and drop repetitions")
