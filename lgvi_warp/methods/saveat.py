# SPDX-License-Identifier: Apache-2.0
"""Times of samples, and the uniform grid of steps that contains every sample time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lgvi_warp.common.errors import Faults, among
from lgvi_warp.common.times import MOST_SHORTENING, meeting, of_step, whole_steps
from lgvi_warp.control.signals import check_names
from lgvi_warp.physics.fields import FIELDS

# Most samples of a run: 1.4 GB for one member.
MOST_SAMPLES = 10_000_000


@dataclass(frozen=True)
class SaveAt:
    """Samples that a run keeps. The start and the end are always kept.

    Args:
        every: Interval between samples [s], counted from the start. Without `every` and `at`, only start and end are kept.
        at: Increasing times of samples [s], >= 0; None by default. Give `every` or `at`, not both. Each time must be a
            whole number of steps, to within 1e-9 of a step, or to the precision of float32 for times in float32.
        fields: Any of "position", "attitude", "velocity", "angular_velocity"; by default all four. An omitted field
            takes no memory. The signals of a controller can be added: "command", "actuator", "demand", "unmet",
            "exerted", "measured_..." and "reference_..." (see lw.Result). A term `lw.terms.EnergyUse` adds the field
            "energy_used".
        final: Whether to keep `result.final`, from which a run can be continued: the states at the end, and the memory
            of forces, actuators and controllers. By default True if the samples of all members are kept and there are
            fewer than 100,000 members.

    Raises:
        SceneError: A setting is wrong; the message names every fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> result = lw.solve(scene, h=0.1, t1=2.0, save=lw.SaveAt(every=0.5, fields=("position",)))
        >>> result.time.tolist()
        [0.0, 0.5, 1.0, 1.5, 2.0]
        >>> sorted(result.samples)
        ['position']
    """

    every: float | None = None
    at: Sequence[float] | None = None
    fields: tuple[str, ...] = FIELDS
    final: bool | None = None

    def __post_init__(self) -> None:
        faults = Faults()
        if not among(self.final, (None, True, False)):
            faults.add("save.final", self.final, "is neither True nor False", "give one of them, or leave it out")
        if self.every is not None and self.at is not None:
            faults.add("save", "every and at", "are both given", "give one of them")
        if self.every is not None:
            object.__setattr__(self, "every", faults.positive("save.every", self.every))
        if self.at is not None:
            times = faults.finite("save.at", self.at)
            if times is not None and (times.ndim != 1 or np.any(times < 0.0) or np.any(np.diff(times) <= 0.0)):
                faults.add("save.at", times, "is not a rising list of times >= 0", "sort it and drop repetitions")
            object.__setattr__(self, "at", times if times is None else tuple(times.ravel().tolist()))
        object.__setattr__(self, "fields", check_names(faults, "save.fields", self.fields))
        faults.raise_if_any()


@dataclass(frozen=True)
class TimeGrid:
    """Uniform steps of h [s] from the start to the end of a run, and the steps after which a sample is kept.

    sample_steps: Number of steps from t = 0 to each sample, int64, (k,); the first is 0, unless the run starts later.
    times: Times of the samples, (k,) [s].
    asked: The requested step [s] if it was shortened; else None.
    """

    h: float
    sample_steps: np.ndarray
    times: np.ndarray
    messages: tuple[str, ...] = ()
    asked: float | None = None

    @property
    def steps(self) -> int:
        """Number of steps from the start to the end."""
        return self.last - self.first

    @property
    def first(self) -> int:
        """Number of steps from t = 0 to the start."""
        return int(self.sample_steps[0])

    @property
    def last(self) -> int:
        """Number of steps from t = 0 to the end."""
        return int(self.sample_steps[-1])

    def shifted(self, t0: float) -> TimeGrid:
        """The same steps and samples, moved to another start t0 [s], a whole number of steps from t = 0."""
        step, first, faults = of_step(self.h), whole_steps(t0, self.h), Faults()
        if first is None or first < 0:
            near = max(0, round(t0 / self.h)) * self.h
            faults.add("t0", t0, f"is not a whole number of steps of {self.h:.9g} s", f"give {near:.9g}")
        elif first + self.steps >= 2**31 - 1:
            faults.add("t0", t0, "is too many steps from t = 0", "at most 2,147,483,646 can be counted")
        faults.raise_if_any()
        steps = self.sample_steps - self.first + (first or 0)
        times = np.array([k * step.numerator / step.denominator for k in steps.tolist()])
        return TimeGrid(self.h, steps, times, self.messages, self.asked)

    def ticks(self, every: int, goes_on: bool = False) -> TimeGrid:
        """The same steps with samples only at the ticks of a controller; a continued run leaves out its first tick."""
        first = self.first + 1 if goes_on else self.first
        step, steps = of_step(self.h), np.arange(-(-first // every) * every, self.last + 1, every)
        times = np.array([k * step.numerator / step.denominator for k in steps.tolist()])
        return TimeGrid(self.h, steps, times, self.messages, self.asked)

    def telling(self, *messages: str) -> TimeGrid:
        """The same steps and samples with additional messages."""
        return replace(self, messages=(*self.messages, *messages))


def time_grid(h: float, t1: float, save: SaveAt, t0: float = 0.0) -> TimeGrid:
    """The steps and samples of a run from t0 to t1 [s].

    Steps of h [s] are shortened until they divide t0, every sample time and t1.
    """
    faults = Faults()
    faults.positive("step", h)
    faults.positive("duration", t1)
    length = t1 - t0
    if t1 > 0 and not length > 0.0:
        faults.add("t1", t1, f"is not after the start, {t0:.9g} s", "give the time of the end, counted from t = 0")
    at = () if save.at is None else save.at
    if at and not faults and max(at) > t1 and whole_steps(max(at), t1) != 1:
        faults.add("save.at", max(at), f"lies beyond the end, {t1} s", "drop it or run longer")
    if at and not faults and min(at) < t0 and whole_steps(min(at), t0) != 1:
        faults.add("save.at", min(at), f"lies before the start, {t0:.9g} s", "drop it")
    if save.every is not None and 0.0 < length < save.every and whole_steps(save.every, length) != 1:
        faults.add("save.every", save.every, f"is longer than the run, {length} s", "save more often or run longer")
    if save.every is not None and length > 0 and 0 < save.every < length / MOST_SAMPLES:
        fault = f"asks for more than {MOST_SAMPLES} samples"
        faults.add("save.every", save.every, fault, "save less often, or run in parts")
    faults.raise_if_any()
    step, meant, times = meeting(h, t1, [t0, *at] if save.every is None else [t0, *at, save.every])
    if meant / step > MOST_SHORTENING:
        fault = f"would have to shrink to {float(step):.3g} s to meet every sample time and the end"
        faults.add("step", h, fault, "choose sample times and a duration that are multiples of the step")
    if times[0] / step >= 2**31 - 1:
        remedy = "at most 2,147,483,646 steps can be made: use a longer step"
        faults.add("step", h, f"needs {int(times[0] / step)} steps", remedy)
    faults.raise_if_any()
    messages: tuple[str, ...] = ()
    if step != meant:
        messages = (f"step shortened from {h} s to {float(step):.9g} s, so that it divides every sample time",)
    counts = [min(int(t / step), int(times[0] / step)) for t in times]
    every = counts.pop() if save.every is not None else counts[0]
    steps = np.union1d(np.arange(counts[1], counts[0] + 1, every), counts)
    # A quotient of whole numbers is the float nearest to each time; a sum of steps would not be.
    kept = np.array([k * step.numerator / step.denominator for k in steps.tolist()])
    return TimeGrid(float(step), steps.astype(np.int64), kept, messages, None if step == meant else float(meant))


def divisors(count: int) -> list[int]:
    """List the divisors of a whole number."""
    small = [k for k in range(1, math.isqrt(count) + 1) if count % k == 0]
    return sorted({*small, *(count // k for k in small)})
