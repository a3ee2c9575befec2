# SPDX-License-Identifier: Apache-2.0
"""Answer of `estimate`: a statistic with its error and its cost."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Self

from lgvi_warp.common import summaries
from lgvi_warp.common.summaries import Summarized, few_digits
from lgvi_warp.criteria.files import Saved, finite_or_none, with_missing_as
from lgvi_warp.uncertainty.estimating.levels import Setting


@dataclass(frozen=True, repr=False)
class Estimated(Summarized, Saved):
    """Estimate of a statistic with its interval; the result of `lw.estimate`.

    Attributes:
        of: name of the statistic.
        unit: unit of the value and of all errors.
        value: the estimate [`unit`].
        interval: 95 % interval, (low, high), which allows for sampling error and bias together [`unit`].
        error: requested root mean square error [`unit`].
        sampling_error: standard error of sampling [`unit`].
        bias: estimated bias, the difference from a finer setting [`unit`]. It is not subtracted from the value.
        bias_interval: 95 % interval of the bias, including the finer setting's own bias, (low, high) [`unit`].
        setting: the setting whose statistic is estimated, such as "psi_x 0.025".
        settings: this setting as arguments of `lw.solve`: method, h and dtype.
        reference: text that names the finer setting and the number of members from which the bias is estimated.
        estimator: "plain Monte Carlo", "sobol", "regression", "levels" or "levels of sobol".
        members: setting -> number of members that were run; pairs of settings are named "psi_x 0.025 less psi_x 0.2".
        seconds: processor time of all runs, including the pilot, without compiling [s].
        pilot_seconds: processor time of the pilot [s].
        plain_seconds: predicted processor time of plain Monte Carlo in this setting, for the same error [s].
        own_seconds: predicted time of plain Monte Carlo at the scene's own step [s]; None if the scene has no step.
        rivals: estimator -> predicted cost of plain Monte Carlo divided by the cost of this estimator, in this setting.
        messages: notes for the user.
        recipe: data with which lw.estimate(fleet, of, recipe=...) runs the same members again, bit-identically: seed,
            setting, estimator, and for each level settings, slopes, strata and members.
        provenance: scene, ensemble, settings, versions and machine.
    """

    study: ClassVar[str] = "estimate"
    endings: ClassVar[tuple[str, ...]] = ("json", "csv", "txt")

    of: str
    unit: str
    value: float
    interval: tuple[float, float]
    error: float
    sampling_error: float
    bias: float
    bias_interval: tuple[float, float]
    setting: str
    settings: Mapping[str, Any]
    reference: str
    estimator: str
    members: Mapping[str, int]
    seconds: float
    pilot_seconds: float
    plain_seconds: float
    own_seconds: float | None = None
    rivals: Mapping[str, float] = field(default_factory=dict)
    messages: tuple[str, ...] = ()
    recipe: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def error_reached(self) -> float:
        """Root mean square error reached: square root of sampling_error^2 + bias^2 [`unit`]."""
        return math.hypot(self.sampling_error, self.bias)

    def summary_rows(self) -> tuple[str, summaries.Rows]:
        return f"Estimated {self.of}", self._rows()

    @property
    def answer(self) -> str:
        if math.isnan(self.value):
            return f"{self.of} has no finite value."
        reached = few_digits(self.error_reached, self.unit, 3)
        asked = f", {self.error:.3g} requested" if math.isfinite(self.error) else ""
        return f"{self.of} is {self._value()}; root-mean-square error {reached}{asked}."

    def _value(self) -> str:
        """Text of the estimate with its interval."""
        low, high = self.interval
        digits = _digits(self.value, 0.5 * (high - low))
        text = few_digits(self.value, self.unit, digits)
        return f"{text}, 95 % interval {low:.{digits}g} to {high:.{digits}g}"

    def _rows(self) -> summaries.Rows:
        after = "" if self.unit in ("", "1") else f" {self.unit}"
        members = ", ".join(f"{name}: {count:,}" for name, count in self.members.items())
        below, above = self.bias_interval
        gain = f" ({self.plain_seconds / self.seconds:.2g} times)" if self.seconds > 0.0 else ""
        cost = (f"{self.seconds:.2g} s, pilot {self.pilot_seconds:.2g} s; plain Monte Carlo in the same setting "
                f"{self.plain_seconds:.2g} s{gain}")  # fmt: skip
        if self.own_seconds is not None:
            cost += f", at the scene's own step {self.own_seconds:.2g} s"
        tried = ", ".join(f"{name} {gain:.2g} times" for name, gain in self.rivals.items())
        return [
            ("value", self._value()),
            ("sampling", f"{self.sampling_error:.2g}{after}   {self.estimator}: {members}"),
            ("bias", f"{self.bias:.2g}{after} ({below:.2g} to {above:.2g})   {self.setting} against {self.reference}"),
            ("cost", cost),
            *([("tried", tried)] if tried else []),
            *(("note", message) for message in self.messages),
        ]

    def _report(self) -> Iterator[str]:
        # The answer has the value.
        yield from (f"{label:<10}  {text}" for label, text in self._rows()[1:])

    def _content(self) -> dict[str, Any]:
        names = [item.name for item in fields(self) if item.name not in ("provenance", "settings")]
        content = {name: getattr(self, name) for name in names} | {"members": dict(self.members)}
        return dict(finite_or_none(content | {"rivals": dict(self.rivals), "recipe": dict(self.recipe)}))

    @classmethod
    def _of_content(cls, content: dict[str, Any]) -> Self:
        low, high = content["interval"]
        ends = (-math.inf if low is None else low, math.inf if high is None else high)
        settings = Setting.from_dict(content["recipe"]["setting"]).options()
        numbers = {
            name: with_missing_as(content[name], math.inf) for name in ("error", "sampling_error", "plain_seconds")
        }
        more = {"interval": ends, "bias_interval": tuple(with_missing_as(content["bias_interval"], math.inf))}
        return cls(**content | numbers | more | {"messages": tuple(content["messages"]), "settings": settings})

    def rows(self) -> Iterator[dict[str, Any]]:
        names = (
            "of",
            "unit",
            "value",
            "error",
            "sampling_error",
            "bias",
            "setting",
            "reference",
            "estimator",
            "seconds",
        )
        low, high = self.interval
        yield {name: getattr(self, name) for name in names[:3]} | {"low": low, "high": high} | {
            name: getattr(self, name) for name in names[3:]} | {"members": sum(self.members.values())}  # fmt: skip


def _digits(value: float, half: float) -> int:
    """Number of digits that show a value to a hundredth of half its interval."""
    if not (math.isfinite(half) and half > 0.0 and value):
        return 6
    return min(12, max(3, 2 + math.ceil(math.log10(max(abs(value) / half, 1.0)))))
