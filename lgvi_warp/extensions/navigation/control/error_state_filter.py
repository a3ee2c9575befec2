# SPDX-License-Identifier: Apache-2.0
"""An error-state Kalman filter for inertial navigation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.declared import flag, text
from lgvi_warp.common.errors import Faults, closest
from lgvi_warp.control.base import Bus, MeasuringPart
from lgvi_warp.control.sensor import RANGE, Sensor
from lgvi_warp.extensions.navigation import DEVICE
from lgvi_warp.extensions.navigation.control.dvl import DIAGONAL, DVL
from lgvi_warp.extensions.navigation.control.imu import IMU
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, number
from lgvi_warp.physics.terms.noisy import normals_at_start

# What a sensor is to the filter, and what it then must be: a class, and what it reads.
ROLES: dict[str, tuple[type[MeasuringPart], str]] = {
    "imu": (IMU, ""),
    "dvl": (DVL, ""),
    "fix": (Sensor, "position"),
    "delayed_fix": (Sensor, "position"),
    "depth": (Sensor, "depth"),
    "heading": (Sensor, "heading"),
}
AIDS = tuple(role for role in ROLES if role != "imu")
REPORT, GATE, WATCHED = "report", "gate", "watched"
# Numbers of a sensor that the filter would not see, each with what to do.
UNSEEN = {"latency": "leave it out: delayed_fix alone may be late"}
# Rows of what it believes, and behind them of counts by sensor, and of what tells whether it diverged (see its device code).
BELIEF_ROWS, DIVERGED_ROWS = 48, 2
# Rows of its memory: before those of fixes on their way, and of each of these; numbers of which each counts its rejections.
STATE_ROWS, FIX_ROWS, RUN_ROWS = 27, 7, 12
STATES, COPIED, MOST_COPIES = 15, 3, 8
# A gate so wide that all pass, within float32; one whose tails are 0. Rejections in a row where the scene has no number.
OPEN, FAR, MOST_REJECTED = 1e9, 30.0, 10.0
_KEY = "give the name of a sensor that stands before the filter, or leave it out"


def _sensor(default: str = "") -> Any:
    """A field for the key of a sensor."""
    return text("is not a text", _KEY, default)


@dataclass(frozen=True, eq=False, kw_only=True)
class ErrorStateFilter(MeasuringPart):
    """An error-state Kalman filter of 15 states: position, velocity, attitude, biases of accelerometers and gyroscopes.

    List it after the sensors that it names. These sensors pass their readings only to the filter. The filter replaces the
    measured position, attitude, velocity over ground and angular velocity by its estimates. At each tick the IMU's
    increments propagate the estimate. Then each new reading updates it, number by number in Joseph's form. A delayed fix
    updates a copy of position and covariances that was stored when the fix was taken (stochastic cloning). Up to 8
    fixes may be pending. For all members, the filter assumes the sensor noise of the scene, times `process_scale` for
    the IMU and `measurement_scale` for others. It estimates the biases of the IMU, but no other bias, drift or rounding.

    The first estimate is the truth plus an error with the standard deviations below, drawn once for each member.

    Sources: Sola (2017), arXiv:1711.02508, chapters 5 and 6; Roumeliotis & Burdick (2002) for stochastic cloning.

    Args:
        imu: Key of an `IMU`; "imu" by default.
        dvl: Key of a `DVL`; "", the default, for none. The next four keys are "" by default, too.
        depth: Key of a `Sensor` of "depth".
        heading: Key of a `Sensor` of "heading".
        fix: Key of a `Sensor` of "position" without latency, such as GPS with `deepest`.
        delayed_fix: Key of a `Sensor` of "position" whose `latency` is below 8 times its `every`, such as USBL. If a
            member's numbers give more pending fixes than the scene's numbers, the filter ignores the excess.
        position_sigma: Standard deviation of the first position error (3,) [m], inertial axes, or one number for all axes; 1
            by default.
        velocity_sigma: Standard deviation of the first velocity error (3,) [m/s], inertial axes; 0.1 by default.
        attitude_sigma: Standard deviation of the first attitude error (3,) [rad], body axes; 0.02 by default.
        accelerometer_sigma: Standard deviation of the accelerometers' bias (3,) [m/s^2], whose first estimate is 0; 0.02 by
            default.
        gyroscope_sigma: Standard deviation of the gyroscopes' bias (3,) [rad/s], whose first estimate is 0; 1e-3 by default.
        start_error: Factor on the error of the first position, velocity and attitude; 1 by default, 0 for the truth.
        process_scale: Factor on the IMU's noise and bias walk that the filter assumes; 1 by default.
        measurement_scale: Factor on the noise of the other sensors that the filter assumes; 1 by default.
        gate: Largest accepted innovation, divided by its standard deviation, for each number of a reading separately, such as
            a beam or a coordinate of a fix. Give one number, or five (5,), for dvl, fix, delayed_fix, depth and heading; inf
            accepts all. By default there is no gate.
        most_rejected: Number of consecutive rejections of one number after which the next reading is accepted. The
            covariance is first enlarged along the measured direction, until the innovation is at the gate. 10 by default,
            inf for never.
        report: Whether the filter records sigmas, innovations, NEES and NIS for signals and statistics; True by default.

    Raises:
        SceneError: If a number is invalid (see `Term`), or a sensor that the filter names is missing, of another kind or
            without noise.

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.control.ErrorStateFilter(dvl="dvl", depth="depth_cell").uses
        {'imu': 'imu', 'dvl': 'dvl', 'depth': 'depth_cell'}
    """

    type: ClassVar[str] = "error_state_filter"
    device: ClassVar[str] = f"{DEVICE}.error_state_filter"
    linear: ClassVar[bool] = False
    every_feature: ClassVar[tuple[str, ...]] = (*AIDS, REPORT, GATE, WATCHED)
    # The sensors that it uses, by what they are to it; set for a part of a scene.
    used: ClassVar[Mapping[str, Any]] = {}

    imu: str = _sensor("imu")
    dvl: str = _sensor()
    depth: str = _sensor()
    heading: str = _sensor()
    fix: str = _sensor()
    delayed_fix: str = _sensor()
    position_sigma: Any = number((3,), "m", 1.0, above=0.0)
    velocity_sigma: Any = number((3,), "m/s", 0.1, above=0.0)
    attitude_sigma: Any = number((3,), "rad", 0.02, above=0.0)
    accelerometer_sigma: Any = number((3,), "m/s^2", 0.02, above=0.0)
    gyroscope_sigma: Any = number((3,), "rad/s", 1e-3, above=0.0)
    start_error: Any = number((), "1", 1.0, least=0.0)
    process_scale: Any = number((), "1", 1.0, above=0.0)
    measurement_scale: Any = number((), "1", 1.0, above=0.0)
    gate: Any = number((len(AIDS),), "1", None, above=0.0, infinite=True, optional=True)
    most_rejected: Any = number((), "1", None, least=1.0, infinite=True, optional=True, integer=True)
    report: bool = flag(True)

    def __post_init__(self) -> None:
        self.repeat(3, *(item.name for item in self.number_fields() if item.metadata["shape"] == (3,)))
        self.repeat(len(AIDS), GATE)
        if self.gate is not None and self.most_rejected is None:
            object.__setattr__(self, "most_rejected", MOST_REJECTED)
        super().__post_init__()

    def check(self, faults: Faults) -> None:
        if self.gate is None and self.most_rejected is not None:
            faults.add(
                "most_rejected",
                float(self.most_rejected),
                "has no meaning without a gate",
                "give gate = 4, or leave it out",
            )

    @property
    def estimates_position(self) -> bool:
        return True

    @property
    def ends(self) -> str:
        return "position_uncertain"

    @property
    def uses(self) -> Mapping[str, str]:
        return {role: getattr(self, role) for role in ROLES if getattr(self, role)}

    @property
    def belief_rows(self) -> int:  # type: ignore[override]
        """Number of rows of the bus with the filter's state."""
        return BELIEF_ROWS + self.rejected_rows + DIVERGED_ROWS if self.report else 0

    @property
    def rejected_rows(self) -> int:  # type: ignore[override]
        """Number of rows of the bus that count rejected readings, by sensor."""
        return len(AIDS) if self.report and self.gate is not None else 0

    @property
    def copies(self) -> int:
        """Number of fixes that may be pending at once with the scene's numbers; 1 without a delayed fix."""
        late = self.used.get("delayed_fix")
        return _on_their_way(late) if late is not None else 1

    def check_used(self, faults: Faults, sensors: Sequence[Any]) -> None:
        # Each sensor is there, before the filter, of the right kind, and with a noise to believe; no other part is before it.
        keys = [part.key for part in sensors]
        before = dict(zip(keys[: keys.index(self.key)], sensors, strict=False))
        if sum(isinstance(part, ErrorStateFilter) for part in sensors) > 1:
            faults.add("sensors", self.key, "is one of several filters", "keep one of them")
        for role, key in self.uses.items():
            self._check_sensor(faults, role, key, before)
        if not self.imu:
            faults.add(f"{self.key}.imu", "", "is missing", "give the name of an imu that stands before the filter")
        # An altimeter leaves the measured motion as it is.
        others = [key for key in before if key not in self.uses.values() and getattr(before[key], "of", "") != RANGE]
        for key in others:
            problem = f"changes what is measured before {self.key}, which takes that for the truth"
            faults.add("sensors", key, problem, "put it behind the filter, or let the filter use it")

    def _check_sensor(self, faults: Faults, role: str, key: str, before: Mapping[str, Any]) -> None:
        """Add a fault if a sensor does not fit its role."""
        kind, reading = ROLES[role]
        word, sensor = f"{self.key}.{role}", before.get(key)
        what = f"a sensor of {reading}" if reading else f"a part of type {kind.type}"
        if sensor is None:
            remedy = closest(key, before) if before else f"give the scene {what}, above the filter"
            faults.add(word, key, "is not a sensor that stands before the filter", remedy)
        elif not isinstance(sensor, kind) or (isinstance(sensor, Sensor) and sensor.of != reading):
            faults.add(word, key, f"is not {what}", f"name one that is {what}")
        elif list(self.uses.values()).count(key) > 1:
            faults.add(word, key, "is named twice", "give each its own sensor")
        elif role != "imu" and not np.all(_noise(sensor) > 0.0):
            faults.add(f"{key}.noise", 0.0, "is 0: the filter would believe it blindly", "give the noise of a reading")
        elif isinstance(sensor, Sensor) and role != "delayed_fix" and np.any(sensor.latency):
            faults.add(f"{key}.latency", float(sensor.latency), f"is not known to {self.key}", UNSEEN["latency"])
        elif isinstance(sensor, Sensor) and role == "delayed_fix" and _on_their_way(sensor) > MOST_COPIES:
            problem = f"has {_on_their_way(sensor)} fixes on their way at once, with every = {float(sensor.every):g}"
            remedy = f"give less than {MOST_COPIES * float(sensor.every):g}, or more ticks between two fixes"
            faults.add(f"{key}.latency", float(sensor.latency), problem, remedy)

    def wired(self, bus: Bus, others: Mapping[str, Term]) -> Any:
        part = super().wired(bus, others)
        object.__setattr__(part, "used", {role: others[key] for role, key in self.uses.items()})
        return part

    def features(self, numbers: Numbers) -> tuple[str, ...]:
        # The sensors that it has, and what else its device code does.
        more = {REPORT: self.report, GATE: self.gate is not None, WATCHED: self.key in self.bus.done}
        return (*(role for role in AIDS if getattr(self, role)), *(word for word, wanted in more.items() if wanted))

    def device_in(self, aligned: bool) -> Any:
        return f"{self.device}:{','.join(self.chosen)}"

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # What it believes of its sensors, where it finds their readings, and the first estimate.
        copies = self.copies
        states, wide = STATES + (COPIED * copies if self.delayed_fix else 0), STATES + COPIED * copies
        values = self._process(numbers) | self._readings(numbers, context) | self._gates(numbers)
        rows = {role: self.bus.handed[self.uses[role]] if role in self.uses else 0 for role in ROLES}
        rows |= {"size": states, "count": STATES, "belief": self.bus.belief, "copies": copies}
        error = STATE_ROWS + FIX_ROWS * copies
        rows |= {"error": error, "work": error + wide, "covariance": error + 2 * wide}
        rows |= {"watched": self.bus.done.get(self.key, 0), "diverged": self.bus.diverged}
        size, first = states * (states + 1) // 2, error + 2 * wide
        rows["tally"] = first + size + (size if self.report else 0)
        last = rows["tally"] + (DIVERGED_ROWS if self.report else 0)
        if self.gate is not None:
            rows |= {"runs": last, "rejected": self.bus.rejected}
        memory = np.zeros((len(context.members), last + (RUN_ROWS + len(AIDS) if self.gate is not None else 0)))
        memory[:, error - copies : error] = -1.0
        sigmas = [numbers[f"{name}_sigma"] for name in ("position", "velocity", "attitude")]
        for i, (name, sigma) in enumerate(zip(("position", "velocity", "attitude"), sigmas, strict=True)):
            xi = normals_at_start(context.seed, f"{self.key}.{name}", context.members)
            memory[:, 3 * i : 3 * i + 3] = numbers["start_error"][:, None] * sigma * xi
        sigmas += [numbers["accelerometer_sigma"], numbers["gyroscope_sigma"]]
        for i in range(STATES):
            memory[:, first + i * (i + 3) // 2] = sigmas[i // 3][:, i % 3] ** 2
        return Packed(values | rows, memory=memory)

    def _gates(self, numbers: Numbers) -> dict[str, Any]:
        """Gate of each sensor, and mean square of a consistent filter's accepted innovations, relative to their variance."""
        if self.gate is None:
            return {}
        from scipy.special import erf

        gates = np.minimum(numbers[GATE], OPEN)
        tails = np.sqrt(2.0 / np.pi) * gates * np.exp(-0.5 * np.minimum(gates, FAR) ** 2)
        shares = 1.0 - tails / erf(gates / np.sqrt(2.0))
        values = {"most_rejected": np.minimum(numbers["most_rejected"], OPEN)}
        for i, role in enumerate(AIDS):
            values |= {f"{role}_gate": gates[:, i], f"{role}_share": shares[:, i]}
        return values

    def _process(self, numbers: Numbers) -> dict[str, Any]:
        """Variances that the filter assumes for the IMU's increments and for its bias walks over a period."""
        unit, scale = self.used["imu"], numbers["process_scale"][:, None]
        named = {"gained_q": "accelerometer_noise", "turned_q": "gyroscope_noise"}
        named |= {"bias_a_q": "accelerometer_walk", "bias_w_q": "gyroscope_walk"}
        return {name: self.bus.period * (scale * getattr(unit, noise)) ** 2 for name, noise in named.items()}

    def _readings(self, numbers: Numbers, context: PackingContext) -> dict[str, Any]:
        """Variances that the filter assumes for readings, and positions of its sensors."""
        scale, used = numbers["measurement_scale"], self.used
        values: dict[str, Any] = {}
        for role in AIDS:
            noise = _noise(used[role]) if role in used else np.ones(3 if ROLES[role][1] == "position" else ())
            factor = scale[:, None] if np.ndim(noise) else scale
            values[f"{role}_r"] = (factor * noise) ** 2
        unit, log = used["imu"], used.get("dvl", DVL())
        late = context.parameters[f"{self.delayed_fix}.latency"] if self.delayed_fix else np.zeros(1)
        places = {"lever": unit.place[None], "arm": (log.place - unit.place)[None], "latency": np.rint(late)}
        for role in ("fix", "delayed_fix", "depth"):
            place = getattr(used.get(role), "place", None)
            places[f"{role}_lever"] = (unit.place - (0.0 if place is None else place))[None]
        beams = {"ahead": DIAGONAL * np.sin(log.angle)[None], "down": np.cos(log.angle)[None]}
        return values | places | beams | {"gravity": context.parameters["environment.gravity"]}


def _on_their_way(sensor: Any) -> int:
    """Number of fixes of a sensor that may be pending at once."""
    return 1 + int(np.rint(sensor.latency) // np.rint(sensor.every))


def _noise(sensor: Any) -> np.ndarray:
    """Standard deviation of a reading with the scene's numbers, from its noise and its rounding."""
    noise = np.asarray(sensor.noise)
    return np.sqrt(noise**2 + sensor.quantum**2 / 12.0) if isinstance(sensor, Sensor) else noise
