# SPDX-License-Identifier: Apache-2.0
"""One random factor for all entries of a number, or of several numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.sampling.distributions.basic import Distribution
from lgvi_warp.sampling.distributions.joint import JointLaw
from lgvi_warp.sampling.distributions.named import as_distribution


@dataclass(frozen=True, eq=False)
class Factor(JointLaw):
    """One random factor per member for all entries of a number, or of several numbers with the key "a, b" in `vary`.

    In a scene file: "drag_matrix.quadratic" = { factor = { uniform = { low = 0.8, high = 1.2 } } }.

    Args:
        law: Distribution of the factor. Where it would use the scene's value (for example as its mean), it uses 1.

    Raises:
        SceneError: If `law` is not a distribution of a single number.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> law = lw.distributions.Factor(lw.distributions.Uniform(low=0.8, high=1.2))
        >>> drawn = lw.Ensemble(scene, 4, vary={"drag_matrix.quadratic": law}).parameters(0, 4)["drag_matrix.quadratic"]
        >>> abs(drawn[:, 1, 1] / drawn[:, 2, 2] - 10.0) < 1e-12
        array([ True,  True,  True,  True])
    """

    law: Any = None
    kind: ClassVar[str] = "factor"
    several: ClassVar[bool] = True

    def __post_init__(self) -> None:
        faults, law = Faults(), as_distribution(self.kind, self.law)
        if not isinstance(law, Distribution) or law.joint or law.fault([()]):
            remedy = "give one of a single number, such as { uniform = { low = 0.8, high = 1.2 } }"
            faults.add(self.kind, self.law, "is not a distribution of a single number", remedy)
        faults.raise_if_any()
        object.__setattr__(self, "law", law)

    @property
    def own(self) -> Any:
        return self.law.own

    def fault(self, shapes: Sequence[tuple[int, ...]]) -> tuple[str, str] | None:
        return None

    def nothing_of(self, bases: Sequence[np.ndarray]) -> str | None:
        return None if any(np.any(base) for base in bases) else self.kind

    def size(self, bases: Sequence[np.ndarray]) -> int:
        # One uniform number.
        return 1

    def draw(self, u: np.ndarray, bases: Sequence[np.ndarray]) -> list[np.ndarray]:
        k = self.law.quantile(u[:, 0], np.array(1.0))
        return [k.reshape(len(k), *[1] * base.ndim) * base for base in bases]

    def to_dict(self) -> dict[str, Any]:
        return {self.kind: self.law.to_dict()}
