# SPDX-License-Identifier: Apache-2.0
"""What a search is about: one number of each member, a quantity of interest or a metric of a loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lgvi_warp.calls.prepared import Prepared, prepare
from lgvi_warp.common.errors import Faults
from lgvi_warp.common.status import failed
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.scene.scene import Scene
from lgvi_warp.statistics.base import TYPES, Statistic
from lgvi_warp.studies.sweeps.setup import metric_of


class Numbers:
    """A prepared run that returns one number of each member: NaN for those that fail, and where a quantity is not finite.

    names: of the columns of a call; None where members are given as states.
    """

    def __init__(self, scene: Scene, names: list[str] | None, key: str, of: Any, settings: Mapping[str, Any]):
        self.of_metric = isinstance(of, Statistic | Mapping) or (isinstance(of, str) and of.partition(" ")[0] in TYPES)
        if self.of_metric:
            self.label, metric = metric_of(key, of)
            # A metric comes to every tick by itself.
            few: dict[str, Any] = {"save": SaveAt(fields=("position",)), **settings, "statistics": [metric]}
            self.run: Prepared = prepare(scene, names, None, **few)
        else:
            self.label = of if isinstance(of, str) else getattr(of, "__name__", str(of))
            self.run = prepare(scene, names, of, failed="nan", **settings)

    def __call__(self, call: Callable[[Prepared], Any]) -> np.ndarray:
        """The numbers of members (n,); a metric may be infinite, as a settling time is where a member never settles."""
        answer = call(self.run)
        if self.of_metric:
            return np.where(failed(answer.status), np.nan, answer.statistics[f"each {self.label}"].value[0, 0])
        values, faults = np.asarray(answer), Faults()
        if values.ndim != 1:
            faults.add("of", f"{values.shape[1]} numbers", "is not a single number", "name one of its entries")
        faults.raise_if_any()
        return values
