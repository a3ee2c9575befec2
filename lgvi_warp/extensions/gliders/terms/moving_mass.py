# SPDX-License-Identifier: Apache-2.0
"""A mass that slides or rolls in the vehicle."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import word
from lgvi_warp.common.errors import Faults, ragged, refusal
from lgvi_warp.extensions.gliders import DEVICE
from lgvi_warp.physics import vehicle
from lgvi_warp.physics.notation import EYE, cross, hat, repeated
from lgvi_warp.physics.terms.actuators import UNLIMITED, first_row, motion, packed_following, refuse_unread
from lgvi_warp.physics.terms.base import (
    Array,
    Inner,
    Numbers,
    Packed,
    PackingContext,
    Term,
    knots,
    number,
    side_by_side,
)

# Fields with one number for each channel of a controller, and what each has by itself.
OF_CHANNELS = {"limit": 1e6, "rate_limit": UNLIMITED, "time_constant": 0.0}
# Up to this part of the vehicle's mass the inertia stays as it is, unless it is asked for.
LIGHT = 0.1


@dataclass(frozen=True, eq=False, kw_only=True)
class MovingMass(Term):
    """A mass in the vehicle, such as a battery or a trim weight, that moves along a path, by commands, or in both ways.

    The vehicle's mass, inertia and center of gravity must include this mass at its reference position r0. At the position r
    its weight adds the torque (r - r0) x m g R^T e3, where R^T e3 is the downward vertical in body axes. A path is linear
    between its times, and constant before the first and after the last. If `inertia` is True, Runge-Kutta methods use the
    vehicle's inertia with the mass at its present position, and the vehicle recoils as the mass moves.

    A controller commands up to two channels: the distance by which the mass slides from the path [m], and the angle by
    which the mass and its slide direction turn about an axis [rad]. A channel n follows n' = (command - n) / time constant,
    with |n'| at most the rate limit and the command within the limit. Channels are 0 at the start and without a controller.

    Args:
        mass: Mass m [kg].
        places: Positions of the path, (k, 3) [m] from the body's origin; one position if only a controller moves the mass.
        times: Times of these positions, (k,) [s], rising; by default 0 for one position.
        reference: Position r0 at which the vehicle's numbers include the mass, (3,) [m]; by default the first of `places`.
        slide_direction: Direction in which a controller slides the mass, (3,), of any length but 0; none by default.
        turn_axis: Axis about which a controller turns the mass, (3,), of any length but 0; none by default.
        turn_center: A point of this axis, (3,) [m] from the body's origin; the origin by default.
        limit: Largest size of the command of each channel, (c,) [m, rad]; by default no limit.
        rate_limit: Largest rate of each channel, (c,) [m/s, rad/s]; by default no limit.
        time_constant: Time constant of the lag of each channel, (c,) [s]; 0 by default, for no lag.
        inertia: Whether the vehicle's inertia changes as the mass moves: True, False, or "auto" (default), which is
            True if the mass exceeds a tenth of the vehicle's mass.

    Raises:
        SceneError: If times do not rise or are missing, a direction has length 0, limits or time constants are given
            without channels, or a number is invalid (see `Term`). A scene refuses the mass if the rest of its
            vehicle, without the mass at the reference position, would have no positive inertia.

    Examples:
        >>> import lgvi_warp as lw
        >>> battery = lw.terms.MovingMass(mass=9.0, places=[[0.0, 0.0, 0.05], [0.03, 0.0, 0.05]], times=[10.0, 25.0])
        >>> battery.reference.tolist()
        [0.0, 0.0, 0.05]
    """

    type: ClassVar[str] = "moving_mass"
    device: ClassVar[str] = f"{DEVICE}.moving_mass"
    strengths: ClassVar[tuple[str, ...]] = ("mass",)
    usual: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(("limit", "rate_limit"), "lengths and angles share it"),
        **dict.fromkeys(("slide_direction", "turn_axis"), "a direction of any length but 0"),
    }
    # The vehicle's mass, where it includes the inertia of this one [kg].
    most: ClassVar[float] = np.inf

    mass: Any = number((), "kg", least=0.0)
    places: Any = number(("k", 3), "m")
    times: Any = number(("k",), "s", None, rising=True, optional=True)
    reference: Any = number((3,), "m", None)
    slide_direction: Any = number((3,), "1", None, optional=True)
    turn_axis: Any = number((3,), "1", None, optional=True)
    turn_center: Any = number((3,), "m", (0.0, 0.0, 0.0))
    limit: Any = number(("c",), "m, rad", None, least=0.0, optional=True)
    rate_limit: Any = number(("c",), "m/s, rad/s", None, least=0.0, optional=True)
    time_constant: Any = number(("c",), "s", None, least=0.0, optional=True)
    inertia: bool | str = word("auto", known=(True, False, "auto"))

    def __post_init__(self) -> None:
        if self.times is None and not ragged(self.places) and np.shape(self.places)[:-1] == (1,):
            object.__setattr__(self, "times", [0.0])
        absent = [name for name in OF_CHANNELS if getattr(self, name) is None]
        if self.reference is None:
            object.__setattr__(self, "reference", first_row(self.places))
            absent.append("reference")
        for name in absent if self.channels else ():
            if name in OF_CHANNELS:
                object.__setattr__(self, name, OF_CHANNELS[name])
        object.__setattr__(self, "following", tuple(absent))
        self.repeat(max(self.channels, 1), *OF_CHANNELS)
        super().__post_init__()
        # A mass that stays, or that a controller alone moves, does not look at the time.
        object.__setattr__(self, "timed", len(self.times) > 1)
        object.__setattr__(self, "carried", self.inertia is True)

    def check(self, faults: Faults) -> None:
        if self.times is None:
            faults.add("times", None, "is missing", "give the time of each place [s]")
        for name in ("slide_direction", "turn_axis"):
            value = getattr(self, name)
            if value is not None and not np.any(value):
                faults.add(name, value, "has zero length", "give a direction of the body, such as [1, 0, 0]")
        for name in OF_CHANNELS:
            value = getattr(self, name)
            if value is None:
                continue
            if not self.channels:
                faults.add(
                    name, value, "is given without a channel", "give slide_direction or turn_axis, or leave it out"
                )
            elif len(value) != self.channels:
                faults.add(name, value, f"has {len(value)} numbers", f"give one for each channel: {self.channels}")

    def of_vehicle(self, numbers: Numbers) -> Any:
        # Whether the inertia is kept up; refuses a mass that the vehicle's numbers cannot include.
        own = {name: value[None] for name, value in numbers.items()}
        dry = float(vehicle.dry_mass(own)[0])
        carried = bool(self.mass > LIGHT * dry) if self.inertia == "auto" else bool(self.inertia)
        if carried:
            remaining = vehicle.inertia6(own)[0] - self.mass * square_at(self.reference[None])[0]
            if self.mass > dry or not np.linalg.eigvalsh(remaining)[0] > 0.0:
                fault = (
                    f"leaves nothing of the vehicle: its {dry:g} kg and its inertia include it at its reference place"
                )
                remedy = "give less, another reference, or inertia = false"
                raise refusal(f"{self.key}.mass", float(self.mass), fault, remedy)
        term = copy.copy(self)
        object.__setattr__(term, "carried", carried)
        object.__setattr__(term, "most", dry if carried else np.inf)
        return term

    @property
    def channels(self) -> int:
        return (self.slide_direction is not None) + (self.turn_axis is not None)

    @property
    def memory(self) -> bool:
        # Whether it follows commands with a lag or at a limited rate, or remembers how fast it moves.
        return self.carried or (self.driver is not None and any(motion(self).values()))

    @property
    def remarks(self) -> tuple[str, ...]:
        # What has inertia and moves at t = 0 pushes the vehicle back at once.
        if not (self.carried and self.timed and self.times[0] <= 0.0 < self.times[-1]):
            return ()
        i = int(np.searchsorted(self.times, 0.0, side="right")) - 1
        speed = float(np.linalg.norm(self.places[i + 1] - self.places[i]) / (self.times[i + 1] - self.times[i]))
        text = f"the mass moves at {speed:.3g} m/s from t = 0 on: the vehicle begins with a kick, its start being that before"
        return (f"{text}; begin the path later",) if speed > 0.0 else ()

    def device_in(self, aligned: bool) -> str:
        features = {"path": True}
        if self.driver is not None:
            channels = {"slide": self.slide_direction is not None, "turn": self.turn_axis is not None}
            # What has inertia is at its place, and then goes to the command: at the rate that counts as none.
            motions = motion(self) | ({"rate": True} if self.carried else {})
            features |= {"driven": True} | channels | motions
        features["inertia"] = self.carried
        return f"{self.device}:{','.join(name for name, present in features.items() if present)}"

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        # In addition, refuses more than the vehicle's mass, and directions without length; raises SceneError for members'
        # numbers that would have no effect.
        if self.driver is not None:
            refuse_unread(self, numbers)
        bad = super().unphysical(numbers)
        bad["mass"] = bad["mass"] | (numbers["mass"] > self.most)
        for name in ("slide_direction", "turn_axis"):
            if name in bad:
                bad[name] = bad[name] | ~np.any(numbers[name], axis=-1)
        return bad

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # The rows of device/moving_mass.py; differences of places turn as vectors do.
        vector, reference = context.frame.vector, numbers["reference"]
        weight = numbers["mass"] * context.parameters["environment.gravity"]
        none = np.zeros((1, 3))
        directions = (unit(numbers.get(name, none)) for name in ("slide_direction", "turn_axis"))
        center = np.subtract(*repeated(numbers["turn_center"], reference))
        places = vector(np.subtract(*repeated(numbers["places"], reference[:, None])))
        rows = side_by_side(
            weight[:, None], numbers["mass"][:, None], context.frame.point(reference),
            *(vector(value) for value in (center, *directions)), knots(numbers["times"], places),
        )  # fmt: skip
        size = numbers["times"].shape[1] - 1
        if self.driver is not None:
            packed = packed_following(self, numbers, np.zeros((1, self.channels, 0)), rows, size)
        else:
            packed = Packed({"memory": 0, "count": 0, "shared": 0, "size": size}, rows)
        if not self.carried:
            return packed
        speed = along(numbers["times"], places, np.array([context.time]))[1][0]
        return packed._replace(memory=speed if packed.memory is None else side_by_side(packed.memory, speed))

    def inner(self, numbers: Numbers, time: Array, twist: Array, down: Array, parameters: Numbers) -> Inner | None:
        # Where a controller moves it, its place is not known after the run: it counts at its reference place.
        if self.driver is not None:
            return None
        r, v = along(numbers["times"], numbers["places"], time)
        m, home = numbers["mass"], numbers["reference"]
        weight = (m * parameters["environment.gravity"])[:, None]
        potential = -np.sum(weight * (r - home) * down, axis=-1)
        if not self.carried:
            return Inner(np.zeros_like(twist), np.zeros_like(potential), potential)
        nu, Om = twist[..., :3], twist[..., 3:]
        here, there = nu + cross(Om, r) + v, nu + cross(Om, home)
        momenta = m[:, None] * np.concatenate([here - there, cross(r, here) - cross(home, there)], axis=-1)
        return Inner(momenta, 0.5 * m * (np.sum(here**2, axis=-1) - np.sum(there**2, axis=-1)), potential)

    def effect(self, numbers: Numbers, parameters: Numbers, speed: Array) -> Array:
        # The torque of a metre, and of a radian, at the first place of the path in a vehicle that lies level.
        weight = (numbers["mass"] * parameters["environment.gravity"])[:, None]
        shifts = []
        if self.slide_direction is not None:
            shifts.append(unit(numbers["slide_direction"]))
        if self.turn_axis is not None:
            arm = np.subtract(*repeated(numbers["places"][:, 0], numbers["turn_center"]))
            shifts.append(cross(unit(numbers["turn_axis"]), arm))
        torques = [cross(weight * shift, np.array([0.0, 0.0, 1.0])) for shift in shifts]
        columns = [np.concatenate([np.zeros_like(torque), torque], axis=-1) for torque in torques]
        return np.stack(repeated(*columns), axis=-1)


def square_at(r: np.ndarray) -> np.ndarray:
    """J^T J (n, 6, 6), the inertia of 1 kg at positions r (n, 3) [m], which have the velocity J (nu; Om) = nu + Om x r."""
    J = np.concatenate([np.broadcast_to(EYE, (len(r), 3, 3)), -hat(r)], axis=-1)
    return np.swapaxes(J, -1, -2) @ J


def along(times: Array, places: Array, t: Array) -> tuple[Array, Array]:
    """Positions (k, n, 3) [m] at times t (k,) on paths (n, points, 3), and velocities [m/s], at knots those before."""
    times, places = repeated(times, places)
    span, change, since = np.diff(times), np.diff(places, axis=1), t[:, None, None] - times
    parts = np.clip(since[..., :-1] / span, 0.0, 1.0)
    moving = (since[..., :-1] > 0.0) & (since[..., 1:] <= 0.0)
    r = places[:, 0] + np.einsum("kni,nij->knj", parts, change)
    return r, np.einsum("kni,nij->knj", moving / span, change)


def unit(v: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) scaled to length 1; zero vectors stay zero."""
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.asarray(v / np.where(length > 0.0, length, 1.0))
