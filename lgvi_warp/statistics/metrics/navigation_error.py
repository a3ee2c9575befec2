# SPDX-License-Identifier: Apache-2.0
"""Distance of each member's estimated position from the true one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from lgvi_warp.common.arguments import flag
from lgvi_warp.common.errors import Faults, closest, refusal
from lgvi_warp.control.signals import NAVIGATION_ERROR
from lgvi_warp.statistics.metrics.metric import Metric, State, Ticks, accumulated
from lgvi_warp.statistics.values.quantity import Quantity

if TYPE_CHECKING:
    from lgvi_warp.sampling.members import Members
    from lgvi_warp.statistics.values.samples import Fields

FIELDS = (NAVIGATION_ERROR, "position")
# Numbers that the metric may be, and their units.
UNITS = {"end": "m", "largest": "m", "percent": "%"}


@dataclass(frozen=True, eq=False)
class NavigationError(Metric):
    """Metric: size of a member's `navigation_error`, the estimated minus the true position.

    Manufacturers of logs and inertial systems state the error as in "percent": the error at the end divided by the
    distance travelled over ground, along straight lines between ticks. It is NaN for a member that does not move.

    Args:
        of: "end", the default: error at the member's last tick [m]; "largest": largest error over all ticks of this run
            [m]; "percent": error at the end in percent of the distance travelled [%], not for a run that continues
            another.
        horizontal: True uses only the north and east components; by default False.

    Raises:
        SceneError: if `of` is none of these names; or, at the start of a run, if nothing estimates the position, or if
            "percent" is requested for a run that continues another.

    Examples:
        >>> import lgvi_warp as lw
        >>> metric = lw.metrics.NavigationError("percent", horizontal=True, then=[lw.statistics.Quantiles(levels=(0.95,))])
        >>> metric.key, metric.unit
        ('navigation percent', '%')
    """

    type: ClassVar[str] = "navigation"
    default: ClassVar[str | None] = "end"

    horizontal: bool = False

    def check(self, faults: Faults) -> None:
        super().check(faults)
        with faults.including():
            flag("navigation.horizontal", self.horizontal)
        if flag("navigation.measured", self.measured):
            faults.add("measured", self.measured, "has no meaning for what compares both", "leave it out")

    def meant(self) -> Quantity:
        if not isinstance(self.of, str) or self.of not in UNITS:
            raise refusal("navigation.of", self.of, "is not known", closest(str(self.of), UNITS))

        def numbers(samples: Fields, members: Members) -> np.ndarray:
            if self.of == "percent" and getattr(members, "final", None) is not None:
                fault = "is of the distance from the start of the mission on, and this run goes on from another"
                raise refusal("navigation.of", self.of, fault, 'give "end", or run the mission as one run')
            error, place = (samples[name].astype(np.float64, copy=False) for name in FIELDS)
            size = np.linalg.norm(error[..., :2] if self.horizontal else error, axis=-1, keepdims=True)
            return np.concatenate([size, place], axis=-1)

        labels = (f"error {self.of}", *(f"position[{i}]" for i in range(3)))
        return Quantity(self.of, numbers, UNITS[self.of], FIELDS, labels, needs_limit=True)

    @property
    def key(self) -> str:
        return self.name or f"{self.type} {self.of}"

    def begin(self, x: np.ndarray) -> State:
        return {"last": x[0].copy(), "most": x[0].copy(), "run": np.zeros(x.shape[1])}

    def follow(self, state: State, ticks: Ticks) -> State:
        way, last = np.linalg.norm(ticks.x[:, 1:] - ticks.before[:, 1:], axis=1), state["last"]
        for _, size, alive in ticks.rows(ticks.x[:, 0]):
            last = np.where(alive, size, last)
        most = np.maximum(state["most"], ticks.of_living(ticks.x[:, 0], 0.0).max(axis=0))
        return {"last": last, "most": most, "run": accumulated(state["run"], ticks, way)}

    def finish(self, state: State) -> np.ndarray:
        if self.of == "percent":
            return np.where(state["run"] > 0.0, 100.0 * state["last"] / state["run"], np.nan)
        return state["most" if self.of == "largest" else "last"]
