# SPDX-License-Identifier: Apache-2.0
"""Sobol indices and Morris' screening of an ensemble, by SALib's designs and estimates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, MissingExtra, SceneError
from lgvi_warp.common.status import Status
from lgvi_warp.runs.quantities import OfInterest
from lgvi_warp.sampling.designs.base import Sampling
from lgvi_warp.sampling.designs.designs import Morris, Saltelli, salib_problem
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.settings import EnsembleSettings
from lgvi_warp.studies.sensitivity.indices import MorrisEffects, SobolIndices
from lgvi_warp.studies.sensitivity.outputs import FailedMembers, Outputs, evaluate

FAILED = ("refuse", "drop")
# A quantity whose range is below this part of its size varies by round-off alone.
CONSTANT = 1e-14


def sobol(
    scene: Scene | Ensemble,
    of: OfInterest | Sequence[OfInterest],
    *,
    samples: int = 1024,
    vary: Mapping[Any, Any] | None = None,
    seed: int | None = None,
    second_order: bool = True,
    confidence: float = 0.95,
    resamples: int = 100,
    failed: str = "refuse",
    **settings: Any,
) -> SobolIndices:
    """Estimate Sobol indices of quantities of interest, by Saltelli's design and SALib's estimates.

    The factors vary independently; a joint distribution counts as one factor. Source: Saltelli et al. (2010), Computer
    Physics Communications 181.

    Args:
        scene: a Scene, with what varies in its ensemble or in `vary`; or an Ensemble, for its scene, vary and seed.
        of: "position[2]" or "depth" (at the end), "max(energy)" (over the path), a lw.Quantity, a function of a Result to
            (n,) or (n, m), or several of these.
        samples: N, best a power of two; N (2 d + 2) members are run for d factors, N (d + 2) without second_order. Default
            1024.
        vary: name -> distribution. Default: that of the scene or the ensemble.
        seed: of the design. Default: that of the scene or the ensemble.
        second_order: whether to estimate indices of pairs as well. Default True.
        confidence: level of the bootstrap's intervals, between 0 and 1. Default 0.95.
        resamples: number of the bootstrap's resamples. Default 100.
        failed: "refuse" for an error where members fail, "drop" to use the groups without a failed member. Default "refuse".
        settings: arguments of `lw.solve` (method, h, t1, save, dtype, threads, progress) and of `evaluate`.

    Returns:
        First-order and total indices of every factor, and second-order indices of pairs.

    Raises:
        SceneError: for faulty arguments, all in one message.
        FailedMembers: where members failed and the indices cannot be computed from the others.
    """
    check_settings(samples, confidence, resamples, failed)
    design = Saltelli(second_order)
    fleet = designed(scene, vary, seed, design, samples)
    outputs = evaluate(fleet, of, **settings)
    return sobol_of(fleet, outputs, confidence=confidence, resamples=resamples, failed=failed)


def sobol_of(
    fleet: Ensemble, outputs: Outputs, *, confidence: float = 0.95, resamples: int = 100, failed: str = "refuse"
) -> SobolIndices:
    """Estimate Sobol indices from outputs that are already there.

    Args:
        fleet: the ensemble that was run, with Saltelli's design.
        outputs: its quantities of interest.
        confidence: level of the bootstrap's intervals, between 0 and 1. Default 0.95.
        resamples: number of the bootstrap's resamples. Default 100.
        failed: "refuse" or "drop", as of `sobol`. Default "refuse".

    Returns:
        The indices, as of `sobol`.

    Raises:
        FailedMembers: where members failed and the indices cannot be computed from the others.
        ImportError: without SALib.
    """
    analyze = salib("sobol")
    design = fleet.sampling
    assert isinstance(design, Saltelli)
    factors = tuple(label for label, _ in fleet.space.factors)
    Y, messages = whole_groups(outputs, design.group_size(fleet.space), failed)
    m, d = Y.shape[1], len(factors)
    estimates = {name: np.full((m, d), np.nan) for name in ("S1", "S1_conf", "ST", "ST_conf")}
    estimates |= {name: np.full((m, d, d), np.nan) for name in ("S2", "S2_conf")}
    problem = {"num_vars": d, "names": list(factors), "bounds": [[0.0, 1.0]] * d}
    for q in varying(Y, outputs.labels, messages):
        S = analyze(problem, Y[:, q].copy(), calc_second_order=design.second_order, num_resamples=resamples,
                    conf_level=confidence, seed=fleet.seed + 1)  # fmt: skip
        for name in estimates.keys() & S.keys():
            estimates[name][q] = S[name]
    for name in ("S2", "S2_conf"):  # SALib gives what is above the diagonal
        estimates[name] = np.where(np.isnan(estimates[name]), np.swapaxes(estimates[name], 1, 2), estimates[name])
    return SobolIndices(
        **_common(factors, outputs, Y, design.group_size(fleet.space), confidence, messages),
        first=estimates["S1"],
        first_confidence=estimates["S1_conf"],
        total=estimates["ST"],
        total_confidence=estimates["ST_conf"],
        second=estimates["S2"] if design.second_order else None,
        second_confidence=estimates["S2_conf"] if design.second_order else None,
    )


def morris(
    scene: Scene | Ensemble,
    of: OfInterest | Sequence[OfInterest],
    *,
    samples: int = 64,
    levels: int = 4,
    vary: Mapping[Any, Any] | None = None,
    seed: int | None = None,
    confidence: float = 0.95,
    resamples: int = 100,
    failed: str = "refuse",
    **settings: Any,
) -> MorrisEffects:
    """Screen for the factors that matter at all, by Morris' elementary effects on few members.

    Args:
        scene: a Scene, with what varies in its ensemble or in `vary`; or an Ensemble, for its scene, vary and seed.
        of: one or several quantities of interest, as of `sobol`.
        samples: number of paths; samples (d + 1) members are run for d factors. Default 64.
        levels: number of levels of the grid that paths go along, even; a step moves a factor by half the grid. Default 4.
        vary: name -> distribution. Default: that of the scene or the ensemble.
        seed: of the design. Default: that of the scene or the ensemble.
        confidence: level of the bootstrap's intervals, between 0 and 1. Default 0.95.
        resamples: number of the bootstrap's resamples. Default 100.
        failed: "refuse" for an error where members fail, "drop" to use the paths without a failed member. Default "refuse".
        settings: arguments of `lw.solve` (method, h, t1, save, dtype, threads, progress) and of `evaluate`.

    Returns:
        Elementary effects of every factor.

    Raises:
        SceneError: for faulty arguments, all in one message.
        FailedMembers: where members failed and the effects cannot be computed from the others.
    """
    check_settings(samples, confidence, resamples, failed)
    fleet = designed(scene, vary, seed, Morris(levels), samples)
    outputs = evaluate(fleet, of, **settings)
    return morris_of(fleet, outputs, confidence=confidence, resamples=resamples, failed=failed)


def morris_of(
    fleet: Ensemble, outputs: Outputs, *, confidence: float = 0.95, resamples: int = 100, failed: str = "refuse"
) -> MorrisEffects:
    """Compute elementary effects from outputs that are already there.

    Args:
        fleet: the ensemble that was run, with Morris' design.
        outputs: its quantities of interest.
        confidence: level of the bootstrap's intervals, between 0 and 1. Default 0.95.
        resamples: number of the bootstrap's resamples. Default 100.
        failed: "refuse" or "drop", as of `morris`. Default "refuse".

    Returns:
        The elementary effects, as of `morris`.

    Raises:
        FailedMembers: where members failed and the effects cannot be computed from the others.
        ImportError: without SALib.
    """
    analyze = salib("morris")
    design, space = fleet.sampling, fleet.space
    assert isinstance(design, Morris)
    group = design.group_size(space)
    kept = _good_rows(outputs, group, failed)
    Y, messages = whole_groups(outputs, group, failed)
    X = design.design(space, np.arange(fleet.members))[kept]
    # A step moves the level by p / 2 of the cube's p parts, where SALib divides by another length.
    scale = design.levels / (design.levels - 1.0)
    factors = tuple(label for label, _ in space.factors)
    names = ("mu", "mu_star", "sigma", "mu_star_conf")
    estimates = {name: np.full((Y.shape[1], len(factors)), np.nan) for name in names}
    for q in varying(Y, outputs.labels, messages):
        S = analyze(salib_problem(space), X, Y[:, q].copy(), num_resamples=resamples, conf_level=confidence,
                    num_levels=design.levels, seed=fleet.seed)  # fmt: skip
        order = [list(S["names"]).index(label) for label, _ in space.factors]
        for name, values in estimates.items():
            values[q] = np.ma.filled(np.ma.masked_invalid(np.ma.array(S[name], dtype=float)), np.nan)[order] * scale
    for number, (_, columns) in enumerate(space.factors):
        if len(columns) > 1:  # a step moves several numbers, and has no sense of its own
            estimates["mu"][:, number] = estimates["sigma"][:, number] = np.nan
    return MorrisEffects(
        **_common(factors, outputs, Y, group, confidence, messages),
        mu_star=estimates["mu_star"],
        mu_star_confidence=estimates["mu_star_conf"],
        mu=estimates["mu"],
        sigma=estimates["sigma"],
    )


def _common(
    factors: tuple[str, ...], outputs: Outputs, Y: np.ndarray, group: int, confidence: float, messages: list[str]
) -> dict[str, Any]:
    """Collect the fields that every analysis has."""
    return {
        "factors": factors,
        "quantities": outputs.labels,
        "mean": Y.mean(axis=0),
        "std": Y.std(axis=0, ddof=1),
        "samples": len(Y) // group,
        "members": len(outputs.values),
        "failed": int(outputs.failed.sum()),
        "confidence": confidence,
        "messages": tuple(messages),
        "provenance": outputs.provenance,
    }


def check_settings(samples: Any, confidence: Any, resamples: Any, failed: Any) -> None:
    """Refuse settings of an analysis that are at fault.

    Args:
        samples: number of groups or paths, at least 2.
        confidence: level of the intervals, between 0 and 1.
        resamples: number of the bootstrap's resamples, at least 2.
        failed: "refuse" or "drop".

    Raises:
        SceneError: with every fault.
    """
    faults = Faults()
    for name, value in (("samples", samples), ("resamples", resamples)):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 2:
            faults.add(name, value, "is not a whole number from 2", "give 2 or more")
    number = faults.number("confidence", confidence)
    if number is not None and not 0.0 < number < 1.0:
        faults.add("confidence", confidence, "is not between 0 and 1", "give a level, such as 0.95")
    faults.choice("failed", failed, FAILED)
    faults.raise_if_any()


def designed(scene: Any, vary: Any, seed: int | None, design: Sampling, samples: int) -> Ensemble:
    """Build the ensemble of a design with this number of groups.

    Args:
        scene: a Scene or an Ensemble.
        vary: name -> distribution; None for those of the scene.
        seed: of the design; None for that of the scene.
        design: the design.
        samples: number of its groups.

    Returns:
        The ensemble.

    Raises:
        SceneError: it is neither a Scene nor an Ensemble.
    """
    if isinstance(scene, Ensemble):
        scene, known, known_seed = scene.scene, scene.vary, scene.seed
    elif isinstance(scene, Scene):
        settings = scene.ensemble_settings or EnsembleSettings()
        known, known_seed = dict(settings.vary), settings.seed
    else:
        raise SceneError([f"scene = {scene!r}: is neither a Scene nor an Ensemble; give lw.Scene(...)"])
    chosen = (known if vary is None else vary, known_seed if seed is None else seed)
    first = Ensemble(scene, None, chosen[1], chosen[0], design)
    return Ensemble(scene, samples * design.group_size(first.space), chosen[1], chosen[0], design)


def salib(name: str) -> Callable[..., Any]:
    """The function of SALib that analyses a design.

    Args:
        name: module of `SALib.analyze`: "sobol" or "morris".

    Returns:
        Its `analyze`.

    Raises:
        ImportError: SALib is not installed; the message names the extra.
    """
    try:
        from importlib import import_module

        return getattr(import_module(f"SALib.analyze.{name}"), "analyze")  # noqa: B009
    except ImportError as error:
        raise MissingExtra("sensitivity studies", "SALib", "uq") from error


def _good_rows(outputs: Outputs, group: int, failed: str) -> np.ndarray:
    """Mask (n,) of the members whose group has no failure."""
    if outputs.failed.any() and failed == "refuse":
        remedy = 'mend what fails (see result.status of lw.solve), or use the whole groups alone: failed="drop"'
        raise FailedMembers([outputs.text(remedy)])
    good = ~outputs.failed.reshape(-1, group).any(axis=1)
    if good.sum() < 2:
        raise FailedMembers(
            [outputs.text(f"{int(good.sum())} groups of the design are whole, too few for an estimate")]
        )
    return np.repeat(good, group)


def whole_groups(outputs: Outputs, group: int, failed: str) -> tuple[np.ndarray, list[str]]:
    """Select the quantities of groups without a failure; write messages about the other groups.

    Args:
        outputs: quantities of the members.
        group: number of members of a group.
        failed: "refuse" or "drop".

    Returns:
        (quantities, messages).

    Raises:
        FailedMembers: where members failed and too few groups are left.
    """
    kept = _good_rows(outputs, group, failed)
    messages = []
    if not kept.all():
        dropped = int((~kept).sum()) // group
        messages.append(outputs.text(f"the {dropped} of {len(kept) // group} groups that they are in were left out, and "
                                     "what remains may not be typical"))  # fmt: skip
    stopped = sum(number for name, number in outputs.counts.items() if name.upper() in Status.__members__
                  and Status[name.upper()].stopped)  # fmt: skip
    if stopped:
        messages.append(f"{stopped} of {len(kept)} members were stopped by events: their numbers are those at the stop")
    return outputs.values[kept], messages


def varying(Y: np.ndarray, labels: Sequence[str], messages: list[str]) -> list[int]:
    """List the quantities that vary; write messages about those that do not.

    Args:
        Y: the quantities (n, m).
        labels: their names.
        messages: to which messages are added.

    Returns:
        Columns of those that vary.
    """
    constant = np.ptp(Y, axis=0) <= CONSTANT * np.abs(Y).max(axis=0)
    messages += [f"{labels[int(q)]} does not vary: it has no indices" for q in np.flatnonzero(constant)]
    return [int(q) for q in np.flatnonzero(~constant)]
