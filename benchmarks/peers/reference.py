# SPDX-License-Identifier: Apache-2.0
"""The end that errors are measured from, in extended precision, and how well a second solution agrees with it."""

from __future__ import annotations

import importlib.util

import numpy as np

import lgvi_warp as lw
from benchmarks.peers import tableaus
from benchmarks.peers.problem import End, Problem, error, make_rates, matrix_end_of

STEP, DRIVEN_STEP = 0.025, 0.002
# Of driven vehicles, whose reference takes minutes, errors are those of so many members.
DRIVEN_MEMBERS = 128
# Of the same method, so none is the reference's own: what a kink of |v| v costs would be the same in both.
OTHER_STEPS = (0.0025, 0.001)


def solve(problem: Problem) -> End:
    """DOP853 in extended precision, all members at once, with attitudes of unit quaternions; of driven vehicles the first."""
    problem = problem.first(DRIVEN_MEMBERS) if problem.driven else problem
    steps = round(problem.t1 / (DRIVEN_STEP if problem.driven else STEP))
    h = np.longdouble(problem.t1) / steps
    rates, y = make_rates(problem, np.longdouble), tuple(problem.state().T.astype(np.longdouble))
    for _ in range(steps):
        y = tableaus.step(rates, y, h, tableaus.TABLEAUS["dop853"])
    return end(np.array(y).T)


def end(state: np.ndarray) -> End:
    """Position and attitude, nothing rounded."""
    w, x, y, z = state[:, 3:7].T
    R = [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)]
    R += [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)]
    R += [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z]
    matrix = np.stack(R, axis=1) / (w * w + x * x + y * y + z * z)[:, None]
    return state[:, :3], matrix.reshape(-1, 3, 3)


def taylor(problem: Problem) -> End:
    """heyoka's Taylor series in extended precision, one member after the other, with attitudes of matrices."""
    from benchmarks.peers import peer_heyoka

    return matrix_end_of(peer_heyoka.extended(problem))


def composition(problem: Problem, h: float) -> End:
    """lgvi_warp's kl8(psi_s) in double precision."""
    result = lw.solve(problem.ensemble, "kl8(psi_s)", h=h, t1=problem.t1, threads=1)
    return result.position[-1], result.attitude[-1]


def explicit(problem: Problem, h: float) -> End:
    """lgvi_warp's rk8 in double precision."""
    result = lw.solve(problem.ensemble, "rk8", h=h, t1=problem.t1, threads=1)
    return result.position[-1], result.attitude[-1]


def agreement(problem: Problem, reference: End, members: int = 256) -> dict[str, float]:
    """Largest difference of the reference from others that share nothing with it, over the first members."""
    part, name, ours, steps = problem.first(members), "kl8(psi_s)", composition, (0.1, 0.05)
    if problem.driven:
        part, name, ours, steps = problem.first(DRIVEN_MEMBERS), "rk8", explicit, OTHER_STEPS
    found = {f"{name}, h = {h:g} s": error(ours(part, h), reference)["error_max"] for h in steps}
    if importlib.util.find_spec("heyoka") and not problem.driven:
        found["heyoka, extended precision"] = error(taylor(part), reference)["error_max"]
    return found
