# SPDX-License-Identifier: Apache-2.0
"""Layout of the random draws of a scene's noise and sensors in a run."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

import numpy as np

from lgvi_warp.control.sensor import Sensor
from lgvi_warp.methods.saveat import TimeGrid
from lgvi_warp.physics.given_draws import DrawLayout, DrawTimes
from lgvi_warp.physics.terms.base import Term
from lgvi_warp.physics.terms.noisy import NoisyTerm
from lgvi_warp.scene.like import SceneLike


def draw_layout(scene: SceneLike, varied: Collection[str], grid: TimeGrid) -> DrawLayout:
    """The draws of every term and sensor that may use random numbers.

    varied: Names of varied numbers, as in Ensemble.varied_names. A strength that is 0 in the scene may differ for a member.
    """

    def acting(term: Term) -> set[str]:
        return {name for name, value in term.parameters().items() if f"{term.key}.{name}" in varied or np.any(value)}

    def each() -> Iterator[tuple[str, Any, DrawTimes]]:
        for term in scene.terms:
            if isinstance(term, NoisyTerm):
                draws = term.draws(grid.h)
                yield term.key, term.streams(acting(term)), DrawTimes(grid.h / draws, draws * grid.steps)
        controller = scene.controller
        for part in controller.sensors if controller else ():
            if isinstance(part, Sensor):
                every = controller.every(grid.h)
                yield part.key, part.streams(acting(part)), DrawTimes(every * grid.h, grid.steps // every + 1)

    return DrawLayout(each())
