"""Sobol indices and Morris' screening of an ensemble, by SALib's designs and estimates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.status import Status
from lgvi_warp.runs.quantities import OfInterest
from lgvi_warp.sampling import designs as samplings
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.settings import EnsembleSettings
from lgvi_warp.studies.sensitivity.indices import MorrisEffects, SobolIndices
from lgvi_warp.studies.sensitivity.outputs import FailedMembers, Outputs, evaluate

FAILED = ("refuse", "drop")
# Below this part of its size, a quantity that differs from member to member does so by round-off.
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
    """Sobol indices of quantities of interest, by Saltelli's design and SALib's estimates.

    scene: a Scene, with what varies in its ensemble or in `vary`; or an Ensemble, for its scene, vary and seed. of:
    "position[2]" or "depth" (at the end), "max(energy)" (over the path), a lw.Quantity, a function of a Result to (n,) or
    (n, m), or several. samples: N, a power of two is best; N (2 d + 2) members are run for d factors, N (d + 2) without
    second_order. confidence, resamples: of the bootstrap's intervals. failed: "refuse", or "drop" to use the groups without
    a failed member only.
    settings: those of `lw.solve` (method, h, t1, save, dtype, threads, progress) and of `evaluate`.

    The factors vary independently: a joint law counts as one. Raises SceneError, and FailedMembers.
    """
    _check(samples, 2, confidence, resamples, failed)
    design = samplings.Saltelli(second_order)
    fleet = _designed(scene, vary, seed, design, samples)
    outputs = evaluate(fleet, of, **settings)
    return sobol_of(fleet, outputs, confidence=confidence, resamples=resamples, failed=failed)


def sobol_of(
    fleet: Ensemble, outputs: Outputs, *, confidence: float = 0.95, resamples: int = 100, failed: str = "refuse"
) -> SobolIndices:
    """The same from the outputs of an ensemble with Saltelli's design that was run already."""
    analyze = _salib("sobol")
    design = fleet.sampling
    assert isinstance(design, samplings.Saltelli)
    factors = tuple(label for label, _ in fleet.space.factors)
    Y, messages = _whole_groups(outputs, design.group_size(fleet.space), failed)
    m, d = Y.shape[1], len(factors)
    found = {name: np.full((m, d), np.nan) for name in ("S1", "S1_conf", "ST", "ST_conf")}
    found |= {name: np.full((m, d, d), np.nan) for name in ("S2", "S2_conf")}
    problem = {"num_vars": d, "names": list(factors), "bounds": [[0.0, 1.0]] * d}
    for q in _varying(Y, outputs.labels, messages):
        S = analyze(problem, Y[:, q].copy(), calc_second_order=design.second_order, num_resamples=resamples,
                    conf_level=confidence, seed=fleet.seed + 1)  # fmt: skip
        for name in found.keys() & S.keys():
            found[name][q] = S[name]
    for name in ("S2", "S2_conf"):  # SALib gives what is above the diagonal
        found[name] = np.where(np.isnan(found[name]), np.swapaxes(found[name], 1, 2), found[name])
    return SobolIndices(
        **_common(factors, outputs, Y, design.group_size(fleet.space), confidence, messages),
        first=found["S1"],
        first_confidence=found["S1_conf"],
        total=found["ST"],
        total_confidence=found["ST_conf"],
        second=found["S2"] if design.second_order else None,
        second_confidence=found["S2_conf"] if design.second_order else None,
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
    """Morris' screening: which factors matter at all, for few members.

    samples: paths; samples (d + 1) members are run for d factors. levels: even, of the grid that paths go along; a step moves
    a factor by half of it. The rest as of `sobol`. Raises SceneError, and FailedMembers.
    """
    _check(samples, 2, confidence, resamples, failed)
    fleet = _designed(scene, vary, seed, samplings.Morris(levels), samples)
    outputs = evaluate(fleet, of, **settings)
    return morris_of(fleet, outputs, confidence=confidence, resamples=resamples, failed=failed)


def morris_of(
    fleet: Ensemble, outputs: Outputs, *, confidence: float = 0.95, resamples: int = 100, failed: str = "refuse"
) -> MorrisEffects:
    """The same from the outputs of an ensemble with Morris' design that was run already."""
    analyze = _salib("morris")
    design, space = fleet.sampling, fleet.space
    assert isinstance(design, samplings.Morris)
    group = design.group_size(space)
    kept = _good_rows(outputs, group, failed)
    Y, messages = _whole_groups(outputs, group, failed)
    X = design.design(space, np.arange(fleet.members))[kept]
    # A step moves the level by another part of the cube than SALib's number: p / 2 of its p parts.
    scale = design.levels / (design.levels - 1.0)
    factors = tuple(label for label, _ in space.factors)
    found = {name: np.full((Y.shape[1], len(factors)), np.nan) for name in ("mu", "mu_star", "sigma", "mu_star_conf")}
    for q in _varying(Y, outputs.labels, messages):
        S = analyze(samplings.salib_problem(space), X, Y[:, q].copy(), num_resamples=resamples, conf_level=confidence,
                    num_levels=design.levels, seed=fleet.seed)  # fmt: skip
        order = [list(S["names"]).index(label) for label, _ in space.factors]
        for name, values in found.items():
            values[q] = np.ma.filled(np.ma.masked_invalid(np.ma.array(S[name], dtype=float)), np.nan)[order] * scale
    for number, (_, columns) in enumerate(space.factors):
        if len(columns) > 1:  # a step moves several numbers, and has no sense of its own
            found["mu"][:, number] = found["sigma"][:, number] = np.nan
    return MorrisEffects(
        **_common(factors, outputs, Y, group, confidence, messages),
        mu_star=found["mu_star"],
        mu_star_confidence=found["mu_star_conf"],
        mu=found["mu"],
        sigma=found["sigma"],
    )


def _common(
    factors: tuple[str, ...], outputs: Outputs, Y: np.ndarray, group: int, confidence: float, messages: list[str]
) -> dict[str, Any]:
    """What every analysis has."""
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


def _check(samples: Any, least: int, confidence: Any, resamples: Any, failed: Any) -> None:
    faults = Faults()
    for name, value, low in (("samples", samples, least), ("resamples", resamples, 2)):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < low:
            faults.add(name, value, f"is not a whole number from {low}", f"give {low} or more")
    number = faults.number("confidence", confidence)
    if number is not None and not 0.0 < number < 1.0:
        faults.add("confidence", confidence, "is not between 0 and 1", "give a level, such as 0.95")
    faults.choice("failed", failed, FAILED)
    faults.raise_if_any()


def _designed(scene: Any, vary: Any, seed: int | None, design: samplings.Sampling, samples: int) -> Ensemble:
    """The ensemble of a design with so many groups."""
    if isinstance(scene, Ensemble):
        scene, known, known_seed = scene.scene, scene.vary, scene.seed
    elif isinstance(scene, Scene):
        own = scene.ensemble_settings or EnsembleSettings()
        known, known_seed = dict(own.vary), own.seed
    else:
        raise SceneError([f"scene = {scene!r}: is neither a Scene nor an Ensemble; give lw.Scene(...)"])
    chosen = (known if vary is None else vary, known_seed if seed is None else seed)
    first = Ensemble(scene, None, chosen[1], chosen[0], design)
    return Ensemble(scene, samples * design.group_size(first.space), chosen[1], chosen[0], design)


def _salib(name: str) -> Callable[..., Any]:
    try:
        from importlib import import_module

        return getattr(import_module(f"SALib.analyze.{name}"), "analyze")  # noqa: B009
    except ImportError as error:
        raise ImportError("sensitivity needs SALib: pip install 'lgvi-warp[uq]'") from error


def _good_rows(outputs: Outputs, group: int, failed: str) -> np.ndarray:
    """(n,), the members of groups without a failure."""
    if outputs.failed.any() and failed == "refuse":
        remedy = 'mend what fails (see result.status of lw.solve), or use the whole groups alone: failed="drop"'
        raise FailedMembers([outputs.text(remedy)])
    good = ~outputs.failed.reshape(-1, group).any(axis=1)
    if good.sum() < 2:
        raise FailedMembers(
            [outputs.text(f"{int(good.sum())} groups of the design are whole, too few for an estimate")]
        )
    return np.repeat(good, group)


def _whole_groups(outputs: Outputs, group: int, failed: str) -> tuple[np.ndarray, list[str]]:
    """The quantities of groups without a failure, and what is to be said about the others."""
    kept = _good_rows(outputs, group, failed)
    messages = []
    if not kept.all():
        left = int((~kept).sum()) // group
        messages.append(outputs.text(f"the {left} of {len(kept) // group} groups that they are in were left out, and "
                                     "what remains may not be typical"))  # fmt: skip
    stopped = sum(number for name, number in outputs.counts.items() if name.upper() in Status.__members__
                  and Status[name.upper()].stopped)  # fmt: skip
    if stopped:
        messages.append(f"{stopped} of {len(kept)} members were stopped by events: their numbers are those at the stop")
    return outputs.values[kept], messages


def _varying(Y: np.ndarray, labels: Sequence[str], messages: list[str]) -> list[int]:
    """Quantities that vary; notes those that do not."""
    constant = np.ptp(Y, axis=0) <= CONSTANT * np.abs(Y).max(axis=0)
    messages += [f"{labels[int(q)]} does not vary: it has no indices" for q in np.flatnonzero(constant)]
    return [int(q) for q in np.flatnonzero(~constant)]
