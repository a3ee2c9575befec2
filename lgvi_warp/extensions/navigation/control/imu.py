# SPDX-License-Identifier: Apache-2.0
"""An inertial measurement unit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.control.base import MeasuringPart
from lgvi_warp.control.sensor import HANDED
from lgvi_warp.extensions.navigation import DEVICE
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, number
from lgvi_warp.physics.terms.noisy import key_of, normals_at_start

# Numbers that are noise: where no member has one, it is no code.
NOISES = ("accelerometer_noise", "gyroscope_noise", "accelerometer_walk", "gyroscope_walk")
# What it hands on: velocity and turn gained, and both biases as they are, by which a filter is judged.
HANDED_ROWS = 12
# Rows of its memory, and of these those of the biases.
ROWS, BIAS_ROWS = 18, slice(12, 18)


@dataclass(frozen=True, eq=False, kw_only=True)
class IMU(MeasuringPart):
    """Inertial measurement unit: increments of velocity and rotation from one tick to the next, with errors.

    It integrates the motion over the whole period between two ticks, like a unit that corrects for coning and sculling:

        turn     = log(R_k-1^T R_k) + T b_w + sqrt(T) gyroscope_noise xi
        velocity = R_k-1^T (v_k - v_k-1 - g T) + T b_a + sqrt(T) accelerometer_noise xi,   in the axes of the last tick
        b <- b + sqrt(T) walk xi,   starting at bias + turn_on xi, drawn once for each member

    T is the period of the controller, v the velocity over ground of the unit's position, R_k the attitude at tick k, and g
    gravity. b is a bias, b_w of the gyroscopes and b_a of the accelerometers. xi are standard normal numbers that follow
    from seed, member, tick and unit name. The Allan variance over the averaging time t is noise^2 / t + walk^2 t / 3
    (IEEE Std 952-1997). An `error_state_filter` uses the increments. Without a filter, the unit replaces the measured
    angular velocity by its mean over the last period. In that case list a `DVL` before the unit: a later `DVL` would
    use this mean instead of the true rate.

    Args:
        place: Position of the unit (3,) [m], body axes; 0 by default.
        accelerometer_noise: Noise density (3,) [m/s^1.5, which is m/s^2 per Hz^1/2], or one number for all axes; 0 by default.
        gyroscope_noise: Noise density (3,) [rad/s^1/2]; 0 by default.
        accelerometer_walk: Random walk of the bias (3,) [m/s^2.5]; 0 by default.
        gyroscope_walk: Random walk of the bias (3,) [rad/s^1.5]; 0 by default.
        accelerometer_bias: Constant bias (3,) [m/s^2]; 0 by default.
        gyroscope_bias: Constant bias (3,) [rad/s]; 0 by default.
        accelerometer_turn_on: Standard deviation of the accelerometers' bias at the start (3,) [m/s^2]; 0 by default.
        gyroscope_turn_on: Standard deviation of the gyroscopes' bias at the start (3,) [rad/s]; 0 by default.

    Raises:
        SceneError: If a number is invalid (see `Term`).

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.control.IMU(gyroscope_noise=1e-4).gyroscope_noise
        array([0.0001, 0.0001, 0.0001])
    """

    type: ClassVar[str] = "imu"
    device: ClassVar[str] = f"{DEVICE}.imu"
    linear: ClassVar[bool] = False
    every_feature: ClassVar[tuple[str, ...]] = (*NOISES, HANDED)
    reading: ClassVar[str] = "angular_velocity"
    sums: ClassVar[bool] = True

    place: Any = number((3,), "m", (0.0, 0.0, 0.0))
    accelerometer_noise: Any = number((3,), "m/s^1.5", 0.0, least=0.0)
    gyroscope_noise: Any = number((3,), "rad/s^1/2", 0.0, least=0.0)
    accelerometer_walk: Any = number((3,), "m/s^2.5", 0.0, least=0.0)
    gyroscope_walk: Any = number((3,), "rad/s^1.5", 0.0, least=0.0)
    accelerometer_bias: Any = number((3,), "m/s^2", 0.0)
    gyroscope_bias: Any = number((3,), "rad/s", 0.0)
    accelerometer_turn_on: Any = number((3,), "m/s^2", 0.0, least=0.0)
    gyroscope_turn_on: Any = number((3,), "rad/s", 0.0, least=0.0)

    def __post_init__(self) -> None:
        self.repeat(3, *(item.name for item in self.number_fields()))
        super().__post_init__()

    @property
    def handed_rows(self) -> int:
        return HANDED_ROWS

    def fault_channels(self, handed: bool) -> int:
        # Behind them are the biases, which are no readings.
        return HANDED_ROWS // 2 if handed else super().fault_channels(handed)

    def features(self, numbers: Numbers) -> tuple[str, ...]:
        # The noises that some member has.
        acting = tuple(name for name in NOISES if np.any(numbers[name]))
        return (*acting, HANDED) if self.is_handed else acting

    def device_in(self, aligned: bool) -> Any:
        return f"{self.device}:{','.join(self.chosen)}"

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Place and noises, the keys of the random numbers, and the biases of the start in the rows of its memory.
        biases = []
        values: dict[str, Any] = {name: numbers[name] for name in ("place", *NOISES)}
        for kind in ("accelerometer", "gyroscope"):
            name, spread = f"{self.key}.{kind}", numbers[f"{kind}_turn_on"]
            bias = numbers[f"{kind}_bias"]
            if np.any(spread):
                bias = bias + spread * normals_at_start(context.seed, name, context.members)
            biases.append(bias)
            values[f"{kind}_key"] = key_of(name, context)
        members = max(len(bias) for bias in biases)
        memory = np.zeros((members, ROWS))
        memory[:, BIAS_ROWS] = np.hstack([np.broadcast_to(bias, (members, 3)) for bias in biases])
        values["gravity"] = context.parameters["environment.gravity"]
        return Packed(values | {"handed": self.bus.handed.get(self.key, 0)}, memory=memory)
