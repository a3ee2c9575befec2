# SPDX-License-Identifier: Apache-2.0
"""Answer of `rare_event`: a probability with its error and cost, and the members for which the event happens."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Self

import numpy as np

from lgvi_warp.common.summaries import listed
from lgvi_warp.criteria.files import Saved, finite_or_none
from lgvi_warp.criteria.running import duration_text
from lgvi_warp.sampling.designs.table import Table
from lgvi_warp.uncertainty.rare.causes import Chance, moved_texts
from lgvi_warp.uncertainty.rare.subset import SubsetRun

# Most numbers that are listed as moved by the event.
MOST_MOVED = 6
ESTIMATORS = {
    "importance": "weights of members drawn about the failing ones of chains",
    "subset": "subset simulation",
    "plain": "plain sampling by Sobol points, or at random with many numbers",
    "splitting": "splitting in time",
}


@dataclass(frozen=True, eq=False)
class RareEvent(Saved):
    """Probability of a rare event, and members for which the event happens (failing members).

    Attributes:
        event: text of the event.
        probability: probability of the event; with failed="event", members that fail count as the event.
        interval: (lower, upper), 95 % interval, by Student's t for the logarithm of the probability.
        relative_error: relative standard error of the probability.
        estimator: "importance", "subset", "plain" or "splitting".
        members: number of members run, by setting: "scene" and the entries of `cheaper`; with splitting, as whole runs.
        failing: the m failing members, a `Table` for lw.Ensemble(scene, sampling=found.failing); None if only noise
            varies. With splitting a member may occur several times, with different noise.
        normals: (m, d), standard normal scores of the d varied numbers of the failing members, in the order of `moved`.
        draws: (m, k), standard normals of the failing members' k draws of noise, for lw.prepare(..., draws="given"); k
            = 0 without noise and with splitting.
        weights: (m,), weights of the failing members; their sum is 1.
        failed_share: fraction of the probability due to members that failed or have a number that is not finite.
        likeliest: values by name of the likeliest failing member: the nearest to the middle (median) of all inputs.
        likeliest_draws: (k,), standard normal draws of this member's noise.
        distance: norm of this member's standard normals: its distance from the middle, in standard deviations.
        moved: name -> mean of the number over failing members, in standard deviations from its middle.
        noise_moved: term or sensor -> z-score of the failing members' draws: of their mean path or their sum of
            squares, whichever is larger. For irrelevant noise it is about standard normal; from 4.5 on it is
            significant.
        runs: the runs of subset simulation, with thresholds and limits of each level. With splitting, both are scores:
            the expected limit at the end divided by its uncertainty; infinite if the event happened.
        plain_members: number of members that plain Monte Carlo would need for the same relative error.
        plain_seconds: time that these members would take at the speed of this call [s].
        seconds: time of all runs of members in this call [s].
        messages: notes for the user.
        provenance: scene, distributions, settings, versions and machine.
        paths: with splitting, (times (j + 1,) [s], indices (j,)) of each failing member: between two times the member
            has the noise of the index between them and of the call's seed, as in `run.states(final, indices=, seed=)`.
        moved_size: name -> mean distance of failing members from the middle [standard deviations]; all members: 0.80.
        moved_spread: name -> standard deviation of failing members divided by that of all members.
        moved_z: name -> largest z-score of the three differences above from all members; significant from 4.5 on.
        by_condition: text of each condition, "any" or "all" -> (probability, lower, upper) over the whole run; empty
            for one condition, or if a status is a condition.
        ancestors: (m,), first-level ancestor of each failing member; with splitting, its independent run. Members that
            share an ancestor are dependent.
    """

    study: ClassVar[str] = "rare"
    endings: ClassVar[tuple[str, ...]] = ("json", "csv", "txt")

    event: str
    probability: float
    interval: tuple[float, float]
    relative_error: float
    estimator: str
    members: Mapping[str, int]
    failing: Table | None = field(repr=False)
    normals: np.ndarray = field(repr=False)
    draws: np.ndarray = field(repr=False)
    weights: np.ndarray = field(repr=False)
    failed_share: float
    likeliest: Mapping[str, Any]
    likeliest_draws: np.ndarray = field(repr=False)
    distance: float
    moved: Mapping[str, float]
    noise_moved: Mapping[str, float]
    runs: tuple[SubsetRun, ...] = field(repr=False)
    plain_members: float
    plain_seconds: float
    seconds: float
    messages: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict, repr=False)
    paths: tuple[tuple[np.ndarray, np.ndarray], ...] = field(default=(), repr=False)
    moved_size: Mapping[str, float] = field(default_factory=dict, repr=False)
    moved_spread: Mapping[str, float] = field(default_factory=dict, repr=False)
    moved_z: Mapping[str, float] = field(default_factory=dict, repr=False)
    by_condition: Mapping[str, Chance] = field(default_factory=dict)
    ancestors: np.ndarray = field(default_factory=lambda: np.zeros(0, int), repr=False)

    @property
    def answer(self) -> str:
        low, high = self.interval
        found = f"Probability of {self.event}: {self.probability:.3g} (95 % interval {low:.3g} to {high:.3g})"
        if not len(self.weights):
            return f"{found}; no failing member was found."
        if not (self.moved or self.noise_moved):
            return f"{found}."
        return f"{found}; in failing members {listed(self._moved() or ['nothing differs beyond chance'], 1)}."

    def _moved(self) -> list[str]:
        """Texts of the differences between failing and all members, the clearest first."""
        columns = [each.values() for each in (self.moved, self.moved_size, self.moved_spread, self.moved_z)]
        moved = dict(zip(self.moved, zip(*columns, strict=False), strict=False))
        laws = self.provenance.get("ensemble", {}).get("vary", {})
        normal = {name for name in moved if "normal" in laws.get(name, laws.get(name.partition("[")[0], {}))}
        return moved_texts(moved, self.noise_moved, normal)

    def _report(self) -> list[str]:
        members = ", ".join(f"{count:,} at {name}" for name, count in self.members.items())
        lines = [
            f"by          {ESTIMATORS[self.estimator]}, to {100.0 * self.relative_error:.2g} % of the probability",
            f"members     {members}; {duration_text(self.seconds)}",
            f"at random   {self.plain_members:,.3g} members would have this error, {duration_text(self.plain_seconds)}",
        ]
        lines += [f"            {name}: {chance.probability:.3g} ({chance.lower:.3g} to {chance.upper:.3g})"
                  for name, chance in self.by_condition.items() if name != "any"]  # fmt: skip
        if self.failed_share > 0.0:
            lines.append(f"failed      {self.failed_share:.1%} of the probability is of members that failed")
        if len(self.weights) and (self.moved or self.noise_moved):
            numbers = ", ".join(f"{name} = {_short(value)}" for name, value in self.likeliest.items())
            noise = " and its noise" if len(self.likeliest_draws) or self.estimator == "splitting" else ""
            lines.append(f"likeliest   {numbers or 'the scene'}{noise}: {self.distance:.2f} sd from the middle")
            # The answer has the first one.
            lines += [f"moved       {text}" for text in self._moved()[1:MOST_MOVED]]
        return [*lines, *(f"note        {message}" for message in self.messages)]

    def _content(self) -> dict[str, Any]:
        failing = None if self.failing is None else self.failing.own_values()
        kept = ("probability", "spread", "thresholds", "acceptance", "size", "members")
        runs = [{name: getattr(run, name) for name in kept} | {"limits": list(run.limits)} for run in self.runs]
        own = {item.name: getattr(self, item.name) for item in fields(self)}
        paths = [list(path) for path in self.paths]
        return finite_or_none(
            own | {"failing": failing, "runs": runs, "likeliest": dict(self.likeliest), "paths": paths}
        )

    @classmethod
    def _of_content(cls, content: dict[str, Any]) -> Self:
        arrays = {name: np.array(content[name], float) for name in ("draws", "normals", "weights", "likeliest_draws")}
        for name in ("draws", "normals"):
            arrays[name] = arrays[name].reshape(len(arrays["weights"]), -1)
        failing = content["failing"]
        runs = tuple(_run_of(run) for run in content["runs"])
        table = None if failing is None else Table(values={name: np.array(each) for name, each in failing.items()})
        paths = tuple((np.array(times), np.array(keys, np.int64)) for times, keys in content.get("paths", ()))
        more: dict[str, Any] = {
            "interval": tuple(content["interval"]),
            "messages": tuple(content["messages"]),
            "paths": paths,
        }
        chances = content.get("by_condition", {})
        more["by_condition"] = {name: Chance(*map(float, each)) for name, each in chances.items()}
        more["ancestors"] = np.array(content.get("ancestors", ()), int)
        return cls(**content | arrays | more | {"failing": table, "runs": runs})

    def rows(self) -> Iterator[dict[str, Any]]:
        columns = {} if self.failing is None else _entries(self.failing.own_values())
        for i, weight in enumerate(self.weights):
            yield {name: float(column[i]) for name, column in columns.items()} | {"weight": float(weight)}


def _run_of(content: Mapping[str, Any]) -> SubsetRun:
    """Read a run from the content of a file; its failing members are left out, since the answer has them."""
    nothing = np.zeros(0)
    thresholds = np.array([-np.inf if bound is None else bound for bound in content["thresholds"]])
    limits = tuple(np.array([np.inf if each is None else each for each in level]) for level in content["limits"])
    return SubsetRun(content["probability"], content["spread"], thresholds, limits, np.array(content["acceptance"]),
                     nothing.reshape(0, 0), nothing, content["size"], content["members"])  # fmt: skip


def _entries(columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Columns of single numbers; vectors and matrices are split into entries, such as "start.position[2]"."""
    entries = {}
    for name, values in columns.items():
        for index in np.ndindex(*values.shape[1:]):
            entries[f"{name}[{','.join(map(str, index))}]" if index else name] = values[(slice(None), *index)]
    return entries


def _short(value: Any) -> str:
    array = np.asarray(value)
    return f"{float(array):.5g}" if array.ndim == 0 else f"[{', '.join(f'{x:.4g}' for x in array.ravel()[:6])}]"
