# SPDX-License-Identifier: Apache-2.0
"""Metrics of a controller's tracking performance, with the definitions of control theory.

y is the actual number and r the desired number at each tick; e = r - y.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.arguments import flag
from lgvi_warp.common.errors import Faults
from lgvi_warp.statistics import tracking
from lgvi_warp.statistics.metrics.metric import Largest, Metric, State, Ticks, Total
from lgvi_warp.statistics.values.quantity import Quantity

# Times that differ by less than this part of the run are the same.
ROUND_OFF = 1e-9


@dataclass(frozen=True, eq=False)
class OfTracking(Metric):
    """A metric of the tracking error e = desired - actual value. Abstract.

    Args:
        of: "depth", "heading" (differences wrapped to [-pi, pi]), "speed" (measured forward speed through the water),
            "north", "east"; or, as a distance from the desired value, "position", "attitude" (angle) or "cross_track".
    """

    tracks: ClassVar[bool] = True

    def meant(self) -> Quantity:
        name = tracking.tracked_name(f"{self.type}.of", self.of, tracking.ERRORS)
        return tracking.error(name, flag(f"{self.type}.measured", self.measured))


@dataclass(frozen=True, eq=False)
class OfCourse(Metric):
    """A metric of the approach to a goal. Abstract.

    The goal is constant: the set point of the scene at the first tick, before any reference model; with other guidance,
    the desired value at the first tick. d is the goal minus the actual value, and the step is d at the first tick.
    "Below" and "beyond" refer to the direction of the step, which is positive if the step is 0.

    Args:
        of: "depth", "heading", "speed", "north" or "east". The goal is the set point, before any reference model; with
            other guidance, the goal is the desired value at the first tick. The step is the change from the first
            actual value to the goal.
    """

    tracks: ClassVar[bool] = True

    def meant(self) -> Quantity:
        known = tuple(tracking.CHANNELS[False])
        return tracking.course(tracking.tracked_name(f"{self.type}.of", self.of, known), bool(self.measured))

    def begin(self, x: np.ndarray) -> State:
        goal = x[1].copy()
        step = self._difference(goal, x[0])
        return {"goal": goal, "step": np.abs(step), "sign": np.where(step < 0.0, -1.0, 1.0)}

    def left(self, state: State, x: np.ndarray) -> np.ndarray:
        """Return the distance to the goal (..., n) in the step's direction, from x (..., d, n): negative beyond the goal."""
        return state["sign"] * self._difference(state["goal"], x[..., 0, :])

    def _difference(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return tracking.CHANNELS[False][self.quantity.name].difference(a, b)


@dataclass(frozen=True, eq=False)
class OfStep(OfCourse):
    """A step-response metric that may be given in percent of the step. Abstract.

    Args:
        percent: True gives the metric in percent of the step, like step_info of python-control, and NaN if the step is
            0. False, the default, gives it in the unit of the quantity.
    """

    percent: bool = False

    @property
    def unit(self) -> str:
        return "%" if self.percent else super().unit

    def percent_of_step(self, state: State, size: np.ndarray) -> np.ndarray:
        """Return a size (n,), in percent of the step if requested."""
        return np.where(state["step"] > 0.0, 100.0 * size / state["step"], np.nan) if self.percent else size


@dataclass(frozen=True, eq=False)
class Overshoot(Largest, OfStep):
    """Metric: largest distance of a member beyond its goal [unit of the quantity, or % of the step]; at least 0.

    Args:
        percent: True gives the metric in percent of the step, and NaN if the step is 0; by default False.

    Examples:
        >>> import lgvi_warp as lw
        >>> controller = lw.Controller(
        ...     period=0.1,
        ...     guidance=[lw.control.SetPoint(heading=0.5)],
        ...     laws=[lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0)],
        ...     allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, 0, 0]])],
        ... )
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]}, controller=controller)
        >>> result = lw.solve(scene, h=0.05, t1=60.0, statistics=[lw.metrics.Overshoot("heading")])
        >>> print(f"{result.statistics['mean overshoot heading'].value[-1, 0]:.2f} rad")
        0.04 rad
    """

    type: ClassVar[str] = "overshoot"

    def size(self, state: State, x: np.ndarray) -> np.ndarray:
        return -self.left(state, x)

    def finish(self, state: State) -> np.ndarray:
        return self.percent_of_step(state, np.maximum(0.0, state["most"]))


@dataclass(frozen=True, eq=False)
class Undershoot(Largest, OfStep):
    """Metric: largest distance of a member from its start, away from the goal [unit of the quantity, or % of the step].

    Args:
        percent: True gives the metric in percent of the step, and NaN if the step is 0; by default False.
    """

    type: ClassVar[str] = "undershoot"

    def size(self, state: State, x: np.ndarray) -> np.ndarray:
        return self.left(state, x)

    def finish(self, state: State) -> np.ndarray:
        return self.percent_of_step(state, state["most"] - state["step"])


@dataclass(frozen=True, eq=False)
class PeakTime(OfCourse):
    """Metric: first time at which a member is farthest in the direction of its step [s]."""

    type: ClassVar[str] = "peak_time"
    form: ClassVar[str] = "s"

    def begin(self, x: np.ndarray) -> State:
        state = super().begin(x)
        return state | {"least": state["step"], "at": np.zeros(len(state["step"]))}

    def follow(self, state: State, ticks: Ticks) -> State:
        distance = ticks.of_living(self.left(state, ticks.x), np.inf)
        i = distance.argmin(axis=0)
        least = np.take_along_axis(distance, i[None], axis=0)[0]
        farther = least < state["least"]
        return {"least": np.where(farther, least, state["least"]), "at": np.where(farther, ticks.t[i], state["at"])}

    def finish(self, state: State) -> np.ndarray:
        return state["at"]


@dataclass(frozen=True, eq=False)
class Peak(Overshoot):
    """Metric: value of the quantity where a member is farthest in the direction of its step [unit of the quantity].

    A heading lies within pi of the goal and is not wrapped to [-pi, pi]. For a step from 0, the metric equals Peak in
    step_info of python-control.
    """

    type: ClassVar[str] = "peak"

    def finish(self, state: State) -> np.ndarray:
        return np.asarray(state["goal"] + state["sign"] * state["most"])


@dataclass(frozen=True, eq=False)
class RiseTime(OfCourse):
    """Metric: rise time of a member, from 10 % to 90 % of its step [s].

    The rise time lasts from the first tick at which at least 10 % of the step is done to the first tick at which at
    least 90 % is done. It is infinite if a member never reaches 90 %.

    Args:
        limits: the two fractions of the step; by default (0.1, 0.9).
    """

    type: ClassVar[str] = "rise_time"
    form: ClassVar[str] = "s"

    limits: Any = (0.1, 0.9)

    def check(self, faults: Faults) -> None:
        super().check(faults)
        numbers = faults.finite("limits", self.limits)
        if numbers is not None and (numbers.shape != (2,) or not 0.0 <= numbers[0] < numbers[1] <= 1.0):
            faults.add("limits", self.limits, "are no two rising parts of a step", "give (0.1, 0.9)")

    def begin(self, x: np.ndarray) -> State:
        state = super().begin(x)
        done = np.where(state["step"] > 0.0, np.inf, 0.0)
        return state | {"low": np.where(self.limits[0] == 0.0, 0.0, done), "high": done}

    def follow(self, state: State, ticks: Ticks) -> State:
        distance = ticks.of_living(self.left(state, ticks.x), np.inf)
        times = {}
        for name, part in zip(("low", "high"), self.limits, strict=True):
            done = state["step"] - distance >= part * state["step"]
            first = np.where(done.any(axis=0), ticks.t[done.argmax(axis=0)], np.inf)
            times[name] = np.minimum(state[name], first)
        return times

    def finish(self, state: State) -> np.ndarray:
        return np.where(np.isinf(state["high"]), np.inf, state["high"] - state["low"])


@dataclass(frozen=True, eq=False)
class SettlingTime(OfCourse):
    """Metric: time after which a member stays within a band about its goal [s].

    It is the time of the earliest tick such that |goal - actual value| <= within at this tick and at all later ticks of
    the member. It is infinite for a member that is outside the band at its last tick.

    Args:
        within: half width of the band, in the unit of the quantity; by default 2 % of the member's step.
    """

    type: ClassVar[str] = "settling_time"
    form: ClassVar[str] = "s"

    within: Any = None

    def check(self, faults: Faults) -> None:
        super().check(faults)
        if self.within is not None:
            faults.positive("within", self.within, "in the unit of what it is of")

    def begin(self, x: np.ndarray) -> State:
        state = super().begin(x)
        band = 0.02 * state["step"] if self.within is None else np.full(len(state["step"]), float(self.within))
        return state | {"band": band, "since": np.where(state["step"] <= band, 0.0, np.inf)}

    def follow(self, state: State, ticks: Ticks) -> State:
        outside, since = np.abs(self.left(state, ticks.x)) > state["band"], state["since"].copy()
        for t, out, alive in ticks.rows(outside):
            np.minimum(since, t, out=since, where=alive)
            np.copyto(since, np.inf, where=out & alive)
        return {"since": since}

    def finish(self, state: State) -> np.ndarray:
        return state["since"]


@dataclass(frozen=True, eq=False)
class SteadyStateError(Total, OfTracking):
    """Metric: mean of a member's error (desired minus actual value) over the ticks of the last part of the run [unit].

    The unit is the quantity's. The metric is NaN for members that stopped or failed before the last tick.

    Args:
        share: the last part, as a fraction of the run's time, above 0 and up to 1; by default 0.1.
    """

    type: ClassVar[str] = "steady_state_error"

    share: float = 0.1

    def check(self, faults: Faults) -> None:
        super().check(faults)
        share = faults.number("share", self.share, "1")
        if share is not None and not 0.0 < share <= 1.0:
            faults.add("share", self.share, "is not a part of the run", "give a number above 0 and up to 1")

    def begin(self, x: np.ndarray) -> State:
        return super().begin(x) | {"count": np.zeros(1)}

    def added(self, state: State, ticks: Ticks) -> np.ndarray:
        return np.where(self._last(state, ticks)[:, None], ticks.x[:, 0], 0.0)

    def follow(self, state: State, ticks: Ticks) -> State:
        return super().follow(state, ticks) | {"count": state["count"] + self._last(state, ticks).sum()}

    def _last(self, state: State, ticks: Ticks) -> np.ndarray:
        return ticks.t >= state["end"] * (1.0 - self.share - ROUND_OFF)

    def finish(self, state: State) -> np.ndarray:
        return np.where(state["until"] >= state["end"], state["sum"] / state["count"], np.nan)


@dataclass(frozen=True, eq=False)
class MaxError(Largest, OfTracking):
    """Metric: largest |e| of a member [unit of the quantity]; e is the desired minus the actual value."""

    type: ClassVar[str] = "max_error"

    def size(self, state: State, x: np.ndarray) -> np.ndarray:
        return np.abs(x[..., 0, :])


@dataclass(frozen=True, eq=False)
class CrossTrack(MaxError):  # noqa: N818  (no exception)
    """Metric: largest horizontal distance from the line through the desired position along the desired velocity [m].

    Where the desired horizontal velocity is 0, the horizontal distance from the desired position counts instead.

    Args:
        of: "cross_track", the default.
    """

    type: ClassVar[str] = "cross_track"
    default: ClassVar[str | None] = "cross_track"


@dataclass(frozen=True, eq=False)
class OverTime(Total, OfTracking):
    """A metric that is an integral over time, by the trapezoidal rule between ticks. Abstract."""

    # The integrand of times (k, 1) [s] and errors (k, n).
    _integrand: ClassVar[Any]

    def added(self, state: State, ticks: Ticks) -> np.ndarray:
        t, dt = ticks.t[:, None], ticks.dt[:, None]
        return np.asarray(0.5 * dt * (self._integrand(t - dt, ticks.before[:, 0]) + self._integrand(t, ticks.x[:, 0])))


@dataclass(frozen=True, eq=False)
class IAE(OverTime):
    """Metric: integral of |e| over time [unit of the quantity times s]; e is the desired minus the actual value.

    Examples:
        >>> import lgvi_warp as lw
        >>> controller = lw.Controller(
        ...     period=0.1,
        ...     guidance=[lw.control.SetPoint(heading=0.5)],
        ...     laws=[lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0)],
        ...     allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, 0, 0]])],
        ... )
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]}, controller=controller)
        >>> result = lw.solve(scene, h=0.05, t1=60.0, statistics=[lw.metrics.IAE("heading")])
        >>> print(f"{result.statistics['mean iae heading'].value[-1, 0]:.1f} rad s")
        4.6 rad s
    """

    type: ClassVar[str] = "iae"
    form: ClassVar[str] = "{0} s"
    _integrand = staticmethod(lambda t, e: np.abs(e))


@dataclass(frozen=True, eq=False)
class ISE(OverTime):
    """Metric: integral of e^2 over time [unit of the quantity squared times s]; e: desired minus actual value."""

    type: ClassVar[str] = "ise"
    form: ClassVar[str] = "{0}^2 s"
    _integrand = staticmethod(lambda t, e: e * e)


@dataclass(frozen=True, eq=False)
class ITAE(OverTime):
    """Metric: integral of t |e| over time t [unit of the quantity times s^2]; e: desired minus actual value."""

    type: ClassVar[str] = "itae"
    form: ClassVar[str] = "{0} s^2"
    _integrand = staticmethod(lambda t, e: t * np.abs(e))


@dataclass(frozen=True, eq=False)
class RMSError(ISE):
    """Metric: root mean square of e over time [unit of the quantity]; e is the desired minus the actual value."""

    type: ClassVar[str] = "rms"
    form: ClassVar[str] = "{0}"

    def begin(self, x: np.ndarray) -> State:
        return super().begin(x) | {"first": np.abs(x[0])}

    def finish(self, state: State) -> np.ndarray:
        return np.where(state["until"] > 0.0, np.sqrt(state["sum"] / state["until"]), state["first"])
