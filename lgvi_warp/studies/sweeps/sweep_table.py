# SPDX-License-Identifier: Apache-2.0
"""What a sweep found: success with its intervals, paired comparisons, ranks, the worst members, and tables of all that."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.errors import MissingExtra, closest, refusal
from lgvi_warp.common.status import failed, stopped
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.results.result import Result
from lgvi_warp.scene.columns import as_given
from lgvi_warp.statistics.estimates import paired
from lgvi_warp.statistics.estimates.given_data import explained
from lgvi_warp.studies.sweeps import setup as setups
from lgvi_warp.studies.sweeps.record import Record, Records
from lgvi_warp.studies.sweeps.setup import Setup, SweepCell
from lgvi_warp.studies.sweeps.success import Probability, Success, probability

if TYPE_CHECKING:
    import xarray

# Quantiles of each metric in the table.
LEVELS = {"q05": 0.05, "median": 0.5, "q95": 0.95}
# Name of the comparison of successes.
SUCCESS = "success"


@dataclass(frozen=True)
class PairedComparison:
    """A difference between two cases on the same members, at one point of the grid."""

    first: str
    second: str
    point: Mapping[str, Any]
    of: str
    values: tuple[float, float]
    difference: paired.Difference
    test: str
    p: float
    real: bool
    only: tuple[int, int] | None = None

    def row(self) -> dict[str, Any]:
        """Return the comparison as a record of a table."""
        d, only = self.difference, self.only or (None, None)
        head = {"first": self.first, "second": self.second, **self.point, "of": self.of}
        values = {"value_first": self.values[0], "value_second": self.values[1]}
        ends = {
            "difference": d.value,
            "lower": d.lower,
            "upper": d.upper,
            "p": d.p,
            "p_holm": self.p,
            "real": self.real,
        }
        return (
            head | values | ends | {"pairs": d.pairs, "test": self.test, "only_first": only[0], "only_second": only[1]}
        )


@dataclass(frozen=True, eq=False, repr=False)
class SweepTable:
    """What a sweep found, without its files.

    Attributes:
        setup: what was run.
        cells: its cells, cases times points of the grid, in order.
        records: what their members showed.
        conditions: what a member must fulfil to pass.
        baseline: name of the case that others are compared with.
        confidence: confidence level of all intervals.
        interval: how intervals of probabilities are formed.
    """

    setup: Setup
    cells: list[SweepCell]
    records: Records
    conditions: Success
    baseline: str
    confidence: float
    interval: str

    def __repr__(self) -> str:
        """Say how much there is."""
        points = len(self.cells) // len(self.cases)
        return f"{type(self).__name__}({len(self.cases)} cases, {points} points, {self.members_count:,} members)"

    @property
    def cases(self) -> tuple[str, ...]:
        """The names of the cases, in their order."""
        return tuple(case.name for case in self.setup.cases)

    @property
    def metrics(self) -> tuple[str, ...]:
        """The names of the metrics, in their order."""
        return tuple(self.setup.metrics)

    @property
    def members_count(self) -> int:
        """Number of members of each cell."""
        return self.setup.members.members

    def unit(self, metric: str) -> str:
        """Return the unit of a metric.

        Args:
            metric: its name.
        """
        statistic = self.setup.metrics[metric]
        return str(getattr(statistic, "unit", statistic.quantity.unit))

    def record(self, cell: SweepCell) -> Record:
        """Return what the members of a cell showed.

        Args:
            cell: one of `cells`.
        """
        return self.records[cell.key]

    def cells_of(self, case: str, at: Mapping[str, Any] | None = None) -> list[SweepCell]:
        """Return the cells of a case.

        Args:
            case: its name.
            at: values of the grid by name that they have; None (default) for all.

        Raises:
            SceneError: there is no such case, or no such point.
        """
        if case not in self.cases:
            raise refusal("case", case, "is none of this sweep", closest(str(case), self.cases))
        for name, value in (at or {}).items():
            if name not in self.setup.axes:
                raise refusal("at", name, "is no axis of the grid", closest(name, tuple(self.setup.axes)))
            if value not in self.setup.axes[name]:
                raise refusal(
                    f'at["{name}"]', value, "is no value of this axis", f"give one of {self.setup.axes[name]}"
                )
        wanted = (at or {}).items()
        return [cell for cell in self.cells if cell.case.name == case and wanted <= cell.point.items()]

    def cell(self, case: str, at: Mapping[str, Any] | None = None) -> SweepCell:
        """Return the one cell of a case at a point of the grid, which has run.

        Args:
            case: its name.
            at: values of all axes of the grid by name; may be left out where there is no grid.

        Raises:
            SceneError: there is no such cell, several, or it was refused.
        """
        cells = self.cells_of(case, at)
        if len(cells) != 1:
            example = {name: values[0] for name, values in self.setup.axes.items()}
            raise refusal(
                "at", at, f"leaves {len(cells)} cells of {case!r}", f"name one point of the grid: at={example}"
            )
        record = self.record(cells[0])
        if record.refused:
            raise refusal("case", cells[0].name, f"was refused: {record.refused}", "mend it, or ask for another one")
        return cells[0]

    def passed(self, cell: SweepCell) -> np.ndarray:
        """Return which members of a cell pass, (n,).

        Args:
            cell: one of `cells`.
        """
        record = self.record(cell)
        return self.conditions.passed(record.status, record.numbers)

    def values(self, case: str, metric: str, at: Mapping[str, Any] | None = None) -> np.ndarray:
        """Return a metric of all members, (n,); NaN where one has none.

        Args:
            case: name of the case.
            metric: name of the metric.
            at: values of the grid by name; may be left out where there is no grid.

        Raises:
            SceneError: there is no such case, point or metric.
        """
        if metric not in self.metrics:
            raise refusal("metric", metric, "is none of this sweep", closest(str(metric), self.metrics))
        return self.record(self.cell(case, at)).numbers[metric]

    def success(self, case: str, at: Mapping[str, Any] | None = None) -> Probability:
        """Return the probability that a member passes, (value, lower, upper).

        Args:
            case: name of the case.
            at: values of the grid by name; may be left out where there is no grid.

        Raises:
            SceneError: there is no such case or point, or it was refused.
        """
        return self._probability(self.passed(self.cell(case, at)))

    def survival(self, case: str, times: Sequence[float], at: Mapping[str, Any] | None = None) -> list[Probability]:
        """Return the probability that a member neither failed nor was stopped by each time, with its interval at each.

        Args:
            case: name of the case.
            times: times [s].
            at: values of the grid by name; may be left out where there is no grid.

        Raises:
            SceneError: there is no such case or point, or it was refused.
        """
        ends = self.values(case, setups.END, at)
        return [self._probability(ends > time) for time in times]

    def _probability(self, passed: np.ndarray) -> Probability:
        return probability(int(passed.sum()), len(passed), self.confidence, self.interval)

    def members(self, case: str, failed: bool = True, at: Mapping[str, Any] | None = None) -> np.ndarray:
        """Return the indices of the members that do not pass, or of those that do.

        Args:
            case: name of the case.
            failed: whether those that do not pass are wanted; by default True.
            at: values of the grid by name; may be left out where there is no grid.

        Raises:
            SceneError: there is no such case or point, or it was refused.
        """
        return np.flatnonzero(self.passed(self.cell(case, at)) != failed)

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

        Raises:
            SceneError: there is no such case or point.
        """
        pairs = [(a, b) for a in self.cells_of(first, at) for b in self.cells_of(second, at) if a.point == b.point]
        return self.corrected_for_number([row for a, b in pairs for row in self._compared(a, b, quantile)])

    def corrected_for_number(self, rows: list[PairedComparison]) -> list[PairedComparison]:
        """Return comparisons made together, with p corrected for their number.

        Args:
            rows: the comparisons.
        """
        corrected = paired.holm(np.array([row.difference.p for row in rows]))
        real = [self._differs(row, p) for row, p in zip(rows, corrected, strict=True)]
        return [replace(row, p=float(p), real=yes) for row, p, yes in zip(rows, corrected, real, strict=True)]

    def _differs(self, row: PairedComparison, p: float) -> bool:
        """Whether a difference is real: by its test, or where there is none by its interval."""
        d = row.difference
        return bool(d.lower > 0.0 or d.upper < 0.0) if np.isnan(d.p) else bool(p < 1.0 - self.confidence)

    def _compared(self, a: SweepCell, b: SweepCell, quantile: float | None) -> Iterator[PairedComparison]:
        """Compare two cells; nothing where one was refused."""
        records = self.record(a), self.record(b)
        if any(record.refused for record in records):
            return
        yield self._of_success(a, b)
        lost = failed(records[0].status) | failed(records[1].status)
        for name in self.metrics:
            if name == setups.END:
                continue
            x, y = (np.where(lost, np.nan, record.numbers[name]) for record in records)
            finite = np.isfinite(x) & np.isfinite(y)
            if quantile is None:
                d, test = paired.means(x, y, self.confidence), "paired t"
                values = tuple(float(v[finite].mean()) if finite.any() else np.nan for v in (x, y))
            else:
                d = paired.quantiles(x, y, quantile, self.confidence, seed=self.setup.members.seed)
                test = "bootstrap of members"
                values = tuple(float(np.quantile(v[finite], quantile)) if finite.any() else np.nan for v in (x, y))
            yield PairedComparison(
                a.case.name, b.case.name, a.point, name, (values[0], values[1]), d, test, np.nan, False
            )

    def _of_success(self, a: SweepCell, b: SweepCell) -> PairedComparison:
        x, y = self.passed(a), self.passed(b)
        only = int((x & ~y).sum()), int((y & ~x).sum())
        d = paired.proportions(*only, len(x), self.confidence)
        values = float(x.mean()), float(y.mean())
        return PairedComparison(
            a.case.name, b.case.name, a.point, SUCCESS, values, d, "McNemar, exact", np.nan, False, only
        )

    def ranking(self, at: Mapping[str, Any] | None = None) -> list[dict[str, Any]]:
        """Rank the cases by success, and say of which others each is better than chance explains, and by how much.

        With a grid a case's success is the mean over its points, of each member's share of points passed; a case that was
        refused at a point is left out. All pairs of cases are tested, McNemar's exact test or with a grid a paired t of
        shares, and p is corrected for all pairs by Holm.

        Args:
            at: values of the grid by name; None (default) for all points.

        Raises:
            SceneError: there is no such point.
        """
        shares: dict[str, np.ndarray] = {}
        single = len(self.cells_of(self.cases[0], at)) == 1
        for case in self.cases:
            cells = self.cells_of(case, at)
            if not any(self.record(cell).refused for cell in cells):
                shares[case] = np.mean([self.passed(cell) for cell in cells], axis=0)
        pairs = list(itertools.combinations(shares, 2))
        tests = [self._share_test(shares[a], shares[b], single) for a, b in pairs]
        p = paired.holm(np.array([test.p for test in tests]))
        tested = {pair: (d.lower, d.upper, level) for pair, d, level in zip(pairs, tests, p, strict=True)}
        tested |= {(b, a): (-upper, -lower, level) for (a, b), (lower, upper, level) in tested.items()}
        rows: list[dict[str, Any]] = []
        for case, share in sorted(shares.items(), key=lambda item: -item[1].mean()):
            better = {}
            for rival in (rival for rival in shares if share.mean() > shares[rival].mean()):
                least, most, level = tested[rival, case]
                if level < 1.0 - self.confidence:
                    better[rival] = f"{rival} by {100.0 * least:.4g} to {100.0 * most:.4g} points"
            passing = self._probability(share == 1.0) if single else self._mean_share(share)
            rows.append({"rank": len(rows) + 1, "case": case, **passing._asdict(), "better_than": ", ".join(better),
                         "better_by": ", ".join(better.values())})  # fmt: skip
        return rows

    def _share_test(self, a: np.ndarray, b: np.ndarray, single: bool) -> paired.Difference:
        if single:
            return paired.proportions(int((a > b).sum()), int((b > a).sum()), len(a), self.confidence)
        return paired.means(a, b, self.confidence)

    def _mean_share(self, share: np.ndarray) -> Probability:
        d = paired.means(np.zeros(len(share)), share, self.confidence)
        return Probability(d.value, max(0.0, d.lower), min(1.0, d.upper))

    def worst(self, count: int = 20, by: str | None = None, case: str | None = None) -> list[dict[str, Any]]:
        """Return the worst members of all cells: those that failed, the earliest first, then by a metric, the largest first.

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
        cells = [cell for name in ((case,) if case else self.cases) for cell in self.cells_of(name)]
        ordered: list[tuple[tuple[float, float, int, int], SweepCell]] = []
        for cell in cells:
            record = self.record(cell)
            if record.refused:
                continue
            lost, ends = failed(record.status), record.numbers[setups.END]
            size = np.nan_to_num(record.numbers[by], nan=np.inf)
            # Sorted by what comes first: earlier failures, then larger numbers; members in their order.
            group, rank = np.where(lost, 0.0, 1.0), np.where(lost, ends, -size)
            order = np.lexsort((np.arange(len(lost)), rank, group))[:count]
            ordered += [((float(group[i]), float(rank[i]), cell.index, int(i)), cell) for i in order]
        ordered.sort(key=lambda item: item[0])
        return [self._member_row(cell, place[3]) for place, cell in ordered[:count]]

    def _member_row(self, cell: SweepCell, i: int) -> dict[str, Any]:
        record, inputs = self.record(cell), self.inputs(cell, i, i + 1)
        return {"case": cell.case.name, **cell.point, "member": i, "status": int(record.status[i]),
                "passed": bool(self.passed(cell)[i]), **{name: float(x[i]) for name, x in record.numbers.items()},
                **{name: float(x[0]) for name, x in inputs.items()}}  # fmt: skip

    def inputs(self, cell: SweepCell, first: int = 0, stop: int | None = None) -> dict[str, np.ndarray]:
        """Return what varies among the members of a cell, one number a name, in the order of `vary`.

        Args:
            cell: one of `cells`, not refused.
            first: first member; by default 0.
            stop: member after the last; None (default) for all.
        """
        assert cell.fleet is not None
        fleet, stop = cell.fleet, cell.fleet.members if stop is None else stop
        chosen = fleet.select(first, stop)
        numbers: dict[str, np.ndarray] = {}
        for variation in as_given(fleet):
            for target in variation.targets:
                drawn = chosen.parameters.get(target.name)
                if drawn is None:
                    drawn = getattr(chosen, target.name.removeprefix("start."), None)
                if drawn is None:
                    continue
                values = drawn if target.index is None else np.moveaxis(drawn, 0, -1)[target.index]
                flat = np.broadcast_to(values, (stop - first, *values.shape[1:])).reshape(stop - first, -1)
                labels = (
                    [target.label] if flat.shape[1] == 1 else [f"{target.label}[{k}]" for k in range(flat.shape[1])]
                )
                numbers |= dict(zip(labels, flat.T, strict=True))
        return numbers

    def causes(self, case: str, at: Mapping[str, Any] | None = None, of: str = SUCCESS) -> list[dict[str, Any]]:
        """Return which of the inputs that vary explain success or a metric, the most important first.

        share: the part of the variance over members that the mean over this input explains, from the members at hand (by bins;
        see `statistics.given_data`), with its interval and the F test's p, corrected for the number of inputs by Holm. slope:
        the standardised coefficient of a linear regression on all inputs. Inputs are meant to be drawn independently.

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
        found = explained(inputs, y, self.confidence)
        p = paired.holm(np.array([one.p for one in found.values()]))
        rows = [{"input": name, **one._asdict(), "p": float(corrected), "median_passed": _median(inputs[name][passed]),
                 "median_failed": _median(inputs[name][~passed])}
                for (name, one), corrected in zip(found.items(), p, strict=True)]  # fmt: skip
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
            threads: number of threads; default all cores.

        Returns:
            Their result.

        Raises:
            SceneError: there is no such case, point or member.
        """
        return setups.rerun_members_of(self.setup, self.cell(case, at), members, save, threads)

    def rows(self) -> list[dict[str, Any]]:
        """Return one record for each cell: success with its interval, and mean, spread and quantiles of each metric.

        Metrics are over members that did not fail and whose number is finite; `missing` counts the others.
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
        row |= {
            SUCCESS if name == "value" else f"{SUCCESS} {name}": end
            for name, end in self._probability(passed)._asdict().items()
        }
        for name, x in record.numbers.items():
            good = x[~lost & np.isfinite(x)]
            some = len(good) > 0
            row |= {f"{name} mean": float(good.mean()) if some else np.nan}
            row |= {f"{name} std": float(good.std(ddof=1)) if len(good) > 1 else np.nan}
            row |= {f"{name} {word}": float(np.quantile(good, at)) if some else np.nan for word, at in LEVELS.items()}
            row |= {f"{name} missing": len(x) - len(good)}
        return row

    @property
    def table(self) -> xarray.Dataset:
        """The rows as an xarray Dataset, by case and by axes of the grid; a cell that was refused is NaN.

        Raises:
            ImportError: xarray is not installed (extra: store).
        """
        try:
            import xarray as xr
        except ImportError as error:
            raise MissingExtra("tables of sweeps", "xarray", "store") from error
        axes = self.setup.axes
        shape = (len(self.cases), *(len(values) for values in axes.values()))
        rows = self.rows()
        names = list(dict.fromkeys(name for row in rows for name in row if name not in ("case", *axes)))
        data = {}
        for name in names:
            values = [row.get(name, np.nan) for row in rows]
            data[name] = (
                ("case", *axes),
                np.array(values, dtype=object if name == "refused" else np.float64).reshape(shape),
            )
        return xr.Dataset(
            data, {"case": list(self.cases), **{name: coordinates(values) for name, values in axes.items()}}
        )


def _median(x: np.ndarray) -> float:
    return float(np.median(x)) if len(x) else np.nan


def coordinates(values: Sequence[Any]) -> list[Any]:
    """Return values of an axis as coordinates: numbers and texts as they are, others as texts."""
    return [value if isinstance(value, int | float | str) else str(value) for value in values]
