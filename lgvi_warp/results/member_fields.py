# SPDX-License-Identifier: Apache-2.0
"""Records of each member besides samples, one definition per field, used in memory, files and stores."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.status import Status, Warnings, stopped

if TYPE_CHECKING:
    from lgvi_warp.engine.outcome import MemberStatus
    from lgvi_warp.engine.plan import Plan


@dataclass(frozen=True)
class MemberField:
    """One number of each member: its name, type and attributes, and the function that computes it.

    dtype: NumPy's type string.
    attributes: CF attributes.
    of: Function of a plan and an outcome that returns the values, shape (n,).
    when: Function of a plan that tells whether its runs have the field; default always.
    """

    name: str
    dtype: str
    attributes: dict[str, Any]
    of: Callable[[Plan, MemberStatus], np.ndarray]
    when: Callable[[Plan], bool] = lambda plan: True


def _failure_time(plan: Plan, outcome: MemberStatus) -> np.ndarray:
    """Time of the last good state, or of the event [s]; NaN for a member without failure or event."""
    if not outcome.status.any():
        return np.full(len(outcome.status), np.nan)
    return np.where(outcome.status != 0, outcome.end_time(plan), np.nan)


def _failure_value(plan: Plan, outcome: MemberStatus) -> np.ndarray:
    """The value that crossed its limit; 0 for an event, NaN for a member without failure or event."""
    if not outcome.status.any():
        return np.full(len(outcome.status), np.nan)
    size = np.where(stopped(outcome.status), 0.0, outcome.failed_size)
    return np.where(outcome.status != 0, size, np.nan)


def _warning_time(plan: Plan, outcome: MemberStatus) -> np.ndarray:
    """Time when the most serious warning was first seen [s]; NaN without a warning."""
    if not outcome.warnings.any():
        return np.full(len(outcome.status), np.nan)
    return np.where(outcome.warnings != 0, outcome.warning_step * plan.grid.h, np.nan)


def _warning_value(plan: Plan, outcome: MemberStatus) -> np.ndarray:
    """The value that was seen at that time; NaN without a warning."""
    if not outcome.warnings.any():
        return np.full(len(outcome.status), np.nan)
    return np.where(outcome.warnings != 0, outcome.warning_value, np.nan)


def _adaptive(plan: Plan) -> bool:
    return plan.method.adaptive


def _alike(plan: Plan) -> bool:
    """Whether several events of the scene have the same status, so that the status does not identify the event."""
    statuses = [event.status for event in plan.ensemble.scene.events]
    return len(set(statuses)) < len(statuses)


STATUS = {
    "long_name": "outcome of the member",
    "flag_values": [int(status) for status in Status],
    "flag_meanings": " ".join(status.name.lower() for status in Status),
}
WARNINGS = {
    "long_name": "bits of lgvi_warp.Warnings",
    "flag_masks": [int(bit) for bit in Warnings],
    "flag_meanings": " ".join(str(bit.name).lower() for bit in Warnings),
}
# Fields of every run.
EVERY = (
    MemberField("status", "|u1", STATUS, lambda plan, outcome: outcome.status),
    MemberField("failure_time", "<f8", {"long_name": "time of the last good state of a member that failed or of its event",
                                        "units": "s"}, _failure_time),
    MemberField("failure_value", "<f8", {"long_name": "size that crossed its limit", "units": "1"}, _failure_value),
    MemberField("warnings", "<u2", WARNINGS, lambda plan, outcome: outcome.warnings),
    MemberField("warning_time", "<f8", {"long_name": "first crossing of the most serious warning", "units": "s"},
                _warning_time),
    MemberField("warning_value", "<f8", {"long_name": "value at that crossing", "units": "1"}, _warning_value),
    MemberField("substeps", "<i8", {"long_name": "steps that were divided", "units": "1"},
                lambda plan, outcome: outcome.substeps),
)  # fmt: skip
FIELDS = (
    *EVERY,
    MemberField("steps_made", "<i8", {"long_name": "steps made", "units": "1"},
                lambda plan, outcome: outcome.chosen[:, 0], _adaptive),
    MemberField("steps_tried", "<i8", {"long_name": "steps tried", "units": "1"},
                lambda plan, outcome: outcome.chosen[:, 1], _adaptive),
    MemberField("event", "|u1", {"long_name": "event of the scene that stopped the member, counted from 1; 0 for none",
                                 "units": "1"}, lambda plan, outcome: outcome.event, _alike),
)  # fmt: skip


def present(plan: Plan) -> tuple[MemberField, ...]:
    """Select the fields that a run of this plan has."""
    return tuple(member_field for member_field in FIELDS if member_field.when(plan))


def size(plan: Plan) -> int:
    """Compute the size of a member's fields [bytes]."""
    return sum(np.dtype(item.dtype).itemsize for item in present(plan))


def member_fields(plan: Plan, outcome: MemberStatus) -> dict[str, np.ndarray]:
    """Compute the fields of an outcome's members: arrays (n,) by name."""
    return {item.name: item.of(plan, outcome).astype(item.dtype, copy=False) for item in present(plan)}
