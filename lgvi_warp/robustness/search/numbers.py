# SPDX-License-Identifier: Apache-2.0
"""Objective of a search: one number of each member, a quantity of interest or a metric of a loop."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from lgvi_warp.calls.prepared import Prepared, prepare
from lgvi_warp.common.errors import Faults
from lgvi_warp.results.quantities import MetricQuantity, names_an_end, unit_of
from lgvi_warp.scene.scene import Scene
from lgvi_warp.statistics.member_metrics import names_a_statistic
from lgvi_warp.store.layout import units_of_numbers

# Numbers of a search that its answer names.
MOST_NAMED = 4


class Numbers:
    """A prepared run that returns one number of each member: NaN for those that fail, and where a quantity is not finite.

    A metric may be infinite, as a settling time is where a member never settles.

    names: of the columns of a call; None where members are given as states.
    """

    def __init__(self, scene: Scene, names: list[str] | None, key: str, of: Any, settings: Mapping[str, Any]):
        # As of a sweep: "energy" is the metric here.
        self.of_metric = names_a_statistic(of) and not names_an_end(of)
        if self.of_metric:
            of = MetricQuantity.named(key, of)
            self.label = of.label
        else:
            self.label = of if isinstance(of, str) else getattr(of, "__name__", str(of))
        self._scene, self._unit = scene, unit_of(of)
        self.run: Prepared = prepare(scene, names, of, failed="nan", **settings)

    def units(self, names: Iterable[str]) -> dict[str, str]:
        """The unit of the objective and of numbers of the scene, by name."""
        return {self.label: self._unit} | units_of_numbers(self._scene, names)

    def __call__(self, call: Callable[[Prepared], Any]) -> np.ndarray:
        """The numbers of members (n,)."""
        values, faults = np.asarray(call(self.run)), Faults()
        if values.ndim != 1:
            faults.add("of", f"{values.shape[1]} numbers", "is not a single number", "name one of its entries")
        faults.raise_if_any()
        return values
