# SPDX-License-Identifier: Apache-2.0
"""Shared results: results of numbers that do not vary between members, computed once for a run."""

from __future__ import annotations

import contextlib
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeVar

import numpy as np

from lgvi_warp.physics.terms.base import PackingContext
from lgvi_warp.scene.slices import AT_ONCE

Value = TypeVar("Value")

# Names under which these are noted beside parameters, whose names all have a dot. AXES is the frame but for its mass matrix,
# which alone changes with the mass of most vehicles.
FRAME, AXES, MEMBERS, SEED = "frame", "axes", "members", "seed"
# Normals that the call gives, which differ by member as what MEMBERS keys does.
GIVEN = "given"


class TrackedParameters(dict[str, np.ndarray]):
    """Numbers by name; the object records the `names` that were read."""

    def __init__(self, numbers: Mapping[str, np.ndarray]):
        super().__init__(numbers)
        self.names: set[str] = set()

    def __getitem__(self, name: str) -> np.ndarray:
        self.names.add(name)
        return super().__getitem__(name)

    def get(self, name: str, default: Any = None) -> Any:
        """Return a number, or the default if there is none of this name."""
        self.names.add(name)
        return super().get(name, default)

    def _all(self) -> None:
        self.names.update(super().keys())

    def __iter__(self) -> Iterator[str]:
        self._all()
        return super().__iter__()

    def __or__(self, other: Any) -> Any:
        return dict(self) | other

    def __ror__(self, other: Any) -> Any:
        return other | dict(self)

    def copy(self) -> dict[str, np.ndarray]:
        """Return all names with their numbers in a dict, and record each."""
        return dict(self)

    def keys(self) -> Any:
        """Return all names, and record each."""
        self._all()
        return super().keys()

    def values(self) -> Any:
        """Return all numbers, and record each."""
        self._all()
        return super().values()

    def items(self) -> Any:
        """Return all names with their numbers, and record each."""
        self._all()
        return super().items()


class TrackedContext(PackingContext):
    """A packing context that records reads of the frame, the members or the seed; parameters are `TrackedParameters`."""

    def __getattribute__(self, name: str) -> Any:
        value = super().__getattribute__(name)
        if name in (FRAME, MEMBERS, SEED, "__dict__"):
            parameters = super().__getattribute__("parameters")
            parameters.names.update((FRAME, MEMBERS, SEED) if name == "__dict__" else (name,))
        elif name == GIVEN and value is not None:
            super().__getattribute__("parameters").names.add(MEMBERS)
        return value


def context(numbers: Mapping[str, np.ndarray], *run: Any) -> PackingContext:
    """A packing context for a computation that `SharedResultsCache` may observe."""
    return (TrackedContext if isinstance(numbers, TrackedParameters) else PackingContext)(numbers, *run)


class _Last(NamedTuple):
    """Given numbers of some members, completed by their frame, and results that follow from these alone."""

    given: Mapping[str, np.ndarray]
    numbers: Mapping[str, Any]
    results: dict[Any, Any]


# What was found of scenes, whose numbers never change: (names that vary, settings) -> results, and which keys vary; of each
# scene for so many runs at most.
MOST_KNOWN = 32
_known: weakref.WeakKeyDictionary[Any, dict[Any, tuple[dict[Any, Any], dict[Any, bool]]]] = weakref.WeakKeyDictionary()


def _known_of(scene: Any) -> dict[Any, tuple[dict[Any, Any], dict[Any, bool]]]:
    try:
        return _known.setdefault(scene, {})
    except TypeError:  # a scene of another kind, to which nothing can refer weakly
        return {}


@dataclass
class SharedResultsCache:
    """Results that are computed once if they depend only on numbers that all members share.

    The cache records the numbers that a computation reads at its first run, so no list is needed. The choice of numbers
    that it reads may depend only on numbers that it has read before, which holds for any function of them.

    user_axes: whether the kernel's axes and origin are the user's. An explicit method adds forces in these axes, where
        a drag matrix keeps its zeros. Other axes are better if a method multiplies matrices, or nothing depends on
        velocities.
    """

    varied: set[str]
    user_axes: bool = False
    _kept: dict[Any, Any] = field(default_factory=dict)
    _varying: dict[Any, bool] = field(default_factory=dict)
    _last: _Last | None = None
    # The last survey, and what it asked (see lgvi_warp.engine.survey).
    surveyed: Any = None

    @contextlib.contextmanager
    def continued(self, scene: Any, names: Iterable[str], settings: Any) -> Iterator[None]:
        """Start with results of an earlier run with the same scene, varied names and settings, and keep them afterwards.

        settings: everything that results depend on in addition to the scene's numbers.
        """
        known, place = _known_of(scene), (frozenset(names), settings)
        kept, varying = known.get(place, ({}, {}))
        self._kept.update(kept)
        self._varying.update(varying)
        yield
        if len(known) >= MOST_KNOWN:
            known.clear()
        known[place] = dict(self._kept), dict(self._varying)

    def __call__(self, key: Any, numbers: Mapping[str, np.ndarray], compute: Callable[[Any], Value]) -> Value:
        """Return a result from the cache, or compute it."""
        if key in self._kept:
            return self._kept[key]
        last = self._last
        results = last.results if last is not None and numbers is last.numbers else {}
        if key in results:
            return results[key]
        if key in self._varying:
            value = compute(numbers)
        else:
            reads = TrackedParameters(numbers)
            value = compute(reads)
            if reads.names.isdisjoint(self.varied):
                self._kept[key] = value
                return value
            self._varying[key] = reads.names.isdisjoint((MEMBERS, SEED))
        if self._varying[key]:
            results[key] = value
        return value

    def completed(self, numbers: Mapping[str, np.ndarray]) -> Any:
        """Completed numbers that `remember` stored for these members; None for other members."""
        last = self._last
        if last is None or any(numbers.get(name) is not last.given.get(name) for name in self.varied):
            return None
        return last.numbers

    def remember(self, parameters: Mapping[str, np.ndarray], numbers: Mapping[str, Any]) -> None:
        """Store results for the numbers of some members until other members follow: a run reads them more than once."""
        few = all(len(parameters[name]) <= AT_ONCE for name in self.varied if name in parameters)
        self._last = _Last(parameters, numbers, {}) if few else None

    def keeps(self, key: Any) -> bool:
        """Whether the result of a computation that ran is shared by all members."""
        return key in self._kept
