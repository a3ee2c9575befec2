# SPDX-License-Identifier: Apache-2.0
"""Splitting into two parts, one of which is the free rotation, for conservative laws with U = U_b(b) + U_R(R).

H = A + B, A = pi.J^-1 pi / 2 + U_b(b), B = p.M^-1 p / 2 + U_R(R). Rotation and the kick of U_b commute (one changes R,
p, pi by F, the other the spatial momentum R p). T and the kick of U_R commute too (neither changes R or R p). With an
accurate rotation both flows are therefore exact. B depends only on R and on the conserved R p, and A is quadratic in
pi. So [B, [B, [B, A]]] = 0 if U_b is at most quadratic, and Runge-Kutta-Nystroem coefficients keep their order.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lgvi_warp.reference.rotation import Array, NoSolution, Solver, norm, quartic
from lgvi_warp.reference.submaps import Body, State, T, kicked

QUARTER_TURN = 0.5 * math.pi
# (part, coefficient), the first applied first.
Program = Sequence[tuple[str, float]]


def splitting(first: str, *half: float) -> Program:
    """Complete half of a palindrome that begins with `first`: its last but one and its middle coefficient are computed."""
    parts, c = (first, "A" if first == "B" else "B"), list(half)
    n = len(c)
    c.append(0.5 - sum(c[n % 2 :: 2]))
    c.append(1.0 - 2.0 * sum(c[(n + 1) % 2 :: 2]))
    return tuple((parts[i % 2], value) for i, value in enumerate((*c, *reversed(c[:-1]))))


# Order 2, 4, 6 and 6, with 1, 6, 11 and 14 rotations. Blanes & Moan (2002), Practical symplectic partitioned Runge-Kutta and
# Runge-Kutta-Nystroem methods, J. Comput. Appl. Math. 142, table 3: SRKN_6^b, SRKN_11^b, SRKN_14^a.
PROGRAMS: dict[str, Program] = {
    "strang": splitting("B"),
    "rkn4_6": splitting(
        "B", 0.0829844064174052, 0.245298957184271, 0.396309801498368, 0.604872665711080, -0.0390563049223486
    ),
    "rkn6_11": splitting(
        "B", 0.0414649985182624, 0.123229775946271, 0.198128671918067, 0.290553797799558, -0.0400061921041533,
        -0.127049212625417, 0.0752539843015807, -0.246331761062075, -0.0115113874206879, 0.357208872795928,
    ),
    "rkn6_14": splitting(
        "A", 0.03785931984061157, 0.09171915262446165, 0.102635633102435, 0.183983170005006, -0.02586788826655869,
        -0.05653436583288827, 0.314241403071447, 0.004914688774712854, -0.130144459517415, 0.143761127168358,
        0.106417700369543, 0.328567693746804, -0.008794243128510581,
    ),
}  # fmt: skip
ORDERS = {"strang": 2, "rkn4_6": 4, "rkn6_11": 6, "rkn6_14": 6}


def modified_inertia(pi: Array, J: Array, h: float, order: int = 10) -> Array:
    """J~ (3, 3) of the preprocessed discrete Moser-Veselov rotation, order 2 to 10.

    docs/theory/splitting.md, (S11).

    J~^-1 = (1 + s) J^-1 + d I, where s and d are polynomials in h^2 |pi|^2 / 2 and h^2 pi.J^-1 pi / 2, which the
    rotation conserves.

    Hairer & Vilmart (2006), J. Phys. A 39, 13225, whose coefficients are symmetric functions of the moments J. Since J~
    depends on pi, the rotation is symplectic to that order only, while D of equation (24) is exactly symplectic. Raises
    NoSolution.
    """
    moments, axes = np.linalg.eigh(J)
    N, H = 0.5 * h * h * pi @ pi, 0.5 * h * h * pi @ np.linalg.solve(J, pi)
    s = d = 0.0
    for k, (s_k, d_k) in enumerate(coefficients(moments)[: order // 2 - 1], start=1):
        powers = [N ** (k - j) * H**j for j in range(k + 1)]
        s, d = s + np.dot(s_k, powers), d + np.dot(d_k, powers)
    inverse = (1.0 + s) / moments + d
    # A spin by theta about a principal axis has J~^-1 h pi = sin(theta): past a quarter turn (24) yields another angle.
    if not (abs(h) * norm(np.linalg.solve(J, pi)) < QUARTER_TURN and np.all(inverse > 0.0)):
        raise NoSolution(f"the modified inertia is of no use for h pi = {h * norm(pi):.3g}. Shorten the step")
    return np.asarray(axes / inverse @ axes.T)


def coefficients(moments: Array) -> list[tuple[list[float], list[float]]]:
    """Hairer & Vilmart (2006): the coefficients of N^(k-j) H^j, j = 0 .. k, in s and in d, for k = 1 to 4.

    docs/theory/splitting.md, (S11).
    """
    I1, I2, I3 = moments.tolist()
    pairs = ((I1, I2, I3), (I2, I3, I1), (I3, I1, I2))
    e = I1 * I2 * I3

    def total(n: int, m: int = 0) -> float:
        """sum I_i^n, or sum (I_i^n + I_j^n) / I_k^m."""
        return sum(a**n for a in (I1, I2, I3)) if m == 0 else sum((a**n + b**n) / c**m for a, b, c in pairs)

    t1, t2, t3, t4 = (total(n) for n in (1, 2, 3, 4))
    i1, i2, i3, i4 = (total(-n) for n in (1, 2, 3, 4))
    r11, r12, r21, r13, r31, r22 = (total(n, m) for n, m in ((1, 1), (1, 2), (2, 1), (1, 3), (3, 1), (2, 2)))
    return [
        ([t1 / (6 * e), -i1 / 3], [-1 / (3 * e), t1 / (6 * e)]),
        (
            [(t2 / e - i1) / (30 * e), (1 - r11) / (30 * e), (3 * t1 / e + 2 * i2) / 60],
            [-t1 / (60 * e**2), i1 / (10 * e) - t2 / (60 * e**2), -(9 + r11) / (60 * e)],
        ),
        (
            [
                (4 * e + 17 * t3 - 15 * e * r11) / (2520 * e**3),
                (9 * t1 + 10 * e * i2 - 6 * r21) / (420 * e**2),
                ((6 * r12 - 100 * i1) * e + 53 * t2) / (2520 * e**2),
                (15 - e * i3 - 2 * r11) / (630 * e),
            ],
            [
                (34 * e * i1 - 19 * t2) / (2520 * e**3),
                (t3 + 2 * e * r11 - 85 * e) / (1260 * e**3),
                (47 * t1 + 13 * r21 - 38 * e * i2) / (2520 * e**2),
                (9 * e * i1 + e * r12 - 11 * t2) / (1260 * e**2),
            ],
        ),
        (
            [
                (62 * t4 - 94 * e * r21 + 66 * e**2 * i2 + 81 * e * t1) / (45360 * e**4),
                (-77 * r31 + 75 * e * r12 + 214 * t2 - 240 * e * i1) / (22680 * e**3),
                (26 * e * r22 + 55 * t3 + 204 * e - 50 * e**2 * i3 - 59 * e * r11) / (7560 * e**3),
                (137 * e * i2 - e * r13 + 3 * t1 - 69 * r21) / (11340 * e**2),
                (2 * e**2 * i4 + 5 * e * r12 - 171 * e * i1 + 159 * t2) / (45360 * e**2),
            ],
            [
                (60 * r11 * e - 61 * t3 - 247 * e) / (45360 * e**4),
                (54 * e * t1 - t4 + 218 * e * r21 - 426 * e**2 * i2) / (45360 * e**4),
                (125 * e * i1 - 5 * r31 - 130 * t2 + 4 * e * r12) / (7560 * e**3),
                (67 * t3 - 735 * e - 15 * e * r22 + 87 * e * r11 + 34 * e**2 * i3) / (22680 * e**3),
                (165 * t1 - e * r13 - 9 * r21 - 145 * e * i2) / (45360 * e**2),
            ],
        ),
    ]


def D(x: State, body: Body, h: float, order: int = 10, solve: Solver = quartic) -> State:
    """The free rotation to this order: equation (24) with J~ instead of J, then R <- R F, p <- F^T p, pi <- F^T pi."""
    F = solve(h * x.pi, modified_inertia(x.pi, body.J, h, order))
    return replace(x, R=x.R @ F, p=F.T @ x.p, pi=F.T @ x.pi)


def A(x: State, body: Body, h: float, order: int = 10, solve: Solver = quartic) -> State:
    """The flow of pi.J^-1 pi / 2 + U_b(b): the free rotation and p <- p + h f, in either order.

    docs/theory/splitting.md, (S10).
    """
    x = D(x, body, h, order, solve)
    force, _ = body.wrench(x.b, x.R, potential=True)
    return kicked(x, h, (force, np.zeros(3)))


def B(x: State, body: Body, h: float) -> State:
    """The flow of p.M^-1 p / 2 + U_R(R): T and pi <- pi + h m, in either order. docs/theory/splitting.md, (S10)."""
    _, torque = body.wrench(x.b, x.R, potential=True)
    return kicked(T(x, body, h), h, (np.zeros(3), torque))


def step(x: State, body: Body, program: Program, h: float, order: int = 10, solve: Solver = quartic) -> State:
    """One step of h [s]. docs/theory/splitting.md, (S10)."""
    for part, coefficient in program:
        x = A(x, body, coefficient * h, order, solve) if part == "A" else B(x, body, coefficient * h)
    return x
