# SPDX-License-Identifier: Apache-2.0
"""What a sweep tells its user: comparisons, ranks, the worst members and their causes, as tables, files and words."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.common.errors import closest, refusal
from lgvi_warp.common.files import write_text
from lgvi_warp.common.status import Status, failed
from lgvi_warp.common.tables import write_csv
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.results.result import Result
from lgvi_warp.statistics.estimates import paired
from lgvi_warp.statistics.estimates.given_data import explained
from lgvi_warp.studies.files import finite_or_none
from lgvi_warp.studies.rare.answer import RareEvent
from lgvi_warp.studies.sweeps.comparisons import PairedComparison, compared, corrected, ranks
from lgvi_warp.studies.sweeps.rare import RareComparison
from lgvi_warp.studies.sweeps.rare_output import provenance_of_rare, rare_against_baseline, rare_lines, rare_rows
from lgvi_warp.studies.sweeps.setup import END, SweepCell, rerun_members_of
from lgvi_warp.studies.sweeps.success import none_text
from lgvi_warp.studies.sweeps.sweep_table import SUCCESS, SweepTable

# Worst members that are listed.
LISTED = 20


class Sweep(SweepTable):
    """What a sweep found: success, comparisons, ranks, the worst members; as tables, files and words.

    Attributes:
        setup: what was run.
        cells: its cells, cases times points of the grid, in order.
        records: what their members showed.
        conditions: what a member must fulfil to pass.
        baseline: name of the case that others are compared with.
        confidence: confidence level of all intervals.
        interval: how intervals of probabilities are formed.
        rares: rare failures of the cells that ask for them; None where none does.
    """

    def compare(
        self, first: str, second: str, at: Mapping[str, Any] | None = None, quantile: float | None = None
    ) -> list[PairedComparison]:
        """Compare two cases on the same members: their success and each metric, at each point of the grid.

        Success: difference of proportions of the members that differ, Tango's interval, McNemar's exact test. Metrics:
        paired t of members that failed in neither case and whose numbers are finite; or of a quantile, by the bootstrap of
        members. p is corrected for all of these comparisons by Holm. docs/guide/is_my_controller_robust.md says how to read
        it.

        Args:
            first: name of a case.
            second: name of another case; differences are second less first.
            at: values of the grid by name; None (default) for all points.
            quantile: level of the quantile to compare in place of means; None (default) for means.

        Returns:
            The comparisons, success first at each point; `row()` of one is a record of a table.

        Raises:
            SceneError: there is no such case or point.
        """
        pairs = [(a, b) for a in self.cells_of(first, at) for b in self.cells_of(second, at) if a.point == b.point]
        return self.corrected_for_number([row for a, b in pairs for row in compared(self, a, b, quantile)])

    def corrected_for_number(self, rows: list[PairedComparison]) -> list[PairedComparison]:
        """Correct p of comparisons that were made together for their number, by Holm.

        Args:
            rows: the comparisons, as of `compare`.

        Returns:
            The same with `p` corrected, and `real` by that and the sweep's confidence.
        """
        return corrected(rows, self.confidence)

    def rare(self, case: str, at: Mapping[str, Any] | None = None) -> RareEvent:
        """Return the rare failure of a case that asks for it: the probability that a member does not pass.

        Its failing members are those that are compared with other cases, some 4,000 at most.

        Args:
            case: name of the case.
            at: values of the grid by name; may be left out where there is no grid.

        Returns:
            The answer of `lw.rare_event`: probability, interval, failing members, the likeliest of them.

        Raises:
            SceneError: there is no such case or point, it did not ask, or it was refused.
        """
        cell = self.cell(case, at)
        answer = None if self.rares is None else self.rares.of(cell)
        if answer is None:
            raise refusal("case", cell.name, "did not ask for its rare failure", "give the case rare = true")
        if answer.found is None:
            raise refusal(
                "case", cell.name, f"has no rare failure: {answer.refused}", "mend it, or ask for another one"
            )
        return answer.found

    def compare_rare(self, first: str, second: str, at: Mapping[str, Any] | None = None) -> list[RareComparison]:
        """Compare the rare failures of two cases, at each point of the grid: how many times as often the second fails.

        Failing members of either are run in both, with the same numbers and noise: P(B) / P(A) = P(B | A) / P(A | B). Where
        too few fail in both, it is the ratio of the two answers. p is corrected for all of these comparisons by Holm.

        Args:
            first: name of a case.
            second: name of another case; ratios are second over first.
            at: values of the grid by name; None (default) for all points.

        Returns:
            The comparisons, of points where both have a rare failure; `row()` of one is a record of a table.

        Raises:
            SceneError: there is no such case or point.
        """
        pairs = [(a, b) for a in self.cells_of(first, at) for b in self.cells_of(second, at) if a.point == b.point]
        return [] if self.rares is None else self.rares.compare(pairs)

    def ranking(self, at: Mapping[str, Any] | None = None) -> list[dict[str, Any]]:
        """Rank the cases by success, and say of which others each is better than chance explains, and by how much.

        With a grid a case's success is the mean over its points, of each member's share of points passed; a case that was
        refused at a point is left out. All pairs of cases are tested, McNemar's exact test or with a grid a paired t of
        shares, and p is corrected for all pairs by Holm.

        Args:
            at: values of the grid by name; None (default) for all points.

        Returns:
            Records with rank, case, value, lower, upper, better_than and better_by, the best first.

        Raises:
            SceneError: there is no such point.
        """
        return ranks(self, at)

    def worst(self, count: int = 20, by: str | None = None, case: str | None = None) -> list[dict[str, Any]]:
        """Find the worst members of all cells: those that failed, the earliest first, then by a metric, the largest first.

        Args:
            count: how many; by default 20.
            by: name of the metric; default the first one that success limits from above, else the first one.
            case: name of the case; None (default) for all.

        Returns:
            Records with case, point, member, status, whether it passed, the metrics and what varies.

        Raises:
            SceneError: there is no such metric or case.
        """
        limited = [name for name, (_, below) in self.conditions.limits.items() if np.isfinite(below)]
        by = by or next(iter([*limited, *self.metrics]))
        if by not in self.metrics:
            raise refusal("by", by, "is no metric of this sweep", closest(str(by), self.metrics))
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
        """Find which of the inputs that vary explain success or a metric, the most important first.

        share: the part of the variance over members that the mean over this input explains, from the members at hand (by
        bins), with its interval and the F test's p, corrected for the number of inputs by Holm. slope: the standardised
        coefficient of a linear regression on all inputs. Inputs are meant to be drawn independently.

        Args:
            case: name of the case.
            at: values of the grid by name; may be left out where there is no grid.
            of: "success" (default), or the name of a metric, over members that did not fail.

        Returns:
            Records with input, share, lower, upper, p, slope, and the input's median where members pass and where they do not.

        Raises:
            SceneError: there is no such case, point or metric, or it was refused.
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
        """Run members again alone, with the bits that they had, and save their samples.

        Args:
            case: name of the case.
            members: their indices.
            at: values of the grid by name; may be left out where there is no grid.
            save: which samples, and when; default as the scene says.
            threads: number of threads; default as of `lw.solve`.

        Returns:
            Their result.

        Raises:
            SceneError: there is no such case, point or member.
        """
        return rerun_members_of(self.setup, self.cell(case, at), members, save, threads)

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write table.csv, comparison.csv, ranking.csv, worst.csv, causes.csv, sweep.json and summary.md into a folder.

        Where rare failures were asked for, rare.csv and rare_comparison.csv too.

        Args:
            folder: of the files, made if needed.

        Returns:
            Paths of the files.

        Raises:
            OSError: they cannot be written.
        """
        target = Path(folder)
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
        texts = {"sweep.json": json.dumps(finite_or_none(provenance(self)), indent=1), "summary.md": str(self)}
        return files + [write_text(target / name, text, target) for name, text in texts.items()]

    def __str__(self) -> str:
        return _summary(self)


def _median(x: np.ndarray) -> float:
    return float(np.median(x)) if len(x) else np.nan


def against_baseline(sweep: Sweep) -> list[PairedComparison]:
    """The comparisons of all other cases with the baseline."""
    rivals = [case for case in sweep.cases if case != sweep.baseline]
    return sweep.corrected_for_number([row for case in rivals for row in sweep.compare(sweep.baseline, case)])


def provenance(table: SweepTable) -> dict[str, Any]:
    """All that the sweep follows from, of plain types."""
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
            "versions": machine.versions()}  # fmt: skip


def as_json(value: Any) -> Any:
    """A value as JSON can hold it: plain types, others as text."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    return value if isinstance(value, int | float | str | bool | list | None) else str(value)


def percent(value: float) -> str:
    """A fraction in percent, as text."""
    return f"{100.0 * value:.4g}"


def _summary(sweep: Sweep) -> str:
    """The sweep in words, as Markdown."""
    size = f"{sweep.members_count:,} members, the same in {len(sweep.cells)} cells"
    lines = ["# Sweep", "", f"{size}; intervals at {sweep.confidence:.0%}.", "", "## Success", ""]
    kind = sweep.setup.members.sampling.kind
    if kind != "random":
        lines += [f"Intervals are those of independent members, which a {kind} does not give: they need not fit.", ""]
    lines += [f"- {_cell_text(sweep, cell)}" for cell in sweep.cells]
    if len(sweep.cases) > 1:
        lines += ["", "## Rank", ""]
        for row in sweep.ranking():
            better = f"; better than {row['better_by']}" if row["better_by"] else ""
            lines.append(f"{row['rank']}. {row['case']}: {percent(row['value'])} % "
                         f"({percent(row['lower'])} to {percent(row['upper'])}){better}")  # fmt: skip
        lines += ["", f"## Against {sweep.baseline}", ""]
        # With a grid metrics would be too many for a page.
        real = [row for row in against_baseline(sweep) if row.real and (row.of == SUCCESS or not sweep.setup.axes)]
        lines += [f"- {_compared_text(sweep, row)}" for row in real] or ["- No difference of success is real."]
        lines += ["", "comparison.csv has the differences of all metrics."]
    if sweep.rares is not None:
        lines += ["", "## Rare failures", "", *rare_lines(sweep)]
    lines += ["", "## What failures go with", ""]
    causes = [text for cell in sweep.cells if (text := _causes_text(sweep, cell))]
    lines += causes or ["- With nothing that varies, as far as seen."]
    lines += ["", "## Worst members", ""]
    for row in sweep.worst(5):
        at = ", ".join(f"{name} = {row[name]}" for name in sweep.setup.axes)
        status = Status(row["status"]).name.lower()
        lines.append(f"- member {row['member']} of {row['case']}{' at ' + at if at else ''}, status {status}")
    return "\n".join(lines) + "\n"


def _causes_text(sweep: Sweep, cell: SweepCell) -> str:
    """The inputs that really explain success in a cell; "" for none."""
    if sweep.record(cell).refused:
        return ""
    rows = [row for row in sweep.causes(cell.case.name, cell.point) if row["p"] < 1.0 - sweep.confidence]
    texts = []
    for row in rows[:3]:
        medians = f"median {row['median_failed']:.4g} where it fails, {row['median_passed']:.4g} where it passes"
        texts.append(f"{row['input']} (explains {percent(row['lower'])} to {percent(row['upper'])} %; {medians})")
    return f"- {cell.name}: {'; '.join(texts)}" if texts else ""


def _cell_text(table: SweepTable, cell: SweepCell) -> str:
    record = table.record(cell)
    if record.refused:
        return f"{cell.name}: refused: {record.refused}"
    passed = table.passed(cell)
    value, lower, upper = table.success(cell.case.name, cell.point)
    counts = f"{int(passed.sum()):,} of {len(passed):,}, {percent(value)} %"
    text = f"{cell.name}: passes {percent(lower)} to {percent(upper)} % ({counts})"
    more = none_text(int(passed.sum()), len(passed), table.confidence)
    return f"{text}; {more}" if more else text


def _compared_text(table: SweepTable, row: PairedComparison) -> str:
    d, at = row.difference, ", ".join(f"{name} = {value}" for name, value in row.point.items())
    where = f" at {at}" if at else ""
    if row.of == SUCCESS:
        word = "better" if d.value > 0.0 else "worse"
        ends = sorted((abs(d.lower), abs(d.upper)))
        counts = f"{row.only[1]:,} pass only there, {row.only[0]:,} only with {row.first}" if row.only else ""
        points = f"{percent(ends[0])} to {percent(ends[1])} points"
        return f"{row.second}{where}: {word} by {points}, seen on the same members ({counts})"
    unit = "" if table.unit(row.of) == "1" else f" {table.unit(row.of)}"
    return f"{row.second}{where}: {row.of} {d.value:+.4g}{unit} ({d.lower:+.4g} to {d.upper:+.4g}), from {row.values[0]:.4g}"
