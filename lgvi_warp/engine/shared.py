# SPDX-License-Identifier: Apache-2.0
"""What all members share: results that follow from numbers of which none varies, computed once for a run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from lgvi_warp.physics.terms.base import PackingContext
from lgvi_warp.scene.ensemble import KEPT

Value = TypeVar("Value")

# Names under which these are noted beside parameters, whose names all have a dot. AXES is the frame but for its mass matrix,
# which alone changes with the mass of most vehicles.
FRAME, AXES, MEMBERS, SEED = "frame", "axes", "members", "seed"


class Reads(dict[str, np.ndarray]):
    """Numbers by name, which note the names that were read.

    Attributes:
        names: the names so far.
    """

    def __init__(self, numbers: Mapping[str, np.ndarray]):
        super().__init__(numbers)
        self.names: set[str] = set()

    def __getitem__(self, name: str) -> np.ndarray:
        self.names.add(name)
        return super().__getitem__(name)

    def get(self, name: str, default: Any = None) -> Any:
        """Return a number, or the default where there is none of this name."""
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
        """Return all names with their numbers in a dict, each noted."""
        return dict(self)

    def keys(self) -> Any:
        """Return all names, each noted."""
        self._all()
        return super().keys()

    def values(self) -> Any:
        """Return all numbers, each noted."""
        self._all()
        return super().values()

    def items(self) -> Any:
        """Return all names with their numbers, each noted."""
        self._all()
        return super().items()


class WatchedContext(PackingContext):
    """A packing context that notes when the frame, the members' indices or the seed are read. Its parameters are `Reads`."""

    def __getattribute__(self, name: str) -> Any:
        value = super().__getattribute__(name)
        if name in (FRAME, MEMBERS, SEED, "__dict__"):
            parameters = super().__getattribute__("parameters")
            parameters.names.update((FRAME, MEMBERS, SEED) if name == "__dict__" else (name,))
        return value


def context(numbers: Mapping[str, np.ndarray], *run: Any) -> PackingContext:
    """A packing context for a computation that `Shared` may watch.

    Args:
        numbers: parameters by name, as the computation was given them.
        run: frame, indices of the members, seed, step and `aligned`, as of `PackingContext`.

    Returns:
        The context.
    """
    return (WatchedContext if isinstance(numbers, Reads) else PackingContext)(numbers, *run)


@dataclass
class Shared:
    """Results computed once, as far as they follow from numbers that vary from no member to another.

    What a computation reads is seen when it runs first, so nothing has to list it. Which numbers it reads must depend on
    numbers that it read before only, as is so for any function of them.

    Args:
        varied: names of what varies; FRAME, MEMBERS and SEED may be among them.
    """

    varied: set[str]
    _kept: dict[Any, Any] = field(default_factory=dict)
    _varying: set[Any] = field(default_factory=set)
    _last: tuple[Mapping[str, np.ndarray], Any] | None = None

    def __call__(self, key: Any, numbers: Mapping[str, np.ndarray], compute: Callable[[Any], Value]) -> Value:
        """A result from memory, or computed.

        Args:
            key: name of the computation; two that may differ must have two names.
            numbers: what it may read, by name.
            compute: the computation.

        Returns:
            Its result.
        """
        if key in self._kept:
            return self._kept[key]
        if key in self._varying:
            return compute(numbers)
        reads = Reads(numbers)
        value = compute(reads)
        if reads.names.isdisjoint(self.varied):
            self._kept[key] = value
        else:
            self._varying.add(key)
        return value

    def of_the_same(self, numbers: Mapping[str, np.ndarray]) -> Any:
        """What `remember` was given for the members that have these numbers.

        Args:
            numbers: numbers by name, the same arrays as then and no copies of them.

        Returns:
            What was remembered; None for other members.
        """
        if self._last is None:
            return None
        numbers_then, value = self._last
        same = all(numbers.get(name) is numbers_then.get(name) for name in self.varied)
        return value if same else None

    def remember(self, numbers: Mapping[str, np.ndarray], value: Any) -> None:
        """Keep what follows from the numbers of few members until others come: a run looks at them more than once.

        Args:
            numbers: numbers by name.
            value: what follows from them.
        """
        few = all(len(numbers[name]) <= KEPT for name in self.varied if name in numbers)
        self._last = (numbers, value) if few else None

    def keeps(self, key: Any) -> bool:
        """Whether a computation that ran is shared by all members.

        Args:
            key: name of the computation.

        Returns:
            False also for one that has not run.
        """
        return key in self._kept
