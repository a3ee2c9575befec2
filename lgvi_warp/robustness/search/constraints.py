# SPDX-License-Identifier: Apache-2.0
"""Constraints of a search: bounds on margins, metrics and quantities that all members must keep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import listed
from lgvi_warp.common.errors import Faults, closest
from lgvi_warp.common.summaries import few_digits
from lgvi_warp.robustness.linear.margins import WORD_OF, margins, unit_of
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.uncertainty.rare.event import ABOVE_OR_BELOW

EXAMPLE = 'write "disk above 0.5", "disk heading_pid above 0.5" or "overshoot depth below 0.3"'
# The risk of a candidate that breaks a constraint is this, and as much again for each that all members break wholly.
BROKEN = 1e100


@dataclass(frozen=True)
class Constraint:
    """A bound on a number of each member; the bound itself is allowed.

    name: name of a metric or a quantity, or of a margin followed by the key of its law.
    """

    name: str
    side: str
    bound: float

    @property
    def text(self) -> str:
        """Text of the constraint."""
        return f"{self.name} {self.side} {few_digits(self.bound, self.unit)}"

    @property
    def margin(self) -> str | None:
        """The name of the margin; None for other numbers."""
        word = self.name.partition(" ")[0]
        return word if word in WORD_OF else None

    @property
    def loop(self) -> str | None:
        """The law of the margin; None for all laws."""
        return self.name.partition(" ")[2] or None

    @property
    def unit(self) -> str:
        """The unit of a margin; "" for other numbers."""
        return unit_of(self.margin) if self.margin else ""

    def slack(self, values: np.ndarray) -> np.ndarray:
        """Distances of numbers from the bound, negative if they violate it; minus infinity for NaN."""
        slack = values - self.bound if self.side == "above" else self.bound - values
        return np.asarray(np.where(np.isnan(values), -np.inf, slack))

    def broken(self, values: np.ndarray) -> np.ndarray:
        """Violation (k,) by numbers (k, n) of members, from 0 to 1; infinite if no member has a number."""
        scale = abs(self.bound) or 1.0
        parts = 1.0 - scale / (scale + np.maximum(-self.slack(values), 0.0))
        return np.where(np.isnan(values).all(axis=1), np.inf, parts.mean(axis=1))

    def worst(self, values: np.ndarray) -> float:
        """The number among (n,) that is closest to the bound or violates it most; NaN if a member has none."""
        return float(values[np.argmin(self.slack(values))])


def constraints_of(faults: Faults, texts: Any, controller: Any) -> tuple[Constraint, ...]:
    """Read constraints, such as "disk above 0.5"."""
    read = []
    for text in listed("constraints", texts, "texts"):
        found = ABOVE_OR_BELOW.fullmatch(text.strip()) if isinstance(text, str) else None
        if found is None:
            faults.add("constraints", text, "is no number with a bound", EXAMPLE)
            continue
        one = Constraint(found[1], found[2], float(found[3]))
        laws = [law.key for law in controller.laws] if controller is not None else []
        if one.margin and controller is None:
            faults.add("constraints", text, "is that of a loop, and the scene has no controller", "give [controller]")
        elif one.margin and one.loop not in (None, *laws):
            faults.add(
                "constraints", text, f"names {one.loop}, which is no law of the controller", closest(one.loop, laws)
            )
        read.append(one)
    return tuple(read)


def penalised(risk: np.ndarray, constraints: Sequence[Constraint], values: Sequence[np.ndarray]) -> np.ndarray:
    """Penalised risks (k,): candidates that keep all constraints come first, then those with smaller violations.

    Deb 2000, Comput. Methods Appl. Mech. Engrg. 186. values: one array (k, n) for each constraint.
    """
    total = sum((one.broken(each) for one, each in zip(constraints, values, strict=True)), np.zeros(len(risk)))
    return np.where((total > 0.0) & np.isfinite(risk), BROKEN * (1.0 + total), risk)


def margins_of(
    constraints: Sequence[Constraint], fleet: Ensemble, settings: Mapping[str, Any]
) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Margins, name of a constraint -> (n,), messages on effects left out; one computation for each loop."""
    found: dict[str, np.ndarray] = {}
    messages: dict[str, None] = {}
    wanted = [one for one in constraints if one.margin]
    how = {name: settings[name] for name in ("method", "h") if name in settings}
    for loop in dict.fromkeys(one.loop for one in wanted):
        names = {one.name: one.margin for one in wanted if one.loop == loop}
        of = list(dict.fromkeys(WORD_OF[margin] for margin in names.values() if margin))
        answer = margins(fleet, loop, of, **how)
        found |= {name: answer.values[margin] for name, margin in names.items() if margin}
        messages |= dict.fromkeys(answer.messages)
    return found, tuple(messages)
