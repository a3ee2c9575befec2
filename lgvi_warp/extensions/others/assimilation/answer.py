# SPDX-License-Identifier: Apache-2.0
"""The result of an assimilation: states of the members, their uncertainty, and the learned numbers."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Self

import numpy as np

from lgvi_warp.common import summaries
from lgvi_warp.common.errors import Faults
from lgvi_warp.common.summaries import Summarized, few_digits
from lgvi_warp.criteria.files import Saved, finite_or_none, with_missing_as
from lgvi_warp.extensions.others.assimilation.innovations import InnovationTest, tested
from lgvi_warp.sampling.designs.table import Table
from lgvi_warp.sampling.final import NUMBERS, Final

# Numbers and series that the answer names.
MOST_NAMED = 2


@dataclass(frozen=True, eq=False, repr=False)
class Assimilated(Summarized, Saved):
    """Members after each assimilated measurement: means, standard deviations, innovations, learned numbers.

    Attributes:
        time: Times of the measurements (k,) [s].
        mean: Means after the measurements (weighted for "particles"): position (k, 3) [m], velocity (k, 3) [m/s] and
            angular_velocity (k, 3) [rad/s] in body axes, attitude (k, 3, 3), and the learned numbers by name, (k, ...).
        std: Standard deviations of the same quantities; those of the attitude are (k, 3) [rad], about the body's axes.
        innovations: {series: measured minus predicted values (k, m)}; NaN if a series has no value at a time.
        innovation_std: {series: expected standard deviations of the innovations (k, m)}, the square root of the sum of
            the predictions' variance and the instrument's variance.
        whitened: {series: innovations multiplied by the inverse square root of their covariance (k, m)}.
        left_out: {series: whether the gate left its values out at each time (k,)}.
        log_likelihood: Logarithm of the probability density of all measured values, each given the values before it, without
            values left out by the gate. It can be used to compare scenes that assimilate the same series.
        inflation: Factor on the covariance of the members before each measurement, (k,).
        effective: Effective number of members before resampling, (k,); copies of one member count once. With Kalman filters
            it is the number of members.
        ancestors: Number of initial members from which the members after each measurement descend, (k,).
        final: Final states of the members, from which a run can continue.
        parameters: The learned numbers of the members at the end, {name: (n, ...)}, for
            `run.states(final, parameters=parameters)`.
        weights: Weights of the members at the end, (n,), with the sum 1.
        method: Name of the filter.
        messages: Remarks on the reliability of the result.
        provenance: Scene, ensemble, settings, versions and machine.
        units: Units of the learned numbers by name.
    """

    study: ClassVar[str] = "assimilate"

    time: np.ndarray
    mean: Mapping[str, np.ndarray]
    std: Mapping[str, np.ndarray]
    innovations: Mapping[str, np.ndarray]
    innovation_std: Mapping[str, np.ndarray]
    whitened: Mapping[str, np.ndarray]
    left_out: Mapping[str, np.ndarray]
    log_likelihood: float
    inflation: np.ndarray
    effective: np.ndarray
    ancestors: np.ndarray
    final: Final
    parameters: Mapping[str, np.ndarray]
    weights: np.ndarray
    method: str
    messages: tuple[str, ...]
    provenance: dict[str, Any]
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def answer(self) -> str:
        units = {name: self.units.get(name, "") for name in self.parameters} | {"position": "m"}
        texts = [f"{name} is {few_digits(self.mean[name][-1], '', 4)} +- {few_digits(self.std[name][-1], unit, 2)}"
                 for name, unit in units.items()]  # fmt: skip
        doubts = [f"{name} {test.verdict}" for name, test in self.consistency().items()]
        innovations = f"; innovations: {summaries.listed(doubts, MOST_NAMED)}" if doubts else ""
        return f"At {self.time[-1]:g} s {summaries.listed(texts, MOST_NAMED)}{innovations}."

    def _report(self) -> list[str]:
        return repr(self).splitlines()

    def summary_rows(self) -> tuple[str, summaries.Rows]:
        """Rows of the summary: learned numbers, and the check of the innovations."""
        rows = [("method", self.method)]
        for name in self.parameters:
            rows.append((name, f"{_text(self.mean[name][-1])} +- {_text(self.std[name][-1])}"))
        rows.append(("position", f"{_text(self.mean['position'][-1])} +- {_text(self.std['position'][-1])} m"))
        for name, test in self.consistency().items():
            text = f"{test.ratio:.2f} of their expected spread, {test.verdict}"
            rows.append((f"innovations of {name}", text))
        rows.append(("log-likelihood", f"{self.log_likelihood:.2f}"))
        if (self.inflation != 1.0).any():
            rows.append(("inflation", f"{self.inflation[-1]:.3g} at the end, of the covariance"))
        rows.append(("effective", f"{self.effective[-1]:,.0f} of {self.final.members:,} members at the end"))
        rows += [("message", text) for text in self.messages]
        return f"Assimilation of {len(self.time):,} times to {self.time[-1]:g} s", rows

    def _content(self) -> dict[str, Any]:
        content = {item.name: getattr(self, item.name) for item in fields(self)}
        ends = {name: getattr(self.final, name) for name in NUMBERS}
        arrays = [self.final.to_arrays(), self.final.parameters]
        ends["arrays"], ends["parameters"] = ({name: _packed(rows) for name, rows in each.items()} for each in arrays)
        return dict(finite_or_none({**content, "final": ends}))

    @classmethod
    def _of_content(cls, content: dict[str, Any]) -> Self:
        ends, read = content["final"], dict[str, Any](content)
        arrays, parameters = (
            {name: _unpacked(rows) for name, rows in ends[key].items()} for key in ("arrays", "parameters")
        )
        for item in fields(cls):
            if item.type == "np.ndarray":
                read[item.name] = _array(content[item.name])
            elif item.type == "Mapping[str, np.ndarray]":
                read[item.name] = {name: _array(rows) for name, rows in content[item.name].items()}
        read["ancestors"] = read["ancestors"].astype(np.int64)
        read["left_out"] = {name: rows != 0.0 for name, rows in read["left_out"].items()}
        read["final"] = Final.from_arrays(arrays, ends, parameters)
        return cls(**read | {"messages": tuple(content["messages"])})

    def rows(self) -> Iterator[dict[str, Any]]:
        kinds = {"mean": self.mean, "std": self.std, "innovation": self.innovations}
        columns = {f"{kind} {name}": np.asarray(rows).reshape(len(self.time), -1)
                   for kind, each in kinds.items() for name, rows in each.items()}  # fmt: skip
        for k, time in enumerate(self.time):
            entries = {f"{name}[{i}]" if rows.shape[1] > 1 else name: float(value)
                       for name, rows in columns.items() for i, value in enumerate(rows[k])}  # fmt: skip
            yield {"time": float(time), "effective": float(self.effective[k])} | entries

    def consistency(self, level: float = 0.95) -> dict[str, InnovationTest]:
        """Test whether innovations are those of a consistent filter: normal, of expected variance, independent in time.

        Args:
            level: Probability that all numbers of a consistent filter are inside their bands, in (0, 1); 0.95 by default.

        Returns:
            {series: test}, with the root mean square, mean and correlation of the innovations, their bands, and a verdict.

        Raises:
            SceneError: If `level` is not in (0, 1).
        """
        faults = Faults()
        chance = faults.number("level", level)
        if chance is not None and not 0.0 < chance < 1.0:
            faults.add("level", level, "is not a probability between 0 and 1", "give 0.95, say")
        faults.raise_if_any()
        tests = {}
        for name, apart in self.innovations.items():
            used = np.isfinite(self.whitened[name]) & ~self.left_out[name][:, None]
            normalised, whitened = (
                np.where(used, each, np.nan) for each in (apart / self.innovation_std[name], self.whitened[name])
            )
            left_out = int((np.isfinite(apart) & self.left_out[name][:, None]).sum())
            tests[name] = tested(normalised, whitened, left_out, float(level))
        return tests

    def table(self) -> Table:
        """The learned numbers of the members as a design; runs with this design begin with these numbers.

        Returns:
            A table with a column for each number.
        """
        return Table(values=dict(self.parameters))


def _text(values: Any) -> str:
    """A few numbers as text, to four digits."""
    return ", ".join(f"{value:.4g}" for value in np.atleast_1d(values).ravel())


def _array(values: Any) -> np.ndarray:
    """Numbers of a file; those that were not finite are NaN."""
    return np.array(with_missing_as(values, np.nan), np.float64)


def _packed(rows: np.ndarray) -> dict[str, Any]:
    """An array as texts that keep every bit, as needed to continue a run."""
    rows = np.ascontiguousarray(rows)
    return {"dtype": rows.dtype.str, "shape": list(rows.shape), "base64": base64.b64encode(rows.tobytes()).decode()}


def _unpacked(content: Mapping[str, Any]) -> np.ndarray:
    dtype = np.dtype(content["dtype"])
    if dtype.kind not in "fiub":
        raise ValueError(f"{dtype} are not numbers")
    return np.frombuffer(base64.b64decode(content["base64"]), dtype).reshape(content["shape"]).copy()
