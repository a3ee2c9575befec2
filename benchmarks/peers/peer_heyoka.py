# SPDX-License-Identifier: Apache-2.0
"""heyoka: adaptive Taylor series, compiled for this machine, one member in each SIMD lane, each lane with its own step.

"batch" keeps one integrator a thread and gives it one packet of members after the other; "ensemble" is heyoka's own
call for it, which copies the integrator for each packet.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from typing import Any

import heyoka as hy
import numpy as np

from benchmarks.peers.problem import DRIVEN, End, Problem, Run, Runs, make_matrix_rates, matrix_end_of

PROBLEMS = ("vehicle", *DRIVEN)
TOLERANCES = (1e-1, 1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13, 1e-15)
ENSEMBLE = (1e-5, 1e-9, 1e-15)
SIZE = 18
# Of the velocities among the numbers of a state.
FIRST = 12


def system(problem: Problem) -> list[tuple[Any, Any]]:
    """The equations of motion as heyoka's expressions, with the matrix R: faster here than with a quaternion."""
    variables = hy.make_vars(*(f"x{i:02d}" for i in range(SIZE)))
    return list(zip(variables, make_matrix_rates(problem, absolute, hy.sqrt)(variables), strict=True))


def absolute(x: Any) -> Any:
    """|x| of a velocity: its sign is a parameter, which an event changes, since a series does not see a change of sign."""
    return hy.par[int(str(x).removeprefix("x")) - FIRST] * x


def turns(problem: Problem) -> list[Any]:
    """Events where a velocity changes its sign: the step ends there, and the next one begins with the other sign."""
    if not problem.driven:
        return []

    def turned(j: int) -> Any:
        def callback(ta: Any, direction: int, lane: int) -> bool:
            ta.pars[j, lane] = direction
            return True

        return hy.t_event_batch(hy.make_vars(f"x{FIRST + j:02d}"), callback=callback)

    return [turned(j) for j in range(SIZE - FIRST)]


def integrator(problem: Problem, tolerance: float) -> Any:
    """A batch integrator of two of the machine's registers, so that one's operation is made while the other's waits."""
    width = 2 * hy.recommended_simd_size(float)
    state = np.repeat(problem.matrix_state()[:1].T, width, axis=1)
    options = {"t_events": turns(problem), "pars": signs(state)} if problem.driven else {}
    return hy.taylor_adaptive_batch(system(problem), np.ascontiguousarray(state), tol=tolerance, **options)


def signs(state: np.ndarray) -> np.ndarray:
    """Signs of the velocities of states (18, lanes)."""
    return np.where(state[FIRST:] < 0.0, -1.0, 1.0)


def extended(problem: Problem) -> np.ndarray:
    """The members' states (members, 18) at the end in extended precision."""
    ta = hy.taylor_adaptive(system(problem), problem.matrix_state()[0].astype(np.longdouble), fp_type=np.longdouble)
    ends = np.empty((problem.members, SIZE), np.longdouble)
    for one, start in zip(ends, problem.matrix_state().astype(np.longdouble), strict=True):
        ta.time, ta.state[:] = np.longdouble(0), start
        ta.propagate_until(np.longdouble(problem.t1))
        one[:] = ta.state
    return ends


class Batch:
    """All members in packets of lanes, and their ends."""

    def __init__(self, problem: Problem, tolerance: float, threads: int):
        self.ta, self.t1, self.threads = integrator(problem, tolerance), problem.t1, threads
        self.driven = problem.driven
        width = self.ta.batch_size
        self.count = problem.members
        packets = -(-self.count // width)
        padded = np.resize(problem.matrix_state(), (packets * width, SIZE))
        self.start = np.ascontiguousarray(padded.reshape(packets, width, SIZE).transpose(0, 2, 1))
        self.ends = np.empty_like(self.start)
        self.parts = [np.arange(packets)[i::threads] for i in range(threads)]
        self.own = [self.ta] + [deepcopy(self.ta) for _ in range(threads - 1)]

    def batch(self) -> None:
        """One integrator a thread."""
        if self.threads == 1:
            return self._part(self.ta, self.parts[0])
        with ThreadPoolExecutor(self.threads) as pool:
            list(pool.map(self._part, self.own, self.parts))

    def _begin(self, ta: Any, i: int) -> None:
        ta.set_time(0.0)
        ta.state[:] = self.start[i]
        if self.driven:
            ta.pars[:] = signs(self.start[i])
            ta.reset_cooldowns()

    def _part(self, ta: Any, packets: np.ndarray) -> None:
        state = ta.state
        for i in packets:
            self._begin(ta, i)
            ta.propagate_until(self.t1)
            self.ends[i] = state

    def ensemble(self) -> None:
        """heyoka's ensemble."""

        def prepared(ta: Any, i: int) -> Any:
            self._begin(ta, i)
            return ta

        found = hy.ensemble_propagate_until_batch(
            self.ta, self.t1, len(self.start), prepared, algorithm="thread", max_workers=self.threads
        )
        for i, one in enumerate(found):
            self.ends[i] = one[0].state

    def end(self) -> End:
        """End of the last call."""
        return matrix_end_of(self.ends.transpose(0, 2, 1).reshape(-1, SIZE)[: self.count])


def runs(problem: Problem, threads: int) -> Runs:
    """By tolerance."""
    for tolerance in TOLERANCES:
        one = Batch(problem, tolerance, threads)
        yield Run("taylor batch", f"tol={tolerance:g}", problem.members, one.batch, one.end)
        if tolerance in ENSEMBLE:
            yield Run("taylor ensemble", f"tol={tolerance:g}", problem.members, one.ensemble, one.end)
