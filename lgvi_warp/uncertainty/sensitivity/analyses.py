# SPDX-License-Identifier: Apache-2.0
"""Sobol indices and Morris screening of an ensemble; Morris screening uses SALib's design and estimates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from lgvi_warp.common.arguments import ensemble_of, of_kind
from lgvi_warp.common.errors import Faults, MissingExtra, refusal
from lgvi_warp.common.real_numbers import whole_remedy
from lgvi_warp.common.status import Status
from lgvi_warp.results.quantities import OfInterest
from lgvi_warp.runs.request import scene_of
from lgvi_warp.sampling.designs.base import Sampling
from lgvi_warp.sampling.designs.designs import Factors, Morris, Saltelli, salib_problem
from lgvi_warp.scene.columns import as_given, columns_of
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.settings import EnsembleSettings
from lgvi_warp.uncertainty.sensitivity.estimates import sobol_estimates
from lgvi_warp.uncertainty.sensitivity.indices import MorrisEffects, SobolIndices
from lgvi_warp.uncertainty.sensitivity.outputs import FailedMembers, Outputs, evaluate, known_arguments

Design = TypeVar("Design", bound=Sampling)

FAILED = ("refuse", "drop")
# A quantity whose range is below this part of its size varies by round-off alone.
CONSTANT = 1e-14


@known_arguments(resamples="intervals are no longer of a bootstrap: give replicates=8")
def sobol(
    scene: Scene | Ensemble,
    of: OfInterest | Sequence[OfInterest],
    *,
    samples: int = 1024,
    vary: Mapping[Any, Any] | None = None,
    seed: int | None = None,
    second_order: bool = True,
    replicates: int = 8,
    groups: Mapping[str, Sequence[str]] | None = None,
    confidence: float = 0.95,
    failed: str = "refuse",
    **settings: Any,
) -> SobolIndices:
    """Estimate Sobol indices of quantities of interest, by Saltelli's design and estimators.

    Factors are inputs that vary independently; a joint distribution is one factor. The spread of R independently
    scrambled Sobol sequences gives the intervals. Saltelli et al. (2010), Computer Physics Communications 181.

    Args:
        scene: a Scene, with distributions in its [ensemble] or in `vary`; or an Ensemble, for its scene, vary and seed.
        of: one or several quantities of interest: "position[2]", "depth" (at the end), "max(energy)" (over the path),
            "outcome floor", a lw.statistics.Quantity, or a function that turns a Result into an array (n,) or (n, m).
        samples: number N of base points: a multiple of `replicates`, preferably a power of two. For d factors, N (2 d +
            2) members are run; without second_order, N (d + 2). Default 1024.
        vary: name -> distribution. Default: the scene's or the ensemble's distributions.
        seed: seed of the design. Default: the scene's or the ensemble's seed.
        second_order: True also estimates second-order indices of pairs. Default True.
        replicates: number R of sequences, a power of two up to 64; R = 1 gives no intervals. More sequences make
            intervals more reliable and estimates slightly less accurate. Default 8.
        groups: name -> names that form one factor: {"start": ["start.position", "start.velocity"]}. Default none.
        confidence: level of the intervals, between 0 and 1, by Student's t over the replicates. Default 0.95.
        failed: "refuse" (default) raises an error if members fail; "drop" omits base points with a failed member.
        settings: arguments of `lw.solve` (method, h, t1, save, dtype, threads, progress) and of `evaluate`.

    Returns:
        First-order and total indices of every factor, in the order of `vary`, and second-order indices of pairs.

    Raises:
        SceneError: if arguments are faulty; one message lists all faults.
        TypeError: for an argument that does not exist.
        FailedMembers: if members failed and the indices cannot be computed from the others.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("sphere")
        >>> normal = lw.distributions.Normal(std=0.1)
        >>> vary = {"start.position[2]": normal, "start.velocity[0]": normal}
        >>> indices = lw.uq.sobol(scene, "depth", vary=vary, samples=64, method="psi_s", h=0.1, t1=1.0)
        >>> indices.factors[indices.total[0].argmax()]
        'start.position[2]'
    """
    faults = Faults()
    with faults.including():
        check_settings(samples, confidence, failed)
    with faults.including():
        design = Saltelli(second_order, replicates, groups)
    if not faults and samples % replicates:
        near = samples // replicates * replicates
        ways = " or ".join(str(number) for number in (near, near + replicates) if number)
        faults.add("samples", samples, f"is not a multiple of replicates = {replicates}", f"give {ways}")
    faults.raise_if_any()
    fleet = designed(scene, vary, seed, design, samples)
    outputs = evaluate(fleet, of, **settings)
    return sobol_of(fleet, outputs, confidence=confidence, failed=failed)


def sobol_of(fleet: Ensemble, outputs: Outputs, *, confidence: float = 0.95, failed: str = "refuse") -> SobolIndices:
    """Estimate Sobol indices from existing outputs.

    Args:
        fleet: the ensemble that was run; its sampling is lw.designs.Saltelli.
        outputs: quantities of interest of its members, from `lw.uq.evaluate`.
        confidence: level of the intervals, between 0 and 1. Default 0.95.
        failed: "refuse" or "drop", as in `sobol`. Default "refuse".

    Returns:
        The indices, as in `sobol`.

    Raises:
        FailedMembers: if members failed and the indices cannot be computed from the others.
    """
    design = _design_of(fleet, outputs, Saltelli)
    factors, group = design.factors(fleet.space), design.group_size(fleet.space)
    order = _order(fleet, factors)
    whole, messages = whole_groups(outputs, group, failed)
    Y, replicates = outputs.values[np.repeat(whole, group)], design.replicate_of(np.flatnonzero(whole))
    m, d = Y.shape[1], len(factors)
    first, first_half, total, total_half = (np.full((m, d), np.nan) for _ in range(4))
    second, second_half = (np.full((m, d, d), np.nan) for _ in range(2))
    for q in varying(Y, outputs.labels, messages):
        found = sobol_estimates(Y[:, q].reshape(-1, group), replicates, design.second_order, confidence)
        (first[q], first_half[q]), (total[q], total_half[q]) = ([part[order] for part in ratio] for ratio in found[:2])
        if found.second is not None:
            second[q], second_half[q] = (part[np.ix_(order, order)] for part in found.second)
    if len(np.unique(replicates)) < 2:
        messages.append("there are no intervals: they are of the spread of replicates, and there is one")
    return SobolIndices(
        **_common(tuple(factors[i][0] for i in order), outputs, Y, group, confidence, messages),
        first=first,
        first_confidence=first_half,
        total=total,
        total_confidence=total_half,
        second=second if design.second_order else None,
        second_confidence=second_half if design.second_order else None,
    )


def _design_of(fleet: Ensemble, outputs: Outputs, kind: type[Design]) -> Design:
    """The design of an ensemble that was run. Raises SceneError if it is of another kind."""
    of_kind("outputs", outputs, "values labels failed counts", "of lw.uq.evaluate", "give what it returns")
    design = ensemble_of(fleet).sampling
    if not isinstance(design, kind):
        example = f"give lw.Ensemble(..., sampling=lw.designs.{kind.__name__}())"
        raise refusal("fleet.sampling", design, f"is not lw.designs.{kind.__name__}", example)
    return design


def _order(fleet: Ensemble, factors: Factors) -> list[int]:
    """Indices of the factors in the order of `vary`."""
    columns = [column for variation in as_given(fleet) for column in columns_of(fleet.space, variation.key)]
    return sorted(range(len(factors)), key=lambda i: min(map(columns.index, factors[i][1])))


@known_arguments()
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
    """Screen for the factors that matter, by Morris' elementary effects, with few members.

    Args:
        scene: a Scene, with distributions in its [ensemble] or in `vary`; or an Ensemble, for its scene, vary and seed.
        of: one or several quantities of interest, as in `sobol`.
        samples: number N of paths; N (d + 1) members are run for d factors. Default 64.
        levels: even number of levels of each factor. A step moves one factor by half of its levels. Default 4.
        vary: name -> distribution. Default: the scene's or the ensemble's distributions.
        seed: seed of the design. Default: the scene's or the ensemble's seed.
        confidence: level of the bootstrap's intervals, between 0 and 1. Default 0.95.
        resamples: number of the bootstrap's resamples. Default 100.
        failed: "refuse" raises an error if members fail; "drop" omits paths with a failed member. Default "refuse".
        settings: arguments of `lw.solve` (method, h, t1, save, dtype, threads, progress) and of `evaluate`.

    Returns:
        Elementary effects of every factor.

    Raises:
        SceneError: if arguments are faulty; one message lists all faults.
        FailedMembers: if members failed and the effects cannot be computed from the others.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("sphere")
        >>> normal = lw.distributions.Normal(std=0.1)
        >>> vary = {"start.position[2]": normal, "start.velocity[0]": normal}
        >>> effects = lw.uq.morris(scene, "depth", vary=vary, samples=8, method="psi_s", h=0.1, t1=1.0)
        >>> effects.factors[effects.mu_star[0].argmax()]
        'start.position[2]'
    """
    check_settings(samples, confidence, failed, resamples)
    fleet = designed(scene, vary, seed, Morris(levels), samples)
    outputs = evaluate(fleet, of, **settings)
    return morris_of(fleet, outputs, confidence=confidence, resamples=resamples, failed=failed)


def morris_of(
    fleet: Ensemble, outputs: Outputs, *, confidence: float = 0.95, resamples: int = 100, failed: str = "refuse"
) -> MorrisEffects:
    """Compute elementary effects from existing outputs.

    Args:
        fleet: the ensemble that was run; its sampling is lw.designs.Morris.
        outputs: quantities of interest of its members, from `lw.uq.evaluate`.
        confidence: level of the bootstrap's intervals, between 0 and 1. Default 0.95.
        resamples: number of the bootstrap's resamples. Default 100.
        failed: "refuse" or "drop", as in `morris`. Default "refuse".

    Returns:
        The elementary effects, as in `morris`.

    Raises:
        FailedMembers: if members failed and the effects cannot be computed from the others.
        ImportError: if SALib is not installed.
    """
    analyze = salib()
    design, space = _design_of(fleet, outputs, Morris), fleet.space
    group = design.group_size(space)
    whole, messages = whole_groups(outputs, group, failed)
    kept = np.repeat(whole, group)
    Y = outputs.values[kept]
    X = design.design(space, np.arange(fleet.members))[kept]
    # A step moves the level by p / 2 of the cube's p parts, where SALib divides by another length.
    scale = design.levels / (design.levels - 1.0)
    factors = [space.factors[i] for i in _order(fleet, space.factors)]
    names = ("mu", "mu_star", "sigma", "mu_star_conf")
    estimates = {name: np.full((Y.shape[1], len(factors)), np.nan) for name in names}
    for q in varying(Y, outputs.labels, messages):
        S = analyze(salib_problem(space), X, Y[:, q].copy(), num_resamples=resamples, conf_level=confidence,
                    num_levels=design.levels, seed=fleet.seed)  # fmt: skip
        order = [list(S["names"]).index(label) for label, _ in factors]
        for name, values in estimates.items():
            values[q] = np.ma.filled(np.ma.masked_invalid(np.ma.array(S[name], dtype=float)), np.nan)[order] * scale
    for number, (_, columns) in enumerate(factors):
        if len(columns) > 1:  # a step moves several numbers, and has no sense of its own
            estimates["mu"][:, number] = estimates["sigma"][:, number] = np.nan
    return MorrisEffects(
        **_common(tuple(label for label, _ in factors), outputs, Y, group, confidence, messages),
        mu_star=estimates["mu_star"],
        mu_star_confidence=estimates["mu_star_conf"],
        mu=estimates["mu"],
        sigma=estimates["sigma"],
    )


def _common(
    factors: tuple[str, ...], outputs: Outputs, Y: np.ndarray, group: int, confidence: float, messages: list[str]
) -> dict[str, Any]:
    """Fields that all analyses share."""
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


def check_settings(samples: Any, confidence: Any, failed: Any, resamples: Any = 2) -> None:
    """Refuse faulty settings of an analysis."""
    faults = Faults()
    for name, value in (("samples", samples), ("resamples", resamples)):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 2:
            faults.add(name, value, "is not a whole number from 2", whole_remedy(value, "give 2 or more"))
    number = faults.number("confidence", confidence)
    if number is not None and not 0.0 < number < 1.0:
        faults.add("confidence", confidence, "is not between 0 and 1", "give a level, such as 0.95")
    faults.choice("failed", failed, FAILED)
    faults.raise_if_any()


def designed(scene: Any, vary: Any, seed: int | None, design: Sampling, samples: int) -> Ensemble:
    """The ensemble of a design with this number of groups; None takes the scene's distributions and seed."""
    settings: Any = (
        scene if isinstance(scene, Ensemble) else scene_of(scene, "scene").ensemble_settings or EnsembleSettings()
    )
    scene = scene.scene if isinstance(scene, Ensemble) else scene
    vary, seed = dict(settings.vary) if vary is None else vary, settings.seed if seed is None else seed
    group = design.group_size(Ensemble(scene, None, seed, vary, design).space)
    return Ensemble(scene, samples * group, seed, vary, design)


def salib() -> Callable[..., Any]:
    """SALib's analysis of Morris' design."""
    try:
        from SALib.analyze.morris import analyze
    except ImportError as error:
        raise MissingExtra("sensitivity studies", "SALib", "uq") from error
    return analyze


def whole_groups(outputs: Outputs, group: int, failed: str) -> tuple[np.ndarray, list[str]]:
    """Mask of groups without failure (N,), and messages about the others; FailedMembers if too few are left."""
    if outputs.failed.any() and failed == "refuse":
        remedy = 'fix the failing members (see result.status of lw.solve), or use the whole groups alone: failed="drop"'
        raise FailedMembers([outputs.text(remedy)])
    whole = np.asarray(~outputs.failed.reshape(-1, group).any(axis=1))
    count, messages = int(whole.sum()), list[str]()
    if count < 2:
        raise FailedMembers([outputs.text(f"{count} groups of the design are whole, too few for an estimate")])
    if count < len(whole):
        messages.append(outputs.text(f"the {len(whole) - count} of {len(whole)} groups that they are in were left out, and "
                                     "what remains may not be typical"))  # fmt: skip
    stopped = sum(number for name, number in outputs.counts.items() if name.upper() in Status.__members__
                  and Status[name.upper()].stopped)  # fmt: skip
    if stopped:
        messages.append(f"{stopped} of {len(outputs.failed)} members were stopped by events: their numbers are those at the "
                        "stop")  # fmt: skip
    return whole, messages


def varying(Y: np.ndarray, labels: Sequence[str], messages: list[str]) -> list[int]:
    """Mask of the quantities that vary; adds messages about those that do not."""
    constant = np.ptp(Y, axis=0) <= CONSTANT * np.abs(Y).max(axis=0)
    messages += [f"{labels[int(q)]} does not vary: it has no indices" for q in np.flatnonzero(constant)]
    return [int(q) for q in np.flatnonzero(~constant)]
