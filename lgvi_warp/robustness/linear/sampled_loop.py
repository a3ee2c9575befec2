# SPDX-License-Identifier: Apache-2.0
"""The linearised closed loops of many members, for any factor on the demand and any delay, from a few launches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from lgvi_warp.control.loop_gain import ADDED, FACTOR, of_all
from lgvi_warp.robustness.linear.bench import Motion, MotionBench
from lgvi_warp.robustness.linear.differences import STEP, Differences, Row
from lgvi_warp.robustness.linear.linearize import remembered

DELAY = "controller.delay"
# Matrices whose eigenvalues are sought at once, by the number of their entries.
ENTRIES = 4_000_000
# Differences err by some 1e-10: what a law sees or moves by less than this, of numbers of size 1, it does not.
SEES = 1e-7
# An eigenvalue so near to the unit circle is on it.
ON_CIRCLE = 1e-9
# What no law sees may grow by this a period: three neutral modes in a row, as rate, angle and place, are known no better.
NEUTRAL = 1e-3


def delayed(bench: MotionBench, motion: Motion, k: int, steps: np.ndarray) -> Motion:
    """The motions after a tick at a steady motion, with delays (m,) in steps."""
    bus: Any = bench.bus
    memory = motion.copied_memory()
    of_bus, count = memory[""], bus.channels
    commands = of_bus[:, :count]
    of_bus[:, bus.acting : bus.acting + 2 * count] = np.tile(commands, 2)
    of_bus[:, bus.acting + 2 * count] = k + steps % bench.every
    memory["controller"] = np.tile(commands, int((steps // bench.every).max()) + 2)
    return replace(motion, memory=memory)


class Opened(NamedTuple):
    """Loops of some members, opened at their demands: x' = A x + B w; the laws demand w = C x at the tick.

    some: (m,), A: (m, n, n), B: (m, n, r), C: (m, r, n).
    """

    some: np.ndarray
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray

    def at(self, component: int) -> Opened:
        """The same loops, opened only at one component of the demand; all other components stay closed."""
        others = np.arange(self.B.shape[2]) != component
        A = self.A + self.B[:, :, others] @ self.C[:, others]
        return Opened(self.some, A, self.B[:, :, ~others], self.C[:, ~others])


class SampledLoop:
    """Loops x' = P x + Q1 u(q ticks ago) + Q0 u(one tick earlier); the tick computes u' and the parts' memory from x'.

    u' is affine in the factor. P, Q1 and Q0 for each delay within a period, and the derivatives of the tick, are
    central differences in lanes. The attribute `moves` (n,) is True if the demand of the loop has any effect. apart:
    components of the demand at which the loop is opened.
    """

    def __init__(self, bench: MotionBench, places: np.ndarray, motion: Motion, k: int, apart: Sequence[int] = ()):
        bus: Any = bench.bus
        n, C, self.every = len(places), bus.channels, bench.every
        zero = np.zeros(n)
        still = delayed(bench, motion, k, np.zeros(n, np.int64))
        terms, parts = remembered(bench, still.memory, terms=True), remembered(bench, still.memory, terms=False)
        parts = [row for row in parts if row.key != "controller"]
        commands = [Row("", i, f"command {i}") for i in range(C)]
        acting = [Row("", bus.acting + i, f"acting {i}") for i in range(C)]
        s = 12 + len(terms)
        self._bounded = np.ones(n, bool)
        of_period = Differences(bench, k, bench.every, [*terms, *acting, *parts], [*terms, *commands, *parts])

        def tick(factors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            """The derivatives of a period and of the tick, with factors (6,) on the demand."""
            numbers = {FACTOR: np.tile(factors, (n, 1)), DELAY: zero}
            derivatives = self._without_failed(of_period(places, still, numbers))
            # A tick sees the motion alone: what it does of x is found behind the period that was between.
            of_motion = np.linalg.solve(
                np.swapaxes(derivatives[:, :12, :12], 1, 2), np.swapaxes(derivatives[:, s:, :12], 1, 2)
            )
            return derivatives, np.concatenate([np.swapaxes(of_motion, 1, 2), derivatives[:, s:, s + C :]], axis=2)

        without = tick(np.zeros(6))[1]
        derivatives, with_loop = tick(np.ones(6))
        self._P, total = derivatives[:, :s, :s], derivatives[:, :s, s : s + C]
        # [u, parts] by [x, parts]: of the laws outside of the loop, and what the loop adds.
        self._tick, self._more = without, with_loop - without
        self._each = [with_loop - tick(1.0 - np.eye(6)[i])[1] for i in apart]

        def written(i: int) -> np.ndarray:
            """Effect of a unit of component i of the demand on commands and parts at a tick (n, C + m)."""
            ends = []
            for sign in (1.0, -1.0):
                numbers = {FACTOR: of_all(zero + 1.0), ADDED: np.tile(sign * STEP * np.eye(6)[i], (n, 1)), DELAY: zero}
                after = bench.run(places, still, k, k + bench.every, numbers).memory
                ends.append(np.stack([after[row.key][:, row.row] for row in (*commands, *parts)], axis=1))
            return np.nan_to_num((ends[0] - ends[1]) / (2.0 * STEP))

        self._written = [written(i) for i in apart]
        self._late = [total]
        of_late = Differences(bench, k, bench.every, acting, terms, motion=False)
        for steps in range(1, bench.every):
            later = delayed(bench, motion, k, np.full(n, steps))
            numbers = {FACTOR: of_all(zero + 1.0), DELAY: zero + steps * bench.plan.grid.h}
            self._late.append(self._without_failed(of_late(places, later, numbers)))
        self._C, self._s, self._m = C, s, len(parts)
        self.moves = np.abs(total @ self._more[:, :C]).max(axis=(1, 2)) > 0.0
        self._axes, self._ranks = self._decomposed()

    def _decomposed(self) -> tuple[np.ndarray, np.ndarray]:
        """Axes of motion and parts (n, s + m, s + m), those that laws observe first, and the number of these.

        States that laws do not observe have no effect on observed ones, so they evolve independently of factor and delay.
        """
        s, m, C = self._s, self._m, self._C
        size = s + m
        axes, ranks = np.tile(np.eye(size), (len(self._P), 1, 1)), np.full(len(self._P), size)
        for i in np.flatnonzero(self._bounded):
            steps = np.zeros((size, size))
            steps[:s, :s] = self._P[i]
            now, more = (_of_states(tick, self._P[i]) for tick in (self._tick[i], self._more[i]))
            steps[s:] = now[C:]
            rows = np.concatenate([now[:C], more])
            lengths = np.linalg.norm(rows, axis=1, keepdims=True)
            rows = rows[lengths[:, 0] > SEES] / lengths[lengths > SEES, None]
            basis = np.zeros((0, size))
            while len(rows) and len(basis) < size:
                # Twice: what is left of a small row is no more across the others than round-off lets it be.
                for _ in range(2):
                    rows = rows - rows @ basis.T @ basis
                _, sizes, across = np.linalg.svd(rows, full_matrices=False)
                rows = across[sizes > SEES]
                basis = np.concatenate([basis, rows])
                rows = rows @ steps
            ranks[i] = len(basis)
            others = np.linalg.svd(basis)[2][len(basis) :] if len(basis) else np.eye(size)
            axes[i] = np.concatenate([basis, others])
            free = np.abs(np.linalg.eigvals(others @ steps @ others.T)).max(initial=0.0)
            self._bounded[i] &= free <= 1.0 + NEUTRAL
        return axes, ranks

    def _without_failed(self, derivatives: np.ndarray) -> np.ndarray:
        """The derivatives, with finite substitutes for members of which a copy failed: their loops do not settle."""
        well = np.isfinite(derivatives).all(axis=(1, 2))
        self._bounded &= well
        return np.where(well[:, None, None], derivatives, np.eye(*derivatives.shape[1:]))

    def stable(self, factor: np.ndarray, steps: np.ndarray, some: np.ndarray) -> np.ndarray:
        """Mask of the loops of some members (m,) that settle, with their factors on the demand and delays in steps.

        A loop settles if all eigenvalues of the observed states are inside the unit circle, and no other state grows.
        """
        answer = np.zeros(len(some), bool)
        for q in np.unique(steps // self.every):
            at = np.flatnonzero(steps // self.every == q)
            size = self._s + self._m + self._C * (q + 2)
            for each in np.array_split(at, max(1, len(at) * size**2 // ENTRIES)):
                A = self._matrices(factor[each], int(q), steps[each] % self.every, some[each])
                for count in np.unique(self._ranks[some[each]]):
                    alike = self._ranks[some[each]] == count
                    answer[each[alike]] = _settles(self._of_seen(A[alike], some[each][alike], int(count)))
        return answer & self._bounded[some]

    def opened(self, steps: np.ndarray, places: np.ndarray) -> Iterator[Opened]:
        """Some loops (m,), opened at the components of their demand, grouped by delay; steps: delays (n,)."""
        s, m, C = self._s, self._m, self._C
        for q in np.unique(steps[places] // self.every):
            some = places[steps[places] // self.every == q]
            A = self._matrices(np.zeros(len(some)), int(q), steps[some] % self.every, some)
            B, rows = (
                np.zeros((len(some), A.shape[1], len(self._each))),
                np.zeros((len(some), len(self._each), A.shape[1])),
            )
            for r, (each, units) in enumerate(zip(self._each, self._written, strict=True)):
                # What one component does is of rank 1: what a unit of it writes, times what the laws see.
                written = np.where(np.abs(units[some]) < SEES, 0.0, units[some])
                size = np.sum(written**2, axis=1, keepdims=True)
                seen = np.einsum("ki,kij->kj", written, each[some]) / np.where(size > 0.0, size, 1.0)
                B[:, s + m : s + m + C, r], B[:, s : s + m, r] = written[:, :C], written[:, C:]
                rows[:, r] = np.einsum("ki,kij->kj", seen[:, :12], A[:, :12])
                rows[:, r, s : s + m] += seen[:, 12:]
            yield Opened(some, A, B, rows)

    def opened_at_commands(self, steps: np.ndarray, places: np.ndarray, channels: Sequence[int]) -> Iterator[Opened]:
        """Some loops (m,), opened at some commands, grouped by delay; steps: delays (n,)."""
        commands = self._s + self._m + np.asarray(channels)
        for q in np.unique(steps[places] // self.every):
            some = places[steps[places] // self.every == q]
            A = self._matrices(np.ones(len(some)), int(q), steps[some] % self.every, some)
            rows = A[:, commands].copy()
            A[:, commands] = 0.0
            yield Opened(some, A, np.tile(np.eye(A.shape[1])[:, commands], (len(some), 1, 1)), rows)

    def observed(self, opened: Opened) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """A, B, C of each opened loop in the observed states, on which alone the demands depend."""
        base = self._s + self._m
        for i, A, B, C in zip(*opened, strict=True):
            count = int(self._ranks[i])
            axes = self._axes[i, :count]
            (smaller,) = self._of_seen(A[None], np.array([i]), count)
            yield smaller, np.concatenate([axes @ B[:base], B[base:]]), np.hstack([C[:, :base] @ axes.T, C[:, base:]])

    def _of_seen(self, A: np.ndarray, some: np.ndarray, count: int) -> np.ndarray:
        """The loops' matrices in the observed states and the commands."""
        axes, base = self._axes[some][:, :count], self._s + self._m
        rows = np.concatenate([axes @ A[:, :base], A[:, base:]], axis=1)
        return np.concatenate([rows[:, :, :base] @ np.swapaxes(axes, 1, 2), rows[:, :, base:]], axis=2)

    def _matrices(self, factor: np.ndarray, q: int, late: np.ndarray, some: np.ndarray) -> np.ndarray:
        """The loops' matrices; states: motion and actuators, parts, commands from the newest to the oldest."""
        s, m, C = self._s, self._m, self._C
        n = s + m + C * (q + 2)
        A = np.zeros((len(some), n, n))
        A[:, :s, :s] = self._P[some]
        newer = np.stack([self._late[j][i] for i, j in zip(some, late, strict=True)])
        first = s + m + C * q
        A[:, :s, first : first + C] = newer
        A[:, :s, first + C : first + 2 * C] = self._late[0][some] - newer
        tick = self._tick[some] + factor[:, None, None] * self._more[some]
        for rows, places in ((slice(0, C), slice(s + m, s + m + C)), (slice(C, C + m), slice(s, s + m))):
            A[:, places] = tick[:, rows, :12] @ A[:, :12]
            A[:, places, s : s + m] += tick[:, rows, 12:]
        older = np.arange(C * (q + 1))
        A[:, s + m + C + older, s + m + older] = 1.0
        return A


def _of_states(tick: np.ndarray, P: np.ndarray) -> np.ndarray:
    """Turn derivatives of a tick by its motion into derivatives by the states (s) one period earlier."""
    return np.concatenate([tick[:, :12] @ P[:12], tick[:, 12:]], axis=1)


def _settles(A: np.ndarray) -> np.ndarray:
    """Mask of matrices (m, n, n) whose eigenvalues are all within the unit circle."""
    if not A.shape[1]:
        return np.ones(len(A), bool)
    return np.asarray(np.abs(np.linalg.eigvals(A)).max(axis=1) < 1.0 - ON_CIRCLE)
