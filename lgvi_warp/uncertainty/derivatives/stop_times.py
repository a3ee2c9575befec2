# SPDX-License-Identifier: Apache-2.0
"""Smooth stop times of an event: roots of the event's distance, from a run that continues."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.control.over_floor import seen_floors
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.results.quantities import OfResult
from lgvi_warp.results.result import Result
from lgvi_warp.statistics.metrics.nearest import distance
from lgvi_warp.uncertainty.derivatives.copies import CopyEnds, CopyRuns, MovedCopies

# Samples about the end, in steps from the one before it, and how often a root is corrected.
NODES, CORRECTIONS = (-1, 0, 1, 2), 8


class StopTimeRuns(CopyRuns):
    """Runs of copies without events; values: times at which the event's distance reaches 0, by a cubic and a parabola.

    event: the event. step: the last whole step before it stopped the members. settings: include method, step and precision.
    """

    def __init__(self, copies: MovedCopies, event: Any, step: int, settings: Mapping[str, Any]):
        h = float(settings["h"])
        self._event, self._h, self._first = event, h, max(0, step + NODES[0])
        steps = self._first + np.arange(len(NODES))
        scene = replace(copies.scene, events=seen_floors(copies.scene.controller, copies.scene.events))
        about = {"save": SaveAt(at=[float(k * h) for k in steps], fields=("position",)), "t1": float(steps[-1] * h)}
        super().__init__(replace(copies, scene=scene), [OfResult("position", lambda result: result.position[-1])],
                         {**settings, **about})  # fmt: skip

    def _ends(self, result: Result, group: Any) -> CopyEnds:
        ends = super()._ends(result, group)
        return replace(ends, values=result.position[-len(NODES) :].reshape(len(NODES), -1).T)

    def __call__(self, each: np.ndarray, by: np.ndarray, report: Any = None) -> tuple[CopyEnds, np.ndarray]:
        ends, added = super().__call__(each, by, report)
        positions = ends.values.reshape(len(each), 3, len(NODES)).transpose(2, 0, 1)
        numbers, event = self.copies.moved(each, by), self._event
        own = {name: getattr(event, name) for name in event.parameters()}

        def number(name: str) -> np.ndarray:
            return np.asarray(numbers.get(f"{event.key}.{name}", np.asarray(own[name])[None]))

        distances = distance(event, positions, number)
        times = [self._h * (self._first + root) for root in (_root(distances, 3), _root(distances, 2))]
        return replace(ends, values=np.stack(times, axis=1)), added


def _root(distances: np.ndarray, degree: int) -> np.ndarray:
    """Root (N,) of the polynomial through samples (4, N) at 0, 1, 2, 3; NaN if it is far from the samples."""
    places = np.arange(degree + 1.0)
    to_powers = np.linalg.inv(np.vander(places, increasing=True))
    powers = to_powers @ distances[: degree + 1]
    x = np.full(distances.shape[1], 1.5)
    rising = np.arange(1.0, degree + 1.0)[:, None]
    with np.errstate(all="ignore"):
        for _ in range(CORRECTIONS):
            value = sum(power * x**i for i, power in enumerate(powers))
            slope = sum(power * x**i for i, power in enumerate(rising * powers[1:]))
            x = x - value / slope
    return np.where((x > -2.0) & (x < 5.0), x, np.nan)
