# SPDX-License-Identifier: Apache-2.0
"""The numbers of an estimate at its end, with their labels, as a table or a prompt shows them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np


def entries_of(estimate: Any) -> Iterator[tuple[str, str, float, float, float, int]]:
    """List the numbers of an estimate at its end."""
    unit = "" if estimate.unit == "1" or estimate.unit.startswith("products") else estimate.unit
    members = _MEMBERS.get(estimate.settings["type"], lambda estimate: estimate.count[-1])(estimate)
    for label, value, lower, upper in _LINES.get(estimate.settings["type"], _entries)(estimate):
        yield label, unit, float(value), float(lower), float(upper), int(members)


def texts_of(estimate: Any) -> list[tuple[str, str, str, str]]:
    """Return the texts of each number of an estimate: its label, its value, its interval, and its number of members."""
    rows = []
    for label, unit, value, lower, upper, members in entries_of(estimate):
        ends = f"{lower:.5g} to {upper:.5g}" if np.isfinite(lower) or np.isfinite(upper) else "no interval"
        kind = "effective members" if "members" in estimate.arrays else "members"
        rows.append((label, f"{value:.6g} {unit}".rstrip(), ends, f"{members:,} {kind}"))
    return rows


Line = tuple[str, float, float, float]


def _labels(estimate: Any) -> list[str]:
    """Label of each component, after the type of the statistic unless the statistic has a name."""
    kind, components = estimate.settings["type"], estimate.coordinates["component"].tolist()
    if len(components) == 1:
        return [estimate.name]
    if not estimate.name.startswith(f"{kind} "):
        return [f"{estimate.name}: {component}" for component in components]
    at = f" at {estimate.settings['at']}" if "at" in estimate.settings else ""
    return [f"{kind} {component}{at}" for component in components]


def _entries(estimate: Any) -> Iterator[Line]:
    """One line for each component at the last sample time."""
    for i, label in enumerate(_labels(estimate)):
        yield label, estimate.value[-1, i], estimate.lower[-1, i], estimate.upper[-1, i]


def _quantiles(estimate: Any) -> Iterator[Line]:
    for i, label in enumerate(_labels(estimate)):
        for j, level in enumerate(estimate.coordinates["level"]):
            yield f"{label} {level:g}", estimate.value[-1, j, i], estimate.lower[-1, j, i], estimate.upper[-1, j, i]


def _covariance(estimate: Any) -> Iterator[Line]:
    names = estimate.coordinates["component"]
    for i, first in enumerate(names):
        for j, second in enumerate(names[: i + 1] if len(names) <= 3 else [first]):
            at = (-1, i, j) if len(names) <= 3 else (-1, i, i)
            yield f"covariance {first}, {second}", estimate.value[at], estimate.lower[at], estimate.upper[at]


def _extremes(estimate: Any) -> Iterator[Line]:
    for i, label in enumerate(_labels(estimate)):
        for name in ("minimum", "maximum"):
            member = int(estimate[f"{name}_member"][-1, i])
            yield f"{label}: {name} (member {member})", estimate[name][-1, i], -np.inf, np.inf


def _passage(estimate: Any) -> Iterator[Line]:
    yield estimate.name, estimate.value[-1], estimate.lower[-1], estimate.upper[-1]
    yield from _times(estimate, "passage_time")


def _outcome(estimate: Any) -> Iterator[Line]:
    yield estimate.name, estimate.value[-1], estimate.lower[-1], estimate.upper[-1]
    if estimate["failed"][-1]:
        lower, upper = (float(estimate[f"fraction_{end}"][-1]) for end in ("lower", "upper"))
        yield f"{estimate.name}: of all members", float(estimate["fraction"][-1]), lower, upper
    yield from _times(estimate, "end_time")


def _times(estimate: Any, name: str) -> Iterator[Line]:
    """Lines for the times at which the levels are reached."""
    for j, level in enumerate(estimate.coordinates["level"]):
        value, lower, upper = (float(estimate[f"{name}{end}"][j]) for end in ("", "_lower", "_upper"))
        yield f"{estimate.name}: time [s] of {level:g}", value, lower, upper


def _attitude(estimate: Any) -> Iterator[Line]:
    yield f"{estimate.name}: dispersion [rad]", estimate["dispersion"][-1], -np.inf, np.inf
    for i, half in enumerate(estimate["rotation_half_width"][-1]):
        yield f"{estimate.name}: about {'xyz'[i]} [rad]", 0.0, -half, half


def _histogram(estimate: Any) -> Iterator[Line]:
    for i, label in enumerate(_labels(estimate)):
        at = -1, i, int(np.argmax(estimate["counts"][-1, i]))
        middle = estimate.coordinates["bin"][at[2]]
        yield f"{label}: fullest bin, at {middle:g}", estimate.value[at], estimate.lower[at], estimate.upper[at]


_LINES: dict[str, Callable[[Any], Iterator[Line]]] = {
    "quantiles": _quantiles,
    "covariance": _covariance,
    "extremes": _extremes,
    "first_passage": _passage,
    "outcome": _outcome,
    "mean_attitude": _attitude,
    "histogram": _histogram,
    # As many as there are members.
    "each": lambda estimate: iter(()),
}

# Number of members behind an estimate, for types where it is not the count at the end.
_MEMBERS: dict[str, Callable[[Any], int]] = {
    "first_passage": lambda estimate: int(estimate.count[0]),
    "outcome": lambda estimate: int(estimate.count[0] + estimate["ended"][0] + estimate["otherwise"][0]),
}
