# SPDX-License-Identifier: Apache-2.0
"""Events that depend on the covariance of a navigation filter."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any, ClassVar

from lgvi_warp.common.declared import text
from lgvi_warp.common.errors import refusal
from lgvi_warp.common.status import Status
from lgvi_warp.extensions.navigation import DEVICE
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, number
from lgvi_warp.physics.terms.events import Event


@dataclass(frozen=True, eq=False, kw_only=True)
class PositionUncertain(Event):
    """Stop a member at the tick at which the standard deviation of its filter's position exceeds a limit.

    The standard deviation of the position is sqrt(s_n^2 + s_e^2 + s_d^2), where s_n, s_e and s_d are the first three numbers
    of the signal "estimate_sigma". The signal need not be saved: a filter with `report = false` works, too.

    Args:
        sigma: Largest standard deviation of the position [m].
        filter: Name of the filter, an `lw.control.ErrorStateFilter`; "error_state_filter" by default.

    Raises:
        SceneError: If a number is invalid (see `Term`). A scene refuses the event if it has no such filter.

    Examples:
        >>> import lgvi_warp as lw
        >>> event = lw.events.PositionUncertain(sigma=20.0)
        >>> event.key, float(event.sigma)
        ('position_uncertain', 20.0)
    """

    type: ClassVar[str] = "position_uncertain"
    status: ClassVar[Status] = Status.POSITION_UNCERTAIN
    device: ClassVar[Any] = f"{DEVICE}.position_uncertain"
    timed: ClassVar[bool] = True
    # First of the rows in which that filter tells how sure it is; set for an event of a scene.
    row: ClassVar[int] = 0

    sigma: Any = number((), "m", above=0.0)
    filter: str = text("is not a name", "give the name of an error_state_filter", "error_state_filter")

    @property
    def follows(self) -> str:
        return self.filter

    def wired(self, bus: Any) -> Any:
        if bus is None or self.filter not in bus.done:
            remedy = 'give [[controller.sensors]] type = "error_state_filter", or its name'
            raise refusal(f"{self.key}.filter", self.filter, "is not the name of a filter of this scene", remedy)
        event = copy.copy(self)
        object.__setattr__(event, "row", bus.done[self.filter])
        return event

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        return Packed({"sigma": numbers["sigma"], "watched": self.row})
