# SPDX-License-Identifier: Apache-2.0
"""Distributions of OpenTURNS, used through their methods: the library is not imported."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import refusal
from lgvi_warp.sampling.distributions.joint import JointLaw, components, split

# A place in memory, in the text of an object that says nothing else of itself.
ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")


@dataclass(frozen=True, eq=False)
class OpenTURNSDistribution(JointLaw):
    """A distribution of OpenTURNS, of one number or jointly of several; `vary` also accepts it without this class.

    The values are absolute. Several numbers follow from levels one by one, each conditional on the numbers before
    (Rosenblatt). A file stores only text, so a run that is read from a file needs the ensemble again.

    Args:
        distribution: The distribution.

    Raises:
        SceneError: If it does not give finite numbers at levels of 0.5.
    """

    distribution: Any = None
    kind: ClassVar[str] = "openturns"
    by_component: ClassVar[bool] = False
    several: ClassVar[bool] = True

    def __post_init__(self) -> None:
        d = int(self.distribution.getDimension())
        try:
            middle = (
                self._one_number(self.distribution, np.array([0.5])) if d == 1 else self._together(np.full((1, d), 0.5))
            )
            usable = bool(np.isfinite(middle).all())
        except Exception:  # whatever a user's object raises
            usable = False
        if not usable:
            raise refusal(
                "distribution", self.distribution, "gives no numbers in its middle", "give one with quantiles"
            )

    @property
    def joint(self) -> bool:
        return int(self.distribution.getDimension()) > 1

    @property
    def own(self) -> Any:
        return self.distribution

    def fault(self, shapes: Sequence[tuple[int, ...]]) -> tuple[str, str] | None:
        d, named = int(self.distribution.getDimension()), components(shapes)
        if d == 1:
            return None if len(shapes) == 1 else ("draws one quantity, several are named", "give one of each")
        return None if d == named else (f"is of {d} numbers, {named} are named", "name as many, in its order")

    def size(self, bases: Sequence[np.ndarray]) -> int:
        # One uniform number for each of its numbers.
        return int(self.distribution.getDimension())

    def quantile(self, u: np.ndarray, base: np.ndarray) -> np.ndarray:
        return self._one_number(self.distribution, u.ravel()).reshape(u.shape)

    def draw(self, u: np.ndarray, bases: Sequence[np.ndarray]) -> list[np.ndarray]:
        return split(self._together(u), bases)

    @staticmethod
    def _one_number(distribution: Any, levels: np.ndarray) -> np.ndarray:
        """Quantiles (n,) at levels (n,); OpenTURNS returns a sample with a point for each level."""
        return np.asarray(distribution.computeQuantile(levels.tolist()), dtype=np.float64).reshape(len(levels))

    def _together(self, u: np.ndarray) -> np.ndarray:
        """Numbers (n, d) at levels (n, d)."""
        law = self.distribution
        if getattr(law, "hasIndependentCopula", lambda: False)():
            return np.stack([self._one_number(law.getMarginal(i), u[:, i]) for i in range(u.shape[1])], axis=1)
        return np.array([np.asarray(law.computeSequentialConditionalQuantile(row), np.float64) for row in u.tolist()])

    def to_dict(self) -> dict[str, Any]:
        return {self.kind: {"law": ADDRESS.sub("", str(self.distribution))}}
