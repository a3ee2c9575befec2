"""Quantities of interest: one or a few numbers of each member of a result, named by a text or computed by a function."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.errors import Faults
from lgvi_warp.result import Result
from lgvi_warp.saveat import FIELDS

SHAPES: dict[str, tuple[int, ...]] = {
    "position": (3,), "attitude": (3, 3), "quaternion_wxyz": (4,), "velocity": (3,), "angular_velocity": (3,), "energy": ()
}  # fmt: skip
NEEDS = {"quaternion_wxyz": ("attitude",), "energy": FIELDS}
OVER_TIME: dict[str, Callable[..., np.ndarray]] = {"max": np.max, "min": np.min, "mean": np.mean, "range": np.ptp}
FUNCTIONS = (*OVER_TIME, "norm")
REMEDY = 'write "position[2]", "energy", "norm(velocity)", "max(position[2])", or give a function of a Result'

OfInterest = str | Callable[[Result], Any]


@dataclass(frozen=True)
class Quantity:
    """A quantity of interest. fields: the samples that it needs; path: whether it needs the whole path.

    "position[2]" is that at the end; max(...), min(...), mean(...) and range(...) are over the samples that were kept;
    norm(...) is the length of a vector.
    """

    label: str
    of: OfInterest
    fields: tuple[str, ...] = FIELDS
    path: bool = False

    def values(self, result: Result) -> np.ndarray:
        """(n, m), float64. Raises SceneError for a function's result of another shape."""
        if isinstance(self.of, str):
            found = _evaluated(self.of, result)
            found = found[-1] if not self.path else found
            return np.asarray(found, dtype=np.float64).reshape(result.members, -1)
        found = np.asarray(self.of(result), dtype=np.float64)
        if found.ndim not in (1, 2) or len(found) != result.members:
            faults = Faults()
            remedy = f"return an array of shape ({result.members},) or ({result.members}, m)"
            faults.add(self.label, "...", f"gave an array of shape {found.shape}", remedy)
            faults.raise_if_any()
        return found.reshape(result.members, -1)

    def labels(self, count: int) -> list[str]:
        """One for each of its numbers."""
        return [self.label] if count == 1 else [f"{self.label}[{i}]" for i in range(count)]


def quantities(of: OfInterest | Sequence[OfInterest]) -> tuple[Quantity, ...]:
    """What is asked for, one or several. Raises SceneError naming every fault."""
    asked = list(of) if isinstance(of, list | tuple) else [of]
    faults = Faults()
    found = [one for one in (_quantity(faults, one) for one in asked) if one]
    if not asked:
        faults.add("of", of, "names nothing", REMEDY)
    faults.raise_if_any()
    return tuple(found)


def _quantity(faults: Faults, of: Any) -> Quantity | None:
    if callable(of):
        # What it looks at cannot be told: it gets everything.
        return Quantity(getattr(of, "__name__", type(of).__name__), of)
    if not isinstance(of, str):
        faults.add("of", of, "is no quantity", REMEDY)
        return None
    functions, name, index = _parts(of)
    if name not in SHAPES or any(one not in FUNCTIONS for one in functions):
        faults.add("of", of, "is not known", REMEDY)
        return None
    shape = SHAPES[name]
    if index is not None and (len(index) != len(shape) or any(i >= n for i, n in zip(index, shape, strict=True))):
        faults.add("of", of, f"is no entry of {name}, of shape {shape}", REMEDY)
        return None
    if sum(one in OVER_TIME for one in functions) > 1:
        faults.add("of", of, "looks over the path twice", "keep one of max, min, mean, range")
        return None
    return Quantity(of.replace(" ", ""), of, NEEDS.get(name, (name,)), any(one in OVER_TIME for one in functions))


def _parts(of: str) -> tuple[list[str], str, tuple[int, ...] | None]:
    """The functions, outermost first; the name; the index of an entry."""
    text, functions = of.replace(" ", ""), []
    while match := re.fullmatch(r"(\w+)\((.*)\)", text):
        functions.append(match[1])
        text = match[2]
    entry = re.fullmatch(r"(\w+)\[(\d+(?:,\d+)*)\]", text)
    return (functions, entry[1], tuple(int(i) for i in entry[2].split(","))) if entry else (functions, text, None)


def _evaluated(of: str, result: Result) -> np.ndarray:
    """(k, n, ...), or (n, ...) where it looks over the path."""
    functions, name, index = _parts(of)
    values = np.asarray(getattr(result, name), dtype=np.float64)
    if index is not None:
        entry: tuple[Any, ...] = (slice(None), slice(None), *index)
        values = values[entry]
    leading = 2
    for function in reversed(functions):
        if function == "norm":
            values = np.sqrt(np.sum(values**2, axis=tuple(range(leading, values.ndim))))
        else:
            values = np.asarray(OVER_TIME[function](values, axis=0))
            leading = 1
    return values
