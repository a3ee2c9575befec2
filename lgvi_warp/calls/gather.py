# SPDX-License-Identifier: Apache-2.0
"""`gather`: statistics computed after a run from its saved samples, in memory or in a store."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from lgvi_warp.calls.kept_samples import KeptSamples, not_kept
from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.control.signals import ordered
from lgvi_warp.engine.block import Block
from lgvi_warp.engine.keepers.observation import Observation, Observing, of_functions
from lgvi_warp.engine.keepers.statistics import BlockStatistics, Gathered
from lgvi_warp.results.result import Result
from lgvi_warp.sampling.designs.table import check_weights
from lgvi_warp.statistics.base import Statistic, from_list
from lgvi_warp.statistics.ends import check_outcomes, outcomes
from lgvi_warp.statistics.estimates.estimate import Estimates
from lgvi_warp.statistics.estimates.tree import Part
from lgvi_warp.statistics.tracking import check_wanted
from lgvi_warp.store.open import open_run


def gather(result: Result | str | os.PathLike[str], statistics: Sequence[Any], weights: Any = None) -> Estimates:
    """Compute statistics of a finished run from the samples that it kept, in memory or in a store, block by block.

    The estimates are bit-identical to those gathered during the run: blocks of members are reduced and joined in the
    same order. If a store holds rounded samples (Store(dtype="float32") of a run in float64), the rounded samples are
    used. The estimates are given at the times of the samples.

    Metrics need a sample at each tick of the controller, with the signals that they read: save=lw.SaveAt(every=period,
    fields=...). They differ by round-off from metrics gathered during the run, since a run converts the values at ticks
    to the user's axes in its kernel. Statistics of outcomes and end times need no samples.

    Args:
        result: A result of `lw.solve`, `lw.open_run` or `lw.Result.load`, or the path of a store. From a store, the
            samples of only a few blocks are in memory at a time.
        statistics: Statistics, as in `lw.solve`, or their tables from a scene file.
        weights: Weights of the members for importance sampling (n,), at least 0; only their ratios count. With weights
            the members represent another distribution than the one from which they were drawn. By default the weights
            of the run are used (see lw.designs.Table), or equal weights if it has none. With weights, the members of a
            Sobol sequence or another design are treated as independent; the confidence intervals are therefore wide.

    Returns:
        The estimates by name. Their `messages` are notes and warnings for the user.

    Raises:
        SceneError: If a statistic needs samples that were not kept, or does not fit the scene. The message names every
            fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=64, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> result = lw.solve(fleet, h=0.1, t1=2.0)
        >>> found = lw.gather(result, [lw.statistics.Mean("depth"), lw.statistics.Quantiles("speed")])
        >>> found["mean depth"].half_width.shape
        (2, 1)
    """
    if isinstance(result, str | os.PathLike):
        result = open_run(result)
    if not isinstance(result, Result):
        raise refusal(
            "result", result, "is not a result", "give what lw.solve or lw.open_run returned, or a store's path"
        )
    kept = KeptSamples(result, _weights(weights, result.members))
    asked = _checked(kept, from_list(statistics))
    ensemble = result.provenance.get("ensemble", {})
    observing = Observing(Observation(asked), result.time, kept.total, kept.replicates)
    for keeper in observing.keepers:
        for block in kept.blocks():
            keeper.merge(block, _part_of_block(kept, keeper, block))
    estimates, messages = observing.read(ensemble, np.asarray(result.status))
    return Estimates(list(estimates.values()), messages)


def _weights(weights: Any, members: int) -> np.ndarray | None:
    """The requested weights (n,), scaled to mean 1; None without weights."""
    if weights is None:
        return None
    faults = Faults()
    numbers = faults.finite("weights", weights)
    if numbers is not None:
        check_weights(faults, "weights", numbers)
    if numbers is not None and not faults and len(numbers) != members:
        faults.add(
            "weights", numbers, f"are {len(numbers):,} numbers for {members:,} members", "give one for each member"
        )
    faults.raise_if_any()
    assert numbers is not None
    return np.asarray(numbers / numbers.mean())


def _checked(kept: KeptSamples, requested: tuple[Statistic, ...]) -> tuple[Statistic, ...]:
    """Check that the statistics fit the scene and the samples that were kept, and return them."""
    faults, result, events = Faults(), kept.result, kept.events
    known = outcomes([event.key for event in events], [event.status for event in events])
    alike = {event.key for event in events if sum(other.status == event.status for other in events) > 1}
    for statistic in requested:
        with faults.including():
            check_outcomes(f"{statistic.type}.{'at' if statistic.at else 'of'}", statistic.outcomes, known)
        for name in alike.intersection(statistic.outcomes) if result.event is None else ():
            problem = "is one of several events of a status, and the result does not tell which stopped a member"
            faults.add("statistics", name, problem, "gather it on the way: solve(..., statistics=[...])")
        if statistic.of_ends or of_functions(statistic):
            continue
        for field in statistic.quantity.fields:
            if field not in result.samples:
                with faults.including():
                    raise not_kept(f"statistics, {statistic.key!r}", field, tuple(result.samples))
    of_ticks = {statistic.key: statistic for statistic in requested if statistic.ticks}
    if of_ticks and kept.period is not None:
        with faults.including():
            kept.tick_rows(f"statistics, {next(iter(of_ticks))!r}")
        with faults.including():
            check_wanted(faults, "statistics", of_ticks, kept.scene.controller)
    faults.raise_if_any()
    return requested


def _part_of_block(kept: KeptSamples, run: Gathered, block: Block) -> list[Part]:
    """Parts of one block's statistics: its samples are passed to them in the order of time."""
    asked, time, samples = run.statistics, kept.result.time, kept.result.samples
    at_ticks = any(statistic.ticks for statistic in asked)
    ticks = kept.tick_rows("statistics") if at_ticks else None
    wanted = {name for statistic in asked if not statistic.of_ends for name in statistic.quantity.fields}
    names = tuple(name for name in ordered(wanted) if name in samples)
    over_time = any(not (statistic.at_end or (statistic.ticks and ticks is not None)) for statistic in asked)
    rows = np.arange(len(time)) if over_time else np.array([len(time) - 1])
    with np.errstate(invalid="ignore", over="ignore"):
        members, weight = kept.members(block, names), kept.weights_of(block)
        gathers = BlockStatistics(run, block, members, None if ticks is None else time[ticks], weight)
        if ticks is not None:
            for when, fields in kept.pieces(block, names, ticks, kept.scene.controller):
                gathers.take_ticks(when, fields)
        for when, fields in kept.pieces(block, names, rows):
            gathers.take(slice(rows[0] + when.start, rows[0] + when.stop), fields)
        return gathers.ended(kept.ends(block))
