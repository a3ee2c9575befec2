# SPDX-License-Identifier: Apache-2.0
"""The question of an estimate: a number of each member, and the statistic of these numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lgvi_warp import statistics
from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.common.status import failed
from lgvi_warp.criteria.risk import CVaR
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.results.quantities import quantities
from lgvi_warp.scene.like import SceneLike
from lgvi_warp.statistics.base import TYPES, Statistic, from_list
from lgvi_warp.statistics.estimates.naming import spelled
from lgvi_warp.statistics.member_metrics import metric_of
from lgvi_warp.statistics.paths.member_statistic import MemberStatistic
from lgvi_warp.uncertainty.estimating.target import Sought

REMEDY = ('give "mean position[0]", "depth above 3", "outcome floor", lw.statistics.Mean, Exceedance, Outcome, FirstPassage '
          "or Quantiles of one level, or a metric")  # fmt: skip


@dataclass(frozen=True)
class Question:
    """Question of an estimate: a target of one number of each member.

    label: label of the answer, such as "mean position[0]".
    of: a quantity of interest; None if a metric gives the number.
    metric: the statistic that computes the number of each member; None if a quantity gives it.
    """

    label: str
    unit: str
    target: Sought
    of: Any = None
    metric: Statistic | None = None

    def settings(self, scene: SceneLike) -> dict[str, Any]:
        """Arguments of `lw.prepare` that the question needs for a scene."""
        if self.metric is None:
            return {"of": self.of, "failed": "nan"}
        every = scene.run.save_every
        if self.metric.ticks and scene.controller is not None:
            every = None  # a metric comes to every tick by itself
        elif every is None:
            problem = "is taken over the whole path, and the scene keeps no samples"
            raise refusal("of", self.label, problem, "give [run] save_every, the time between them")
        return {"statistics": [self.metric], "save": SaveAt(every=every, fields=("position",))}

    def numbers(self, answer: Any) -> np.ndarray:
        """The number of each member (n,) from the answer of a prepared run; NaN for members that failed."""
        if self.metric is None:
            y = np.asarray(answer, dtype=np.float64)
        else:
            gathered = answer.statistics[f"each {self.metric.key}"].value[0, 0]
            y = np.where(failed(answer.status), np.nan, gathered)
        if y.ndim != 1:
            raise refusal("of", self.label, f"is {y.shape[1]} numbers", "name one of its entries")
        return np.array(y)


def question_of(of: Any, risk: Any = "mean") -> Question:
    """Read a question; SceneError unless it is a mean, probability, quantile or cvar of one number.

    risk: "mean", the level of a quantile, or a CVaR; for a quantity or a metric.
    """
    question = _read(of)
    if isinstance(risk, str) and risk == "mean":
        return question
    if question.target.kind != "mean":
        raise refusal("risk", risk, f"is given beside {question.label}", "leave it out, or give the quantity itself")
    return with_risk(question, risk)


def with_risk(question: Question, risk: Any) -> Question:
    """The same number of each member, with a quantile or the mean of the worst members as statistic."""
    inner = question.label.removeprefix("mean ")
    if isinstance(risk, CVaR):
        target = Sought("cvar", risk.share) if risk.share < 1.0 else Sought()
        return replace(question, label=f"{risk} of {inner}", target=target)
    if isinstance(risk, float) and 0.0 < risk < 1.0:
        return replace(question, label=f"{100.0 * risk:g} % quantile of {inner}", target=Sought("quantile", risk))
    remedy = 'give "mean", a level such as 0.95, or lw.metrics.CVaR(0.05)'
    raise refusal("risk", risk, "is not a risk", remedy)


def _read(of: Any) -> Question:
    if isinstance(of, Mapping):
        (statistic,) = from_list([dict(of)], "of", unique_names=False)
        return _of_statistic(statistic)
    if isinstance(of, Statistic):
        return _of_statistic(of)
    if isinstance(of, str):
        return _of_text(of.strip())
    if not callable(of) and items_of(of) is not None:
        raise refusal("of", of, "is several quantities", "ask for one at a time")
    return _of_quantity(of)


def _of_text(text: str) -> Question:
    word, _, rest = text.partition(" ")
    if word in ("probability", "exceedance"):
        text = rest
    for side in ("above", "below"):
        inner, found, limit = text.partition(f" {side} ")
        if found:
            faults, bound = Faults(), None
            try:
                bound = faults.number(f"of = {text!r}", float(limit))
            except ValueError:
                faults.add("of", text, f"has no number after {side}", 'give "depth above 3"')
            faults.raise_if_any()
            return _bounded(_read(inner.strip()), **{side: bound})
    if word == "mean" and rest:
        return _read(rest)
    if word in TYPES and word not in ("outcome", "end_time"):
        (statistic,) = from_list([{"type": word, "of": rest} if rest else {"type": word}], "of", unique_names=False)
        return _of_statistic(statistic)
    return _of_quantity(text)


def _of_quantity(of: Any) -> Question:
    """The mean of a quantity of interest; for an outcome, its probability."""
    (interest,) = quantities(of)
    kind = getattr(interest, "kind", "")
    if kind == "outcome":
        return Question(interest.label, "1", Sought("probability"), of)
    if kind == "end_time" or getattr(interest, "outcome", ""):
        problem = "is of those members alone that end so, whose number is not fixed"
        raise refusal("of", interest.label, problem, "ask for the probability of the outcome, or run lw.solve")
    return Question(f"mean {interest.label}", interest.unit or "1", Sought(), of)


def _of_statistic(statistic: Statistic) -> Question:
    """The question of a statistic; SceneError if it has another kind, or is taken only over some members."""
    if statistic.at is not None or (statistic.stopped == "left_out" and not statistic.ticks):
        problem = "is of some of the members alone, whose number is not fixed"
        raise refusal("of", statistic.key, problem, "ask for all of them, or run lw.solve(statistics=[...])")
    if isinstance(statistic, statistics.Outcome):
        return _of_quantity(f"outcome {statistic.quantity.name}")
    if isinstance(statistic, statistics.EndTime) or not isinstance(
        statistic,
        statistics.Mean | statistics.Exceedance | statistics.Quantiles | statistics.FirstPassage | MemberStatistic,
    ):
        raise refusal("of", statistic.key, "is not a mean, probability or quantile of all members", REMEDY)
    if isinstance(statistic, MemberStatistic):
        _, gathering = metric_of("of", statistic)
        question = Question(f"mean {statistic.key}", statistic.unit or "1", Sought(), None, gathering)
        return _asked_of(question, _only(statistic))
    if statistic.quantity.size != 1:
        problem = f"is of {statistic.quantity.size} numbers of each member"
        raise refusal("of", statistic.key, problem, f"name one, such as {statistic.quantity.labels[0]!r}")
    if isinstance(statistic, statistics.FirstPassage):
        return _of_passage(statistic)
    return _asked_of(_of_quantity(statistic.of), statistic)


def _only(statistic: MemberStatistic) -> Statistic:
    """The statistic that computes the number of each member."""
    if len(statistic.then) != 1:
        raise refusal(
            f"{statistic.type}.then", len(statistic.then), "statistics are asked for", "ask for one at a time"
        )
    return statistic.then[0]


def _asked_of(question: Question, statistic: Statistic) -> Question:
    """The question of a statistic about a number."""
    if isinstance(statistic, statistics.Quantiles):
        if len(statistic.levels) != 1:
            raise refusal("of", statistic.levels, "are several levels", "ask for one: levels=[0.95]")
        return with_risk(question, float(statistic.levels[0]))
    if isinstance(statistic, statistics.Exceedance):
        limits = {name: getattr(statistic, name) for name in ("above", "below")}
        return _bounded(question, **{k: None if v is None else float(np.ravel(v)[0]) for k, v in limits.items()})
    if isinstance(statistic, statistics.Mean):
        return question
    raise refusal("of", statistic.type, "is not a mean, probability or quantile", REMEDY)


def _bounded(question: Question, above: float | None = None, below: float | None = None) -> Question:
    """The probability that a number is within limits; for a condition without limits, that it is true."""
    inner = question.label.removeprefix("mean ")
    limits = "".join(f" {word} {spelled(v)}" for word, v in (("above", above), ("below", below)) if v is not None)
    if not limits:
        above = 0.5
    label = f"probability {inner}{limits}"
    return replace(question, label=label, unit="1", target=Sought("probability", above=above, below=below))


def _of_passage(statistic: statistics.FirstPassage) -> Question:
    """The probability of passing a limit by the end: that the extreme of the samples is beyond the limit."""
    above, below = statistic.above, statistic.below
    if not isinstance(statistic.of, str) or (above is None) == (below is None):
        remedy = "give the name of a quantity and one limit, or an event of the scene and lw.statistics.Outcome"
        raise refusal("of", statistic.key, "is not a passage of one limit by a named quantity", remedy)
    extreme = f"max({statistic.of})" if below is None else f"min({statistic.of})"
    limits = {"above": above, "below": below}
    return _bounded(_of_quantity(extreme), **{k: None if v is None else float(v) for k, v in limits.items()})
