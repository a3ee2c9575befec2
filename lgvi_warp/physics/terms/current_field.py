# SPDX-License-Identifier: Apache-2.0
"""A current on a grid in space and time, such as an ocean model gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number


@dataclass(frozen=True, eq=False, kw_only=True)
class CurrentField(Term):
    """A current on a regular grid in north, east and depth, and in time if that is given: linear in each, held outside.

    Several fields of one grid, of an ensemble forecast say, are scenarios: `scenario` says which, and may vary by member.

    Args:
        velocities: Velocities of the water at the nodes, (x, y, z, 3) [m/s] in inertial axes; (t, x, y, z, 3) with `times`;
            (s, t, x, y, z, 3), or (s, x, y, z, 3) without `times`, with scenarios.
        origin: Place of the first node, (3,) [m]: north, east, depth; zeros by default.
        spacing: Distance of the nodes along north, east and depth, (3,) [m].
        times: Time of the first field and time between two of them, (2,) [s]; None, the default: they do not change.
        scenario: Which of the scenarios, a whole number from 0; 0 by default.

    Raises:
        SceneError: Where the shape of `velocities` does not fit, and as `Term`.

    Examples:
        An eddy that turns once in 1,000 s about the middle of a square of 200 m.

        >>> import lgvi_warp as lw
        >>> import numpy as np
        >>> x = np.linspace(-100.0, 100.0, 21)
        >>> north, east = np.meshgrid(x, x, indexing="ij")
        >>> turn = 2.0 * np.pi / 1000.0
        >>> eddy = np.stack([-turn * east, turn * north, 0.0 * north], axis=-1)[:, :, None]
        >>> field = lw.terms.CurrentField(velocities=eddy, origin=[-100.0, -100.0, 0.0], spacing=[10.0, 10.0, 10.0])
        >>> field.velocities.shape
        (1, 1, 21, 21, 1, 3)
    """

    type: ClassVar[str] = "current_field"

    velocities: Any = number(("s", "t", "x", "y", "z", 3), "m/s")
    origin: Any = number((3,), "m", (0.0, 0.0, 0.0))
    spacing: Any = number((3,), "m", above=0.0)
    times: Any = number((2,), "s", None, optional=True)
    scenario: Any = number((), "1", 0.0, least=0.0)

    def __post_init__(self) -> None:
        velocities = np.asarray(self.velocities)
        if velocities.ndim == 4:
            velocities = velocities[None, None]
        elif velocities.ndim == 5:
            velocities = velocities[:, None] if self.times is None else velocities[None]
        if velocities.ndim == 6:
            object.__setattr__(self, "velocities", velocities)
        super().__post_init__()

    @property
    def timed(self) -> bool:  # type: ignore[override]
        return self.times is not None

    def check(self, faults: Faults) -> None:
        if self.times is None and self.velocities.shape[1] > 1:
            faults.add(
                "times", None, f"is missing for {self.velocities.shape[1]} fields", "give [first, between] in seconds"
            )
        if self.times is not None and not self.times[1] > 0.0:
            faults.add("times", self.times, "has no time between two fields", "give [first, between] in seconds")
        if _no_scenario(self.scenario[None], len(self.velocities)).any():
            faults.add("scenario", self.scenario, f"is none of {len(self.velocities)}", "give a whole number from 0")

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        bad = super().unphysical(numbers)
        return bad | {"scenario": bad["scenario"] | _no_scenario(numbers["scenario"], len(self.velocities))}

    def present(self, numbers: Numbers) -> bool:
        return bool(np.any(numbers["velocities"]))

    def device_in(self, aligned: bool) -> str:
        return "current_field:time" if self.timed else "current_field"

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        field = numbers["velocities"]
        counts = np.array(field.shape[1:6])
        # Rows from one node to the next along each axis; 0 where there is one node.
        rows = 3 * np.array([np.prod(counts[i + 1 :], dtype=np.int64) for i in range(5)])
        words = dict(
            zip(("scenario", "time", "north", "east", "depth"), np.where(counts > 1, rows, 0).tolist(), strict=True)
        )
        times = numbers.get("times", np.array([[0.0, 1.0]]))
        values = {
            "origin": numbers["origin"],
            "inverse": 1.0 / numbers["spacing"],
            "last": (counts[2:] - 1.0)[None],
            "start": times[:, 0],
            "inverse_time": 1.0 / times[:, 1],
            "last_time": np.array([counts[1] - 1.0]),
            "chosen": numbers["scenario"],
        }
        return Packed(values | words, field.reshape(len(field), -1))

    def water(self, numbers: Numbers, position: np.ndarray, time: np.ndarray, parameters: Numbers) -> np.ndarray:
        from scipy.ndimage import map_coordinates

        n = position.shape[1]
        field = numbers["velocities"]
        times = numbers.get("times", np.array([[0.0, 1.0]]))
        result = np.empty(position.shape)
        for i in range(n):
            values = field[i % len(field)][int(numbers["scenario"][i % len(numbers["scenario"])])]
            first, between = times[i % len(times)]
            place = (position[:, i] - numbers["origin"][i % len(numbers["origin"])]) / numbers["spacing"][
                i % len(numbers["spacing"])
            ]
            at = np.column_stack([(time - first) / between, place]).T
            for axis in range(3):
                result[:, i, axis] = map_coordinates(values[..., axis], at, order=1, mode="nearest")
        return result


def _no_scenario(scenario: np.ndarray, count: int) -> np.ndarray:
    """Which numbers (n,) are no index of so many scenarios."""
    return (scenario != np.rint(scenario)) | (scenario > count - 1)
