# SPDX-License-Identifier: Apache-2.0
"""The outcome of a block's members: status, failure, warnings and event of each."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from lgvi_warp.engine.plan import Plan
from lgvi_warp.statistics.ends import Ends


@dataclass
class MemberStatus:
    """The outcome of m members, arrays with one entry each.

    Attributes:
        status: (m,), of `Status`.
        failed_step: (m,), number of steps made before the failure or the event.
        failed_size: (m,), value that crossed its limit; for an event the fraction of the step made before it [1].
        chosen: (m, 2), adaptive steps made and tried; (m, 0) where steps are not adaptive.
        warnings: (m,), bits of `Warnings`.
        warning_step: (m,), steps made at the first crossing of the most serious warning.
        warning_value: (m,), value at that crossing.
        substeps: (m,), number of steps that were divided.
        event: (m,), number of the event that stopped the member, counted from 1; 0 for none.
    """

    status: np.ndarray
    failed_step: np.ndarray
    failed_size: np.ndarray
    chosen: np.ndarray
    warnings: np.ndarray
    warning_step: np.ndarray
    warning_value: np.ndarray
    substeps: np.ndarray
    event: np.ndarray

    def at(self, members: slice) -> MemberStatus:
        """The outcome of some members.

        Args:
            members: which of them.

        Returns:
            Views of their entries.
        """
        return MemberStatus(*(getattr(self, field.name)[members] for field in fields(self)))

    @classmethod
    def clear(cls, members: int, paces: int) -> MemberStatus:
        """The outcome of members that reached the end without a fault.

        Args:
            members: number of members, m.
            paces: number of columns of `chosen`: 2 for adaptive steps, else 0.

        Returns:
            An outcome whose entries are all zero.
        """
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
        """The time at which each member ended: at its event, at its failure, or at the end of the run.

        Args:
            plan: the plan of the run.

        Returns:
            (m,) [s].
        """
        # An event's size is the part of its step that was made before it.
        fraction = np.where(self.event != 0, self.failed_size, 0.0)
        return np.where(self.status != 0, (self.failed_step + fraction) * plan.grid.h, plan.grid.times[-1])

    def ends(self, plan: Plan) -> Ends:
        """How and when the members ended, as statistics need it.

        Args:
            plan: the plan of the run.

        Returns:
            Statuses, events and end times of the m members.
        """
        events = tuple(event.key for event in plan.ensemble.scene.events)
        return Ends(self.status, self.event, self.end_time(plan), events)
