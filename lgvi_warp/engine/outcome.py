"""To be said in one sentence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lgvi_warp.engine.plan import Plan
from lgvi_warp.statistics.ends import Ends


@dataclass
class Outcome:
    """What a block's members came to: arrays over its members. chosen: steps made and tried (count, 2), where they choose.

    warnings: bits of Warnings; warning_step, warning_value: steps made and value at the first crossing of the most serious
    one. substeps: steps that were divided. event: the number of the event that stopped a member, from 1; 0 for none.
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

    @classmethod
    def clear(cls, members: int, paces: int = 0) -> Outcome:
        """Of so many members that came through without fault; paces: columns of `chosen`."""
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
        """(n,) [s], until when each member went on: its event, its failure, or the end of the run."""
        # An event's size is the part of its step that was made before it.
        part = np.where(self.event != 0, self.failed_size, 0.0)
        return np.where(self.status != 0, (self.failed_step + part) * plan.grid.h, plan.grid.times[-1])

    def ends(self, plan: Plan) -> Ends:
        """How and when the members ended, for statistics."""
        events = tuple(one.key for one in plan.ensemble.scene.events)
        return Ends(self.status, self.event, self.end_time(plan), events)
