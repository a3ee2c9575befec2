"""Largest stable steps: what linear theory says of a method, and how fast a member moves at its start.

A limit is a number c of a method over a rate of a member, h < c / rate. The rates are |J^-1 pi| of its rotation, w of its
Munk oscillation and of its restoring oscillation, and (l + 2 q |v|) / I of its drag.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping

import numpy as np

from lgvi_warp.methods.method import FORCED, Method
from lgvi_warp.methods.tableaux import Tableau
from lgvi_warp.physics import inertia, vehicle

# A step counts as stable where a small motion grows by less than this: tenfold in 4000 steps.
GROWTH = math.log(10.0) / 4000.0
# Slowest contraction with which the iteration for the forces of Phi* reaches its tolerance in 60 rounds.
CONTRACTION = 1e-14 ** (1.0 / 60.0)
# Spacing and end of the numbers h w that are tried [rad].
STEP, MOST = 1e-3, 30.0
# Letters of programs: sub-maps that turn the body, and those that change its momentum in each oscillation. Turns about
# the three axes follow one another; only that about the oscillation's own axis, R1 or R3 (twice a step), counts.
TURNS = ("D", "W", "R1", "A")
MOMENTS = {"munk": ("T", "Ap", "B"), "restoring": ("K", "B")}


def _oscillator(method: Method, moments: tuple[str, ...]) -> list[tuple[bool, float]]:
    """List the moves of one step in turn: (whether the angle or the rate is advanced, over how many steps)."""
    if method.two_part:
        first = method.program[0][0]
        return [((first == "A") == (i % 2 == 0), g) for i, g in enumerate(method.stages)]
    program, n = method.program, len(method.program) // 2
    if method.halved:
        lengths = [2.0 * g for g in method.stages]
        pairs = list(zip(lengths[0::2], lengths[1::2], strict=True))
        maps = [
            (letter, c * (a if i < n else b if i >= len(program) - n else 0.5 * (a + b)))
            for a, b in pairs
            for i, (letter, c) in enumerate(program)
        ]
    else:
        maps = [(letter, c * g) for g in method.stages for letter, c in program]
    return [(letter in TURNS, c) for letter, c in maps if letter in TURNS or letter in moments]


@functools.cache
def oscillation_limit(name: str, kind: str = "munk") -> float:
    """Compute the largest h w at which a small oscillation of frequency w stays small.

    For sub-maps it follows from the product of shears that a step is, for explicit methods from the stability polynomial
    at i h w. Large amplitudes may tumble earlier.

    Args:
        name: of the method.
        kind: "munk" or "restoring". Default "munk".

    Returns:
        The limit [rad]; infinite without one; NaN for gauss*, which end where their iteration does.
    """
    method, numbers = Method(name), np.arange(STEP, MOST, STEP)
    if method.gauss:
        return math.nan
    if method.tableau:
        growth = np.abs(stability_polynomial(method.tableau, 1j * numbers))
    else:
        step = np.broadcast_to(np.eye(2), (len(numbers), 2, 2)).copy()
        for angle, c in _oscillator(method, MOMENTS[kind]):
            row, source, sign = (0, 1, 1.0) if angle else (1, 0, -1.0)
            step[:, row] += (sign * c * numbers)[:, None] * step[:, source]
        # Determinant 1: both eigenvalues lie on the unit circle up to a trace of 2.
        half = 0.5 * np.abs(step[:, 0, 0] + step[:, 1, 1])
        growth = half + np.sqrt(np.maximum(half**2 - 1.0, 0.0))
    return _first(numbers, growth)


def stability_polynomial(tableau: Tableau, z: np.ndarray) -> np.ndarray:
    """Evaluate the stability polynomial R(z) of an explicit method: one step of y' = (z/h) y from y = 1.

    Args:
        tableau: of the method.
        z: complex or real numbers (n,).

    Returns:
        R(z) (n,).
    """
    s = len(tableau.b)
    slopes: list[np.ndarray] = []
    for i in range(s):
        slopes.append(1.0 + z * sum((a * k for a, k in zip(tableau.a[i], slopes, strict=False)), np.zeros_like(z)))
    return np.asarray(1.0 + z * sum(b * k for b, k in zip(tableau.b, slopes, strict=True)))


def _first(numbers: np.ndarray, growth: np.ndarray) -> float:
    beyond = growth > 1.0 + GROWTH
    return float(numbers[np.argmax(beyond)] - STEP) if beyond.any() else math.inf


@functools.cache
def drag_limit(name: str) -> float:
    """Compute the largest h (l + 2 q |v|) / I, beyond which explicit drag grows.

    A composition is refused where a stage that goes backward would meet a drag number above 0.5.

    Args:
        name: of the method.

    Returns:
        The limit [1]; infinite where drag is advanced exactly or implicitly.
    """
    method = Method(name)
    if method.linearly_implicit:
        return math.inf
    if method.tableau:
        numbers = np.arange(STEP, MOST, STEP)
        return _first(numbers, np.abs(stability_polynomial(method.tableau, -numbers)))
    if method.base in FORCED:
        # Phi is explicit, (1 - x) v; Phi* implicit, v / (1 + x), but its iteration contracts by x, in Psi over h/2.
        return {"phi": 2.0, "phi_adjoint": CONTRACTION, "psi": 2.0 * CONTRACTION}[method.base]
    back = -min(0.0, *method.stages)
    return 0.5 / back if back else math.inf


@functools.cache
def rotation_limit(name: str) -> float:
    """Compute the largest h |J^-1 pi| of a method.

    It is |J^-1 a| = 1 for equation (24), half an angle of 1 for turns about axes, and for rk* the step at which the
    numbers of R grow.

    Args:
        name: of the method.

    Returns:
        The limit [rad]; infinite for Runge-Kutta methods on the rotation group; NaN for gauss*.
    """
    method = Method(name)
    if method.tableau:
        return math.inf if name in ("cg3", "rkmk4") else oscillation_limit(name)
    if method.gauss:
        return math.nan
    if method.two_part:
        # The modified rotation of a part ends at a quarter turn.
        first = method.program[0][0] == "A"
        return 0.5 * math.pi / max(abs(g) for g in method.stages[0 if first else 1 :: 2])
    share = max(abs(c) for letter, c in method.program if letter in ("D", "W", "R1"))
    longest = max(abs(g) for g in method.stages) * (2.0 if method.halved else 1.0)
    return (2.0 if method.turns else 1.0) / (share * longest)


LIMITS: dict[str, Callable[[str], float]] = {
    "rotation": rotation_limit,
    "munk": lambda name: oscillation_limit(name, "munk"),
    "restoring": lambda name: oscillation_limit(name, "restoring"),
    "drag": drag_limit,
}
TEXTS = {
    "rotation": "|J^-1 a| = 1, half a turn's angle = 1 (psi_x), or R grows (rk*)",
    "munk": "Munk oscillation, h w = limit",
    "restoring": "restoring oscillation, h w = limit",
    "drag": "drag number h (l + 2 q |v|) / I = limit",
}


def rates(
    parameters: Mapping[str, np.ndarray], velocity: np.ndarray, angular_velocity: np.ndarray
) -> dict[str, np.ndarray]:
    """Compute how fast members move at their start.

    Mathematics, section 7: w_Munk^2 = |p|^2 (1/M_min - 1/M_max) / J_min, w_restoring^2 = B |r| / J_min.

    Args:
        parameters: names of the scene -> values with leading dimension 1 or n.
        velocity: of the members (n, 3) [m/s], body axes.
        angular_velocity: of the members (n, 3) [rad/s], body axes.

    Returns:
        Names of LIMITS -> rate (n,) [rad/s; drag 1/s].
    """
    n = len(velocity)
    I6 = np.broadcast_to(vehicle.inertia6(parameters), (n, 6, 6))
    p = np.einsum("nij,nj->ni", I6, np.concatenate([velocity, angular_velocity], axis=1))[:, :3]
    frame, _ = inertia.uncoupled_frame(inertia.blocks(I6))
    least, most = (1.0 / np.linalg.eigvalsh(frame.M)[:, i] for i in (-1, 0))
    J = np.min(frame.J, axis=1)
    arm = parameters["vehicle.center_of_buoyancy"] - parameters.get("vehicle.center_of_gravity", np.zeros((1, 3)))
    moment = parameters["vehicle.buoyancy"] * np.linalg.norm(arm, axis=-1)
    # A difference of two equal masses is round-off.
    spread = np.where(most - least > 1e-12 * most, most - least, 0.0)
    by_kind = {
        "rotation": np.linalg.norm(angular_velocity, axis=1),
        "munk": np.linalg.norm(p, axis=1) * np.sqrt(spread / J),
        "restoring": np.sqrt(moment / J) + np.zeros(n),
    }
    return by_kind | {"drag": drag_rate(parameters, I6, velocity, angular_velocity)}


def drag_rate(
    parameters: Mapping[str, np.ndarray], I6: np.ndarray, velocity: np.ndarray, angular_velocity: np.ndarray
) -> np.ndarray:
    """Compute the largest (l_ii + 2 q_ii |v_i|) / I_ii over the six axes, summed over all drag terms.

    Args:
        parameters: names of the scene -> values with leading dimension 1 or n.
        I6: inertia with added mass (n, 6, 6) [kg, kg m, kg m^2].
        velocity: of the members (n, 3) [m/s], body axes.
        angular_velocity: of the members (n, 3) [rad/s], body axes.

    Returns:
        Rate (n,) [1/s]; 0 without drag.
    """
    speeds = np.abs(np.concatenate([velocity, angular_velocity], axis=1))
    total = np.zeros_like(speeds)
    for key in drag_keys(parameters):
        linear, quadratic = (_diagonal(parameters[f"{key}.{kind}"]) for kind in ("linear", "quadratic"))
        total = total + linear + 2.0 * quadratic * speeds
    return np.asarray(np.max(total / np.einsum("nii->ni", I6), axis=1))


def drag_keys(parameters: Mapping[str, np.ndarray]) -> list[str]:
    """Find the terms with linear and quadratic drag coefficients on six axes.

    Args:
        parameters: names of the scene -> values.

    Returns:
        Keys of the terms, such as "drag".
    """
    keys = [name.removesuffix(".quadratic") for name in parameters if name.endswith(".quadratic")]
    return [key for key in keys if parameters.get(f"{key}.linear", np.zeros(1)).shape[-1] == 6]


def _diagonal(values: np.ndarray) -> np.ndarray:
    return values if values.ndim == 2 else np.einsum("nii->ni", values)
