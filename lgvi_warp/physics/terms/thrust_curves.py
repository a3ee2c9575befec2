# SPDX-License-Identifier: Apache-2.0
"""Thrust as a function of the command, on the host: values and inverses of polynomials and tables."""

from __future__ import annotations

import numpy as np

from lgvi_warp.physics.notation import repeated

# The curve w^2, coefficients from the first power up.
SQUARE = (0.0, 1.0)
# A table's thrust at the command 0 counts as 0 below this part of its largest.
NEUTRAL = 1e-9


def polynomial_values(polynomial: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Values p_1 w + p_2 w^2 + ... of polynomials (1 or n, powers), from the first power up, at w (1 or n, k)."""
    value = np.zeros_like(w)
    for coefficient in polynomial.T[::-1]:
        value = (value + coefficient[:, None]) * w
    return value


def parted(curves: np.ndarray) -> tuple[np.ndarray, bool]:
    """Polynomials ahead and astern (1 or n, 2 powers) in the form that lgvi_kernels.laws.thrust_curves reads.

    Returns: For each side the odd powers, then the even powers; and whether both sides form one odd curve.
    """
    ahead, astern = np.split(curves, 2, axis=1)
    rows = [side[:, first::2] for side in (ahead, astern) for first in (0, 1)]
    return np.concatenate(rows, axis=1), not (np.any(ahead != astern) or np.any(rows[1]))


def table_values(at: np.ndarray, values: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Values at w (1 or n, channels) of tables with knots `at` (1 or n, t) and values (1 or n, t, channels)."""
    value = values[:, 0] + np.zeros_like(w)
    for j in range(at.shape[1] - 1):
        share = np.clip((w - at[:, j, None]) / (at[:, j + 1] - at[:, j])[:, None], 0.0, 1.0)
        value = value + share * (values[:, j + 1] - values[:, j])
    return value


def unfit(at: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Mask (n,) of members whose tables (n, t), (n, t, units) fall, are constant at nonzero thrust, or are not 0 at 0."""
    at, values = repeated(at, values)
    change = np.diff(values, axis=1)
    idle = (values[:, 1:] == 0.0) & (values[:, :-1] == 0.0)
    falls = np.any((change <= 0.0) & ~idle, axis=(1, 2))
    neutral = np.array([[np.interp(0.0, x, y) for y in columns.T] for x, columns in zip(at, values, strict=True)])
    return np.asarray(falls | np.any(np.abs(neutral) > NEUTRAL * np.abs(values).max(axis=1), axis=1))


def side_of_table(at: np.ndarray, values: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray]:
    """One side of tables of thrust (n, t) at commands (n, t), from the command at which thrust begins.

    Returns: Sizes of commands (n, t) and of thrusts (n, t), from (begin, 0) up; knots of the other side are moved there.
    """
    if side < 0.0:
        at, values = -at[:, ::-1], -values[:, ::-1]
    at, values = repeated(at, values)
    acts = values > 0.0
    # The last command without thrust, or where the line to the next one is 0.
    i = np.clip(np.argmax(acts, axis=1), 1, None) - 1
    row = np.arange(len(at))
    low, high = values[row, i], values[row, i + 1]
    begin = at[row, i] - low / np.where(high > low, high - low, 1.0) * (at[row, i + 1] - at[row, i])
    begin = np.where(acts.any(axis=1), begin, 0.0)
    return np.where(acts, at, begin[:, None]), np.where(acts, values, 0.0)


def solve(polynomial: np.ndarray, wanted: float, reach: float) -> float:
    """The smallest w in [0, reach] at which a polynomial without a constant has a given value.

    Args:
        polynomial: Coefficients from the first power up.
        wanted: The value, above 0.
        reach: Upper end of the interval.

    Returns:
        This w; if the polynomial does not reach the value, the w of its largest value.
    """
    powers = np.concatenate([[-wanted], polynomial])
    slope = np.polynomial.polynomial.polyder(powers)
    turns = _within(np.polynomial.polynomial.polyroots(slope), reach)
    places = np.array([0.0, *turns, reach])
    values = _value(polynomial, places)
    if values.max() <= wanted:
        return float(places[values.argmax()])
    # The polynomial is monotonic between its turns: the first interval at whose end it reaches the value has the root.
    i = int((values >= wanted).argmax())
    low, high = places[i - 1], places[i]
    for _ in range(200):
        middle = 0.5 * (low + high)
        if _value(polynomial, middle) < wanted:
            low = middle
        else:
            high = middle
    return float(high)


def _value(polynomial: np.ndarray, w: np.ndarray) -> np.ndarray:
    """The values of one polynomial (powers,) at w, of any shape."""
    return polynomial_values(polynomial[None], np.reshape(w, (1, -1))).reshape(np.shape(w))


def _within(roots: np.ndarray, reach: float) -> np.ndarray:
    """The real roots strictly between 0 and reach, sorted."""
    real = roots.real[np.abs(roots.imag) <= 1e-9 * (1.0 + np.abs(roots))]
    return np.sort(real[(real > 0.0) & (real < reach)])
