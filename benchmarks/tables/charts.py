# SPDX-License-Identifier: Apache-2.0
"""Explicit tableaux and charts of the attitude: right-hand sides a simulated second for an error, in NumPy."""

import sys

import numpy as np

from benchmarks.pages import line, markdown, stamp
from benchmarks.peers import plot
from benchmarks.peers.problem import end_of, error, make_problem, make_rates
from lgvi_warp.methods.tableaux import CASH_KARP, DOP853, DOPRI5, RK4

MEMBERS, T1 = 32, 20.0
ERRORS = tuple(10.0**-k for k in range(1, 10))
# Steps a second: the last one has the error of the last column, or nearly so.
RATES = {4: (1, 2, 4, 8, 16, 32), 5: (1, 2, 3, 4, 8, 16, 32), 6: (2, 3, 4, 8, 16), 8: (1, 2, 4, 8, 16)}
# Name -> order, rows of `a` after the first, b. Kutta (1901); Tsitouras (2011); Butcher (1964).
TABLEAUX = {
    "rk4": (4, RK4.a[1:], RK4.b),
    "Kutta's 3/8": (4, ((1 / 3,), (-1 / 3, 1.0), (1.0, -1.0, 1.0)), (1 / 8, 3 / 8, 3 / 8, 1 / 8)),
    "rk5": (5, DOPRI5.a[1:], DOPRI5.b),
    "rk5_ck": (5, CASH_KARP.a[1:], CASH_KARP.b),
    "Tsitouras": (
        5,
        ((0.161,), (-0.008480655492356989, 0.335480655492357),
         (2.8971530571054935, -6.359448489975075, 4.3622954328695815),
         (5.325864828439257, -11.748883564062828, 7.4955393428898365, -0.09249506636175525),
         (5.86145544294642, -12.92096931784711, 8.159367898576159, -0.071584973281401, -0.028269050394068383)),
        (0.09646076681806523, 0.01, 0.4798896504144996, 1.379008574103742, -3.290069515436081, 2.324710524099774),
    ),
    "Butcher": (
        6,
        ((1 / 3,), (0.0, 2 / 3), (1 / 12, 1 / 3, -1 / 12), (-1 / 16, 9 / 8, -3 / 16, -3 / 8),
         (0.0, 9 / 8, -3 / 8, -3 / 4, 1 / 2), (9 / 44, -9 / 11, 63 / 44, 18 / 11, 0.0, -16 / 11)),
        (11 / 120, 0.0, 27 / 40, 27 / 40, -4 / 15, -4 / 15, 11 / 120),
    ),
    "rk8": (8, DOP853.a[1:], DOP853.b),
}  # fmt: skip

TEXT = f"""Evaluations of the right-hand side in a simulated second for an error of position or attitude after {T1:g} s, the
largest of {MEMBERS} members of the paper's vehicle, in NumPy. Rows: two rows of R, as explicit methods have them;
rotation vector: R exp(v) from step to step, v from 0. The number of stages is that of a step.
An empty cell: not among the steps tried."""


def cross(a, b):
    """a x b of vectors (3, n)."""
    return np.cross(a, b, axis=0)


def twist_rates(problem, u, o, z):
    """nu' and Om' (3, n) from nu, Om and R^T e3."""
    M, J, d = problem.M[:, None], problem.J[:, None], problem.d[:, None]
    return (cross(M * u, o) + problem.net * z) / M, (cross(J * o, o) + cross(M * u, u) - cross(d, z)) / J


def turned(R, v):
    """The rows (3, 3, n) of R exp(v)."""
    n2 = (v * v).sum(0)
    n = np.maximum(np.sqrt(n2), 1e-30)
    a, b = np.sin(n) / n, 2.0 * (np.sin(0.5 * n) / n) ** 2
    once = [cross(row, v) for row in R]
    return np.array([row + a * t + b * cross(t, v) for row, t in zip(R, once, strict=True)])


class Rows:
    """y: b, the first and the last row of R, nu, Om."""

    def __init__(self, problem):
        R = problem.R.transpose(1, 2, 0)
        self.problem, self.y = problem, np.concatenate([problem.b.T, R[0], R[2], problem.nu.T, problem.Om.T])

    def rates(self, y):
        first, last, u, o = y[3:6], y[6:9], y[9:12], y[12:]
        way = [(row * u).sum(0) for row in (first, cross(last, first), last)]
        return np.concatenate([way, cross(first, o), cross(last, o), *twist_rates(self.problem, u, o, last)])

    def take(self, y):
        self.y = y

    def end(self):
        first, last = self.y[3:6], self.y[6:9]
        return self.y[:3].T, np.array([first, cross(last, first), last]).transpose(2, 0, 1)


class Quaternion:
    """y: b, a quaternion, nu, Om."""

    def __init__(self, problem):
        self._rates, self.y = make_rates(problem), problem.state().T

    def rates(self, y):
        return np.array(self._rates(y))

    def take(self, y):
        self.y = y

    def end(self):
        return end_of(self.y.T)


class RotationVector:
    """y: b, the rotation vector from the step's start, nu, Om."""

    def __init__(self, problem):
        self.problem, self.R = problem, problem.R.transpose(1, 2, 0)
        self.y = np.concatenate([problem.b.T, np.zeros_like(problem.b.T), problem.nu.T, problem.Om.T])

    def rates(self, y):
        v, u, o = y[3:6], y[6:9], y[9:]
        R, n2 = turned(self.R, v), (v * v).sum(0)
        # (1 - |v| cot(|v| / 2) / 2) / |v|^2 by its series; the angle of a step is below 1.
        g = 1 / 12 + n2 * (1 / 720 + n2 * (1 / 30240 + n2 * (1 / 1209600 + n2 / 47900160)))
        turning = o + 0.5 * cross(v, o) + g * cross(v, cross(v, o))
        return np.concatenate([[(row * u).sum(0) for row in R], turning, *twist_rates(self.problem, u, o, R[2])])

    def take(self, y):
        self.R, self.y = turned(self.R, y[3:6]), y
        y[3:6] = 0.0

    def end(self):
        return self.y[:3].T, self.R.transpose(2, 0, 1)


CHARTS = {"rows": Rows, "quaternion": Quaternion, "rotation vector": RotationVector}


def end(chart, tableau, rate, problem):
    """Position and attitude after T1."""
    x, h = CHARTS[chart](problem), 1.0 / rate
    _, a, b = tableau
    for _ in range(round(T1 * rate)):
        k = [x.rates(x.y)]
        for row in a:
            k.append(x.rates(x.y + h * sum(weight * slope for weight, slope in zip(row, k, strict=True))))
        x.take(x.y + h * sum(weight * slope for weight, slope in zip(b, k, strict=True)))
    return x.end()


def row(chart, name, problem, truth):
    """The cells of one tableau in one chart."""
    tableau = TABLEAUX[name]
    order, _, b = tableau
    with np.errstate(all="ignore"):
        pairs = [
            (error(end(chart, tableau, rate, problem), truth)["error_max"], len(b) * rate) for rate in RATES[order]
        ]
    costs = [plot.cost([one for one in pairs if np.isfinite(one[0])], target) for target in ERRORS]
    within = [f"{one:.1f}" if len(b) * RATES[order][0] < one < np.inf else "" for one in costs]
    return [chart, f"`{name}`" if name.startswith("rk") else name, str(order), str(len(b)), *within]


def main():
    problem = make_problem(MEMBERS, T1)
    truth = end("quaternion", TABLEAUX["rk8"], 64, problem)
    rows = []
    for chart in CHARTS:
        for name in TABLEAUX if chart == "rows" else ("rk4", "rk5", "rk8"):
            rows.append(row(chart, name, problem, truth))
            print(line(rows[-1]), file=sys.stderr, flush=True)
    head = ["attitude", "tableau", "order", "stages", *(f"{one:.0e}" for one in ERRORS)]
    return "\n\n".join([TEXT, stamp("charts"), markdown(head, rows, "ll" + "r" * (2 + len(ERRORS)))])
