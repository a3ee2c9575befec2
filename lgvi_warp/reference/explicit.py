# SPDX-License-Identifier: Apache-2.0
"""Explicit Runge-Kutta methods on y = (b, two rows of R, p, pi), of one vehicle, with all its laws.

The middle row of R is the cross product of the others. The memory of a law is known at every stage if it depends on time
and itself alone (`Law.follow`). The memory of other laws is advanced by half a step before and after, as in K, to order 2.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from lgvi_warp.reference.carried import boarded, landed, velocities
from lgvi_warp.reference.rotation import Array, cross
from lgvi_warp.reference.submaps import (
    Body,
    State,
    acceleration_wrench,
    damping,
    load,
    look,
    power,
    recorded,
    remembered,
    water,
)
from lgvi_warp.reference.terms import Law

Row = tuple[float, ...]


class Tableau(Protocol):
    """Coefficients of lgvi_warp.methods.tableaux: a, b, c; rows of error estimates, which are of order h^`estimate`."""

    @property
    def a(self) -> tuple[Row, ...]:
        """Row i has i numbers."""

    @property
    def b(self) -> Row:
        """Weights of the stages, (stages,)."""

    @property
    def c(self) -> Row:
        """Times of the stages in steps, (stages,)."""

    @property
    def errors(self) -> tuple[Row, ...]:
        """Weights of an error estimate (stages,), or one more, with f(y) at the end."""

    @property
    def estimate(self) -> int:
        """Power of h in the error estimate."""


# step(x, body, h) -> the state h [s] later.
Step = Callable[[State, Body, float], State]

# Hairer, Norsett & Wanner (HNW), Solving Ordinary Differential Equations I, II.4, and Hairer & Wanner II, IV.2 (PI control),
# as in their codes DOPRI5 and DOP853: safety factor, exponent of the error of the step before, smallest and largest factor
# from one step to the next.
SAFETY = 0.9
BETA = 0.04
SHRINK, GROW = 0.333, 6.0


USER: Array = np.zeros(3)


def pack(x: State) -> Array:
    """y (15,): b [m], the first and the last row of R, p [N s], pi [N m s]."""
    return np.concatenate([x.b, x.R[0], x.R[2], x.p, x.pi])


def unpack(y: Array, x: State, t: float) -> State:
    """The state of y (15,), see `pack`, at t; other entries as in x. docs/theory/runge_kutta.md, (K4)."""
    first, last = y[3:6], y[6:9]
    return replace(x, b=y[:3], R=np.array([first, cross(last, first), last]), p=y[9:12], pi=y[12:], t=t)


def wrench(x: State, body: Body, h: float, nu: Array, Om: Array) -> tuple[Array, Array, Array]:
    """Force (3,) [N], torque (3,) [N m] of all laws, body axes, and the water's velocity (3,) [m/s], inertial."""
    views = look(x, body, h)
    flow = water(views, body)
    force, torque = body.wrench(x.b, x.R, views)
    pushed, turned = acceleration_wrench(x.R, body, flow)
    drag = damping(x, body, h, nu, Om, flow) @ np.concatenate([nu, Om]) - load(x, body, h, nu, Om)[1]
    return force + pushed - drag[:3], torque + turned - drag[3:], flow.velocity


def at(x: State, origin: Array) -> State:
    """The same motion with b [m] and pi [N m s] at another point of the body, (3,) [m] from the old one, body axes."""
    return replace(x, b=x.b + x.R @ origin, pi=x.pi - cross(origin, x.p))


def derivatives(x: State, body: Body, h: float, origin: Array = USER) -> tuple[Array, Array, Array, Array]:
    """b' (3,), R' (3, 3), p' (3,), pi' (3,), eq. (1) and the dynamics of Nordkvist & Sanyal 2010 with all laws.

    docs/theory/integrator.md, (1), (I1); docs/theory/runge_kutta.md, (K1); docs/theory/water.md, (W1).

    b' = R nu + u, R' = R hat(Om), p' = p x Om + f, pi' = pi x Om + p x nu + m; some laws depend on the step h.
    """
    x = at(x, -origin)
    nu, Om = np.split(velocities(x, body, h), 2)
    force, torque, u = wrench(x, body, h, nu, Om)
    turning = np.array([cross(row, Om) for row in x.R])
    p, pi = cross(x.p, Om) + force, cross(x.pi, Om) + cross(x.p, nu) + torque
    return x.R @ nu + u + turning @ origin, turning, p, pi - cross(origin, p)


def rates(x: State, body: Body, h: float, origin: Array = USER) -> Array:
    """Rate of the vector of `pack`, dy/dt (15,)."""
    b, R, p, pi = derivatives(x, body, h, origin)
    return np.concatenate([b, R[0], R[2], p, pi])


def remembered_half(x: State, body: Body, h: float, second: bool) -> State:
    """Memory of laws, half a step of h [s] later; x.t is the step's start, or its end in the second half.

    Memory that is known at every stage is not changed: see `followed`.
    """
    if not any(memory.size for memory in x.memory):
        return x
    middle = remembered(replace(x, t=x.t + (-0.5 if second else 0.5) * h), body, h, second)
    memory = (old if follows(law) else new for law, old, new in zip(body.terms, x.memory, middle.memory, strict=True))
    return replace(x, memory=tuple(memory))


def follows(law: Law) -> bool:
    """Whether the memory of a law depends on time and itself alone."""
    return type(law).follow is not Law.follow


def followed(x: State, body: Body, h: float) -> State:
    """The same state with the memory of laws at x.t, from their memory at a time h earlier.

    Raises ValueError for h < 0, which a stage of cg3 needs: memory cannot be followed backwards.
    """
    if h == 0.0 or not any(memory.size and follows(law) for law, memory in zip(body.terms, x.memory, strict=False)):
        return x
    if h < 0.0:
        raise ValueError(f"h = {h:.3g} s: what laws remember is not known before a step. Use rkmk4")
    views = look(x, body, h)
    return recorded(x, body, views, tuple(law.follow(view) for law, view in zip(body.terms, views, strict=True)))


def stages(x: State, body: Body, h: float, tableau: Tableau, origin: Array = USER) -> Array:
    """k_i = f(t + c_i h, y + h sum_j a_ij k_j), (stages, 15)."""
    return stages_and_powers(x, body, h, tableau, origin)[0]


def stages_and_powers(x: State, body: Body, h: float, tableau: Tableau, origin: Array = USER) -> tuple[Array, Array]:
    """Stages as in `stages`, and the power at each stage, (stages,) [W]. docs/theory/runge_kutta.md, (K2)."""
    y, K, watts = pack(x), np.zeros((len(tableau.b), 15)), np.zeros(len(tableau.b))
    for i, (row, c) in enumerate(zip(tableau.a, tableau.c, strict=True)):
        stage = followed(unpack(y + h * np.array(row) @ K[:i], x, x.t + c * h), body, c * h)
        own = at(stage, -origin)
        K[i], watts[i] = rates(stage, body, h, origin), power(own, body, h, velocities(own, body, h))
    return K, watts


def stepper(tableau: Tableau, origin: Array = USER) -> Step:
    """step(x, body, h): y + h sum_i b_i k_i, with y taken at a point (3,) [m] of the body; x is at the user's origin.

    docs/theory/runge_kutta.md, (K3).
    """

    def step(x: State, body: Body, h: float) -> State:
        x = at(boarded(remembered_half(x, body, h, second=False), body, h), origin)
        K, watts = stages_and_powers(x, body, h, tableau, origin)
        y = pack(x) + h * np.array(tableau.b) @ K
        x = replace(x, used=x.used + h * float(np.array(tableau.b) @ watts))
        x = landed(at(followed(unpack(y, x, x.t + h), body, h), -origin), body, h)
        return remembered_half(x, body, h, second=True)

    return step


def advance(step: Step, x: State, body: Body, h: float, steps: int) -> State:
    """The state after this many steps, each made by step(x, body, h)."""
    for _ in range(steps):
        x = step(replace(x, t=x.step * h), body, h)
        x = replace(x, step=x.step + 1, t=(x.step + 1) * h)
    return x


def advance_steady(tableau: Tableau, x: State, body: Body, h: float, steps: int, origin: Array = USER) -> State:
    """The state after this many steps of h [s] if forces are constant in inertial axes: then R p = P + t F is known.

    docs/theory/runge_kutta.md, (K6).

    y = (b, two rows of R, pi), (12,); p = R^T (R p) at every stage.
    """
    x = at(x, origin)
    nu, Om = np.split(np.linalg.solve(body.I6, np.concatenate([x.p, at(x, -origin).pi])), 2)
    P, F = x.R @ x.p, x.R @ wrench(x, body, h, nu, Om)[0]

    def unpacked(y: Array, t: float) -> State:
        full_state = unpack(np.concatenate([y[:9], P, y[9:]]), x, t)
        return replace(full_state, p=full_state.R.T @ (P + t * F))

    def f(y: Array, t: float) -> Array:
        rate = rates(unpacked(y, t), body, h, origin)
        return np.concatenate([rate[:9], rate[12:]])

    y = np.concatenate([x.b, x.R[0], x.R[2], x.pi])
    for k in range(steps):
        K = np.zeros((len(tableau.b), 12))
        for i, (row, c) in enumerate(zip(tableau.a, tableau.c, strict=True)):
            K[i] = f(y + h * np.array(row) @ K[:i], (k + c) * h)
        y = y + h * np.array(tableau.b) @ K
    return replace(at(unpacked(y, steps * h), -origin), step=steps)


def error_norm(tableau: Tableau, K: Array, h: float, scale: Array) -> float:
    """Error of a step divided by the tolerance, HNW (4.11); with two estimates, HNW II.10: e5^2 / sqrt(e5^2 + e3^2 / 100).

    docs/theory/runge_kutta.md, (K7).

    K: Rates (stages, 15), with the rate at the end of the step if the tableau needs it.
    """
    norms = [float(np.mean((h * np.array(e) @ K / scale) ** 2)) for e in tableau.errors]
    if len(norms) == 1:
        return math.sqrt(norms[0])
    fifth, third = norms
    return 0.0 if fifth == 0.0 else fifth / math.sqrt(fifth + 0.01 * third)


def next_factor(tableau: Tableau, error: float, before: float) -> float:
    """PI control, h <- h factor; error and before: errors of this step and of the last accepted step.

    docs/theory/runge_kutta.md, (K8).
    """
    exponent = 1.0 / tableau.estimate - 0.75 * BETA
    factor = SAFETY * max(error, 1e-10) ** -exponent * max(before, 1e-4) ** BETA
    return min(GROW, max(SHRINK, factor))


def attempt(x: State, body: Body, h: float, tableau: Tableau, rtol: float, atol: float | Array) -> tuple[State, float]:
    """The state h [s] later, and its error divided by the tolerance atol + rtol max(|y_k|, |y_k+1|)."""
    x = remembered_half(x, body, h, second=False)
    K, y = stages(x, body, h, tableau), pack(x)
    y_k1 = y + h * np.array(tableau.b) @ K
    new = followed(unpack(y_k1, x, x.t + h), body, h)
    if len(tableau.errors[0]) > len(K):
        K = np.vstack([K, rates(new, body, h)])
    error = error_norm(tableau, K, h, atol + rtol * np.maximum(np.abs(y), np.abs(y_k1)))
    return replace(remembered_half(new, body, h, second=True), step=x.step + 1), error


def first_step(x: State, body: Body, tableau: Tableau, rtol: float, atol: float | Array) -> float:
    """Starting step of HNW II.4: an explicit Euler step of h0 = 0.01 |y| / |f| estimates the second derivative."""
    y, f = pack(x), rates(x, body, 1.0)
    scale = atol + rtol * np.abs(y)
    d0, d1 = (math.sqrt(np.mean((v / scale) ** 2)) for v in (y, f))
    h0 = 0.01 * d0 / d1 if d0 > 1e-5 and d1 > 1e-5 else 1e-6
    d2 = math.sqrt(np.mean(((rates(unpack(y + h0 * f, x, x.t + h0), body, 1.0) - f) / scale) ** 2)) / h0
    h1 = (0.01 / max(d1, d2)) ** (1.0 / tableau.estimate) if max(d1, d2) > 1e-15 else max(1e-6, 1e-3 * h0)
    return min(100.0 * h0, h1)


def adaptive(
    x: State,
    body: Body,
    times: Sequence[float],
    rtol: float,
    atol: float | Array,
    tableau: Tableau,
    h: float | None = None,
) -> list[State]:
    """The states at increasing times, at which shortened steps end; h: first step, None (default) for `first_step`.

    Every state's `step` counts the accepted steps. Raises ValueError if the step becomes too small.
    """
    h = first_step(x, body, tableau, rtol, atol) if h is None else h
    states, before = [], 1e-4
    for t in times:
        while x.t < t:
            # Not a tiny last step: what is left is divided in two.
            remaining = t - x.t
            taken = remaining if remaining <= 1.0001 * h else min(h, 0.5 * remaining)
            new, error = attempt(x, body, taken, tableau, rtol, atol)
            if not math.isfinite(error):
                error = 1e10
            factor = next_factor(tableau, error, before)
            if error <= 1.0:
                x, before = (replace(new, t=t) if taken == remaining else new), error
                h = max(h, taken * factor) if taken < h else taken * factor
            else:
                h = taken * min(1.0, factor)
            if not h > 1e-14 * max(1.0, abs(x.t)):
                raise ValueError(f"t = {x.t:.6g}: the step {h:.3g} s is too small. Loosen rtol or atol")
        states.append(x)
    return states
