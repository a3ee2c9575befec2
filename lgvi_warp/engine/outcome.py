# SPDX-License-Identifier: Apache-2.0
"""The outcome of a block's members: status, failure, warnings and event of each."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from lgvi_warp.engine.plan import Plan
from lgvi_warp.statistics.ends import Ends


@dataclass
class MemberStatus:
    """The outcome of m members, arrays with one entry each."""

    status: np.ndarray  # (m,), of `Status`
    failed_step: np.ndarray  # (m,), steps made before the failure or the event
    failed_size: np.ndarray  # (m,), what crossed its limit; of an event the part of the step made before it [1]
    chosen: np.ndarray  # (m, 2), adaptive steps made and tried; (m, 0) where steps are not adaptive
    warnings: np.ndarray  # (m,), bits of `Warnings`
    warning_step: np.ndarray  # (m,), steps made at the first crossing of the most serious warning
    warning_value: np.ndarray  # (m,), value at that crossing
    substeps: np.ndarray  # (m,), steps that were divided
    event: np.ndarray  # (m,), number of the event that stopped the member, counted from 1; 0 for none

    def at(self, members: slice) -> MemberStatus:
        """The outcome of some members, as views."""
        return MemberStatus(*(getattr(self, field.name)[members] for field in fields(self)))

    @classmethod
    def clear(cls, members: int, paces: int) -> MemberStatus:
        """The outcome of members that reached the end without a fault; paces: number of columns of `chosen`."""
        steps, values = (lambda: np.zeros(members, np.int64)), (lambda: np.zeros(members))
        return cls(
            status=np.zeros(members, np.uint8),
            failed_step=steps(),
            failed_size=values(),
            chosen=np.zeros((members, paces), np.int64),
            warnings=np.zeros(members, np.uint16),
            warning_step=steps(),
            warning_value=values(),
            substeps=steps(),
            event=np.zeros(members, np.uint8),
        )

    def end_time(self, plan: Plan) -> np.ndarray:
        """Time (m,) [s] at which each member ended: its event, its failure, or the end of the run."""
        # An event's size is the part of its step that was made before it.
        fraction = np.where(self.event != 0, self.failed_size, 0.0)
        return np.where(self.status != 0, (self.failed_step + fraction) * plan.grid.h, plan.grid.times[-1])

    def ends(self, plan: Plan) -> Ends:
        """Outcomes and end times of the members, as statistics need them."""
        events = tuple(event.key for event in plan.ensemble.scene.events)
        return Ends(self.status, self.event, self.end_time(plan), events)
