"""Quantities of interest: one or a few numbers of each member of a result, named by a text or computed by a function."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.common.real_numbers import NotReal, real_results
from lgvi_warp.methods.saveat import FIELDS
from lgvi_warp.runs.result import Result
from lgvi_warp.statistics.functional import Functional, functional
from lgvi_warp.statistics.quantity import Quantity

REMEDY = 'write "position[2]", "depth", "norm(velocity)", "max(depth)", or give a function of a Result'

OfInterest = str | Quantity | Callable[..., Any]


@dataclass(frozen=True)
class OfResult:
    """A quantity of interest: a `Functional`, or a function of a Result.

    "position[2]" is that at the end; max(...), min(...), mean(...) and range(...) are over the samples that were kept;
    norm(...) is the length of a vector. looks_at_members: whether it may ask for more of the members than their parameters.
    """

    label: str
    of: Functional | Callable[[Result], Any]
    looks_at_members: bool = False

    @property
    def fields(self) -> tuple[str, ...]:
        """The samples that it needs: all for a function, since what it looks at cannot be told."""
        return self.of.quantity.fields if isinstance(self.of, Functional) else FIELDS

    @property
    def over_path(self) -> bool:
        """Whether it needs the whole path."""
        return isinstance(self.of, Functional) and self.of.over_path

    @property
    def is_function(self) -> bool:
        """Whether it is a function of a Result."""
        return not isinstance(self.of, Functional)

    def values(self, result: Result, members: Any = None) -> np.ndarray:
        """Its numbers (n, m), float64.

        Args:
            result: with the fields that it needs.
            members: as lw.Ensemble.select gives them, for a Quantity that looks at them; by default the result's own
                parameters and first samples.

        Raises:
            SceneError: for a function's result of another shape.
        """
        if isinstance(self.of, Functional):
            found = self.of(*samples_of(result, slice(None) if self.over_path else slice(-1, None), members))
            return found if self.over_path else found[-1]
        faults = Faults()
        try:
            found = real_results(self.of(result)).astype(np.float64)
        except NotReal as error:
            faults.add(self.label, "...", error.what, "return an array of real numbers")
        faults.raise_if_any()
        if found.ndim not in (1, 2) or len(found) != result.members:
            remedy = f"return an array of shape ({result.members},) or ({result.members}, m)"
            faults.add(self.label, "...", f"gave an array of shape {found.shape}", remedy)
            faults.raise_if_any()
        return found.reshape(result.members, -1)

    def labels(self, count: int) -> list[str]:
        """One for each of its `count` numbers."""
        if isinstance(self.of, Functional):
            return list(self.of.labels)
        return [self.label] if count == 1 else [f"{self.label}[{i}]" for i in range(count)]


class _Samples(dict[str, np.ndarray]):
    """Samples of a result as functions of (samples, members) see them."""

    def __init__(self, fields: Mapping[str, np.ndarray], time: np.ndarray, terms: Sequence[Any]):
        super().__init__(fields)
        self.time, self.terms = time, terms


def samples_of(result: Result, when: slice = slice(None), members: Any = None) -> tuple[Any, Any]:
    """(samples, members) of a result at some of its times, as a Quantity's function takes them."""
    fields = {name: result.samples[name][when] for name in FIELDS if name in result.samples}
    start = {name: result.samples[name][0] for name in fields}
    known = SimpleNamespace(parameters=result.parameters, count=result.members, **start)
    return _Samples(fields, result.time[when], result.terms), known if members is None else members


def quantities(of: OfInterest | Sequence[OfInterest]) -> tuple[OfResult, ...]:
    """What is asked for, one or several. Raises SceneError naming every fault."""
    asked = list(of) if isinstance(of, list | tuple) else [of]
    faults = Faults()
    found: list[OfResult] = []
    for one in asked:
        if callable(one) and not isinstance(one, Quantity) and not _of_samples(one):
            found.append(OfResult(getattr(one, "__name__", type(one).__name__), one))
        elif isinstance(one, str | Quantity) or callable(one):
            with faults.including():
                meant = functional("of", one)
                found.append(OfResult(meant.label, meant, not isinstance(one, str)))
        else:
            faults.add("of", one, "is no quantity", REMEDY)
    if not asked:
        faults.add("of", of, "names nothing", REMEDY)
    faults.raise_if_any()
    return tuple(found)


def _of_samples(function: Callable[..., Any]) -> bool:
    """Whether a function is one of (samples, members), as statistics take them, and not of a Result."""
    try:
        given = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return False
    plain = [
        one
        for one in given
        if one.kind in (one.POSITIONAL_ONLY, one.POSITIONAL_OR_KEYWORD) and one.default is one.empty
    ]
    return len(plain) == 2
