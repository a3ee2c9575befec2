# SPDX-License-Identifier: Apache-2.0
"""An inertial measurement unit: what its accelerometers and gyroscopes add up to from one tick to the next."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.lanes.noise import noise_key
from lgvi_kernels.law import *
from lgvi_kernels.laws.control.readings import (
    put_attitude,
    remember3,
    remembered3,
    taken_attitude,
    turn_to,
)

# Its rows of the memory: the last attitude, the last velocity of its place, and both biases.
VELOCITY, BIAS_A, BIAS_W, ROWS = 9, 12, 15, 18


# Not inlined, for the sake of the compiler: it is called four times.
@wp.func(inline=False)
def drawn(like: Any, key: Any, tick: int, stream: int):
    """Three standard normals of a tick."""
    return normals3(like, key.member, tick, key.channel + stream, key.seed0, key.seed1)


@functools.cache
def made(features):
    """The device code of a unit.

    features: its numbers that some member has, and "handed" where a filter takes what it measures.
    """
    noisy_a, noisy_w, walking_a, walking_w, handed = (
        name in features
        for name in ("accelerometer_noise", "gyroscope_noise", "accelerometer_walk", "gyroscope_walk", "handed")
    )

    def params(width, real):
        """Params: the numbers by member; keys of the random numbers; first of its rows of memory, and of what it hands on."""
        names = ("place", "accelerometer_noise", "gyroscope_noise", "accelerometer_walk", "gyroscope_walk")
        keys = dict.fromkeys(("accelerometer_key", "gyroscope_key"), noise_key(width))
        words = dict.fromkeys(("memory", "handed"), wp.int32)
        return struct("IMU", **dict.fromkeys(names, lane3(width, real)), **keys, gravity=lane(width, real), **words)

    @wp.func
    def walked(y: Any, p: Any, spread: Any):
        """Let the biases walk over a period."""
        if wp.static(walking_a):
            step = spread * (p.accelerometer_walk * drawn(spread, p.accelerometer_key, y.tick, 1))
            remember3(y, p.memory + wp.static(BIAS_A), remembered3(y, p.memory + wp.static(BIAS_A)) + step)
        if wp.static(walking_w):
            step_w = spread * (p.gyroscope_walk * drawn(spread, p.gyroscope_key, y.tick, 1))
            remember3(y, p.memory + wp.static(BIAS_W), remembered3(y, p.memory + wp.static(BIAS_W)) + step_w)

    @wp.func
    def since(y: Any, p: Any, v: Any, unity: Any):
        """The velocity and the turn gained since the last tick, in the axes of the last tick, with their errors."""
        spread = root(y.period * unity)
        z = taken_attitude(y, p.memory)
        turned = turn_to(z, y) + y.period * remembered3(y, p.memory + wp.static(BIAS_W))
        v_last = remembered3(y, p.memory + wp.static(VELOCITY))
        gained = to_body(z, vec3(v.x - v_last.x, v.y - v_last.y, v.z - v_last.z - y.period * p.gravity))
        gained = gained + y.period * remembered3(y, p.memory + wp.static(BIAS_A))
        if wp.static(noisy_a):
            gained = gained + spread * (p.accelerometer_noise * drawn(unity, p.accelerometer_key, y.tick, 0))
        if wp.static(noisy_w):
            turned = turned + spread * (p.gyroscope_noise * drawn(unity, p.gyroscope_key, y.tick, 0))
        walked(y, p, spread)
        return gained, turned

    @wp.func
    def measure(y: Any, p: Any):
        """Hand on what was gained, or let y have the mean rate."""
        unity = ones(y.position.x)
        zero = unity - unity
        v = to_inertial(y, y.velocity + cross(y.angular_velocity, p.place))
        gained = vec3(zero, zero, zero)
        turned = gained
        if y.step > y.start:
            gained, turned = since(y, p, v, unity)
        put_attitude(y, p.memory)
        remember3(y, p.memory + wp.static(VELOCITY), v)
        if wp.static(handed):
            remember3(y, p.handed, gained)
            remember3(y, p.handed + 3, turned)
            remember3(y, p.handed + 6, remembered3(y, p.memory + wp.static(BIAS_A)))
            remember3(y, p.handed + 9, remembered3(y, p.memory + wp.static(BIAS_W)))
        else:
            if y.step > y.start:
                y.angular_velocity = (unity / (y.period * unity)) * turned
        return y

    return device(__name__, features, params=params, measure=measure)
