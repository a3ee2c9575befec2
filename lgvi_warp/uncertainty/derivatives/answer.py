# SPDX-License-Identifier: Apache-2.0
"""Answer of `derivatives`: derivatives with their errors, and the reasons if there is none."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Self

import numpy as np

from lgvi_warp.common.summaries import few_digits, plural
from lgvi_warp.criteria.files import Saved, finite_or_none, with_missing_as

# Pairs of names that are told with one reason, and derivatives that the answer names.
MOST_NAMES, MOST_NAMED = 2, 3
ARRAYS = ("value", "jacobian", "error", "increments")


@dataclass(frozen=True, eq=False)
class Derivatives(Saved):
    """Derivatives of a run's outputs with respect to numbers of its scene; the result of `lw.derivatives`.

    m is the number of quantities and k the number of numbers. For a fleet of n members, arrays (m,) have the shape (n,
    m), and arrays (m, k) the shape (n, m, k).

    Attributes:
        of: names of the quantities (m,).
        units: units of the quantities (m,), "" if unknown.
        by: names of the numbers (k,).
        value: values of the quantities (m,).
        jacobian: derivative of each quantity by each number (m, k) [unit of quantity / unit of number]; NaN if undefined.
        error: estimated error of each derivative (m, k), from round-off and from the disagreement of differences at
            several increments. It is no bound: the true error is sometimes about 3 times as large. The error of the
            method's step is not included. NaN if undefined.
        increments: the largest increment used for each derivative (m, k) [unit of the number]; NaN if undefined.
        undefined: "quantity by number" -> sentence that gives the reason why this derivative is undefined.
        messages: notes for the user.
        members: number of copies of members that were run.
        provenance: scene, settings, versions and machine.
        by_units: units of the numbers (k,), "1" for a number without a unit.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("sphere", start={"velocity": [0.0, 0.0, 0.5]})
        >>> slopes = lw.derivatives(scene, "depth", "start.velocity[2]", method="psi_x", h=0.1, t1=2.0)
        >>> print(f"{slopes.jacobian[0, 0]:.4f}")
        2.0000
    """

    study: ClassVar[str] = "derivatives"

    of: tuple[str, ...]
    units: tuple[str, ...]
    by: tuple[str, ...]
    value: np.ndarray
    jacobian: np.ndarray
    error: np.ndarray
    increments: np.ndarray = field(repr=False)
    undefined: Mapping[str, str]
    messages: tuple[str, ...] = ()
    members: int = 0
    provenance: Mapping[str, Any] = field(default_factory=dict, repr=False)
    by_units: tuple[str, ...] = ()

    @property
    def answer(self) -> str:
        jacobian = np.atleast_3d(self.jacobian.T).T
        defined = np.isfinite(jacobian)
        texts: dict[str, list[str]] = {}
        named = [(i, j) for i, j in np.ndindex(defined.shape[1:]) if defined[:, i, j].any()]
        for i, j in named[:MOST_NAMED]:
            slope = few_digits(jacobian[defined[:, i, j], i, j].mean(), self.units[i], 4)
            error = f" (+- {self.error[i, j]:.1g})" if self.jacobian.ndim == 2 and np.isfinite(self.error[i, j]) else ""
            unit = dict(enumerate(self.by_units)).get(j, "1")
            step = "unit" if unit == "1" else unit
            texts.setdefault(self.of[i], []).append(f"{slope}{error} per {step} of {self.by[j]}")
        if not named:
            count, why = defined[0].size, "; ".join([*dict.fromkeys(self.undefined.values())][:2])
            none = (
                f"None of {count} derivatives is defined"
                if count > 1
                else f"{self.of[0]} has no derivative by {self.by[0]}"
            )
            return f"{none}: {why}."
        said = "; ".join(f"{of} changes by {', '.join(each)}" for of, each in texts.items())
        more = f", and {plural(len(named) - MOST_NAMED, 'more derivative')}" if len(named) > MOST_NAMED else ""
        undefined = int((~defined.any(axis=0)).sum())
        none = f"; {undefined} of {defined[0].size} are undefined" if undefined else ""
        return (
            said
            + more
            + (f", on average over {len(jacobian):,} members" if self.jacobian.ndim == 3 else "")
            + none
            + "."
        )

    def _report(self) -> list[str]:
        fleet = self.value.ndim == 2
        lines = ["of a fleet: mean over members, and the least and the largest"] if fleet else []
        for i, label in enumerate(self.of):
            unit = f" {self.units[i]}" if self.units[i] not in ("", "1") else ""
            value = _ends(self.value[:, i]) if fleet else f"{self.value[i]:.7g}"
            lines.append(f"{label} = {value}{unit}")
            for j, number in enumerate(self.by):
                slopes, errors = self.jacobian[..., i, j], self.error[..., i, j]
                text = _ends(slopes) if fleet else _sure(float(slopes), float(errors))
                lines.append(f"  by {number:<28} {text}")
        pairs: dict[str, list[str]] = {}
        for name, reason in self.undefined.items():
            pairs.setdefault(reason, []).append(name)
        for reason, names in pairs.items():
            more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
            lines.append(f"undefined   {', '.join(names[:MOST_NAMES])}{more}: {reason}")
        return [*lines, *(f"note        {message}" for message in self.messages)]

    def _content(self) -> dict[str, Any]:
        return finite_or_none({item.name: getattr(self, item.name) for item in fields(self)})

    @classmethod
    def _of_content(cls, content: dict[str, Any]) -> Self:
        arrays = {name: np.array(with_missing_as(content[name], math.nan), dtype=np.float64) for name in ARRAYS}
        texts = {name: tuple(content.get(name, ())) for name in ("of", "units", "by", "by_units", "messages")}
        return cls(**content | arrays | texts)

    def rows(self) -> Iterator[dict[str, Any]]:
        jacobian = np.atleast_3d(self.jacobian.T).T
        names = {name: np.reshape(getattr(self, name), jacobian.shape) for name in ARRAYS[1:]}
        values = np.reshape(self.value, jacobian.shape[:2])
        for member, i, j in np.ndindex(*jacobian.shape):
            about = {"member": member, "of": self.of[i], "by": self.by[j], "value": float(values[member, i])}
            yield about | {name: float(array[member, i, j]) for name, array in names.items()}


def _sure(value: float, error: float) -> str:
    """Text of a derivative with its error."""
    return "none" if math.isnan(value) else f"{value:.9g} +- {error:.1g}"


def _ends(values: np.ndarray) -> str:
    """Text of the members' mean, smallest and largest value, and of the number of members without a value."""
    known = values[np.isfinite(values)]
    count = len(values) - len(known)
    missing = f" ({count} members have none)" if count > 1 else " (1 member has none)" if count else ""
    return f"{known.mean():.6g}, {known.min():.6g} to {known.max():.6g}{missing}" if len(known) else "none"
