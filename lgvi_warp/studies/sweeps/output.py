# SPDX-License-Identifier: Apache-2.0
"""Files of a sweep: tables, its provenance, and a summary in words."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.common.files import write_text
from lgvi_warp.common.status import Status
from lgvi_warp.common.tables import write_csv
from lgvi_warp.studies.files import finite_or_none
from lgvi_warp.studies.sweeps.setup import END
from lgvi_warp.studies.sweeps.success import none_text
from lgvi_warp.studies.sweeps.sweep_table import SUCCESS, PairedComparison, SweepTable

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
    """

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write table.csv, comparison.csv, ranking.csv, worst.csv, causes.csv, sweep.json and summary.md into a folder.

        Args:
            folder: of the files, made if needed.

        Returns:
            Paths of the files.

        Raises:
            OSError: they cannot be written.
        """
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        comparison = [row.row() for row in against_baseline(self)]
        tables = {
            "table": self.rows(),
            "comparison": comparison,
            "ranking": self.ranking(),
            "worst": self.worst(LISTED),
        }
        tables["causes"] = [{"case": cell.case.name, **cell.point, "of": of, **row} for cell in self.cells
                            if not self.record(cell).refused for of in (SUCCESS, *self.metrics) if of != END
                            for row in self.causes(cell.case.name, cell.point, of)]  # fmt: skip
        files = [write_csv(rows, target / f"{name}.csv", target) for name, rows in tables.items()]
        texts = {"sweep.json": json.dumps(finite_or_none(provenance(self)), indent=1), "summary.md": summary(self)}
        return files + [write_text(target / name, text, target) for name, text in texts.items()]

    def __str__(self) -> str:
        """Return the sweep in words."""
        return summary(self)


def against_baseline(table: SweepTable) -> list[PairedComparison]:
    """Return the comparisons of all other cases with the baseline."""
    others = [case for case in table.cases if case != table.baseline]
    rows = [row for case in others for row in table.compare(table.baseline, case)]
    return table.corrected_for_number(rows)


def provenance(table: SweepTable) -> dict[str, Any]:
    """Return all that the sweep follows from, of plain types."""
    setup = table.setup
    cells = [{"case": cell.case.name, "at": {name: as_json(value) for name, value in cell.point.items()}, "key": cell.key,
              "fixed": list(cell.fixed), "refused": table.record(cell).refused, "messages": list(table.record(cell).messages)}
             for cell in table.cells]  # fmt: skip
    scene = setup.scene.to_dict()
    scene.pop("ensemble", None)
    metrics = {name: metric.to_dict() | {"unit": table.unit(name)} for name, metric in setup.metrics.items()}
    return {"scene": scene, "ensemble": setup.members.to_dict(), "metrics": metrics, "success": table.conditions.to_dict(),
            "baseline": table.baseline, "confidence": table.confidence, "interval": table.interval,
            "settings": {name: as_json(value) for name, value in setup.settings.items()}, "cells": cells,
            "versions": machine.versions()}  # fmt: skip


def as_json(value: Any) -> Any:
    """Return a value as JSON can hold it: plain types, others as text."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    return value if isinstance(value, int | float | str | bool | list | None) else str(value)


def percent(value: float) -> str:
    """Return a fraction in percent, as text."""
    return f"{100.0 * value:.4g}"


def summary(found: SweepTable) -> str:
    """Return the sweep in words, as Markdown.

    Args:
        found: the sweep.
    """
    count, level = found.members_count, f"{found.confidence:.0%}"
    lines = [
        "# Sweep",
        "",
        f"{count:,} members, the same in {len(found.cells)} cells; intervals at {level}.",
        "",
        "## Success",
        "",
    ]
    kind = found.setup.members.sampling.kind
    if kind != "random":
        lines += [f"Intervals are those of independent members, which a {kind} does not give: they need not fit.", ""]
    lines += [f"- {_cell_text(found, cell)}" for cell in found.cells]
    if len(found.cases) > 1:
        lines += ["", "## Rank", ""]
        for row in found.ranking():
            better = f"; better than {row['better_by']}" if row["better_by"] else ""
            lines.append(f"{row['rank']}. {row['case']}: {percent(row['value'])} % "
                         f"({percent(row['lower'])} to {percent(row['upper'])}){better}")  # fmt: skip
        lines += ["", f"## Against {found.baseline}", ""]
        # With a grid metrics would be too many for a page.
        real = [row for row in against_baseline(found) if row.real and (row.of == SUCCESS or not found.setup.axes)]
        lines += [f"- {_compared_text(found, row)}" for row in real] or ["- No difference of success is real."]
        lines += ["", "comparison.csv has the differences of all metrics."]
    lines += ["", "## What failures go with", ""]
    lines += [text for cell in found.cells if (text := _causes_text(found, cell))] or [
        "- With nothing that varies, as far as seen."
    ]
    lines += ["", "## Worst members", ""]
    for row in found.worst(5):
        at = ", ".join(f"{name} = {row[name]}" for name in found.setup.axes)
        status = Status(row["status"]).name.lower()
        lines.append(f"- member {row['member']} of {row['case']}{' at ' + at if at else ''}, status {status}")
    return "\n".join(lines) + "\n"


def _causes_text(table: SweepTable, cell: Any) -> str:
    """The inputs that really explain success in a cell; "" for none."""
    if table.record(cell).refused:
        return ""
    rows = [row for row in table.causes(cell.case.name, cell.point) if row["p"] < 1.0 - table.confidence]
    texts = []
    for row in rows[:3]:
        medians = f"median {row['median_failed']:.4g} where it fails, {row['median_passed']:.4g} where it passes"
        texts.append(f"{row['input']} (explains {percent(row['lower'])} to {percent(row['upper'])} %; {medians})")
    return f"- {cell.name}: {'; '.join(texts)}" if texts else ""


def _cell_text(table: SweepTable, cell: Any) -> str:
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
        seen = f"{row.only[1]:,} pass only there, {row.only[0]:,} only with {row.first}" if row.only else ""
        points = f"{percent(ends[0])} to {percent(ends[1])} points"
        return f"{row.second}{where}: {word} by {points}, seen on the same members ({seen})"
    unit = "" if table.unit(row.of) == "1" else f" {table.unit(row.of)}"
    return f"{row.second}{where}: {row.of} {d.value:+.4g}{unit} ({d.lower:+.4g} to {d.upper:+.4g}), from {row.values[0]:.4g}"
