# SPDX-License-Identifier: Apache-2.0
"""Results of a check of device code: single checks, and the report that lists them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from lgvi_warp.common.sentences import capital
from lgvi_warp.engine.arrays import FIELDS
from lgvi_warp.physics.terms.base import Packed, Term

# How much of a law's largest number its roundings may add up to: 64 of them.
ROUND_OFF = 64.0 * float(np.finfo(np.float64).eps)
# What to do where lanes mix, or where numbers that vary give something else.
LANES_APART = "a lane must not look at others"
VARIED_NUMBERS = "packed() must give n entries where its numbers have n"


class Check(NamedTuple):
    """The result of one check."""

    name: str  # what was checked, such as "law: torque = -dU/dR"
    worst: float  # the worst deviation found, in the unit of what was checked
    allowed: float  # the largest deviation allowed at that view, in the same unit
    ok: bool
    text: str  # where it failed and the remedy, or a note; "" for none


@dataclass(frozen=True)
class LawReport:
    """The checks of one law, or of one part of a controller; printed as a table.

    Attributes:
        term: the checked term or part.
        checks: one entry for each check, in order.
    """

    term: Term
    checks: tuple[Check, ...]

    @property
    def ok(self) -> bool:
        """Whether every check of the law passed."""
        return all(check.ok for check in self.checks)

    def __str__(self) -> str:
        head = f"{type(self.term).__name__} ({self.term.key}): {'ok' if self.ok else 'WRONG'}"
        rows = [("check", "worst", "allowed", "", "")]
        for name, worst, allowed, ok, text in self.checks:
            rows.append((name, f"{worst:.2e}", f"{allowed:.2e}", "ok" if ok else "WRONG", text))
        widths = [max(len(row[i]) for row in rows) for i in range(4)]
        padded = ([*(text.ljust(n) for text, n in zip(row, widths, strict=False)), row[4]] for row in rows)
        return "\n  ".join([head, *("  ".join(row).rstrip() for row in padded)])


class Described(Protocol):
    """Views or ticks that a message can describe."""

    def description(self, i: int) -> str:
        """Describe one view or tick in words."""


def judged(
    name: str, difference: np.ndarray | str, allowed: np.ndarray | float, views: Described, remedy: str
) -> Check:
    """Make a check of deviations: it shows the deviation that exceeds its limit by most, and its view.

    difference: (k,) or (k, d), deviations at k views; or a text that says why they could not be computed.
    allowed: largest allowed deviation; an array has one limit for each view (k,).
    """
    if isinstance(difference, str):
        return Check(name, np.inf, 0.0, False, difference)
    k = len(difference)
    worst = np.abs(difference).reshape(k, -1)
    limit = np.broadcast_to(np.reshape(allowed, (-1, 1)) if np.ndim(allowed) == 1 else allowed, worst.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(worst <= limit, worst / np.maximum(limit, 1e-300), 1.0 + worst)
        ratio = np.where(np.isfinite(worst), ratio, np.inf)
    i, j = np.unravel_index(ratio.argmax(), ratio.shape)
    good = bool(np.all(worst <= limit) and np.isfinite(limit).all())
    text = "" if good else f"{views.description(int(i))}. {capital(remedy)}"
    return Check(name, float(worst[i, j]), float(limit[i, j]), good, text)


def finite(name: str, values: np.ndarray | str, views: Described, remedy: str = "guard divisions and roots") -> Check:
    """Check that the values (k, n) at k views are finite."""
    wrong = values if isinstance(values, str) else (~np.isfinite(values).all(axis=1)).astype(float)
    return judged(name, wrong, 0.0, views, remedy)


def first_wrong(checks: Iterable[Check]) -> Check:
    """Return the first check that fails, or else the last check; later checks are not made."""
    for check in checks:
        if not check.ok:
            break
    return check


def attempt(make: Callable[[], Any], where: str) -> Any:
    """Call a function that packs numbers; return its result, or a message on its failure."""
    try:
        return make()
    except Exception as error:
        return f"packed() fails {where}: {type(error).__name__}: {error}"


def packed_numbers(term: Term, Params: np.dtype, pack: Callable[[], Any]) -> tuple[Packed | None, list[Check]]:
    """Check that packed() fills the fields that params() names.

    Returns: (the packed numbers, or None after a failure; the check).
    """
    packed = attempt(pack, "with shared numbers")
    if not isinstance(packed, Packed):
        text = packed if isinstance(packed, str) else f"packed() returns {packed!r:.60}"
        remedy = (
            "write packed(self, numbers, context) that returns lw.laws.Packed({name: numbers}), names as in params()"
        )
        return None, [Check("packed", 1.0, 0.0, False, f"{text}. {capital(remedy)}")]
    places = {"first": packed.rows is not None, "memory": packed.memory is not None, "work": packed.work}
    first_law = Params["own"]
    fields = (first_law["own"] if first_law.names == FIELDS else first_law).names
    filled = set(packed.values) | {name for name, present in places.items() if present}
    wanted = set(fields or ()) - {"unused"}
    wrong = [f"{name} is not in packed().values" for name in sorted(wanted - filled)]
    wrong += [f"{name} is not a field of params()" for name in sorted(filled - wanted - places.keys())]
    return packed, [Check("numbers", len(wrong), 0.0, not wrong, "; ".join(wrong))]


def unpacked(problem: str) -> Check:
    """Check that failed because the device cannot use the numbers."""
    text = f"{problem}. Give arrays (1,), (1, 3) or (n,), (n, 3), and whole numbers"
    return Check("packed", 1.0, 0.0, False, text)
