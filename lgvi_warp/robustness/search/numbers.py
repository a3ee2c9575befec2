# SPDX-License-Identifier: Apache-2.0
"""Objective of a search: one number of each member, a quantity of interest or a metric of a loop."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
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
    """A prepared run that returns one number of each member; NaN if a member fails or a quantity is not finite.

    A metric may be infinite, such as the settling time of a member that never settles.

    names: names of the columns of a call; None if members are given as states. more: further quantities and metrics,
    each with one number of each member.
    """

    def __init__(
        self, scene: Scene, names: list[str] | None, key: str, of: Any, settings: Mapping[str, Any],
        more: Sequence[str] = (),
    ):  # fmt: skip
        # As of a sweep: "energy" is the metric here.
        self.of_metric = _names_a_metric(of)
        if self.of_metric:
            of = MetricQuantity.named(key, of)
            self.label = of.label
        else:
            self.label = of if isinstance(of, str) else getattr(of, "__name__", str(of))
        self._scene, self._unit = scene, unit_of(of)
        others = {each: MetricQuantity.named("constraints", each) if _names_a_metric(each) else each for each in more}
        # What is asked for twice is gathered once.
        wanted = {self.label: of} | {name: each for name, each in others.items() if name != self.label}
        self._columns = [list(wanted).index(name) for name in (self.label, *more)]
        self._count = len(wanted)
        several = list(wanted.values()) if len(wanted) > 1 else of
        self.run: Prepared = prepare(scene, names, several, failed="nan", **settings)

    def units(self, names: Iterable[str]) -> dict[str, str]:
        """The unit of the objective and of numbers of the scene, by name."""
        return {self.label: self._unit} | units_of_numbers(self._scene, names)

    def __call__(self, call: Callable[[Prepared], Any]) -> np.ndarray:
        """The numbers of members (n,); with `more` (n, 1 + number of further quantities)."""
        values, faults = np.asarray(call(self.run)), Faults()
        count = 1 if values.ndim == 1 else values.shape[1]
        if count != self._count:
            faults.add("of", f"{count} numbers", "is not a single number", "name one of its entries")
        faults.raise_if_any()
        if len(self._columns) == 1:
            return values
        values = values.reshape(len(values), -1)[:, self._columns]
        # A member without one of its numbers cannot be compared.
        return np.where(np.isnan(values).any(axis=1, keepdims=True), np.nan, values)


def _names_a_metric(of: Any) -> bool:
    return names_a_statistic(of) and not names_an_end(of)
