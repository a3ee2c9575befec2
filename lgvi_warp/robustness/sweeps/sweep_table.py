# SPDX-License-Identifier: Apache-2.0
"""Cells of a sweep with their members' results: lookups, success with its intervals, inputs that vary, and a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import explained
from lgvi_warp.common.errors import MissingExtra, closest, refusal
from lgvi_warp.common.status import failed, stopped
from lgvi_warp.criteria.success import Probability, Success, probability
from lgvi_warp.robustness.sweeps.rare import RareFailures
from lgvi_warp.robustness.sweeps.record import Record, Records
from lgvi_warp.robustness.sweeps.setup import END, Setup, SweepCell
from lgvi_warp.scene.columns import as_given

if TYPE_CHECKING:
    import xarray

# What users may ask of lw.Sweep, which adds comparisons, files and words.
__all__ = ["SweepTable"]

# Quantiles of each metric in the table.
LEVELS = {"q05": 0.05, "median": 0.5, "q95": 0.95}
# Name of the comparison of successes, and of the columns of rare failures.
SUCCESS, RARE = "success", "rare"


@explained
@dataclass(frozen=True, eq=False, repr=False)
class SweepTable:
    """Outcomes of a sweep's members, and their success rates."""

    setup: Setup
    cells: list[SweepCell]
    records: Records
    conditions: Success
    baseline: str
    confidence: float
    interval: str
    rares: RareFailures | None = None
    matters: Mapping[str, float] = field(default_factory=dict)

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        explained(cls)

    def __repr__(self) -> str:
        points = len(self.cells) // len(self.cases)
        return f"{type(self).__name__}({len(self.cases)} cases, {points} points, {self.members_count:,} members)"

    @property
    def cases(self) -> tuple[str, ...]:
        """The names of the cases, in their order."""
        return tuple(case.name for case in self.setup.cases)

    @property
    def metrics(self) -> tuple[str, ...]:
        """The names of the metrics, in their order; "time_to_failure" is the last."""
        return tuple(self.setup.metrics)

    @property
    def members_count(self) -> int:
        """Number of members of each cell."""
        return self.setup.members.members

    def unit(self, metric: str) -> str:
        """Return the unit of a metric.

        Args:
            metric: name of the metric, one of `metrics`.

        Returns:
            The unit as text, such as "rad s"; "1" if it has none.

        Raises:
            SceneError: there is no such metric.
        """
        if metric not in self.metrics:
            raise refusal("metric", metric, "is not a metric of this sweep", closest(metric, self.metrics))
        statistic = self.setup.metrics[metric]
        return str(getattr(statistic, "unit", statistic.quantity.unit))

    def record(self, cell: SweepCell) -> Record:
        """Return the results of the members of a cell.

        Args:
            cell: one of `cells`.

        Returns:
            The record: `status` (n,); `numbers`, metric -> (n,); `messages`; `refused`, reason, or "" if the cell ran.
        """
        return self.records[cell.key]

    def cells_of(self, case: str, at: Mapping[str, Any] | None = None) -> list[SweepCell]:
        """Return the cells of a case.

        Args:
            case: name of the case.
            at: values of the grid by name that select cells; None (default) for all.

        Returns:
            The cells, in the order of the grid.

        Raises:
            SceneError: there is no such case, or no such point.
        """
        if case not in self.cases:
            raise refusal("case", case, "is not part of this sweep", closest(str(case), self.cases))
        for name, value in (at or {}).items():
            axes = self.setup.axes
            if name not in axes:
                raise refusal("at", name, "is not an axis of the grid", closest(name, tuple(axes)))
            if value not in axes[name]:
                raise refusal(f'at["{name}"]', value, "is not a value of this axis", f"give one of {axes[name]}")
        wanted = (at or {}).items()
        return [cell for cell in self.cells if cell.case.name == case and wanted <= cell.point.items()]

    def cell(self, case: str, at: Mapping[str, Any] | None = None) -> SweepCell:
        """Return the cell of a case at a point of the grid; the cell must have run.

        Args:
            case: name of the case.
            at: values of all axes of the grid by name; may be left out if there is no grid.

        Returns:
            The cell.

        Raises:
            SceneError: no cell or several cells match, or the cell was refused.
        """
        cells = self.cells_of(case, at)
        if len(cells) != 1:
            remedy = f"name one point of the grid: at={self.setup.first_point}"
            raise refusal("at", at, f"leaves {len(cells)} cells of {case!r}", remedy)
        record = self.record(cells[0])
        if record.refused:
            raise refusal("case", cells[0].name, f"was refused: {record.refused}", "correct it, or choose another one")
        return cells[0]

    def passed(self, cell: SweepCell) -> np.ndarray:
        """Return a mask of the members of a cell: True for members that pass.

        Args:
            cell: one of `cells`.

        Returns:
            Mask (n,) of bool; a member that failed never passes.
        """
        record = self.record(cell)
        return self.conditions.passed(record.status, record.numbers)

    def values(self, case: str, metric: str, at: Mapping[str, Any] | None = None) -> np.ndarray:
        """Return a metric of all members of a cell.

        Args:
            case: name of the case.
            metric: name of the metric.
            at: values of the grid by name; may be left out if there is no grid.

        Returns:
            Values (n,) in the unit of the metric; NaN if a member has none.

        Raises:
            SceneError: there is no such case, point or metric.
        """
        if metric not in self.metrics:
            raise refusal("metric", metric, "is not part of this sweep", closest(str(metric), self.metrics))
        return self.record(self.cell(case, at)).numbers[metric]

    def success(self, case: str, at: Mapping[str, Any] | None = None) -> Probability:
        """Return the probability that a member passes.

        Args:
            case: name of the case.
            at: values of the grid by name; may be left out if there is no grid.

        Returns:
            (value, lower, upper), between 0 and 1: the fraction of the members, and its confidence interval.

        Raises:
            SceneError: there is no such case or point, or the cell was refused.
        """
        return self._probability(self.passed(self.cell(case, at)))

    def survival(self, case: str, times: Sequence[float], at: Mapping[str, Any] | None = None) -> list[Probability]:
        """Return the probability that a member still runs at each time: it neither failed nor was stopped by an event.

        Args:
            case: name of the case.
            times: times (k,) [s].
            at: values of the grid by name; may be left out if there is no grid.

        Returns:
            (value, lower, upper) at each time, as in `success`.

        Raises:
            SceneError: there is no such case or point, or the cell was refused.
        """
        ends = self.values(case, END, at)
        return [self._probability(ends > time) for time in times]

    def _probability(self, passed: np.ndarray) -> Probability:
        return probability(int(passed.sum()), len(passed), self.confidence, self.interval)

    def members(self, case: str, failed: bool = True, at: Mapping[str, Any] | None = None) -> np.ndarray:
        """Return the members that do not pass, or the members that pass.

        Args:
            case: name of the case.
            failed: True for members that do not pass, False for members that pass; by default True.
            at: values of the grid by name; may be left out if there is no grid.

        Returns:
            Indices of the members, rising.

        Raises:
            SceneError: there is no such case or point, or the cell was refused.
        """
        return np.flatnonzero(self.passed(self.cell(case, at)) != failed)

    def inputs(self, cell: SweepCell, first: int = 0, stop: int | None = None) -> dict[str, np.ndarray]:
        """Return the inputs that vary among the members of a cell.

        Args:
            cell: one of `cells`, not refused.
            first: first member; by default 0.
            stop: member after the last; None (default) for all.

        Returns:
            Values by name, each (stop - first,), in the order of `vary`. A vector has one name for each of its entries.
        """
        assert cell.fleet is not None
        fleet, stop = cell.fleet, cell.fleet.members if stop is None else stop
        chosen = fleet.select(first, stop)
        numbers: dict[str, np.ndarray] = {}
        for target in (target for variation in as_given(fleet) for target in variation.targets):
            drawn = chosen.parameters.get(target.name)
            if drawn is None:
                drawn = getattr(chosen, target.name.removeprefix("start."), None)
            if drawn is None:
                continue
            values = drawn if target.index is None else np.moveaxis(drawn, 0, -1)[target.index]
            flat = np.broadcast_to(values, (stop - first, *values.shape[1:])).reshape(stop - first, -1)
            size = flat.shape[1]
            labels = [target.label] if size == 1 else [f"{target.label}[{k}]" for k in range(size)]
            numbers |= dict(zip(labels, flat.T, strict=True))
        return numbers

    def rows(self) -> list[dict[str, Any]]:
        """Return success with its interval, and mean, standard deviation and quantiles of each metric.

        Metrics are summarised over members that did not fail and have a finite number; `missing` counts the others.

        Returns:
            One record for each cell: case, point, refused, members, failed, stopped, passed, success and metrics by name.
        """
        return [self._row(cell) for cell in self.cells]

    def _row(self, cell: SweepCell) -> dict[str, Any]:
        record = self.record(cell)
        row: dict[str, Any] = {"case": cell.case.name, **cell.point, "refused": record.refused}
        if record.refused:
            return row
        passed, lost = self.passed(cell), failed(record.status)
        row |= {"members": len(passed), "failed": int(lost.sum()), "stopped": int(stopped(record.status).sum()),
                "passed": int(passed.sum())}  # fmt: skip
        value, lower, upper = self._probability(passed)
        row |= {SUCCESS: value, f"{SUCCESS} lower": lower, f"{SUCCESS} upper": upper}
        for name, x in record.numbers.items():
            good = x[~lost & np.isfinite(x)]
            some = len(good) > 0
            row |= {f"{name} mean": float(good.mean()) if some else np.nan}
            row |= {f"{name} std": float(good.std(ddof=1)) if len(good) > 1 else np.nan}
            row |= {f"{name} {word}": float(np.quantile(good, at)) if some else np.nan for word, at in LEVELS.items()}
            row |= {f"{name} missing": len(x) - len(good)}
        return row | self._rare_row(cell)

    def _rare_row(self, cell: SweepCell) -> dict[str, Any]:
        """Columns on a cell's rare failure, if it was requested."""
        answer = None if self.rares is None else self.rares.of(cell)
        if answer is None:
            return {}
        if (found := answer.found) is None:
            return {f"{RARE} refused": answer.refused}
        return {RARE: found.probability, f"{RARE} lower": found.interval[0], f"{RARE} upper": found.interval[1],
                f"{RARE} error": found.relative_error, f"{RARE} members": sum(found.members.values()),
                f"{RARE} refused": ""}  # fmt: skip

    @property
    def table(self) -> xarray.Dataset:
        """The rows as an xarray Dataset over cases and axes of the grid; numbers of a refused cell are NaN.

        Raises:
            ImportError: xarray is not installed (extra: store).
        """
        try:
            import xarray as xr
        except ImportError as error:
            raise MissingExtra("tables of sweeps", "xarray", "store") from error
        axes, rows = self.setup.axes, self.rows()
        shape = (len(self.cases), *(len(values) for values in axes.values()))
        data = {}
        for name in dict.fromkeys(name for row in rows for name in row if name not in ("case", *axes)):
            kind = object if name in ("refused", f"{RARE} refused") else np.float64
            data[name] = ("case", *axes), np.array([row.get(name, np.nan) for row in rows], dtype=kind).reshape(shape)
        return xr.Dataset(data, {"case": list(self.cases)} | {name: coordinates(x) for name, x in axes.items()})


def coordinates(values: Sequence[Any]) -> list[Any]:
    """Values of an axis as coordinates: numbers and texts unchanged, others as texts."""
    return [value if isinstance(value, int | float | str) else str(value) for value in values]
