# SPDX-License-Identifier: Apache-2.0
"""Output of a sweep: comparisons, ranks, the worst members and their causes, as tables, files and texts."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.common.arguments import of_kind, path_of, whole_number
from lgvi_warp.common.errors import closest, refusal
from lgvi_warp.common.files import write_text
from lgvi_warp.common.status import failed
from lgvi_warp.common.tables import markdown, write_csv
from lgvi_warp.criteria.files import finite_or_none
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.results.result import Result
from lgvi_warp.robustness.sweeps.comparisons import PairedComparison, compared, corrected, ranks
from lgvi_warp.robustness.sweeps.rare import RareComparison
from lgvi_warp.robustness.sweeps.rare_output import provenance_of_rare, rare_against_baseline, rare_rows
from lgvi_warp.robustness.sweeps.setup import END, SweepCell, rerun_members_of
from lgvi_warp.robustness.sweeps.summary import against_baseline, answer_of, summary
from lgvi_warp.robustness.sweeps.sweep_table import SUCCESS, SweepTable
from lgvi_warp.robustness.sweeps.verdicts import matters_of
from lgvi_warp.statistics.estimates import paired
from lgvi_warp.statistics.estimates.given_data import explained
from lgvi_warp.uncertainty.rare.answer import RareEvent

# Worst members that are listed.
LISTED = 20


class Sweep(SweepTable):
    """Answer of a sweep: success, comparisons, ranks and the worst members, as tables, files and texts.

    Attributes:
        setup: description of the runs.
        cells: all combinations of a case and a point of the grid, in order.
        records: results of the members of each cell.
        conditions: conditions that a member must fulfil to pass.
        baseline: name of the case with which the other cases are compared.
        confidence: confidence level of all intervals.
        interval: kind of the confidence intervals of probabilities.
        rares: rare failures of the cells for which they were requested; None if they were requested for no cell.
        matters: smallest differences that matter: by "success" [percentage points] or name of a metric [its unit].
        cases: names of the cases.
        metrics: names of the metrics.
        table: the rows as an xarray Dataset.

    Methods:
        success: Probability that a member of a case passes.
        compare: Compare two cases on the same members.
        ranking: Rank the cases by success.
        worst: The worst members of all cells.
        causes: Inputs that explain success or a metric.
        values: A metric of all members of a cell.
        survival: Probability that a member still runs at each time.
        members: Indices of members that fail to pass, or of members that pass.
        again: Run members of a case again and save their samples.
        rare: Probability of a rare failure of a case.
        compare_rare: Compare the rare failures of two cases.
        rows: Success and metrics of each cell, as records.
        save: Write tables and summary into a folder.
    """

    @property
    def answer(self) -> str:
        """The best and the worst cells in one sentence. The text of `str` ends with this sentence."""
        return answer_of(self)

    def compare(
        self,
        first: str,
        second: str,
        at: Mapping[str, Any] | None = None,
        quantile: float | None = None,
        matters: Any = None,
    ) -> list[PairedComparison]:
        """Compare two cases on the same members: their success and each metric, at each point of the grid.

        Success is compared by the difference of paired proportions (Tango's interval, McNemar's exact test). A metric
        is compared by a paired t test, or for a quantile by bootstrap, over members with finite numbers that failed in
        neither case. Holm's method corrects the p-values for their number. See docs/guide/is_my_controller_robust.md.

        Args:
            first: name of a case.
            second: name of another case; differences are second minus first.
            at: values of the grid by name that select points; None (default) for all points.
            quantile: level of a quantile that is compared instead of the mean; None (default) for means.
            matters: the smallest difference that matters, as in `lw.sweep`; None (default): as given to the sweep.

        Returns:
            The comparisons; at each point, success comes first. `row()` of a comparison is a record of a table. With
            `matters`, `verdict` of a comparison is "better", "worse", "equivalent" or "undecided".

        Raises:
            SceneError: there is no such case, point or metric.
        """
        pairs = [(a, b) for a in self.cells_of(first, at) for b in self.cells_of(second, at) if a.point == b.point]
        judged = self if matters is None else replace(self, matters=matters_of(matters, self.metrics, SUCCESS))
        return self.corrected_for_number([row for a, b in pairs for row in compared(judged, a, b, quantile)])

    def corrected_for_number(self, rows: list[PairedComparison]) -> list[PairedComparison]:
        """Correct the p-values p of simultaneous comparisons for their number, by Holm's method.

        Args:
            rows: the comparisons, as in `compare`.

        Returns:
            The same comparisons with corrected `p`; `real` is True if the difference is significant.
        """
        kind = "difference p real", "a comparison", "give those of Sweep.compare"
        return corrected([of_kind(f"rows[{i}]", row, *kind) for i, row in enumerate(rows)], self.confidence)

    def rare(self, case: str, at: Mapping[str, Any] | None = None) -> RareEvent:
        """Return the rare failure of a case that requested it: the probability that a member does not pass.

        The answer lists at most about 4,000 failing members. `compare_rare` runs these members in other cases.

        Args:
            case: name of the case.
            at: values of the grid by name; may be left out if there is no grid.

        Returns:
            The answer of `lw.rare_event`: probability, interval, failing members, and the likeliest of them.

        Raises:
            SceneError: no such case or point exists, the case requested no rare failure, or its estimate was refused.
        """
        cell = self.cell(case, at)
        answer = None if self.rares is None else self.rares.of(cell)
        if answer is None:
            raise refusal("case", cell.name, "did not ask for its rare failure", "give the case rare = true")
        if answer.found is None:
            raise refusal(
                "case", cell.name, f"has no rare failure: {answer.refused}", "correct it, or choose another one"
            )
        return answer.found

    def compare_rare(self, first: str, second: str, at: Mapping[str, Any] | None = None) -> list[RareComparison]:
        """Compare the rare failures of two cases at each point of the grid: ratio of their failure probabilities.

        Failing members of case A run also in B, and those of B in A, with the same numbers and noise: P(B) / P(A) = P(B
        | A) / P(A | B). If too few fail in both, the two estimates are divided. Holm's method corrects the p-values.

        Args:
            first: name of a case.
            second: name of another case; ratios are second divided by first.
            at: values of the grid by name that select points; None (default) for all points.

        Returns:
            The comparisons at all points where both cases have a rare failure. `row()` of each is a record of a table.

        Raises:
            SceneError: there is no such case or point.
        """
        pairs = [(a, b) for a in self.cells_of(first, at) for b in self.cells_of(second, at) if a.point == b.point]
        return [] if self.rares is None else self.rares.compare(pairs)

    def ranking(self, at: Mapping[str, Any] | None = None) -> list[dict[str, Any]]:
        """Rank the cases by success; list for each case the cases that it beats significantly, and by how much.

        With a grid, a case's success is the mean over members of the fraction of points at which the member passes. A
        case that was refused at a point is left out. All pairs of cases are tested: by McNemar's exact test or, with a
        grid, by a paired t test of the fractions. Holm's method corrects the p-values for the number of pairs.

        Args:
            at: values of the grid by name that select points; None (default) for all points.

        Returns:
            Records with rank, case, value, lower, upper, better_than and better_by; the best case comes first.

        Raises:
            SceneError: there is no such point.
        """
        return ranks(self, at)

    def worst(self, count: int = 20, by: str | None = None, case: str | None = None) -> list[dict[str, Any]]:
        """Find the worst members of all cells: failed members (the earliest first), then members of largest metric.

        Args:
            count: number of members; by default 20.
            by: name of the metric. Default: the first metric with an upper limit in `success`, else the first metric.
            case: name of the case; None (default) for all cases.

        Returns:
            Records with case, point, member, status, passed, the metrics and the inputs that vary.

        Raises:
            SceneError: there is no such metric or case.
        """
        count = whole_number("count", count, 0)
        limited = [name for name, (_, below) in self.conditions.limits.items() if np.isfinite(below)]
        by = by or next(iter([*limited, *self.metrics]))
        if by not in self.metrics:
            raise refusal("by", by, "is not a metric of this sweep", closest(str(by), self.metrics))
        places: list[tuple[float, float, int, int]] = []
        for cell in (cell for name in ((case,) if case else self.cases) for cell in self.cells_of(name)):
            record = self.record(cell)
            if record.refused:
                continue
            lost, ends = failed(record.status), record.numbers[END]
            size = np.nan_to_num(record.numbers[by], nan=np.inf)
            # Sorted by what comes first: earlier failures, then larger numbers; members in their order.
            group, rank = np.where(lost, 0.0, 1.0), np.where(lost, ends, -size)
            order = np.lexsort((np.arange(len(lost)), rank, group))[:count]
            places += [(float(group[i]), float(rank[i]), cell.index, int(i)) for i in order]
        return [self._member_row(self.cells[index], i) for _, _, index, i in sorted(places)[:count]]

    def _member_row(self, cell: SweepCell, i: int) -> dict[str, Any]:
        record, inputs = self.record(cell), self.inputs(cell, i, i + 1)
        return {"case": cell.case.name, **cell.point, "member": i, "status": int(record.status[i]),
                "passed": bool(self.passed(cell)[i]), **{name: float(x[i]) for name, x in record.numbers.items()},
                **{name: float(x[0]) for name, x in inputs.items()}}  # fmt: skip

    def causes(self, case: str, at: Mapping[str, Any] | None = None, of: str = SUCCESS) -> list[dict[str, Any]]:
        """Find which of the varied inputs explain success or a metric, the most important first.

        share: fraction of the variance over members that this input alone explains, estimated by bins of the members,
        with an interval and the p-value p of an F test. Holm's method corrects p for the number of inputs. slope:
        standardised coefficient of a linear regression on all inputs. Inputs should be independent.

        Args:
            case: name of the case.
            at: values of the grid by name; may be left out if there is no grid.
            of: "success" (default), or the name of a metric, over members that did not fail.

        Returns:
            Records with input, share, lower, upper, p, slope, and the input's medians over passing and failing members.

        Raises:
            SceneError: there is no such case, point or metric, or the cell was refused.
        """
        cell = self.cell(case, at)
        passed, inputs = self.passed(cell), self.inputs(cell)
        y = passed.astype(np.float64)
        if of != SUCCESS:
            y = np.where(failed(self.record(cell).status), np.nan, self.values(case, of, at))
        effects = explained(inputs, y, self.confidence)
        p = paired.holm(np.array([effect.p for effect in effects.values()]))
        rows = [{"input": name, **effect._asdict(), "p": float(level), "median_passed": _median(inputs[name][passed]),
                 "median_failed": _median(inputs[name][~passed])}
                for (name, effect), level in zip(effects.items(), p, strict=True)]  # fmt: skip
        return sorted(rows, key=lambda row: -np.nan_to_num(row["share"], nan=-1.0))

    def again(
        self,
        case: str,
        members: Sequence[int],
        at: Mapping[str, Any] | None = None,
        save: SaveAt | None = None,
        threads: int | None = None,
    ) -> Result:
        """Run some members again, with bit-identical results, and save their samples.

        Args:
            case: name of the case.
            members: indices of the members.
            at: values of the grid by name; may be left out if there is no grid.
            save: sample times and fields; by default those of the scene.
            threads: number of threads; by default as in `lw.solve`.

        Returns:
            The result of these members.

        Raises:
            SceneError: there is no such case, point or member.
        """
        return rerun_members_of(self.setup, self.cell(case, at), members, save, threads)

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write table.csv, comparison.csv, ranking.csv, worst.csv, causes.csv, sweep.json and summary.md into a folder.

        If rare failures were requested, rare.csv and rare_comparison.csv are written, too.

        Args:
            folder: folder of the files, created if needed.

        Returns:
            Paths of the files.

        Raises:
            OSError: the files cannot be written.
        """
        target = path_of("folder", folder)
        target.mkdir(parents=True, exist_ok=True)
        tables = {"table": self.rows(), "comparison": [row.row() for row in against_baseline(self)],
                  "ranking": self.ranking(), "worst": self.worst(LISTED)}  # fmt: skip
        tables["causes"] = [{"case": cell.case.name, **cell.point, "of": of, **row} for cell in self.cells
                            if not self.record(cell).refused for of in (SUCCESS, *self.metrics) if of != END
                            for row in self.causes(cell.case.name, cell.point, of)]  # fmt: skip
        if self.rares is not None:
            tables["rare"] = rare_rows(self)
            tables["rare_comparison"] = [row.row() for row in rare_against_baseline(self)]
        files = [write_csv(rows, target / f"{name}.csv", target) for name, rows in tables.items()]
        texts = {
            "sweep.json": json.dumps({"answer": self.answer} | finite_or_none(provenance(self)), indent=1),
            "summary.md": markdown(str(self)),
        }
        return files + [write_text(target / name, text, target) for name, text in texts.items()]

    def __str__(self) -> str:
        return summary(self)


def _median(x: np.ndarray) -> float:
    return float(np.median(x)) if len(x) else np.nan


def provenance(table: SweepTable) -> dict[str, Any]:
    """All inputs that determine the sweep, as plain types."""
    setup = table.setup
    cells = [{"case": cell.case.name, "at": {name: as_json(value) for name, value in cell.point.items()}, "key": cell.key,
              "fixed": list(cell.fixed), "refused": table.record(cell).refused, "messages": list(table.record(cell).messages)}
             | provenance_of_rare(table, cell) for cell in table.cells]  # fmt: skip
    scene = setup.scene.to_dict()
    scene.pop("ensemble", None)
    metrics = {name: metric.to_dict() | {"unit": table.unit(name)} for name, metric in setup.metrics.items()}
    return {"scene": scene, "ensemble": setup.members.to_dict(), "metrics": metrics, "success": table.conditions.to_dict(),
            "baseline": table.baseline, "confidence": table.confidence, "interval": table.interval,
            "settings": {name: as_json(value) for name, value in setup.settings.items()}, "cells": cells,
            "versions": machine.versions()} | ({"matters": dict(table.matters)} if table.matters else {})  # fmt: skip


def as_json(value: Any) -> Any:
    """Convert a value for JSON: plain types unchanged, others to text."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    return value if isinstance(value, int | float | str | bool | list | None) else str(value)
