# SPDX-License-Identifier: Apache-2.0
"""Runs whose numbers carry slopes: packing of members and their shifted copies, and slopes of the samples.

Members and copies are packed together; the differences of each number are written next to the number in its lanes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.common.errors import refusal
from lgvi_warp.engine import arrays
from lgvi_warp.engine.arrays import Writing
from lgvi_warp.engine.packing import Packing
from lgvi_warp.engine.shared import AXES, FRAME
from lgvi_warp.physics import inertia
from lgvi_warp.physics.inertia import Frame
from lgvi_warp.sampling.members import Members, Shifted
from lgvi_warp.scene.copies import BETWEEN, FOUR_POINTS, OFFSETS, SIX_POINTS, repeats

# A plan, whose module imports others that import this one.
Plan = Any

# Two differences of a number may differ by so much of it, and of its round-off; beyond it is not smooth. A number that is 0,
# or almost, is one of several of size 1, whose round-off it has.
SMOOTH, ROUND_OFF = 1e-7, 64.0 * 2.0**-52


class Slopes:
    """Slopes of the packed numbers of some members, by each number.

    moved: whether any packed number depends on the number, for each number.
    """

    def __init__(self, plan: Plan):
        self._targets = plan.ensemble.copies.targets
        self._spec = plan.spec
        self._repeats = repeats(len(self._targets))
        self.moved = [False] * len(self._targets)
        self._steps: np.ndarray = np.empty((0, len(self._targets)))

    def begin(self, shifted: Shifted) -> None:
        """Start with the members whose numbers follow."""
        self._steps = shifted.steps

    @property
    def writing(self) -> Writing:
        """Functions that write numbers and their slopes into dual lanes."""
        return Writing(self._put, self._put_rows)

    def of(self, numbers: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        """Numbers (m, ...) of members and their slopes, from numbers (m times copies, ...) with the copies."""
        by_member = numbers.reshape(len(self._steps), self._repeats, *numbers.shape[1:])
        values = by_member[:, 0]
        return values, [self._slope(by_member, values, i) for i in range(len(self._targets))]

    def _slope(self, by_member: np.ndarray, values: np.ndarray, i: int) -> np.ndarray:
        around = by_member[:, 1 + i * len(OFFSETS) : 1 + (i + 1) * len(OFFSETS)]
        here = values[:, None]
        # What does not change has no slope at all, also where it is infinite.
        changes = np.where(around == here, 0.0, around - here)
        if not changes.any():
            return np.zeros(values.shape)
        if around.dtype.kind in "biu":
            raise self._refused(i, "is counted in whole steps or looks there, and so has no derivative")
        self.moved[i] = True
        slope, rough = (np.einsum("j,mj...->m...", weights, changes) for weights in (SIX_POINTS, FOUR_POINTS))
        # Copies may agree with each other beside a member that stands elsewhere: what they tell of it is compared too.
        beside = np.einsum("j,mj...->m...", BETWEEN, changes)
        most = SMOOTH * np.abs(slope).max() + ROUND_OFF * np.abs(values).max(initial=1.0)
        # A difference that is no number belongs to a member that the run marks as failed.
        if np.any(np.abs(slope - rough) > most) or np.any(np.abs(beside) > most):
            raise self._refused(i, "is where what follows from it has a kink or a jump, and so no derivative")
        steps = self._steps[:, i].reshape(-1, *(1,) * (values.ndim - 1))
        return np.asarray(slope / steps)

    def _refused(self, i: int, problem: str) -> Exception:
        return refusal("tangents", self._targets[i].label, problem, "leave it out, or change it a little")

    def check_moved(self) -> None:
        """Refuse a number on which no number of the kernel depends."""
        for target, moved in zip(self._targets, self.moved, strict=True):
            if not moved:
                problem = "changes nothing that a run computes with, or in whole steps alone"
                raise refusal("tangents", target.label, problem, "leave it out")

    def places(self) -> Iterator[slice]:
        """Slices of a lane that hold the slopes by each number."""
        width = self._spec.width
        for i in range(1, 1 + self._spec.tangents):
            yield slice(i * width, (i + 1) * width)

    def _put(self, target: np.ndarray, column: Any) -> None:
        lanes = target.ndim > 1
        if np.ndim(column) == 0 or len(column) == 1 or len(column) == len(self._steps):
            arrays.put(target[..., : self._spec.width] if lanes else target, column)
            return
        values, slopes = self.of(column)
        if not lanes:
            # One number a packet has no lanes, and so no slopes.
            for i, slope in enumerate(slopes):
                if slope.any():
                    raise self._refused(i, "sets what all vehicles of a packet share, and so has no derivative here")
            arrays.put(target, values[:1])
            return
        arrays.put(target[..., : self._spec.width], values)
        for place, slope in zip(self.places(), slopes, strict=True):
            arrays.put(target[..., place], slope)

    def _put_rows(self, target: np.ndarray, rows: np.ndarray) -> None:
        if len(rows) == 1:
            arrays.put_rows(target[..., : self._spec.width], rows)
            return
        values, slopes = self.of(rows)
        arrays.put_rows(target[..., : self._spec.width], values)
        for place, slope in zip(self.places(), slopes, strict=True):
            arrays.put_rows(target[..., place], slope)


class CopiesPacking(Packing):
    """Packing of members and their copies for the kernel."""

    def __init__(self, plan: Plan, members: Members):
        self._repeats = repeats(len(plan.ensemble.copies.targets))
        super().__init__(plan, members)

    def _framed(self) -> dict[str, Any]:
        # Principal axes may come in any order and sense: those of the copies are to go on from the member's.
        numbers = super()._framed()
        return numbers | {name: self._like_members(*numbers[name]) for name in (AXES, FRAME)}

    def _like_members(self, frame: Frame, U: np.ndarray, coupling: np.ndarray) -> tuple[Frame, np.ndarray, np.ndarray]:
        if frame.whole is not None and len(frame.J) > 1:
            # The kernel computes with the whole inertia, and not with the moments.
            return replace(frame, J=np.repeat(self.of_members(frame.J), self._repeats, axis=0)), U, coupling
        if len(frame.Q) == 1:
            return frame, U, coupling
        like = np.repeat(self.of_members(frame.Q), self._repeats, axis=0)
        P = inertia.nearest_axes(frame.Q, like, ordered=self.plan.method.turns)
        return inertia.in_order(frame, P), inertia.in_axes(P, U), coupling

    def _scale(self, frame: Frame) -> np.ndarray:
        # A unit of the kernel's: the same for a member and its copies.
        scale = super()._scale(frame)
        return scale if len(scale) == 1 else np.repeat(scale[:: self._repeats], self._repeats)

    def frame_of_members(self) -> Frame:
        """The frame of the members themselves."""
        own: dict[str, Any] = {
            item.name: None if value is None else self.of_members(value)
            for item in dataclasses.fields(Frame)
            for value in (getattr(self.frame, item.name),)
        }
        return Frame(**own)

    def of_members(self, values: np.ndarray) -> np.ndarray:
        """Values of the members themselves, from values of members and copies."""
        return values if len(values) == 1 else values[:: self._repeats]


def slopes_of_frame(slopes: Slopes, frame: Frame) -> list[tuple[np.ndarray, np.ndarray]]:
    """Slopes of the axes Q and of the origin of a frame of members and copies, by each number."""
    each = [slopes.of(v)[1] if len(v) > 1 else None for v in (frame.Q, frame.origin)]
    still = np.zeros((1, 3, 3)), np.zeros((1, 3))
    count = len(slopes.moved)
    return [
        (still[0] if each[0] is None else each[0][i], still[1] if each[1] is None else each[1][i]) for i in range(count)
    ]


class Jacobians:
    """Keeper of the slopes of every sample, by name (k times, n members, ..., numbers)."""

    def __init__(self, plan: Plan):
        self.fields = {
            name: np.empty(
                (len(plan.grid.times), plan.ensemble.members, *plan.layout.table[name].shape, plan.spec.tangents)
            )
            for name in plan.fields
        }

    def open(self, plan: Plan, block: Any, members: Members) -> _BlockJacobians:
        """The keeper of a block's slopes."""
        return _BlockJacobians({name: values[:, block.first : block.stop] for name, values in self.fields.items()})

    def merge(self, block: Any, part: Any) -> None:
        """Do nothing: threads of this process write into their places."""


@dataclasses.dataclass
class _BlockJacobians:
    places: dict[str, np.ndarray]

    def take(self, when: slice, samples: Any) -> None:
        """Ignore the samples."""

    def take_slopes(self, when: slice, slopes: list[dict[str, np.ndarray]]) -> None:
        """Write the slopes by each number into their places."""
        for i, by_name in enumerate(slopes):
            for name, place in self.places.items():
                place[when, ..., i] = by_name[name]

    def close(self, outcome: Any) -> None:
        """Do nothing at the end."""
