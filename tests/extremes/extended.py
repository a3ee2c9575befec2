# SPDX-License-Identifier: Apache-2.0
"""The maps of psi_s and psi_x for many vehicles at once, in NumPy's extended precision (longdouble, 64 bits on x86-64).

What a kernel differs by from these is round-off and nothing else. Free bodies, weight, restoring moment, drag along the axes.
M and J are diagonal. Kept as plain as the printed equations, with a Newton iteration on Cayley's parameter for (24).
"""

from dataclasses import dataclass, replace

import numpy as np

REAL = np.longdouble
FOLLOWING, PRECEDING = [1, 2, 0], [2, 0, 1]
# Newton's steps on G(c) = 0: each doubles the digits; near |J^-1 a| = 1 it only halves the error.
NEWTON_STEPS = 60
SETTLED, STALLED = 1e-18, 1e-12


@dataclass(frozen=True)
class Bodies:
    """n vehicles: M, J (n, 3), net weight (n,) [N], Br (n, 3) [N m], drag: linear and quadratic (n, 6)."""

    M: np.ndarray
    J: np.ndarray
    net: np.ndarray
    Br: np.ndarray
    linear: np.ndarray
    quadratic: np.ndarray


@dataclass(frozen=True)
class States:
    """b (n, 3), R (n, 3, 3), p, pi (n, 3) of n vehicles; solvable (n,): whether (24) had a certain solution so far."""

    b: np.ndarray
    R: np.ndarray
    p: np.ndarray
    pi: np.ndarray
    solvable: np.ndarray


def cross(a, b):
    """a x b, (n, 3)."""
    return a[..., FOLLOWING] * b[..., PRECEDING] - a[..., PRECEDING] * b[..., FOLLOWING]


def dot(a, b):
    """a . b, (n, 1)."""
    return np.sum(a * b, axis=-1, keepdims=True)


def apply(R, v):
    """R v."""
    return np.stack([dot(R[:, i], v)[:, 0] for i in range(3)], axis=-1)


def solve3(rows, v):
    """x with A x = v, A by its rows (Cramer)."""
    r0, r1, r2 = rows
    c0 = cross(r1, r2)
    return (v[:, :1] * c0 + v[:, 1:2] * cross(r2, r0) + v[:, 2:] * cross(r0, r1)) / dot(r0, c0)


def cayley_root(a, J):
    """c with G(c) = a + a x c + c (a.c) - 2 J c = 0, and whether |J^-1 a| < 1."""
    solvable = dot(a / J, a / J)[:, 0] < 1.0
    a = np.where(solvable[:, None], a, 0.0)
    c = a / (2.0 * J)
    hat = [cross(e + 0.0 * a, a) - 2.0 * J * e for e in np.eye(3, dtype=REAL)]
    e, before = np.eye(3, dtype=REAL), np.full(len(a), np.inf, REAL)
    done = np.zeros(len(a), bool)
    for _ in range(NEWTON_STEPS):
        G = a + cross(a, c) + c * dot(a, c) - 2.0 * J * c
        s = dot(a, c)
        rows = [hat[i] + s * e[i] + c[:, i : i + 1] * a for i in range(3)]
        d = solve3(rows, G)
        c = c - d
        size = np.abs(d).max(axis=1)
        largest = np.abs(c).max(axis=1)
        # Near |J^-1 a| = 1 and for rods the last steps are round-off, larger than elsewhere, and shrink no more.
        stalled = (size > 0.9 * before) & (size < STALLED * largest)
        done = done | stalled | (size <= SETTLED * (largest + SETTLED))
        if done.all():
            break
        before = size
    return c, solvable


def turned_by(x, c):
    """p, pi and R after the turn cay(c): F^T v = v - 2/(1 + c.c) (c x v - c x (c x v))."""
    k = 2.0 / (1.0 + dot(c, c))

    def back(v):
        w = cross(c, v)
        return v - k * (w - cross(c, w))

    R = np.stack([back(x.R[:, i]) for i in range(3)], axis=1)
    return replace(x, R=R, p=back(x.p), pi=back(x.pi))


def D(x, body, h):
    c, solvable = cayley_root(h * x.pi, body.J)
    return replace(turned_by(x, c), solvable=x.solvable & solvable)


def turn(x, body, h, axis):
    """R_i of psi_x: the tangent of half the angle is y + y^3 / 3, y = h Om_i / 2."""
    y = 0.5 * h * x.pi[:, axis] / body.J[:, axis]
    return turned_by(x, (y + y**3 / 3.0)[:, None] * np.eye(3, dtype=REAL)[axis])


def T(x, body, h):
    nu = x.p / body.M
    return replace(x, b=x.b + h * apply(x.R, nu), pi=x.pi + h * cross(x.p, nu))


def E(x, body, h):
    """Exact flow of drag alone, per axis."""
    P, inertia = np.concatenate([x.p, x.pi], axis=1), np.concatenate([body.M, body.J], axis=1)
    z = h * body.linear / inertia
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.where(z == 0.0, 1.0, -np.expm1(-z) / z)
    P = P * np.exp(-z) / (1.0 + h * body.quadratic / inertia**2 * s * np.abs(P))
    return replace(x, p=P[:, :3], pi=P[:, 3:])


def K(x, body, h):
    z = x.R[:, 2]
    force, torque = body.net[:, None] * z, -cross(body.Br, z)
    x = replace(x, p=x.p + 0.5 * h * force, pi=x.pi + 0.5 * h * torque)
    x = E(x, body, h)
    return replace(x, p=x.p + 0.5 * h * force, pi=x.pi + 0.5 * h * torque)


def step(x, body, h, method):
    """One step of psi_s or psi_x."""
    half = REAL(h) / 2
    if method == "psi_s":
        return T(D(K(D(T(x, body, half), body, half), body, REAL(h)), body, half), body, half)
    x = T(x, body, half)
    for axis in range(3):
        x = turn(x, body, half, axis)
    x = K(x, body, REAL(h))
    for axis in reversed(range(3)):
        x = turn(x, body, half, axis)
    return T(x, body, half)


def advance(x, body, h, steps, method="psi_s"):
    """The states after so many steps."""
    for _ in range(steps):
        x = step(x, body, h, method)
    return x


# Size of the perturbations that error growth is measured with, and how many directions.
SMALL, DIRECTIONS = 1e-8, 4


def repeated(item, n, times):
    """Bodies or states `times` times over."""
    return type(item)(*(np.concatenate([value] * times) for value in vars(item).values()))


def perturbed(x, rng, aligned):
    """Attitude turned by SMALL, momenta changed by SMALL of their size, each in a random direction.

    aligned (n,): motions along one axis that stay there, zeros being exact: only the size of what is not zero changes.
    """

    def direction(v):
        u = np.where(aligned[:, None], np.sign(v), rng.normal(size=v.shape))
        size = np.sqrt(dot(u, u))
        return np.divide(u, size, out=np.zeros_like(u), where=size > 0.0).astype(REAL)

    sizes = [np.sqrt(dot(v, v)) for v in (x.p, x.pi)]
    R = turned_by(x, 0.5 * SMALL * direction(x.pi)).R
    return replace(x, R=R, p=x.p + SMALL * sizes[0] * direction(x.p), pi=x.pi + SMALL * sizes[1] * direction(x.pi))


def distance(x, y, body):
    """(n,): largest of |R - R'|, |p - p'| / |p| and |pi - pi'| / |pi|, in the largest momenta of both."""

    def relative(u, v):
        size = np.maximum(np.sqrt(dot(u, u)), np.sqrt(dot(v, v)))[:, 0]
        difference = np.sqrt(dot(u - v, u - v))[:, 0]
        return np.divide(difference, size, out=np.zeros_like(size), where=size > 0.0)

    return np.maximum.reduce([np.abs(x.R - y.R).max(axis=(1, 2)), relative(x.p, y.p), relative(x.pi, y.pi)])


def with_growth(x, body, h, steps, method="psi_s", aligned=False):
    """The states at the end, how much a relative error of any step grows at most (n,), and the longest |b| and way (n,)."""
    rng, n = np.random.default_rng(2), len(x.b)
    many = repeated(x, n, DIRECTIONS)
    y = perturbed(
        many, rng, np.broadcast_to(aligned, n * DIRECTIONS) if np.ndim(aligned) == 0 else np.tile(aligned, DIRECTIONS)
    )
    bodies = repeated(body, n, DIRECTIONS)
    growth, far, way = np.ones(n), np.abs(x.b).max(axis=1), np.zeros(n)
    for k in range(steps):
        before = x.b
        x, y = step(x, body, h, method), step(y, bodies, h, method)
        way = way + np.abs(x.b - before).max(axis=1)
        far = np.maximum(far, np.abs(x.b).max(axis=1))
        if k % 10 == 0 or k == steps - 1:
            d = distance(y, repeated(x, n, DIRECTIONS), bodies).reshape(DIRECTIONS, n).max(axis=0) / SMALL
            growth = np.fmax(growth, d.astype(float))
    return x, growth, far.astype(float), way.astype(float)
