# SPDX-License-Identifier: Apache-2.0
"""First-order indices of any run for all numbers that varied in it, from its members as they are."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lgvi_warp.calls.kept_samples import KeptSamples, not_kept
from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.common.status import failed
from lgvi_warp.results.quantities import EndQuantity, OfInterest, OfResult, quantities
from lgvi_warp.results.result import Result
from lgvi_warp.results.varied import varied
from lgvi_warp.statistics.estimates.given_data import explained
from lgvi_warp.store.open import open_run
from lgvi_warp.uncertainty.sensitivity.indices import Indices

# Correlation of two inputs from which on they are said to share what they explain.
SHARED = 0.3
# Most inputs whose correlations are looked at.
MOST_COMPARED = 200


@dataclass(frozen=True, eq=False)
class GivenDataIndices(Indices):
    """First-order indices from given data: fractions of the variance of m quantities that each of d inputs explains.

    Attributes:
        first: fraction of the variance explained by the input alone (m, d) [1]; may be estimated slightly below 0.
        first_confidence: distance from `first` to the farther end of its interval (m, d).
        lower: lower end of the interval (m, d).
        upper: upper end of the interval (m, d).
        p: p-value: probability that chance alone gives an index of at least this size (m, d).
        slope: standardised linear regression coefficient (m, d). Its sign gives the direction of the effect.
    """

    first: np.ndarray
    first_confidence: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    p: np.ndarray
    slope: np.ndarray
    name: ClassVar[str] = "Indices from given data"
    columns: ClassVar[tuple[str, ...]] = ("first", "lower", "upper", "p", "slope")
    intervals: ClassVar[dict[str, str]] = {"first": "first_confidence"}
    drawn: ClassVar[tuple[str, ...]] = ("first",)


def given_data(
    result: Result | str | os.PathLike[str], of: OfInterest | Sequence[OfInterest], *, confidence: float = 0.95
) -> GivenDataIndices:
    """Estimate first-order indices from a finished run, for every number that varied in it or at its start.

    No special design is needed. For each input, the members are divided into bins. The index is the variance of the
    bins' means as a fraction of the whole variance, minus the fraction expected by chance. The interval follows from
    the noncentral F distribution, and is wider if the quantity is not normal. Interactions are not detected (see
    `lw.uq.sobol`). Inputs should be independent: the common effect of correlated inputs counts for each of them.

    Args:
        result: A result of `lw.solve`, `lw.open_run` or `lw.Result.load`, or the path of a store.
        of: One or several quantities of interest, as in `lw.uq.sobol`: "depth" (at the end), "max(depth)", "outcome floor",
            "end_time floor", "depth at 30", a Quantity, a function of a Result or of (samples, members).
        confidence: Level of the intervals; by default 0.95.

    Returns:
        The indices: factors are the numbers that varied, such as "vehicle.mass" and "start.position[2]".

    Raises:
        SceneError: If nothing varied, members have weights, or needed samples were not saved.

    Examples:
        >>> import lgvi_warp as lw
        >>> vary = {name: lw.distributions.Normal(std=1.0) for name in ("vehicle.buoyancy", "start.position[2]")}
        >>> fleet = lw.Ensemble(lw.Scene.named("remus_100"), members=256, vary=vary)
        >>> found = lw.uq.given_data(lw.solve(fleet, h=0.1, t1=2.0), "depth")
        >>> found.factors
        ('vehicle.buoyancy', 'start.position[2]')
    """
    if isinstance(result, str | os.PathLike):
        result = open_run(result)
    if not isinstance(result, Result):
        raise refusal(
            "result", result, "is not a result", "give what lw.solve or lw.open_run returned, or a store's path"
        )
    interests, inputs = quantities(of), varied(result)
    _check(result, inputs, confidence)
    columns, labels = _values(result, interests)
    explanations = [explained(inputs, y, confidence) for y in columns]
    arrays = {
        column: np.array([[getattr(of_output[name], field) for name in inputs] for of_output in explanations])
        for column, field in zip(GivenDataIndices.columns, ("share", "lower", "upper", "p", "slope"), strict=True)
    }
    good = [y[np.isfinite(y)] for y in columns]
    return GivenDataIndices(
        factors=tuple(inputs),
        quantities=labels,
        mean=np.array([y.mean() if len(y) else np.nan for y in good]),
        std=np.array([y.std() if len(y) else np.nan for y in good]),
        samples=min(len(y) for y in good),
        members=result.members,
        failed=int(failed(np.asarray(result.status)).sum()),
        confidence=float(confidence),
        messages=_messages(result, inputs, columns, labels),
        provenance=result.provenance,
        first=arrays["first"],
        first_confidence=np.fmax(arrays["upper"] - arrays["first"], arrays["first"] - arrays["lower"]),
        lower=arrays["lower"],
        upper=arrays["upper"],
        p=arrays["p"],
        slope=arrays["slope"],
    )


def _check(result: Result, inputs: Mapping[str, np.ndarray], confidence: float) -> None:
    """Refuse a result without indices, and a faulty confidence."""
    faults = Faults()
    level = faults.number("confidence", confidence, "1")
    if level is not None and not 0.0 < level < 1.0:
        faults.add("confidence", confidence, "is not between 0 and 1", "give 0.95")
    if not inputs:
        remedy = "run an ensemble with vary={...}; a file of a run that kept no samples lacks what varied"
        faults.add("result", "...", "has no number that differs between members", remedy)
    if result.weights is not None:
        remedy = "draw members from the distribution that is meant, or ask lw.gather for means where an input is high and low"
        faults.add("result", "...", "has members with weights, and indices from given data are of equal ones", remedy)
    faults.raise_if_any()


def _values(result: Result, of: Sequence[OfResult]) -> tuple[list[np.ndarray], tuple[str, ...]]:
    """The numbers (n,) of each quantity and component, NaN if a member failed; and their labels."""
    kept, names = KeptSamples(result), set[str]()
    for each in of:
        known = set(result.samples)
        wanted = known if each.is_function else set(each.fields)
        needs = not (isinstance(each, EndQuantity) and each.kind != "at")
        for field in sorted(wanted - known) if needs and not each.looks_at_members else ():
            raise not_kept("of", field, tuple(result.samples))
        names |= wanted & known if needs else set()
    parts = (
        [result] if result.store is None else (kept.of_block(block, tuple(sorted(names))) for block in kept.blocks())
    )
    groups: list[list[np.ndarray]] = []
    for part in parts:
        lost = failed(np.asarray(part.status))
        group = []
        for each in of:
            numbers = each.values(part)
            of_outcome = isinstance(each, EndQuantity) and each.kind != "at"
            group.append(numbers if of_outcome else np.where(lost[:, None], np.nan, numbers))
        groups.append(group)
    joined = [np.concatenate(arrays) for arrays in zip(*groups, strict=True)]
    labels = [label for each, numbers in zip(of, joined, strict=True) for label in each.labels(numbers.shape[1])]
    return [column for numbers in joined for column in numbers.T], tuple(labels)


def _messages(
    result: Result, inputs: Mapping[str, np.ndarray], columns: Sequence[np.ndarray], labels: Sequence[str]
) -> tuple[str, ...]:
    """Remarks on the indices for the user."""
    texts = []
    sampling = result.provenance.get("ensemble", {}).get("sampling", "random")
    kind = sampling if isinstance(sampling, str) else next(iter(sampling))
    if kind not in ("random", "table"):
        texts.append(f"intervals are those of independent members, wider than need be for sampling {kind!r}")
    for y, label in zip(columns, labels, strict=True):
        some = y[np.isfinite(y)]
        if not len(some) or np.ptp(some) == 0.0:
            texts.append(f"{label} does not vary: it has no indices")
    for first, second, r in _correlated(inputs):
        texts.append(f"{first} and {second} are correlated ({r:.2f}): what they explain together counts for both")
    return tuple(texts)


def _correlated(inputs: Mapping[str, np.ndarray]) -> list[tuple[str, str, float]]:
    """Text of the most correlated inputs, at most five pairs."""
    names = list(inputs)[:MOST_COMPARED]
    if len(names) < 2:
        return []
    matrix = np.corrcoef([inputs[name] for name in names])
    # Of independent inputs chance leaves some n^(-1/2).
    least = max(SHARED, 5.0 / np.sqrt(len(inputs[names[0]])))
    pairs = [(i, j) for i, j in zip(*np.triu_indices(len(names), 1), strict=True) if abs(matrix[i, j]) > least]
    pairs.sort(key=lambda pair: -abs(matrix[pair]))
    return [(names[i], names[j], float(matrix[i, j])) for i, j in pairs[:5]]
