# SPDX-License-Identifier: Apache-2.0
"""Text of a sweep: identical cells are listed once, and large sweeps get ten lines."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from lgvi_warp.common.errors import printable
from lgvi_warp.common.status import Status
from lgvi_warp.common.summaries import percent, plural
from lgvi_warp.criteria.success import Success, none_text
from lgvi_warp.results.outcomes import RISEN
from lgvi_warp.robustness.sweeps.comparisons import PairedComparison
from lgvi_warp.robustness.sweeps.rare_output import rare_lines
from lgvi_warp.robustness.sweeps.setup import SweepCell
from lgvi_warp.robustness.sweeps.sweep_table import SUCCESS, SweepTable
from lgvi_warp.robustness.sweeps.verdicts import VERDICTS
from lgvi_warp.store.layout import units_of_numbers

# A Sweep, of `output`, which asks for this summary.
Sweep = Any

# More cells than these are summed up by case; so many cases are named then, and so many inputs.
MOST_CELLS, MOST_CASES, MOST_INPUTS = 10, 5, 2
# Values, or points of the grid, that the answer names.
MOST_NAMED = 2


def against_baseline(sweep: Sweep) -> list[PairedComparison]:
    """The comparisons of all other cases with the baseline."""
    rivals = [case for case in sweep.cases if case != sweep.baseline]
    return sweep.corrected_for_number([row for case in rivals for row in sweep.compare(sweep.baseline, case)])


def summary(sweep: Sweep) -> str:
    """Summary of the sweep as Markdown."""
    size = f"{sweep.members_count:,} members, the same in {len(sweep.cells)} cells"
    lines = ["# Sweep", "", f"{size}; intervals at {sweep.confidence:.0%}.", ""]
    kind = sweep.setup.members.sampling.kind
    remark = [f"Intervals are those of independent members, which a {kind} does not give: they need not fit.", ""]
    remark = [] if kind == "random" else remark
    brief = len(sweep.cells) > MOST_CELLS
    lines += [*remark, *_brief(sweep)] if brief else ["## Success", "", *remark, *_in_full(sweep)]
    if sweep.rares is not None:
        at = len(lines) if brief else lines.index("## What failures go with") - 1
        lines[at:at] = ["", "## Rare failures", "", *rare_lines(sweep)]
    # A name of a file may hold line ends.
    return "\n".join(map(printable, [*lines, *_above_surface(sweep), "", answer_of(sweep)])) + "\n"


def ends_of(sweep: SweepTable) -> tuple[list[SweepCell], list[SweepCell]]:
    """The cells with the most and with the fewest passing members; both empty if no cell ran."""
    counts = {cell.index: int(sweep.passed(cell).sum()) for cell in sweep.cells if not sweep.record(cell).refused}
    ends = (max(counts.values(), default=0), min(counts.values(), default=0))
    best, worst = ([cell for cell in sweep.cells if counts.get(cell.index) == end] for end in ends)
    return best, worst


def answer_of(sweep: SweepTable) -> str:
    """The best and the worst cells in one sentence."""
    (best, worst), count = ends_of(sweep), len(sweep.cells)
    refused = sum(bool(sweep.record(cell).refused) for cell in sweep.cells)
    if not best:
        return f"No cell ran: {plural(refused, 'cell')} refused."
    verb = "reach the end" if sweep.conditions == Success() else "hold"
    said = f"{_share(sweep, best[0])} of {plural(sweep.members_count, 'member')} {verb}"
    if best != worst:
        said = f"Best: {_place(sweep, best)}: {said}; worst: {_place(sweep, worst)}: {_share(sweep, worst[0])}"
    elif count > 1:
        said = f"In {_place(sweep, best) if refused else f'all {count} cells'} {said}"
    return f"{said}; {plural(refused, 'cell')} refused." if refused else f"{said}."


def _share(sweep: SweepTable, cell: SweepCell) -> str:
    """Share of the members that pass, with its interval."""
    value, lower, upper = (percent(each, 3) for each in sweep.success(cell.case.name, cell.point))
    return f"{value} % ({lower} to {upper} %)"


def _place(sweep: SweepTable, cells: Sequence[SweepCell]) -> str:
    """Text of cases and points of cells, such as "soft, kp 0.2, delay 1 or 2 s", for axes with several values."""
    axes = {name: values for name, values in sweep.setup.axes.items() if len(values) > 1}
    units = {name: f" {unit}" * (unit != "1") for name, unit in units_of_numbers(sweep.setup.scene, axes).items()}
    cases = list(dict.fromkeys(cell.case.name for cell in cells)) if len(sweep.cases) > 1 or not axes else []
    values = {name: list(dict.fromkeys(str(cell.point[name]) for cell in cells)) for name in axes}
    if max(1, len(cases)) * np.prod([len(each) for each in values.values()]) == len(cells):
        texts = [f"{name} {_either(each)}{units[name]}" for name, each in values.items()]
        return ", ".join([*([_either(cases)] if cases else []), *texts])
    points = [", ".join([*[cell.case.name] * bool(cases), *(f"{name} {cell.point[name]}{units[name]}" for name in axes)])
              for cell in cells]  # fmt: skip
    return _either(points, 1 if len(axes) > 1 else MOST_NAMED)


def _either(texts: Sequence[str], most: int = MOST_NAMED) -> str:
    """Text of alternatives; only a few are named."""
    more = [f"{len(texts) - most:,} more"] if len(texts) > most else []
    return " or ".join([*texts[:most], *more])


def _above_surface(sweep: Sweep) -> list[str]:
    """Lines on cells whose members rise above the surface without a term or an event for it."""
    found = [
        (cell.name, text) for cell in sweep.cells for text in sweep.record(cell).messages if text.startswith(RISEN)
    ]
    if not found:
        return []
    return [
        "",
        f"In {len(found)} of {len(sweep.cells)} cells members leave the water; the first, {': '.join(found[0])}.",
    ]


def _in_full(sweep: Sweep) -> list[str]:
    """Lines about all cells; identical cells are listed once."""
    groups = alike(sweep)
    lines = [f"- {names_of(cells)}: {_cell_text(sweep, cells[0])}" for cells in groups]
    if len(sweep.cases) > 1:
        lines += ["", "## Rank", ""]
        lines += [f"{row['rank']}. {_rank_text(row)}" for row in sweep.ranking()]
        lines += ["", f"## Against {sweep.baseline}", ""]
        # With a grid metrics would be too many for a page.
        shown = [row for row in against_baseline(sweep)
                 if (row.real or row.verdict) and (row.of == SUCCESS or not sweep.setup.axes)]  # fmt: skip
        places: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
        for row in shown:
            places.setdefault((row.second, _compared_text(sweep, row)), []).append(row.point)
        lines += [f"- {case}{_at(points)}: {text}" for (case, text), points in places.items()]
        lines += [] if shown else ["- No difference of success is real."]
        lines += ["", "comparison.csv has the differences of all metrics."]
    lines += ["", "## What failures go with", ""]
    causes = [f"- {names_of(cells)}: {text}" for cells in groups if (text := _causes_text(sweep, cells[0]))]
    lines += causes or ["- With nothing that varies, as far as seen."]
    return [*lines, "", "## Worst members", "", *(f"- {text}" for text in _worst_texts(sweep, 5, groups))]


def _brief(sweep: Sweep) -> list[str]:
    """Ten lines about many cells: cases by rank, causes, and the worst members; the tables have the rest."""
    groups = alike(sweep)
    same = len(sweep.cells) - len(groups)
    ranked = {row["case"]: row for row in sweep.ranking()}
    rows = [row for row in against_baseline(sweep) if row.of == SUCCESS]
    lines = []
    for case in list(ranked)[:MOST_CASES]:
        ends = sorted((sweep.passed(cell).mean(), cell.index) for cell in sweep.cells_of(case))
        text = f"{ranked[case]['rank']}. {_rank_text(ranked[case])}"
        if len(ends) > 1 and ends[0][0] == ends[-1][0]:
            text += f"; {percent(ends[0][0])} % at each point"
        elif len(ends) > 1:
            text += f"; from {percent(ends[0][0])} %{_at([sweep.cells[ends[0][1]].point])} to {percent(ends[-1][0])} %"
        lines.append(text + _tally([row for row in rows if row.second == case], sweep.baseline))
    if (others := len(ranked) - MOST_CASES) > 0:
        lines.append(f"- {others} more cases: ranking.csv")
    refused = Counter(record.refused for cell in sweep.cells if (record := sweep.record(cell)).refused)
    if refused:
        reason, count = refused.most_common(1)[0]
        lines.append(f"- {refused.total()} cells are refused, {count} of them: {reason}")
    lines += [f"- {text}" for text in _causes_of_all(sweep, groups)]
    lines.append(f"- worst: {'; '.join(_worst_texts(sweep, 3, groups))}")
    if same:
        lines.append(f"- {same} cells are as another one, to the bit: such as {names_of(max(groups, key=len))}")
    return [*lines, "", "table.csv has a line for each cell, comparison.csv all differences."]


def alike(sweep: SweepTable) -> list[list[SweepCell]]:
    """Groups of cells whose results are bit-identical, or that were refused for the same reason."""
    groups: dict[Any, list[SweepCell]] = {}
    for cell in sweep.cells:
        record = sweep.record(cell)
        shown = (np.asarray(record.status).tobytes(), *(each.tobytes() for each in record.numbers.values()))
        groups.setdefault(record.refused or shown, []).append(cell)
    return list(groups.values())


def names_of(cells: Sequence[SweepCell]) -> str:
    """Text of the cases and points of cells."""
    points: dict[str, list[Mapping[str, Any]]] = {}
    for cell in cells:
        points.setdefault(cell.case.name, []).append(cell.point)
    return ", ".join(f"{case}{_at(each)}" for case, each in points.items())


def _at(points: Sequence[Mapping[str, Any]]) -> str:
    """Text of points of the grid, such as " at a = 1 or 2, b = 3"; "" without a grid."""
    if not points or not points[0]:
        return ""
    values = {name: list(dict.fromkeys(str(point[name]) for point in points)) for name in points[0]}
    if np.prod([len(each) for each in values.values()]) == len(points):
        return " at " + ", ".join(f"{name} = {' or '.join(each)}" for name, each in values.items())
    return " at " + "; ".join(", ".join(f"{name} = {value}" for name, value in point.items()) for point in points)


def _rank_text(row: Mapping[str, Any]) -> str:
    better = f"; better than {row['better_by']}" if row["better_by"] else ""
    return f"{row['case']}: {percent(row['value'])} % ({percent(row['lower'])} to {percent(row['upper'])}){better}"


def _tally(rows: Sequence[PairedComparison], baseline: str) -> str:
    """Text of the numbers of grid points at which a case is better or worse than the baseline; "" for the baseline."""
    if not rows:
        return ""
    words = Counter(row.verdict or ("better" if row.difference.value > 0.0 else "worse") if row.real or row.verdict
                    else "not really different" for row in rows)  # fmt: skip
    counts = [f"{words[word]} {word}" for word in (*VERDICTS, "not really different") if words[word]]
    return f"; beside {baseline}: {', '.join(counts)}"


def _worst_texts(sweep: Sweep, count: int, groups: Sequence[Sequence[SweepCell]]) -> Iterable[str]:
    """Texts of the worst members; of identical cells, only the first is used."""
    again = {cell.index for cells in groups for cell in cells[1:]}
    rows = sweep.worst(count * (1 + len(again)))
    cells = (sweep.cell(row["case"], {name: row[name] for name in sweep.setup.axes}) for row in rows)
    first = [(row, cell) for row, cell in zip(rows, cells, strict=True) if cell.index not in again]
    for row, cell in first[:count]:
        yield f"member {row['member']} of {row['case']}{_at([cell.point])}, status {Status(row['status']).name.lower()}"


def _real_causes(sweep: Sweep, cell: SweepCell) -> list[dict[str, Any]]:
    """The inputs that significantly explain success in a cell."""
    if sweep.record(cell).refused:
        return []
    return [row for row in sweep.causes(cell.case.name, cell.point) if row["p"] < 1.0 - sweep.confidence]


def _causes_text(sweep: Sweep, cell: SweepCell) -> str:
    """Text of the inputs that significantly explain success in a cell; "" for none."""
    texts = []
    for row in _real_causes(sweep, cell)[:3]:
        medians = f"median {row['median_failed']:.4g} where it fails, {row['median_passed']:.4g} where it passes"
        texts.append(f"{row['input']} (explains {percent(row['lower'])} to {percent(row['upper'])} %; {medians})")
    return "; ".join(texts)


def _causes_of_all(sweep: Sweep, groups: Sequence[Sequence[SweepCell]]) -> list[str]:
    """Texts of the inputs that explain success in the most cells, and the cell where each explains most."""
    found: dict[str, list[tuple[float, int]]] = {}
    for cells in groups:
        for row in _real_causes(sweep, cells[0]):
            found.setdefault(row["input"], []).extend((row["share"], cell.index) for cell in cells)
    texts = []
    for name, shares in sorted(found.items(), key=lambda item: -len(item[1]))[:MOST_INPUTS]:
        share, index = max(shares, key=lambda each: each[0])
        where = sweep.cells[index].name
        texts.append(f"{name} explains success in {len(shares)} cells, most in {where}: {percent(share)} %")
    return texts or ["failures go with nothing that varies, as far as seen"]


def _cell_text(table: SweepTable, cell: SweepCell) -> str:
    record = table.record(cell)
    if record.refused:
        return f"refused: {record.refused}"
    passed = table.passed(cell)
    value, lower, upper = table.success(cell.case.name, cell.point)
    counts = f"{int(passed.sum()):,} of {len(passed):,}, {percent(value)} %"
    text = f"passes {percent(lower)} to {percent(upper)} % ({counts})"
    more = none_text(int(passed.sum()), len(passed), table.confidence)
    return f"{text}; {more}" if more else text


def _compared_text(table: SweepTable, row: PairedComparison) -> str:
    d = row.difference
    judged = f"{row.verdict}: " if row.verdict else ""
    if row.of == SUCCESS:
        counts = f"{row.only[1]:,} pass only there, {row.only[0]:,} only with {row.first}" if row.only else ""
        if judged:
            value, lower, upper = (f"{100.0 * each:+.4g}" for each in (d.value, d.lower, d.upper))
            told = f"success {value} points ({lower} to {upper}), where {percent(row.matters)} matter"
        else:
            ends = sorted((abs(d.lower), abs(d.upper)))
            word = "better" if d.value > 0.0 else "worse"
            told = f"{word} by {percent(ends[0])} to {percent(ends[1])} points"
        return f"{judged}{told}, seen on the same members ({counts})"
    unit = "" if table.unit(row.of) == "1" else f" {table.unit(row.of)}"
    told = f"{row.of} {d.value:+.4g}{unit} ({d.lower:+.4g} to {d.upper:+.4g}), from {row.values[0]:.4g}"
    return f"{judged}{told}" + (f", where {row.matters:.4g} matters" if judged else "")
