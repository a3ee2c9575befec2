# SPDX-License-Identifier: Apache-2.0
"""Quantities of interest of an ensemble's members, computed for some thousands of members at a time."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, ParamSpec, TypeVar

import numpy as np

from lgvi_warp.calls.prepared import FailedMembers as FailedMembers
from lgvi_warp.calls.runner import PATHS_AT_ONCE, Runner, samples_for, statistics_for
from lgvi_warp.calls.runner import Outputs as Outputs
from lgvi_warp.common.arguments import ensemble_of, flag
from lgvi_warp.common.errors import closest
from lgvi_warp.common.progress import callback, shows_progress
from lgvi_warp.common.sentences import capital
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.results.quantities import OfInterest, quantities
from lgvi_warp.scene.ensemble import Ensemble

# Arguments that every entry of lw.uq hands on to its runs.
SETTINGS = ("method", "h", "t1", "save", "dtype", "width", "checks", "on_failure", "common_noise", "threads", "executor",
            "scheduler", "progress")  # fmt: skip
P = ParamSpec("P")
R = TypeVar("R")


def known_arguments(**gone: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Refuse arguments that neither the function nor its runs have; the message has the function's name."""

    def decorated(function: Callable[P, R]) -> Callable[P, R]:
        named = [p.name for p in inspect.signature(function).parameters.values() if p.kind is not p.VAR_KEYWORD]
        known = list(dict.fromkeys((*named, *SETTINGS)))

        @functools.wraps(function)
        def checked(*arguments: P.args, **settings: P.kwargs) -> R:
            for name in settings.keys() - known:
                raise TypeError(
                    f"lw.uq.{function.__name__}() has no argument {name!r}. {capital(gone.get(name) or closest(name, known))}"
                )
            return function(*arguments, **settings)

        return checked

    return decorated


@known_arguments()
@shows_progress
def evaluate(
    fleet: Ensemble,
    of: OfInterest | Sequence[OfInterest],
    *,
    common_noise: bool = False,
    progress: Callable[[float], None] | bool | None = None,
    save: SaveAt | None = None,
    **settings: Any,
) -> Outputs:
    """Run an ensemble, some thousands of members at a time, and keep only its quantities of interest.

    A member counts as failed if its status is a failure or a quantity is not finite. A stop by an event is no failure.

    Args:
        fleet: the ensemble.
        of: one or several quantities of interest, as in `sobol`.
        common_noise: True gives every member the same noise of forces. Default False.
        progress: True shows a bar or lines, as in lw.solve; a function is called with the completed fraction, from 0 to 1.
        save: samples to save in each run. Default: those that the quantities need.
        settings: arguments of `lw.solve` (method, h, t1, dtype, width, checks, on_failure, threads, executor, scheduler).

    Returns:
        The quantities of every member, and a mask of failed members.

    Raises:
        SceneError: if arguments are faulty, or if a quantity needs the path and no sampling interval is known.

    Examples:
        >>> import lgvi_warp as lw
        >>> vary = {"start.position[2]": lw.distributions.Normal(std=1.0)}
        >>> fleet = lw.Ensemble(lw.Scene.named("sphere"), members=4, vary=vary)
        >>> outputs = lw.uq.evaluate(fleet, "depth", method="psi_s", h=0.1, t1=1.0)
        >>> outputs.values.shape
        (4, 1)
    """
    interests, report = quantities(of), callback(progress)
    ensemble_of(fleet), flag("common_noise", common_noise)
    # The scene's own statistics, keep and until do not apply: every member of the design must run.
    gathered = statistics_for(fleet.scene, interests)
    runner = Runner(fleet, gathered, save=samples_for(fleet.scene, interests, save), **settings)
    if common_noise:
        fleet = fleet.subset(np.arange(fleet.members))
        fleet.indices = np.zeros(fleet.members, dtype=np.int64)
    found = runner.evaluate(fleet, interests, PATHS_AT_ONCE, report)
    return replace(found, provenance=found.provenance | {"ensemble": fleet.to_dict()})
