# SPDX-License-Identifier: Apache-2.0
"""Comparisons of two cases of a sweep on the same members, and the ranking of all cases."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lgvi_warp.common.status import failed
from lgvi_warp.criteria.success import Probability, probability
from lgvi_warp.robustness.sweeps.setup import END, SweepCell
from lgvi_warp.robustness.sweeps.sweep_table import SUCCESS, SweepTable
from lgvi_warp.robustness.sweeps.verdicts import verdict
from lgvi_warp.statistics.estimates import paired


@dataclass(frozen=True)
class PairedComparison:
    """A difference between two cases on the same members, at one point of the grid.

    only: number of members that pass only with the first case, and only with the second case.
    matters: the smallest difference that matters, in its unit; NaN if none was given.
    more_is_better: True if a larger value is better.
    """

    first: str
    second: str
    point: Mapping[str, Any]
    of: str
    values: tuple[float, float]
    difference: paired.Difference
    test: str
    p: float = np.nan
    real: bool = False
    only: tuple[int, int] | None = None
    matters: float = np.nan
    more_is_better: bool = True

    @property
    def verdict(self) -> str:
        """Verdict on the second case: "better", "worse", "equivalent" or "undecided"; "" if `matters` was not given."""
        if np.isnan(self.matters):
            return ""
        return verdict(self.difference, self.matters, self.real, self.more_is_better)

    def row(self) -> dict[str, Any]:
        """The comparison as a record of a table."""
        d, only, values = self.difference, self.only or (None, None), self.values
        judged = {"matters": self.matters, "verdict": self.verdict} if self.verdict else {}
        return {"first": self.first, "second": self.second, **self.point, "of": self.of, "value_first": values[0],
                "value_second": values[1], "difference": d.value, "lower": d.lower, "upper": d.upper, "p": d.p,
                "p_holm": self.p, "real": self.real, "pairs": d.pairs, "test": self.test, "only_first": only[0],
                "only_second": only[1], **judged}  # fmt: skip


def compared(table: SweepTable, a: SweepCell, b: SweepCell, quantile: float | None) -> list[PairedComparison]:
    """Compare success and each metric of two cells, by means or quantiles; empty if a cell was refused."""
    records = table.record(a), table.record(b)
    if any(record.refused for record in records):
        return []
    lost = failed(records[0].status) | failed(records[1].status)
    rows = [_of_success(table, a, b)]
    for name in table.metrics:
        if name == END:
            continue
        x, y = (np.where(lost, np.nan, record.numbers[name]) for record in records)
        if quantile is None:
            d, test, number = paired.means(x, y, table.confidence), "paired t", np.mean
        else:
            d = paired.quantiles(x, y, quantile, table.confidence, seed=table.setup.members.seed)
            test, number = "bootstrap of members", functools.partial(np.quantile, q=quantile)
        finite = np.isfinite(x) & np.isfinite(y)
        first, second = (float(number(v[finite])) if finite.any() else np.nan for v in (x, y))
        least, more = table.matters.get(name, np.nan), _more_is_better(table, name)
        rows.append(PairedComparison(a.case.name, b.case.name, a.point, name, (first, second), d, test, matters=least,
                                     more_is_better=more))  # fmt: skip
    return rows


def _more_is_better(table: SweepTable, metric: str) -> bool:
    """True if a larger value of a metric is better: success limits it only from below. Otherwise smaller is better."""
    above, below = table.conditions.limits.get(metric, (-np.inf, np.inf))
    return bool(np.isfinite(above) and not np.isfinite(below))


def _of_success(table: SweepTable, a: SweepCell, b: SweepCell) -> PairedComparison:
    x, y = table.passed(a), table.passed(b)
    only = int((x & ~y).sum()), int((y & ~x).sum())
    d = paired.proportions(*only, len(x), table.confidence)
    values = float(x.mean()), float(y.mean())
    least = table.matters.get(SUCCESS, np.nan) / 100.0
    return PairedComparison(a.case.name, b.case.name, a.point, SUCCESS, values, d, "McNemar, exact", only=only,
                            matters=least)  # fmt: skip


def corrected(rows: list[PairedComparison], confidence: float) -> list[PairedComparison]:
    """Correct p for the number of comparisons; `real` follows from this p or, without a test, from the interval."""
    answers = []
    for row, p in zip(rows, paired.holm(np.array([row.difference.p for row in rows])), strict=True):
        d = row.difference
        real = d.lower > 0.0 or d.upper < 0.0 if np.isnan(d.p) else p < 1.0 - confidence
        answers.append(replace(row, p=float(p), real=bool(real)))
    return answers


def ranks(table: SweepTable, at: Mapping[str, Any] | None) -> list[dict[str, Any]]:
    """Rank the cases by success, with the cases that each is significantly better than, as in `Sweep.ranking`."""
    shares: dict[str, np.ndarray] = {}
    single = len(table.cells_of(table.cases[0], at)) == 1
    for case in table.cases:
        cells = table.cells_of(case, at)
        if not any(table.record(cell).refused for cell in cells):
            shares[case] = np.mean([table.passed(cell) for cell in cells], axis=0)
    pairs = list(itertools.combinations(shares, 2))
    tests = [_share_test(shares[a], shares[b], single, table) for a, b in pairs]
    p = paired.holm(np.array([test.p for test in tests]))
    tested = {pair: (d.lower, d.upper, level) for pair, d, level in zip(pairs, tests, p, strict=True)}
    tested |= {(b, a): (-upper, -lower, level) for (a, b), (lower, upper, level) in tested.items()}
    rows: list[dict[str, Any]] = []
    for case, share in sorted(shares.items(), key=lambda item: -item[1].mean()):
        better = {}
        for rival in (rival for rival in shares if share.mean() > shares[rival].mean()):
            least, most, level = tested[rival, case]
            if level < 1.0 - table.confidence:
                better[rival] = f"{rival} by {100.0 * least:.4g} to {100.0 * most:.4g} points"
        passing = _mean_share(share, table)
        if single:
            passing = probability(int(share.sum()), len(share), table.confidence, table.interval)
        rows.append({"rank": len(rows) + 1, "case": case, **passing._asdict(), "better_than": ", ".join(better),
                     "better_by": ", ".join(better.values())})  # fmt: skip
    return rows


def _share_test(a: np.ndarray, b: np.ndarray, single: bool, table: SweepTable) -> paired.Difference:
    if single:
        return paired.proportions(int((a > b).sum()), int((b > a).sum()), len(a), table.confidence)
    d = paired.means(a, b, table.confidence)
    if d.lower < d.upper:
        return d
    # All members differ by as much: so many may do otherwise, and by anything; the test is that of signs.
    others = _unseen(len(a), table)
    lower, upper = d.value - others * (1.0 + d.value), d.value + others * (1.0 - d.value)
    return d._replace(lower=lower, upper=upper, p=min(1.0, 2.0 * 0.5 ** len(a)) if d.value else 1.0)


def _mean_share(share: np.ndarray, table: SweepTable) -> Probability:
    d = paired.means(np.zeros(len(share)), share, table.confidence)
    if d.lower < d.upper:
        return Probability(d.value, max(0.0, d.lower), min(1.0, d.upper))
    # All members pass as many points: Student's t knows no others.
    others = _unseen(len(share), table)
    return Probability(d.value, d.value * (1.0 - others), d.value + others * (1.0 - d.value))


def _unseen(count: int, table: SweepTable) -> float:
    """Upper limit of the fraction of members with a property that none of `count` members has."""
    return probability(0, count, table.confidence, table.interval).upper
