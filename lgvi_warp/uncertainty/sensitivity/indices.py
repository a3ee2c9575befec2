# SPDX-License-Identifier: Apache-2.0
"""Results of a sensitivity analysis, as tables and files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.summaries import few_digits, listed, percent
from lgvi_warp.criteria.files import Saved, finite_or_none, with_missing_as
from lgvi_warp.results.quantities import unit_of

# Quantities that the answer names; and part of the first factor's amount from which on it names a second one.
MOST_QUANTITIES, LEAST_SECOND = 2, 0.01


@dataclass(frozen=True, eq=False)
class Indices(Saved):
    """Result of a sensitivity analysis of m quantities for d factors.

    Attributes:
        factors: names of the factors, which vary independently (d,).
        quantities: labels of the quantities of interest (m,).
        mean: mean of the quantities over the design (m,) [their units].
        std: standard deviation of the quantities over the design (m,) [their units].
        samples: number of base points or paths of the design that were used; for given data, number of members.
        members: number of members that were run.
        failed: number of members that failed.
        confidence: level of the intervals; fields named ..._confidence hold the half widths of intervals.
        messages: notes for the user.
        provenance: scene, settings, versions and machine of the runs.
    """

    factors: tuple[str, ...]
    quantities: tuple[str, ...]
    mean: np.ndarray
    std: np.ndarray
    samples: int
    members: int
    failed: int
    confidence: float
    messages: tuple[str, ...]
    provenance: dict[str, Any] = field(repr=False)
    study: ClassVar[str] = "sensitivity"
    endings: ClassVar[tuple[str, ...]] = ("txt", "csv", "json")
    name: ClassVar[str] = ""
    columns: ClassVar[tuple[str, ...]] = ()
    # Column -> field with the half width of its interval.
    intervals: ClassVar[dict[str, str]] = {}
    # Columns that a picture shows; empty: all.
    drawn: ClassVar[tuple[str, ...]] = ()
    # Column by which the answer ranks the factors.
    ranked: ClassVar[str] = "first"

    def rows(self) -> Iterator[dict[str, Any]]:
        """List one record for each quantity, factor and index.

        Yields:
            Records of quantity, factor, other, index, value and confidence.
        """
        for q, quantity in enumerate(self.quantities):
            for f, factor in enumerate(self.factors):
                for column in self.columns:
                    name = self.intervals.get(column)
                    half = getattr(self, name)[q, f] if name else np.nan
                    yield {"quantity": quantity, "factor": factor, "other": "", "index": column,
                           "value": float(getattr(self, column)[q, f]), "confidence": float(half)}  # fmt: skip

    def _heading(self) -> str:
        return f"{self.name}: {self.samples} samples, {self.members} members, {self.failed} failed"

    @property
    def answer(self) -> str:
        texts = [self._ranking(q) for q in range(len(self.quantities))]
        more = f"; and {len(texts) - MOST_QUANTITIES:,} more" if len(texts) > MOST_QUANTITIES else ""
        return f"{'; '.join(texts[:MOST_QUANTITIES])}{more}."

    def _ranking(self, q: int) -> str:
        """Text of the factors on which a quantity depends most; several if their intervals overlap."""
        quantity, values = self.quantities[q], getattr(self, self.ranked)[q]
        half = np.nan_to_num(getattr(self, self.intervals[self.ranked])[q])
        known = [f for f in np.argsort(-values, kind="stable") if np.isfinite(values[f])]
        if not known:
            return f"{quantity} does not vary, or has no finite values"
        least = values[known[0]] - half[known[0]]
        if least <= 0.0:
            return f"{quantity} depends on no factor beyond sampling error"
        first = [f for f in known if values[f] + half[f] >= least]
        texts = [f"{self.factors[f]} ({self._amount(q, values[f], half[f])})" for f in known[: max(2, len(first))]]
        if len(first) > 1:
            return f"{quantity} depends most on {listed(texts, 2)}, whose order is within sampling error"
        worth = max(half[known[1]], LEAST_SECOND * values[known[0]]) if len(known) > 1 else np.inf
        second = len(self.quantities) == 1 and len(known) > 1 and values[known[1]] > worth
        then = f", then on {texts[1]}" if second else ""
        return f"{quantity} depends most on {texts[0]}{then}"

    def _amount(self, q: int, value: float, half: float) -> str:
        """Text of the fraction of a quantity's variance that a factor explains."""
        # No factor explains more than all: the estimate may.
        return f"{percent(min(value, 1.0), 3)} +- {100.0 * half:.2g} % of its variance"

    def _report(self) -> list[str]:
        """A table for each quantity."""
        width = max(len(label) for label in (*self.factors, "factor"))
        lines = [self._heading(), *(f"note: {message}" for message in self.messages)]
        for q, quantity in enumerate(self.quantities):
            lines += ["", f"{quantity}: mean {self.mean[q]:.6g}, standard deviation {self.std[q]:.3g}"]
            lines.append(f"  {'factor':<{width}}" + "".join(f"  {column:>21}" for column in self.columns))
            for f, factor in enumerate(self.factors):
                cells = "".join(f"  {self._cell(column, q, f):>21}" for column in self.columns)
                lines.append(f"  {factor:<{width}}{cells}")
            lines += self._more(q)
        return [*lines, f"+- is half the {self.confidence:.0%} interval"]

    def _cell(self, column: str, q: int, f: int) -> str:
        value = getattr(self, column)[q, f]
        name = self.intervals.get(column)
        return f"{value:.4g}" + (f" +- {getattr(self, name)[q, f]:.2g}" if name else "")

    def _more(self, q: int) -> list[str]:
        """Lines below a quantity's table."""
        return []

    def _content(self) -> dict[str, Any]:
        names = ("name", "factors", "quantities", "samples", "members", "failed", "confidence", "messages")
        content = {name: getattr(self, name) for name in (*names, "mean", "std")}
        content["rows"] = list(self.rows())
        return finite_or_none(content) | {"provenance": self.provenance}

    @classmethod
    def _of_content(cls, content: dict[str, Any]) -> Indices:
        """Read the indices of the analysis that the content names. Raises ValueError if it is unknown."""
        kinds = [kind for kind in cls.__subclasses__() or [cls] if kind.name == content["name"]]
        if not kinds:
            raise ValueError(f"{content['name']!r} is not an analysis")
        return kinds[0]._from(content)

    @classmethod
    def _from(cls, content: dict[str, Any]) -> Indices:
        """Read a result from the content of a JSON file."""
        places = _places(content)
        shape = len(content["quantities"]), len(content["factors"])
        rows = [row for row in content["rows"] if row["index"] in cls.columns]
        if len(rows) != shape[0] * shape[1] * len(cls.columns):
            raise ValueError(f"has {len(rows):,} rows for {shape[0]:,} quantities and {shape[1]:,} factors")
        arrays = {name: np.full(shape, np.nan) for name in (*cls.columns, *cls.intervals.values())}
        for row in rows:
            at = places["quantities"][row["quantity"]], places["factors"][row["factor"]]
            arrays[row["index"]][at] = with_missing_as(row["value"], np.nan)
            if row["index"] in cls.intervals:
                arrays[cls.intervals[row["index"]]][at] = with_missing_as(row["confidence"], np.nan)
        names = ("samples", "members", "failed", "confidence", "provenance")
        kept: dict[str, Any] = arrays | {name: content[name] for name in names}
        kept |= {name: tuple(content[name]) for name in ("factors", "quantities", "messages")}
        kept |= {name: np.array(with_missing_as(content[name], np.nan), dtype=np.float64) for name in ("mean", "std")}
        return cls(**kept, **cls._pairs_from(content))

    @classmethod
    def _pairs_from(cls, content: dict[str, Any]) -> dict[str, Any]:
        """Further arguments of this analysis."""
        return {}


def _places(content: dict[str, Any]) -> dict[str, dict[str, int]]:
    """Indices of quantities and of factors, by name."""
    return {key: {name: i for i, name in enumerate(content[key])} for key in ("quantities", "factors")}


@dataclass(frozen=True, eq=False)
class SobolIndices(Indices):
    """Sobol indices: fractions of the variance of each of m quantities that d factors cause.

    If a quantity does not vary, all its indices are NaN, and a message reports this.

    Attributes:
        first: fraction due to each factor alone (m, d) [1].
        first_confidence: half width of the interval of `first` (m, d).
        total: fraction due to each factor with all its interactions (m, d) [1].
        total_confidence: half width of the interval of `total` (m, d).
        second: fraction due to each interaction of two factors (m, d, d) [1]; symmetric, NaN on the diagonal; or None.
        second_confidence: half width of the interval of `second` (m, d, d); None if not estimated.
    """

    first: np.ndarray
    first_confidence: np.ndarray
    total: np.ndarray
    total_confidence: np.ndarray
    second: np.ndarray | None
    second_confidence: np.ndarray | None
    name: ClassVar[str] = "Sobol indices"
    columns: ClassVar[tuple[str, ...]] = ("first", "total")
    ranked: ClassVar[str] = "total"
    intervals: ClassVar[dict[str, str]] = {"first": "first_confidence", "total": "total_confidence"}

    def rows(self) -> Iterator[dict[str, Any]]:
        yield from super().rows()
        for q, j, k in self._pairs():
            assert self.second is not None
            assert self.second_confidence is not None
            yield {"quantity": self.quantities[q], "factor": self.factors[j], "other": self.factors[k], "index": "second",
                   "value": float(self.second[q, j, k]), "confidence": float(self.second_confidence[q, j, k])}  # fmt: skip

    @classmethod
    def _pairs_from(cls, content: dict[str, Any]) -> dict[str, Any]:
        """Second-order indices, if the file has them."""
        rows = [row for row in content["rows"] if row["index"] == "second"]
        if not rows:
            return {"second": None, "second_confidence": None}
        places, m, d = _places(content), len(content["quantities"]), len(content["factors"])
        if 2 * len(rows) != m * d * (d - 1):
            raise ValueError(f"has {len(rows):,} rows of pairs for {m:,} quantities and {d:,} factors")
        second, half = (np.full((m, d, d), np.nan) for _ in range(2))
        for row in rows:
            q = places["quantities"][row["quantity"]]
            j, k = (places["factors"][row[name]] for name in ("factor", "other"))
            second[q, j, k] = second[q, k, j] = with_missing_as(row["value"], np.nan)
            half[q, j, k] = half[q, k, j] = with_missing_as(row["confidence"], np.nan)
        return {"second": second, "second_confidence": half}

    def _amount(self, q: int, value: float, half: float) -> str:
        amount = super()._amount(q, value, half)
        return amount if len(self.factors) == 1 else f"{amount}, with interactions"

    def _pairs(self) -> list[tuple[int, int, int]]:
        d = 0 if self.second is None else len(self.factors)
        return [(q, j, k) for q in range(len(self.quantities)) for j in range(d) for k in range(j + 1, d)]

    def _more(self, q: int) -> list[str]:
        """List the pairs with the largest second-order indices."""
        if self.second is None or self.second_confidence is None:
            return []
        pairs = [(self.second[q, j, k], self.second_confidence[q, j, k], j, k) for p, j, k in self._pairs() if p == q]
        pairs = sorted((pair for pair in pairs if pair[0] > pair[1]), reverse=True)[:10]
        return [f"  {self.factors[j]} with {self.factors[k]}: second {value:.4g} +- {half:.2g}"
                for value, half, j, k in pairs]  # fmt: skip


@dataclass(frozen=True, eq=False)
class MorrisEffects(Indices):
    """Elementary effects of d factors on m quantities: change of a quantity per whole range of a factor.

    mu and sigma of a factor with several numbers, such as an attitude, are NaN, since a step moves all of its numbers.

    Attributes:
        mu_star: mean absolute effect (m, d) [the quantity's unit].
        mu_star_confidence: half width of the interval of `mu_star` (m, d).
        mu: mean effect (m, d) [the quantity's unit].
        sigma: standard deviation of the effects (m, d) [the quantity's unit]; large for nonlinear effects or interactions.
    """

    mu_star: np.ndarray
    mu_star_confidence: np.ndarray
    mu: np.ndarray
    sigma: np.ndarray
    name: ClassVar[str] = "Morris screening"
    columns: ClassVar[tuple[str, ...]] = ("mu_star", "mu", "sigma")
    intervals: ClassVar[dict[str, str]] = {"mu_star": "mu_star_confidence"}
    ranked: ClassVar[str] = "mu_star"

    def _amount(self, q: int, value: float, half: float) -> str:
        return f"{few_digits(value, '', 3)} +- {few_digits(half, unit_of(self.quantities[q]), 2)} over its range"
