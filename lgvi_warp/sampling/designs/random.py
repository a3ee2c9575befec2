# SPDX-License-Identifier: Apache-2.0
"""Independent random numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lgvi_warp.common.random import uniforms_of
from lgvi_warp.sampling.designs.base import Drawn, Sampling
from lgvi_warp.sampling.designs.space import Space


@dataclass(frozen=True)
class Random(Sampling):
    """Independent random numbers, which depend only on the seed, the member's index and the name of the quantity.

    Adding members or varied names does not change the other numbers. `Random` is the default of `lw.Ensemble`. The
    error of a mean falls with the square root of the number of members; `LatinHypercube` and `Sobol` fill the cube more
    evenly. The generator is Philox (Salmon et al. 2011).
    """

    kind: ClassVar[str] = "random"

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        # Levels from Philox counters keyed by seed and name, at the member's place.
        sizes = zip(space.keys, space.sizes, strict=True)
        return {key: uniforms_of(space.seed, key, members, size) for key, size in sizes}
