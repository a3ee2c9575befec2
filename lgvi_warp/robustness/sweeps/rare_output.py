# SPDX-License-Identifier: Apache-2.0
"""Output of a sweep on rare failures: records, texts, and their provenance."""

from __future__ import annotations

from typing import Any

import numpy as np

from lgvi_warp.robustness.sweeps.rare import RareComparison
from lgvi_warp.robustness.sweeps.setup import SweepCell
from lgvi_warp.robustness.sweeps.sweep_table import SweepTable
from lgvi_warp.uncertainty.rare.answer import ESTIMATORS


def rare_against_baseline(sweep: SweepTable) -> list[RareComparison]:
    """The comparisons of the rare failures of all other cases with the baseline's."""
    if sweep.rares is None:
        return []
    rivals = [case for case in sweep.cases if case != sweep.baseline]
    pairs = [(a, b) for case in rivals for a in sweep.cells_of(sweep.baseline) for b in sweep.cells_of(case)
             if a.point == b.point]  # fmt: skip
    return sweep.rares.compare(pairs)


def rare_rows(sweep: SweepTable) -> list[dict[str, Any]]:
    """The rare failures as records: probability, number of runs, likeliest failing member, and shifted inputs."""
    rows = []
    for cell in sweep.cells:
        if sweep.rares is None or (answer := sweep.rares.of(cell)) is None:
            continue
        row: dict[str, Any] = {"case": cell.case.name, **cell.point, "refused": answer.refused}
        if (found := answer.found) is not None:
            row |= {"event": found.event, "probability": found.probability, "lower": found.interval[0],
                    "upper": found.interval[1], "error": found.relative_error, "by": found.estimator,
                    "members": sum(found.members.values()), "plain_members": found.plain_members,
                    "failed_share": found.failed_share, "distance": found.distance}  # fmt: skip
            for name, value in found.likeliest.items():
                array = np.asarray(value)
                row |= {f"likeliest {name}{list(index) if index else ''}": float(array[index])
                        for index in np.ndindex(array.shape)}  # fmt: skip
            row |= {f"probability of {name}": chance.probability for name, chance in found.by_condition.items()
                    if name != "any"}  # fmt: skip
            row |= {f"moved {name}": shift for name, shift in found.moved.items()}
            row |= {f"z of noise {name}": score for name, score in found.noise_moved.items()}
        rows.append(row)
    return rows


def provenance_of_rare(sweep: SweepTable, cell: SweepCell) -> dict[str, Any]:
    """Content of a sweep's file on a cell's rare failure; empty if none was requested."""
    if sweep.rares is None or (answer := sweep.rares.of(cell)) is None:
        return {}
    said: dict[str, Any] = {"asked": sweep.rares.asked(cell.case), "refused": answer.refused}
    if (found := answer.found) is not None:
        said |= {"event": found.event, "probability": found.probability, "interval": list(found.interval),
                 "error": found.relative_error, "by": found.estimator, "members": dict(found.members),
                 "by_condition": {name: list(chance) for name, chance in found.by_condition.items()},
                 "messages": list(found.messages)}  # fmt: skip
    return {"rare": said}


def rare_lines(sweep: SweepTable) -> list[str]:
    """Lines of text on the rare failures, and on the ratios of other cases' probabilities to the baseline's."""
    lines = []
    for cell in sweep.cells:
        if sweep.rares is None or (answer := sweep.rares.of(cell)) is None:
            continue
        if (found := answer.found) is None:
            lines.append(f"- {cell.name}: none: {answer.refused}")
            continue
        low, high = found.interval
        taken = f"{ESTIMATORS[found.estimator]}, {sum(found.members.values()):,} members"
        lines.append(
            f"- {cell.name}: fails with probability {found.probability:.3g} ({low:.3g} to {high:.3g}), by {taken}"
        )
    rows = rare_against_baseline(sweep)
    if lines and not rows and sum(_has_answer(sweep, cell) for cell in sweep.cells) > 1:
        lines.append(
            f"- no comparisons: the baseline {sweep.baseline} has no rare failure; name another, or ask compare_rare"
        )
    for row in rows:
        at = ", ".join(f"{name} = {value}" for name, value in row.point.items())
        ratio, where = row.ratio, f" at {at}" if at else ""
        seen = ("seen on failing members of either" if ratio.paired else "from the two answers") + (
            "" if row.real else "; not real"
        )
        lines.append(f"- {row.second}{where}: fails {ratio.value:.3g} times as often as {row.first} "
                     f"({ratio.lower:.3g} to {ratio.upper:.3g}), {seen}")  # fmt: skip
    return lines


def _has_answer(sweep: SweepTable, cell: Any) -> bool:
    answer = sweep.rares.of(cell) if sweep.rares is not None else None
    return answer is not None and answer.found is not None


def rare_refused(sweep: SweepTable) -> bool:
    """True if rare failures were requested, but there is no answer."""
    if sweep.rares is None:
        return False
    answers = [answer for cell in sweep.cells if (answer := sweep.rares.of(cell)) is not None]
    return all(answer.found is None for answer in answers)
