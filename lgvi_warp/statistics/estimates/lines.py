# SPDX-License-Identifier: Apache-2.0
"""The numbers of an estimate at its end, with their labels, as a table and a prompt show them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np


def entries_of(one: Any) -> Iterator[tuple[str, str, float, float, float, int]]:
    """List the numbers of an estimate at its end."""
    unit = "" if one.unit == "1" or one.unit.startswith("products") else one.unit
    members = _MEMBERS.get(one.settings["type"], lambda one: one.count[-1])(one)
    for label, value, lower, upper in _LINES.get(one.settings["type"], _entries)(one):
        yield label, unit, float(value), float(lower), float(upper), int(members)


def texts_of(one: Any) -> list[tuple[str, str, str, str]]:
    """Return the texts of each number of an estimate: its label, its value, its interval, and its number of members."""
    rows = []
    for label, unit, value, lower, upper, members in entries_of(one):
        ends = f"{lower:.5g} to {upper:.5g}" if np.isfinite(lower) or np.isfinite(upper) else "no interval"
        rows.append((label, f"{value:.6g} {unit}".rstrip(), ends, f"{members:,} members"))
    return rows


Line = tuple[str, float, float, float]


def _labels(one: Any) -> list[str]:
    """Label of each component, preceded by the type of the statistic unless it was given a name."""
    kind, at = one.settings["type"], f" at {one.settings['at']}" if "at" in one.settings else ""
    if one.name != f"{kind} {', '.join(one.name.split(' ', 1)[1:])}" or len(one.coordinates["component"]) == 1:
        names = [one.name] if len(one.coordinates["component"]) == 1 else one.coordinates["component"].tolist()
        return names if len(names) == 1 else [f"{one.name}: {name}" for name in names]
    return [f"{kind} {name}{at}" for name in one.coordinates["component"]]


def _entries(one: Any) -> Iterator[Line]:
    """One line for each component at the last sample time."""
    for i, label in enumerate(_labels(one)):
        yield label, one.value[-1, i], one.lower[-1, i], one.upper[-1, i]


def _quantiles(one: Any) -> Iterator[Line]:
    for i, label in enumerate(_labels(one)):
        for j, level in enumerate(one.coordinates["level"]):
            yield f"{label} {level:g}", one.value[-1, j, i], one.lower[-1, j, i], one.upper[-1, j, i]


def _covariance(one: Any) -> Iterator[Line]:
    names = one.coordinates["component"]
    for i, first in enumerate(names):
        for j, second in enumerate(names[: i + 1] if len(names) <= 3 else [first]):
            at = (-1, i, j) if len(names) <= 3 else (-1, i, i)
            yield f"covariance {first}, {second}", one.value[at], one.lower[at], one.upper[at]


def _extremes(one: Any) -> Iterator[Line]:
    for i, label in enumerate(_labels(one)):
        for name in ("minimum", "maximum"):
            member = int(one[f"{name}_member"][-1, i])
            yield f"{label}: {name} (member {member})", one[name][-1, i], -np.inf, np.inf


def _passage(one: Any) -> Iterator[Line]:
    yield one.name, one.value[-1], one.lower[-1], one.upper[-1]
    yield from _times(one, "passage_time")


def _outcome(one: Any) -> Iterator[Line]:
    yield one.name, one.value[-1], one.lower[-1], one.upper[-1]
    if one["failed"][-1]:
        lower, upper = (float(one[f"fraction_{end}"][-1]) for end in ("lower", "upper"))
        yield f"{one.name}: of all members", float(one["fraction"][-1]), lower, upper
    yield from _times(one, "end_time")


def _times(one: Any, name: str) -> Iterator[Line]:
    """A line for the time by which each level is reached."""
    for j, level in enumerate(one.coordinates["level"]):
        value, lower, upper = (float(one[f"{name}{end}"][j]) for end in ("", "_lower", "_upper"))
        yield f"{one.name}: time [s] of {level:g}", value, lower, upper


def _attitude(one: Any) -> Iterator[Line]:
    yield f"{one.name}: dispersion [rad]", one["dispersion"][-1], -np.inf, np.inf
    for i, half in enumerate(one["rotation_half_width"][-1]):
        yield f"{one.name}: about {'xyz'[i]} [rad]", 0.0, -half, half


def _histogram(one: Any) -> Iterator[Line]:
    for i, label in enumerate(_labels(one)):
        at = -1, i, int(np.argmax(one["counts"][-1, i]))
        middle = one.coordinates["bin"][at[2]]
        yield f"{label}: fullest bin, at {middle:g}", one.value[at], one.lower[at], one.upper[at]


_LINES: dict[str, Callable[[Any], Iterator[Line]]] = {
    "quantiles": _quantiles,
    "covariance": _covariance,
    "extremes": _extremes,
    "first_passage": _passage,
    "outcome": _outcome,
    "mean_attitude": _attitude,
    "histogram": _histogram,
    # As many as there are members.
    "each": lambda one: iter(()),
}

# Number of members behind an estimate, for types where it is not the count at the end.
_MEMBERS: dict[str, Callable[[Any], int]] = {
    "first_passage": lambda one: int(one.count[0]),
    "outcome": lambda one: int(one.count[0] + one["ended"][0] + one["otherwise"][0]),
}
