# SPDX-License-Identifier: Apache-2.0
"""Expressions for quantities: a name, a component, a difference, a vector's length, or a reduction over the path.

"position[2]", "norm(velocity)" and the difference "measured_position - position" give numbers of each member at each
time; "vehicle.buoyancy" gives the member's own number; "max(depth)" and "range(norm(velocity))" give one number of each
member, over its path. Statistics, sensitivity, trade-offs and stability maps all read expressions here.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import Faults, closest, refusal
from lgvi_warp.control.signals import ordered
from lgvi_warp.statistics.values import reductions
from lgvi_warp.statistics.values.quantity import KNOWN, Quantity, joined, named, of_number
from lgvi_warp.statistics.values.reductions import Reduction

if TYPE_CHECKING:
    from lgvi_warp.sampling.members import Members
    from lgvi_warp.statistics.values.samples import Fields

OVER_TIME = {"max": reductions.MAXIMUM, "min": reductions.MINIMUM, "mean": reductions.MEAN, "range": reductions.RANGE}
# The length of a vector: of all of it, or of its first two components, which of one in inertial axes are north and east.
LENGTHS = {"norm": slice(None), "horizontal": slice(2)}
FUNCTIONS = (*OVER_TIME, *LENGTHS)
INERTIAL = {"position", "velocity_inertial", "measured_position", "navigation_error", "reference_position"}


@dataclass(frozen=True)
class Functional:
    """A quantity with the functions applied to it, and the index of the result's component; None: all components."""

    label: str
    quantity: Quantity
    functions: tuple[str, ...] = ()
    entry: int | None = None

    @property
    def _turn(self) -> int | None:
        """Index of the function that reduces the path."""
        return next((i for i, name in enumerate(self.functions) if name in OVER_TIME), None)

    @property
    def over_path(self) -> bool:
        """True if it reduces the path: one row for each member instead of one for each time."""
        return self._turn is not None

    @property
    def inner(self) -> Quantity:
        """The quantity at each time, before any reduction over the path."""
        if not self.over_path:
            return self.as_quantity()
        functions = self.functions[: self._turn]
        label = reduce(lambda text, name: f"{name}({text})", functions, self.quantity.name)
        return Functional(label, self.quantity, functions).as_quantity()

    @property
    def reduction(self) -> Reduction:
        """The reduction of the path, with the functions and the entry that are applied to its result."""
        assert self._turn is not None
        reduction, functions = OVER_TIME[self.functions[self._turn]], self.functions[self._turn + 1 :]
        if not functions and self.entry is None:
            return reduction

        def finish(state: np.ndarray) -> np.ndarray:
            values = self._applied(functions, np.moveaxis(reduction.finish(state), -2, -1))
            return np.ascontiguousarray(np.moveaxis(values, -1, -2))

        return replace(reduction, finish=finish, of_samples=reduction.of_samples and not functions)

    def _applied(self, functions: Sequence[str], values: np.ndarray) -> np.ndarray:
        """Apply the functions (lengths of vectors) and take the entry, along the last axis."""
        for name in functions:
            values = np.sqrt(np.sum(values[..., LENGTHS[name]] ** 2, axis=-1, keepdims=True))
        return values if self.entry is None else values[..., self.entry : self.entry + 1]

    @property
    def unit(self) -> str:
        """The unit of its numbers."""
        return self.quantity.unit

    @property
    def size(self) -> int:
        """Number of components of the result."""
        return 1 if self.entry is not None or LENGTHS.keys() & set(self.functions) else self.quantity.size

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the components; each is an expression for that component."""
        if self.size == 1:
            return (self.label,)
        if not self.functions:
            return tuple(label.replace(", ", ",") for label in self.quantity.labels)
        return tuple(f"{self.label}[{i}]" for i in range(self.quantity.size))

    def __call__(self, samples: Fields, members: Members) -> np.ndarray:
        """Evaluate the expression: float64 (k, n, size), or (n, size) if it reduces the path."""
        if self.over_path:
            values = self.inner(samples, members).astype(np.float64, copy=False)
            return self.reduction.over(values, samples.time).T
        values = self.quantity(samples, members).astype(np.float64, copy=False).transpose(0, 2, 1)
        return self._applied(self.functions, values)

    def as_quantity(self) -> Quantity:
        """Return the expression as a Quantity; if it reduces the path, this only has a name, and no numbers at each time."""
        if not self.functions and self.entry is None:
            return self.quantity
        return replace(self.quantity, name=self.label, labels=self.labels, function=self)


def functional(key: str, of: Any) -> Functional:
    """Return the expression for `of`."""
    if isinstance(of, Functional):
        return of
    if not isinstance(of, str):
        meaning = quantity(key, of)
        return Functional(meaning.name, meaning)
    return _parsed(key, of, of.replace(" ", ""))


def _parsed(key: str, of: str, text: str) -> Functional:
    """Parse a text without spaces, which is all of `of` or a part of it."""
    outer, entry = text, None
    if len(_operands(text)) == 1 and (match := re.fullmatch(r"(\w+\(.*\))\[(\d+)\]", text)):
        outer, entry = match[1], int(match[2])
    names, inner = _nested(outer)
    faults = Faults()
    for name in names:
        if name not in FUNCTIONS:
            faults.add(key, of, f"has a function {name!r} that is not known", closest(name, FUNCTIONS))
    if sum(name in OVER_TIME for name in names) > 1:
        faults.add(key, of, "is taken over the path twice", f"keep one of {', '.join(OVER_TIME)}")
    faults.raise_if_any()
    if len(operands := _operands(inner)) > 1:
        meaning = _difference(key, of, [_parsed(key, of, operand) for operand in operands])
    elif re.fullmatch(r"\w+(\[[\d,]+\])?", inner):
        meaning = named(key, of, inner)
    elif re.fullmatch(r"\w+(\.\w+|\[\d+\])*\.\w+(\[[\d,]+\])?", inner):
        meaning = of_number(key, of, inner)
    else:
        form = 'write "position[2]", "depth", "norm(velocity)", "max(depth)" or "measured_depth - depth"'
        raise refusal(key, of, "is not a quantity", f"{form}, of {', '.join(KNOWN)}")
    base = Functional(text.replace("-", " - "), meaning, tuple(reversed(names)))
    if "horizontal" in base.functions and (base.functions[0] != "horizontal" or not _inertial(meaning)):
        problem = "has a horizontal length of what is not a vector in inertial axes"
        raise refusal(key, of, problem, "write horizontal(navigation_error) or horizontal(velocity_inertial)")
    if entry is not None and (base.size == 1 or entry >= base.size):
        fault = f"{outer} has {base.size} component{'s' * (base.size > 1)}"
        raise refusal(key, of, fault, f"give one of them from 0, or {outer} alone")
    return replace(base, entry=entry)


def _inertial(meaning: Quantity) -> bool:
    """True if a quantity is a vector in inertial axes, beginning with north and east, or a difference of such vectors."""
    return meaning.size == 3 and not {part.partition("[")[0] for part in meaning.name.split(" - ")} - INERTIAL


def _nested(text: str) -> tuple[list[str], str]:
    """Names of the functions around a name, the outermost first, and the name."""
    functions = []
    while len(_operands(text)) == 1 and (match := re.fullmatch(r"(\w+)\((.*)\)", text)):
        functions.append(match[1])
        text = match[2]
    return functions, text


def _operands(text: str) -> list[str]:
    """The parts of a text between minus signs outside brackets."""
    parts, depth = [""], 0
    for character in text:
        depth += (character in "([") - (character in ")]")
        if character == "-" and not depth:
            parts.append("")
        else:
            parts[-1] += character
    return parts


def _difference(key: str, of: str, operands: Sequence[Functional]) -> Quantity:
    """The first quantity minus the others; differences of angles are wrapped to half a turn."""
    for operand in operands:
        if operand.over_path:
            remedy = "give a difference of quantities at each time, as in max(measured_depth - depth)"
            raise refusal(key, of, f"{operand.label} is taken over the whole path, and has no difference", remedy)
    first, *others = parts = [operand.as_quantity() for operand in operands]
    for other in others:
        if other.size != first.size or other.unit != first.unit or not other.unit:
            told = (f"{part.name} has {part.size} x [{part.unit or 'unknown unit'}]" for part in (first, other))
            raise refusal(key, of, " and ".join(told), "give quantities of one unit and size")

    def function(samples: Fields, members: Members) -> np.ndarray:
        values = first(samples, members).astype(np.float64, copy=False)
        for other in others:
            values = values - other(samples, members)
        if first.unit == "rad":
            values -= 2.0 * np.pi * np.rint(values / (2.0 * np.pi))
        return values.transpose(0, 2, 1)

    name, *labels = (" - ".join(each) for each in zip(*((part.name, *part.labels) for part in parts), strict=True))
    fields = ordered(field for part in parts for field in part.fields)
    return Quantity(name, function, first.unit, fields, tuple(labels), needs_limit=True)


def quantity(key: str, of: Any) -> Quantity:
    """Return the quantity for a name, a name with an index, a function of (samples, members), or a list of these."""
    if isinstance(of, Quantity):
        return of
    if isinstance(of, str):
        return functional(key, of).as_quantity()
    if callable(of):
        return Quantity(str(getattr(of, "__name__", type(of).__name__)), of)
    if items := items_of(of):
        parts = [quantity(f"{key}[{i}]", item) for i, item in enumerate(items)]
        for i, (part, item) in enumerate(zip(parts, items, strict=True)):
            if len(items) > 1 and over_path(part):
                fault = "is taken over the whole path, and a list is of numbers at each time"
                raise refusal(f"{key}[{i}]", item, fault, "ask for it alone")
        return joined(parts)
    remedy = f"give one of {', '.join(KNOWN)}, one component as in 'position[2]', or a function of (samples, members)"
    raise refusal(key, of, "is not a quantity", remedy)


def over_path(quantity: Quantity) -> Functional | None:
    """Return the expression of a quantity that reduces the path; None for a quantity at each time."""
    expression = quantity.function
    return expression if isinstance(expression, Functional) and expression.over_path else None
