# SPDX-License-Identifier: Apache-2.0
"""Times as whole numbers of steps: decimals are read exactly, ratios within round-off."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction

import numpy as np

# A time is a whole number of steps within this part of a step.
ROUND_OFF = 1e-9
# Round-off of a ratio of two times, float64 and float32, as a part of it.
DOUBLE, SINGLE = 2.0**-50, 2.0**-22
# A shared step that would be more than this many times shorter than the one asked for is refused.
MOST_SHORTENING = 20


def exact(x: float) -> Fraction:
    """Find the intended number: 0.1 + 0.2 is 3/10, 0.3333333333333333 is 1/3, 1e-12 is itself."""
    simple = Fraction(repr(float(x))).limit_denominator(10**6)
    return simple if abs(float(simple) - x) <= 1e-15 * abs(x) else Fraction(f"{x:.15g}")


def of_step(h: float) -> Fraction:
    """Find the intended number of a step [s], or its exact binary value if the intended number has other bits."""
    meant = exact(h)
    return meant if float(meant) == h else Fraction(float(h))


def whole_steps(time: float, h: float) -> int | None:
    """Count the steps of h [s] in a time [s]; None if it is no whole number within round-off."""
    ratio = float(time) / float(h)
    steps = round(ratio) if math.isfinite(ratio) else 0
    return steps if abs(ratio - steps) <= slack(ratio, time, h) else None


def slack(ratio: float, *numbers: float) -> float:
    """Bound the round-off of a ratio of times, some of which may come from float32."""
    single = any(_of_float32(x) != x for x in numbers)
    return min(0.25, ROUND_OFF + abs(ratio) * (SINGLE if single else DOUBLE))


def rows_at(times: np.ndarray, time: float) -> np.ndarray:
    """Find a time [s] among others (k,), within round-off; returns an index or none."""
    size = max(1.0, abs(float(time)), float(times[-1]) if len(times) else 0.0)
    return np.flatnonzero(np.abs(times - time) <= size * max(ROUND_OFF, slack(1.0, time) - ROUND_OFF))


def shared_spacing(times: Iterable[Fraction]) -> Fraction:
    """Find the longest time that divides all times [s]."""
    spacing = Fraction(0)
    for t in times:
        shared = math.gcd(spacing.numerator * t.denominator, t.numerator * spacing.denominator)
        spacing = Fraction(shared, spacing.denominator * t.denominator)
    return spacing


def longest_step(times: Sequence[float]) -> Fraction:
    """Find the longest step that divides all times [s], the first of which is the longest."""
    spacing = shared_spacing(map(exact, times))
    if min(times) > MOST_SHORTENING * spacing:
        parts = _as_parts(min(times), times)
        return shared_spacing(parts[1:]) if parts else spacing
    return spacing


def meeting(h: float, end: float, times: Sequence[float]) -> tuple[Fraction, Fraction, list[Fraction]]:
    """Choose a step [s] of at most h that divides an end and more times.

    The times are read in four ways: as decimals, as decimals of float32, as whole numbers of steps, and as parts of the
    end. The first way that keeps the requested step is used, or else the first that shortens it little.

    Returns: The step, the requested step, and the times with the end first, as they were read.
    """
    found, every = [], [float(end), *map(float, times)]
    decimals = [exact(t) for t in (float(h), *every)]
    for reading in (None, _as_float32, _in_steps, _as_parts):
        read = reading(float(h), every) if reading else decimals
        if read is not None:
            meant, *others = read
            spacing = shared_spacing(others)
            step = spacing / math.ceil(spacing / meant)
            if step == meant:
                return step, meant, others
            found.append((step, meant, others))
    return next((read for read in found if read[1] / read[0] <= MOST_SHORTENING), found[0])


def _of_float32(x: float) -> float:
    """Read the shortest decimal of a float32 number; return any other number unchanged."""
    with np.errstate(over="ignore"):
        single = np.float32(x)
    return float(str(single)) if float(single) == x else float(x)


def _as_float32(h: float, times: Sequence[float]) -> list[Fraction] | None:
    """Read numbers that were rounded to float32 as their shortest decimals; None if there is no such number."""
    shortest = [_of_float32(t) for t in (h, *times)]
    return None if shortest == [h, *times] else [exact(t) for t in shortest]


def _in_steps(h: float, times: Sequence[float]) -> list[Fraction] | None:
    """Read times as whole numbers of steps; None if one is not. The step keeps its bits if it divides the end."""
    counts = [whole_steps(t, h) for t in times]
    if not counts[0] or any(not count if t else False for count, t in zip(counts, times, strict=True)):
        return None
    step, end = of_step(h), Fraction(times[0])
    if abs(step * counts[0] - end) > DOUBLE * end:
        step = end / counts[0]
    return [step, *(step * (count or 0) for count in counts)]


def _as_parts(h: float, times: Sequence[float]) -> list[Fraction] | None:
    """Read times as fractions of the end; None if one is not."""
    end, ratio = times[0], times[0] / h
    finest = int(min(2.0**31, MOST_SHORTENING * ratio)) + 1
    parts = [Fraction(t / end).limit_denominator(finest) for t in times]
    if any(abs(t - end * part) > h * slack(ratio, t, end) for t, part in zip(times, parts, strict=True)):
        return None
    # A quotient beyond the range of float64 is none.
    own = h / end if 0.0 < h / end < math.inf else Fraction(h) / Fraction(end)
    return [Fraction(end) * part for part in (Fraction(own), *parts)]
