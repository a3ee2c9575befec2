# SPDX-License-Identifier: Apache-2.0
"""An altimeter: the range to the sea floor along a beam."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.control.over_floor import packed_over, with_floor
from lgvi_warp.control.sensor import RANGE, Sensor
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number


@dataclass(frozen=True, eq=False, kw_only=True)
class Altimeter(Sensor):
    """A sensor of the range to the scene's floor along a beam fixed to the body, with the same errors as a `Sensor`.

    The range is 0 if the beam begins on or below the floor, and `most` if the beam ends above it. It is computed from
    the true position and attitude, not from the readings of other sensors. Readings are limited to 0 to `most`.

    Args:
        direction: Direction of the beam in body axes, (3,) of any length; (0, 0, 1) by default, down.
        point: Point at which the beam begins, (3,) [m] in body axes; zeros by default.
        most: Largest range of the beam [m]; 100 by default.
        floor: Name of the floor; "", the default, stands for the only floor of the scene.
        noise: Standard deviation of the noise of each reading [m]; 0 by default.
        bias: Constant error added to each reading [m]; 0 by default.
        drift: Standard deviation of the random walk after 1 s [m / s^1/2]; 0 by default.
        quantum: Readings are rounded to whole multiples of this length [m]; 0 by default, for no rounding.
        every: Number of ticks from one new reading to the next, a whole number; 1 by default.
        latency: Number of ticks after which a reading arrives, a whole number; 0 by default.
        dropout: Probability that a reading is lost, in which case the last reading is kept; 0 by default.
        burst: Mean length of a run of lost readings [ticks]; by default losses are independent.
        outlier: Probability that a reading is an outlier; by default there are no outliers.
        outlier_std: Standard deviation of the error that an outlier adds to the reading [m].

    Raises:
        SceneError: If `direction` has length 0, or for a reason listed at `Sensor`. A scene refuses an altimeter if it
            has no floor, or if it has several floors and `floor` names none of them.

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.control.Altimeter(direction=[1.0, 0.0, 1.0], most=30.0, noise=0.05).key
        'altimeter'
    """

    type: ClassVar[str] = "altimeter"
    of: ClassVar[str] = RANGE  # type: ignore[misc]  # no field of it: it measures nothing else
    # The floor; set for a part of a scene.
    ground: ClassVar[Any] = None

    direction: Any = number((3,), "1", (0.0, 0.0, 1.0))
    point: Any = number((3,), "m", (0.0, 0.0, 0.0))
    most: Any = number((), "m", 100.0, above=0.0)
    floor: str = ""

    @property
    def count(self) -> int:
        # One number, its range.
        return 1

    def shape_of(self, item: Any) -> tuple[Any, ...]:
        # The errors are scalars.
        return item.metadata["shape"] if item.name in ("direction", "point", "place") else ()

    def check(self, faults: Faults) -> None:
        super().check(faults)
        if not np.any(self.direction):
            faults.add(
                "direction", self.direction, "is not a direction", "give a vector of body axes, such as [0, 0, 1]"
            )

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        bad = super().unphysical(numbers)
        return bad | {"direction": bad["direction"] | ~np.any(numbers["direction"], axis=1)}

    def in_scene(self, faults: Faults, events: Sequence[Term], sensors: Sequence[Any]) -> Any:
        return with_floor(self, faults, events)

    def device_in(self, aligned: bool) -> Any:
        return f"altimeter:{','.join(('range', *self.chosen))}"

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The errors as those of a sensor; the beam; where the reading stands.
        errors = super().packed(numbers, context)
        beam = {"beam": unit(numbers["direction"]), "point": numbers["point"], "most": numbers["most"]}
        values = errors.values | beam | {"row": self.bus.ranges[self.key]}
        return packed_over(self.ground, context, values)._replace(memory=errors.memory)


def unit(direction: np.ndarray) -> np.ndarray:
    """Directions (n, 3), scaled to length 1."""
    return np.asarray(direction / np.linalg.norm(direction, axis=-1, keepdims=True))
