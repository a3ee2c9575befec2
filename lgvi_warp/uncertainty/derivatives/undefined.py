# SPDX-License-Identifier: Apache-2.0
"""Reasons against a derivative that differences do not show: steps, jumps by a tick, growth of small differences."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeGuard

import numpy as np

from lgvi_warp.common.sentences import capital
from lgvi_warp.common.status import Status, failed, stopped
from lgvi_warp.control.docking import Docking
from lgvi_warp.control.fault import Fault
from lgvi_warp.control.sensor import Sensor
from lgvi_warp.control.waypoints import Waypoints
from lgvi_warp.physics.terms.events import StopTime
from lgvi_warp.physics.terms.wrench import WrenchSchedule
from lgvi_warp.results.quantities import EndQuantity, MetricQuantity, OfResult
from lgvi_warp.results.result import Result
from lgvi_warp.sampling.final import MEMORY
from lgvi_warp.scene.variations import Target
from lgvi_warp.statistics.metrics.nearest import COUNTS
from lgvi_warp.uncertainty.derivatives.extrapolation import FEW, KINK, ROUGH, STEPS, Extrapolated

# Growth of small differences beyond which a derivative says nothing of the path.
MOST_GROWTH = 1e6
# Type of a metric -> how it changes.
JUMPING = dict.fromkeys(
    ("settling_time", "rise_time", "peak_time", "path_time"), "is the time of a tick or sample, and jumps by one"
) | {
    "saturation_share": "counts ticks, and jumps by one",
    "time_to_failure": 'is the time of a step: ask for "end_time NAME" of an event',
}
OF_SENSORS = {
    "dropout": "decides which readings are lost, one by one",
    "every": "is a whole number of ticks",
    "latency": "is a whole number of ticks",
    "quantum": "is the step by which readings jump",
    "burst": "decides which readings are lost, one by one",
    "outlier": "decides which readings are outliers, one by one",
}
OF_FAULTS = {
    "choice": "is the number of a kind",
    "delay": "is that of a whole number of ticks",
    "duty": "decides at which ticks the fault acts",
    "period": "is that of a whole number of ticks",
}
BEFORE = 'ask for a quantity at a time before, "depth at 30", or for when it ends, "end_time NAME"'


def of_number(scene: Any, target: Target) -> str | None:
    """Reason why no quantity has a derivative by this number of a scene; None if no reason is known."""
    key, _, name = target.name.rpartition(".")
    part = next((part for part in scene.parts if part.key == key), None)
    reason = None
    if target.name == "controller.delay":
        reason = "lasts a whole number of steps"
    elif isinstance(part, Sensor):
        reason = OF_SENSORS.get(name)
    elif isinstance(part, Fault) and name in ("time", "until"):
        reason = "is that of the tick at or after it"
    elif isinstance(part, Fault):
        reason = OF_FAULTS.get(name)
    elif isinstance(part, Waypoints) and name in ("radius", "loiter_turns", "loiter_time"):
        reason = "decides at which tick a leg is done"
    elif isinstance(part, Docking) and name in ("mouth", "funnel", "judged"):
        reason = "decides at which tick the vehicle goes round"
    elif isinstance(part, WrenchSchedule) and name == "times" and part.jumps:
        reason = "is when the push jumps, and a run meets that at whole steps"
    return f"{target.label} {reason}" if reason else None


def of_interest(interest: OfResult, number: Target, scene: Any) -> str | None:
    """Reason why a quantity has no derivative, by this number or by any; None if no reason is known."""
    key, _, name = number.name.rpartition(".")
    events = {event.key: event for event in scene.events}
    timed = isinstance(events.get(key), StopTime) and name == "at"
    reason = None
    if isinstance(interest, MetricQuantity):
        reason = JUMPING.get(interest.metric.type)
    elif isinstance(interest, EndQuantity) and interest.kind == "outcome":
        reason = "is 1 or 0, and jumps"
    elif is_end_time(interest):
        known = isinstance(events.get(interest.outcome), StopTime) or interest.outcome in timed_events(scene)
        return None if known else f"{interest.label} is the time of a step, without a distance that is used up then"
    if reason is None and timed:
        reason = "goes by whole steps with the time at which members stop"
    return f"{interest.label} {reason}" if reason else None


def is_end_time(interest: OfResult) -> TypeGuard[EndQuantity]:
    """True if a quantity is the time at which members ended with some outcome."""
    return isinstance(interest, EndQuantity) and interest.kind == "end_time"


def timed_events(scene: Any) -> dict[str, Any]:
    """Events by name whose distance is known, so that their stop times have a derivative."""
    return {event.key: event for event in scene.events if event.type in COUNTS}


def quanta(scene: Any, numbers: Mapping[str, np.ndarray]) -> dict[str, float]:
    """The largest quantum of each sensor that rounds, by name; numbers: the members' own values."""
    names = {f"{part.key}.quantum": part for part in scene.parts if isinstance(part, Sensor)}
    largest = {name: float(np.max(np.abs(numbers.get(name, part.quantum)))) for name, part in names.items()}
    return {name: quantum for name, quantum in largest.items() if quantum > 0.0}


def of_loop(rounding: Mapping[str, float]) -> str | None:
    """Reason why nothing has a derivative in a loop whose sensors round."""
    if not rounding:
        return None
    sensors = ", ".join(f"{name.rpartition('.')[0]} to {quantum:g}" for name, quantum in rounding.items())
    return f"the loop goes in steps, since readings are rounded ({sensors}); smooth=True leaves that out"


# Row of the memory, of guidance that jumps from one way to the next, which counts how often it did.
COUNTING: Mapping[type, int] = {Waypoints: 0, Docking: 2}


def has_legs(scene: Any) -> bool:
    """True if some guidance follows one leg after another."""
    return any(type(part) in COUNTING for part in scene.parts)


def legs_done(scene: Any, result: Result) -> np.ndarray:
    """Number of legs of waypoints, or approaches to a dock, done at the end of a run (n,); 0 if there are none."""
    done = np.zeros(result.members)
    for part in (part for part in scene.parts if type(part) in COUNTING):
        remembered = result.final.lanes[f"{MEMORY}part {part.key} {type(part).__name__}"]
        done = np.maximum(done, np.asarray(remembered, dtype=np.float64)[:, COUNTING[type(part)]])
    return np.rint(done)


def of_member(interest: OfResult, value: float, code: int, end: float, growth: float, legs: float) -> str | None:
    """Reason why a quantity of a member has no derivative; None if no reason is known.

    code: the member's status. end: its end time [s]. growth: growth factor of small differences of its start. legs:
    number of legs of waypoints that it has done at the time of the quantity.
    """
    if failed(np.array([code]))[0]:
        return f"the member failed ({Status(code).name.lower()})"
    timed, at_end = code == Status.TIME, is_end_time(interest)
    early = isinstance(interest, EndQuantity) and interest.when is not None and interest.when < end
    if stopped(np.array([code]))[0] and not (timed or at_end or early):
        return f"an event stopped the member ({Status(code).name.lower()}), and that time moves too. {capital(BEFORE)}"
    if not np.isfinite(value):
        return "the member does not end so" if at_end else f"it is {value:g}"
    if growth > MOST_GROWTH:
        return f"a small difference of the start grows {growth:.1g} times, more than 1e6. Ask at an earlier time"
    if legs > 0.0:
        return f"it jumps with the tick at which a leg is done, and {legs:.0f} of them were. Ask for a time before"
    return None


def of_differences(slopes: Extrapolated, place: tuple[int, ...], increments: np.ndarray) -> str | None:
    """Reason why differences give no derivative; None if they do. increments: (levels,)."""
    code, largest, least = int(slopes.code[place]), increments.max(), increments.min()
    if code == FEW:
        return f"copies at increments from {least:.2g} to {largest:.2g} fail, or end in another way"
    if code == STEPS:
        return f"it jumps between increments of {least:.2g} and {largest:.2g}"
    if code == KINK:
        value, jump = slopes.value[place], slopes.jump[place]
        above, below = value + 0.5 * jump, value - 0.5 * jump
        return f"there is a kink here: the derivative is {above:.6g} from above and {below:.6g} from below"
    if code == ROUGH:
        return f"differences disagree at increments from {least:.2g} to {largest:.2g}"
    return None
