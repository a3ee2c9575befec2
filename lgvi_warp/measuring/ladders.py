# SPDX-License-Identifier: Apache-2.0
"""A search for the longest step of each method and precision that keeps an error."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from typing import Any

from lgvi_warp.engine.plan import Plan
from lgvi_warp.measuring import cost
from lgvi_warp.measuring.budget import Budget
from lgvi_warp.measuring.comparison import Sample
from lgvi_warp.measuring.distance import Distance
from lgvi_warp.measuring.kernels import Kernels
from lgvi_warp.measuring.reference import ROUND_OFF, Reference
from lgvi_warp.measuring.speed import void
from lgvi_warp.measuring.trials import PRECISIONS, Trial, tried
from lgvi_warp.runs.default_method import h_rates
from lgvi_warp.runs.step_error import rates

# A step in float32 costs at least this part of one in float64.
LEAST_FLOAT32 = 0.4
# The step times the fastest rate of damping above which damping limits it.
STIFF = 2.0
# Those that nearly always have the cheapest among them (`python -m benchmarks run suggest`): each kernel takes seconds to
# compile. The others are tried where these do not keep the error, or where the search has their kernel already.
SHORT = {
    "conservative": ("rk8", "kl8(psi_x)", "psi_x", "psi_1"),
    "damped": ("rk4", "rk8"),
    "noisy": ("psi_x", "psi_s", "rk4"),
}
# Number of readings of each cost.
ROUNDS = 7


class Ladders:
    """A search for the longest step of each method and precision that keeps the target.

    Each method runs one coarse step first. Then the steps are halved in turn until the error is below the target, and
    lengthened by the slope of the errors. A method is dropped if its steps cost twice as much as the cheapest setting
    so far, and a precision is dropped if the other one is better.

    priced: (microseconds of one core per vehicle and second, trial) of each setting that keeps the target.
    looked_at: names of the methods that ran a step, or whose steps were too expensive to run.
    """

    def __init__(
        self, sample: Sample, reference: Reference, distance: Distance, target: float, budget: Budget, named: bool = False
    ):  # fmt: skip
        self.sample, self.reference, self.of, self.target = sample, reference, distance.name, target
        self.budget, self.named = budget, named
        # A precision whose round-off is near the target is not tried.
        size = distance.largest(reference.result)
        coarse = [name for name in PRECISIONS if target > 4.0 * ROUND_OFF[name] * size]
        self.dtypes = coarse or ["float64"]
        self.priced: list[tuple[float, Trial]] = []
        self.looked_at: set[str] = set()
        self._compiled = {sample.plan(sample.candidate(name, 1)).spec for name in reference.methods}

    def climb(self, methods: Sequence[str], report: Callable[[float], None] = void, new_kernels: bool = True) -> None:
        """Search the longest steps of some methods; each runs one step in turn."""
        dtypes = sorted(self.dtypes)
        specs = {(method, dtype): self.sample.plan(self.sample.candidate(method, 1, dtype)).spec
                 for method in methods for dtype in dtypes}  # fmt: skip
        # What costs no compiling comes first, and last what the other precision of the method may spare.
        order = {method: sorted(dtypes, key=lambda dtype: specs[method, dtype] not in self._compiled)
                 for method in methods}  # fmt: skip
        first = sorted(methods, key=lambda method: specs[method, order[method][0]] not in self._compiled)
        climbing = {method: self._method(method, order[method], specs, new_kernels) for method in first}
        while climbing:
            for method in list(climbing):
                asked = self.named and method not in self.looked_at
                if (self.budget.over and self.priced and not asked) or next(climbing[method], None) is None:
                    climbing.pop(method).close()
                report(1.0 - len(climbing) / len(methods))

    def _method(
        self, method: str, dtypes: Sequence[str], specs: dict[tuple[str, str], Any], new_kernels: bool
    ) -> Generator[Trial | str, None, None]:
        """Search the precisions of a method, one after the other; yields when it is the next method's turn."""
        known: dict[str, float | None] = {}
        for dtype in dtypes:
            if known:
                yield dtype
            new = specs[method, dtype] not in self._compiled
            # A step in float32 is cheaper, and its error is no smaller: float64 is for what round-off stopped.
            if known.get("float32") is not None or known.get("float64", 0.0) in (None, math.inf):
                continue
            if new and (not new_kernels or LEAST_FLOAT32 * (known.get("float64") or 0.0) > self.least):
                continue
            self._compiled.add(specs[method, dtype])
            self.looked_at.add(method)
            known[dtype] = yield from self.longest(method, dtype)

    def longest(self, method: str, dtype: str) -> Generator[Trial, None, float | None]:
        """Find the longest step that keeps the target, and its cost [us of one core per vehicle and second].

        The cost is infinite if such steps are too expensive, None if the errors no longer fall.
        """
        sample, reference, of, target = self.sample, self.reference, self.of, self.target
        m, before, worse = sample.coarsest(2.0), math.inf, 0
        plan = sample.plan_to_price(sample.candidate(method, m, dtype))
        with self.budget.free():
            sample.kernels.compile(plan)
        per_step = step_cost(plan, sample.kernels)
        while per_step / sample.h(m) < 2.0 * self.least:
            trial = tried(sample, sample.candidate(method, m, dtype), reference, budget=self.budget)
            size = trial.error(of)
            if size <= target:
                best = lengthened(sample, trial, m, before, reference, of, target)
                # Price the step that was found: where a step iterates, its work depends on its length.
                self.priced.append((step_cost(best.plan, sample.kernels) / best.candidate.h, best))
                return self.priced[-1][0]
            worse = worse + 1 if size > 0.8 * before and before < 0.1 else 0
            if worse >= 2 or m > 10**7 or self.budget.over or m == sample.allowed(2 * m):
                return None
            before = size
            m = sample.allowed(2 * m)
            if cost.work_grows(plan):
                plan = sample.plan_to_price(sample.candidate(method, m, dtype))
                per_step = step_cost(plan, sample.kernels)
            yield trial
        return math.inf

    @property
    def least(self) -> float:
        """The cheapest price so far."""
        return min((price for price, _ in self.priced), default=math.inf)

    @property
    def limited_by_damping(self) -> bool:
        """True if no setting is found, or if the cheapest setting's step is not small against the fastest damping."""
        trials = self.cheapest()
        return not trials or h_rates(rates(self.sample.ensemble), trials[0].candidate.h)["drag"] > STIFF

    def cheapest(self) -> list[Trial]:
        """The trials that keep the target, the cheapest first; those above 1.5 times the cheapest cost are left out."""
        return [trial for price, trial in sorted(self.priced, key=lambda pair: pair[0]) if price < 1.5 * self.least]


def step_cost(plan: Plan, kernels: Kernels) -> float:
    """Cost of one step of a plan [us per vehicle]."""
    return kernels.costs([plan], ROUNDS)[0].us_per_vehicle_second * plan.grid.h


def lengthened(
    sample: Sample, good: Trial, m: int, before: float, reference: Reference, of: str, target: float
) -> Trial:
    """Lengthen a step as far as the target allows, to less than twice its length, where the error is `before`."""
    low, high, size = m // 2, m, good.error(of)
    if not math.isfinite(before) or before <= target or low < 1:
        return good
    for _ in range(3):
        slope = math.log(before / max(size, 1e-300)) / math.log(high / low)
        guess = round(low * (before / target) ** (1.0 / max(slope, 0.5)) + 0.5)
        guess = sample.allowed(min(max(guess, low + 1), high - 1))
        if guess <= low or guess >= high or high - low < 0.04 * high:
            break
        trial = tried(sample, sample.candidate(good.candidate.method, guess, good.candidate.dtype), reference)
        if trial.error(of) <= target:
            good, high, size = trial, guess, trial.error(of)
        elif math.isfinite(trial.error(of)):
            low, before = guess, trial.error(of)
        else:
            break
    return good
