# SPDX-License-Identifier: Apache-2.0
"""Tracking errors: desired minus actual depth, heading, speed and position, and the distance from the path."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.errors import Faults, among, closest, refusal
from lgvi_warp.control.signals import ordered
from lgvi_warp.statistics.values.quantity import Function, Quantity

if TYPE_CHECKING:
    from lgvi_warp.control.controller import Controller
    from lgvi_warp.sampling.members import Members
    from lgvi_warp.statistics.base import Statistic
    from lgvi_warp.statistics.values.samples import Fields

Numbers = Callable[[Mapping[str, np.ndarray]], np.ndarray]


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Angles (...,) [rad] within [-pi, pi]."""
    turns = np.asarray(angle / (2.0 * np.pi))
    np.rint(turns, out=turns)
    turns *= 2.0 * np.pi
    return np.subtract(angle, turns, out=turns)


@dataclass(frozen=True)
class Channel:
    """One number of the motion with a desired and an actual value.

    actual: function of the samples that returns the actual numbers (k, n).
    wanted: name of the desired signal, (k, n) or, with `entry`, (k, n, 3).
    entry: index of the desired number in its signal; None (the default): the signal is one number.
    wish: name in guidance and index of the number: ("depth", None) or ("position", 0); None for none.
    """

    name: str
    unit: str
    actual: Numbers
    of_actual: tuple[str, ...]
    wanted: str
    entry: int | None = None
    wish: tuple[str, int | None] | None = None
    angle: bool = False
    entries: tuple[int, ...] = ()

    def difference(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Return a - b (k, n) [unit], wrapped for angles."""
        return wrapped(a - b) if self.angle else a - b

    def reference(self, samples: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the desired number at each tick, (k, n) [unit]."""
        values = samples[self.wanted].astype(np.float64, copy=False)
        return values if self.entry is None else values[..., self.entry]

    def error(self, samples: Fields, members: Members) -> np.ndarray:
        """Return desired minus actual number, (k, n) [unit]."""
        return self.difference(self.reference(samples), self.actual(samples))

    def course(self, samples: Fields, members: Members) -> np.ndarray:
        """Return actual number and goal, (k, n, 2) [unit]: the set point before any reference model, else the desired."""
        y, goal = self.actual(samples), self._set_point(samples.controller, members)
        goal = self.reference(samples) if goal is None else np.broadcast_to(goal, y.shape)
        # Side by side in memory as they are used: components before members.
        return np.moveaxis(np.stack([y, goal], axis=1), 1, 2)

    def _set_point(self, controller: Any, members: Members) -> np.ndarray | None:
        """Values of the members' set points, (1,) or (n,); None if another kind of guidance gives the number."""
        if controller is None or self.wish is None:
            return None
        wish, entry = self.wish
        parts = [part for part in controller.guidance if wish in part.gives and part.type != "reference_model"]
        if not parts or parts[-1].type != "set_point":
            return None
        numbers = {name: members.parameters[f"{parts[-1].key}.{name}"] for name in parts[-1].parameters()}
        if wish == "depth" and "depth" not in numbers:
            wish, entry = "position", 2
        if wish not in numbers:
            # A place without a heading is wanted heading north.
            return np.zeros(1)
        return numbers[wish] if entry is None else numbers[wish][:, entry]


def _entry(name: str, i: int | None = None) -> Numbers:
    def number(samples: Mapping[str, np.ndarray]) -> np.ndarray:
        values = samples[name].astype(np.float64, copy=False)
        return values if i is None else values[..., i]

    return number


def _true_heading(samples: Mapping[str, np.ndarray]) -> np.ndarray:
    R = samples["attitude"].astype(np.float64, copy=False)
    return np.arctan2(R[..., 1, 0], R[..., 0, 0])


def _channels(measured: bool) -> dict[str, Channel]:
    place = "measured_position" if measured else "position"
    heading = _entry("measured_heading") if measured else _true_heading
    of_heading = "measured_heading" if measured else "attitude"
    depth = ("measured_depth", None) if measured else ("position", 2)
    water = ("measured_water_velocity",)
    channels = (
        Channel("depth", "m", _entry(*depth), depth[:1], "reference_depth", None, ("depth", None), entries=(2,)),
        Channel("heading", "rad", heading, (of_heading,), "reference_heading", None, ("heading", None), True, (0, 3)),
        Channel("speed", "m/s", _entry(*water, 0), water, "reference_speed", None, ("speed", None)),
        Channel("north", "m", _entry(place, 0), (place,), "reference_position", 0, ("position", 0), entries=(0,)),
        Channel("east", "m", _entry(place, 1), (place,), "reference_position", 1, ("position", 1), entries=(1,)),
    )
    # Signals are gathered whole.
    return {channel.name: replace(channel, entries=()) if measured else channel for channel in channels}


# By whether the actual number is what sensors measure, or the truth.
CHANNELS = {measured: _channels(measured) for measured in (False, True)}


def _away(samples: Mapping[str, np.ndarray], place: str) -> np.ndarray:
    """Desired minus actual position, (k, n, 3) [m]."""
    return np.asarray(samples["reference_position"].astype(np.float64, copy=False) - samples[place])


def _distance(samples: Fields, members: Members, place: str) -> np.ndarray:
    """Distance (k, n) [m] from the desired position."""
    e = _away(samples, place)
    return np.sqrt(e[..., 0] ** 2 + e[..., 1] ** 2 + e[..., 2] ** 2)


def _cross_track(samples: Fields, members: Members, place: str) -> np.ndarray:
    """Horizontal distance (k, n) [m] from the desired position, or from the line along the desired velocity through it."""
    e, v = _away(samples, place), samples["reference_velocity"].astype(np.float64, copy=False)
    pace = np.hypot(v[..., 0], v[..., 1])
    moves = pace > 0.0
    tx, ty = (np.divide(v[..., i], pace, out=np.zeros_like(pace), where=moves) for i in (0, 1))
    return np.where(moves, np.abs(e[..., 1] * tx - e[..., 0] * ty), np.hypot(e[..., 0], e[..., 1]))


def _angle(samples: Fields, members: Members, attitude: str) -> np.ndarray:
    """Angle (k, n) [rad] of the rotation from the desired to the actual attitude: 0 to pi."""
    R, wanted = (samples[name].astype(np.float64, copy=False) for name in (attitude, "reference_attitude"))
    # By the distance of the matrices, 8 sin^2(angle / 2): exact near 0, where the trace is not.
    size = np.sqrt(((R - wanted) ** 2).sum(axis=(-2, -1)))
    return 2.0 * np.arcsin(np.clip(size / np.sqrt(8.0), 0.0, 1.0))


# Distances from what is wanted, which have no sign: their unit, the actual sample they read, the wanted ones, the function.
_DISTANCES: dict[str, tuple[str, str, tuple[str, ...], Callable[..., np.ndarray]]] = {
    "position": ("m", "position", ("reference_position",), _distance),
    "attitude": ("rad", "attitude", ("reference_attitude",), _angle),
    "cross_track": ("m", "position", ("reference_position", "reference_velocity"), _cross_track),
}
ERRORS = (*CHANNELS[False], *_DISTANCES)
# What guidance has to want, so that there is an error of tracking: by name of what is tracked.
NEEDED = {name: (channel.wish or (name,))[0] for name, channel in CHANNELS[False].items()}
NEEDED |= {"position": "position", "attitude": "attitude", "cross_track": "position"}


@functools.cache
def error(name: str, measured: bool) -> Quantity:
    """Return the tracking error as a quantity: desired minus actual."""
    if name in _DISTANCES:
        unit, actual, wanted, function = _DISTANCES[name]
        actual = f"measured_{actual}" if measured else actual
        distance = functools.partial(function, **{"attitude" if name == "attitude" else "place": actual})
        return Quantity(name, distance, unit, ordered((actual, *wanted)), needs_limit=True)
    return _of_channel(CHANNELS[measured][name], CHANNELS[measured][name].error, (name,))


@functools.cache
def course(name: str, measured: bool) -> Quantity:
    """Return a number of the motion and its goal as a quantity of two components."""
    channel = CHANNELS[measured][name]
    return _of_channel(channel, channel.course, (name, f"goal of {name}"))


def _of_channel(channel: Channel, function: Function, labels: tuple[str, ...]) -> Quantity:
    """Return a function of a channel's actual and desired number as a quantity."""
    fields = ordered((*channel.of_actual, channel.wanted))
    entries = ((channel.of_actual[0], channel.entries),) if channel.entries else ()
    return Quantity(channel.name, function, channel.unit, fields, labels, needs_limit=True, entries=entries)


def tracked_name(key: str, of: Any, known: tuple[str, ...]) -> str:
    """Return the name of the tracked number."""
    if isinstance(of, str) and of in known:
        return of
    why = "is a distance, which has no goal beyond" if among(of, _DISTANCES) else "is nothing that is tracked"
    raise refusal(key, of, why, closest(str(of), known))


def check_wanted(faults: Faults, key: str, metrics: Mapping[str, Statistic], controller: Controller | None) -> None:
    """Add a fault for each metric without guidance, whose error would be the distance from 0, or without a dock."""
    docks = [part.key for part in controller.guidance if part.type == "docking"] if controller else []
    for name, metric in metrics.items():
        dock = getattr(metric, "docking", None)
        if dock is not None and dock not in docks:
            faults.add(
                key, name, f"needs a guidance docking of the name {dock!r}", "give [[controller.guidance]] docking"
            )
    if controller is None:
        return
    wishes = {wish for part in controller.guidance for wish in part.gives}
    for name, metric in metrics.items():
        tracked = metric.quantity.name if metric.tracks else None
        if tracked is not None and NEEDED[tracked] not in wishes:
            problem = f"is of the {tracked}, and no guidance of the scene wants a {NEEDED[tracked]}"
            faults.add(key, name, problem, "give guidance that wants it, or another metric")
