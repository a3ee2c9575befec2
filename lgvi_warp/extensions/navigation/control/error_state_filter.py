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
REPORT = "report"
# Numbers of a sensor that the filter would not see, each with what to do.
UNSEEN = {"latency": "leave it out: delayed_fix alone may be late"}
# Rows of what it believes, and of its memory before the covariance (see its device code).
BELIEF_ROWS, STATE_ROWS, WAITING_ROW = 48, 70, 33
STATES, COPIED = 15, 3
_KEY = "give the name of a sensor that stands before the filter, or leave it out"


def _sensor(default: str = "") -> Any:
    """The key of a sensor."""
    return text("is not a text", _KEY, default)


@dataclass(frozen=True, eq=False, kw_only=True)
class ErrorStateFilter(MeasuringPart):
    """An error-state Kalman filter of 15 states: position, velocity, attitude, biases of accelerometers and gyroscopes.

    List it after the sensors that it names. These hand their readings to it alone, and it replaces the measured position,
    attitude, velocity over ground and angular velocity by its estimate. At each tick it goes on by what the IMU has
    gained; then it takes each new reading, number by number in Joseph's form. A delayed fix corrects the position copied
    as the fix was taken, with its covariances (stochastic cloning), one at a time. The filter believes the noises that the
    scene gives for its sensors, whatever a member's are, times `process_scale` and `measurement_scale`; it knows nothing of
    their bias, drift and quantum, but for the biases of the IMU.

    The first estimate is the truth with an error as large as the sigmas below say, drawn once a member.

    Sola (2017), arXiv:1711.02508, chapters 5 and 6; Roumeliotis & Burdick (2002) for the copy.

    Args:
        imu: Key of an `IMU`; "imu" by default.
        dvl: Key of a `DVL`; "", the default, for none, as of those that follow.
        depth: Key of a `Sensor` of "depth".
        heading: Key of a `Sensor` of "heading".
        fix: Key of a `Sensor` of "position" without latency, as GPS with `deepest`.
        delayed_fix: Key of a `Sensor` of "position" whose `latency` may be up to its `every`, as USBL.
        position_sigma: Of the first estimate (3,) [m], inertial axes; 1 by default; one number for all axes.
        velocity_sigma: The same of the velocity (3,) [m/s], inertial axes; 0.1 by default.
        attitude_sigma: The same of the attitude (3,) [rad], body axes; 0.02 by default.
        accelerometer_sigma: Of the bias, whose first estimate is 0 (3,) [m/s^2]; 0.02 by default.
        gyroscope_sigma: The same of the gyroscopes (3,) [rad/s]; 1e-3 by default.
        start_error: Factor of the error of the first position, velocity and attitude; 1 by default, 0 for the truth.
        process_scale: Factor of the IMU's noises and walks as the filter believes them; 1 by default.
        measurement_scale: Factor of the other noises; 1 by default.
        report: Whether it notes sigmas, innovations, NEES and NIS for signals and statistics; True by default.

    Raises:
        SceneError: As `Term`; and where a sensor that it names is missing, of another kind or without noise.

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.control.ErrorStateFilter(dvl="dvl", depth="depth_cell").uses
        {'imu': 'imu', 'dvl': 'dvl', 'depth': 'depth_cell'}
    """

    type: ClassVar[str] = "error_state_filter"
    device: ClassVar[str] = f"{DEVICE}.error_state_filter"
    linear: ClassVar[bool] = False
    every_feature: ClassVar[tuple[str, ...]] = (*AIDS, REPORT)
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
    report: bool = flag(True)

    def __post_init__(self) -> None:
        self.repeat(3, *(item.name for item in self.number_fields() if item.metadata["shape"]))
        super().__post_init__()

    @property
    def estimates_position(self) -> bool:
        return True

    @property
    def uses(self) -> Mapping[str, str]:
        return {role: getattr(self, role) for role in ROLES if getattr(self, role)}

    @property
    def belief_rows(self) -> int:  # type: ignore[override]
        """Rows of the bus with what it believes."""
        return BELIEF_ROWS if self.report else 0

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
        """Add a fault where a sensor does not fit its role."""
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
        elif isinstance(sensor, Sensor) and role == "delayed_fix" and np.any(sensor.latency >= sensor.every):
            problem = f"is not below every = {float(sensor.every):g}: two fixes would be on their way"
            faults.add(f"{key}.latency", float(sensor.latency), problem, "give more ticks between two fixes")

    def wired(self, bus: Bus, others: Mapping[str, Term]) -> Any:
        part = super().wired(bus, others)
        object.__setattr__(part, "used", {role: others[key] for role, key in self.uses.items()})
        return part

    def features(self, numbers: Numbers) -> tuple[str, ...]:
        # The sensors that it has, and whether it notes what it believes.
        return (*(role for role in AIDS if getattr(self, role)), *((REPORT,) if self.report else ()))

    def device_in(self, aligned: bool) -> Any:
        return f"{self.device}:{','.join(self.chosen)}"

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # What it believes of its sensors, where it finds their readings, and the first estimate.
        states = STATES + (COPIED if self.delayed_fix else 0)
        values = self._process(numbers) | self._readings(numbers, context)
        rows = {role: self.bus.handed[self.uses[role]] if role in self.uses else 0 for role in ROLES}
        rows |= {"size": states, "count": STATES, "belief": self.bus.belief}
        size = states * (states + 1) // 2
        work = size if self.report else 0
        memory = np.zeros((len(context.members), STATE_ROWS + size + work))
        memory[:, WAITING_ROW] = -1.0
        sigmas = [numbers[f"{name}_sigma"] for name in ("position", "velocity", "attitude")]
        for i, (name, sigma) in enumerate(zip(("position", "velocity", "attitude"), sigmas, strict=True)):
            xi = normals_at_start(context.seed, f"{self.key}.{name}", context.members)
            memory[:, 3 * i : 3 * i + 3] = numbers["start_error"][:, None] * sigma * xi
        sigmas += [numbers["accelerometer_sigma"], numbers["gyroscope_sigma"]]
        for i in range(STATES):
            memory[:, STATE_ROWS + i * (i + 3) // 2] = sigmas[i // 3][:, i % 3] ** 2
        return Packed(values | rows, memory=memory)

    def _process(self, numbers: Numbers) -> dict[str, Any]:
        """Variances over a period of what the IMU gains, and of the walks of its biases, as the filter believes them."""
        unit, scale = self.used["imu"], numbers["process_scale"][:, None]
        named = {"gained_q": "accelerometer_noise", "turned_q": "gyroscope_noise"}
        named |= {"bias_a_q": "accelerometer_walk", "bias_w_q": "gyroscope_walk"}
        return {name: self.bus.period * (scale * getattr(unit, noise)) ** 2 for name, noise in named.items()}

    def _readings(self, numbers: Numbers, context: PackingContext) -> dict[str, Any]:
        """Variances of readings as the filter believes them, and where its sensors are."""
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


def _noise(sensor: Any) -> np.ndarray:
    """The standard deviation of a reading as the scene gives it: its noise, and what rounding adds."""
    noise = np.asarray(sensor.noise)
    return np.sqrt(noise**2 + sensor.quantum**2 / 12.0) if isinstance(sensor, Sensor) else noise
