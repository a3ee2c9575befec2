"""White noise of force and torque along the user's body axes: the impulse over a step h is S sqrt(h) xi."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.law import add, div, int_lane, lane3, mul, normals3, ones, root, struct  # noqa: F401

NOISE = True


@functools.cache
def params(width, real):
    """Params: for each of the user's axes, the noise's force and torques, in the kernel's axes.

    forcex to forcez [N s^1/2]; momentx to momentz: its torque about the origin of the forces; torquex to torquez [N m s^1/2];
    member, seed0, seed1, channel: with the step, the key of the random numbers; the torques' key has channel + 1.
    """
    Lane3 = lane3(width, real)
    columns = {f"{kind}{axis}": Lane3 for kind in ("force", "moment", "torque") for axis in "xyz"}
    key = {"member": int_lane(width), "seed0": wp.int32, "seed1": wp.int32, "channel": wp.int32}
    return struct("WrenchNoise", **columns, **key)


@wp.func
def law(w: Any, view: Any, p: Any):
    """S xi / sqrt(h): held over the kick, so that the impulse's variance is S^2 h."""
    unity = ones(view.b.x)
    size = unity / root(view.h * unity)
    f = size * normals3(unity, p.member, view.step, p.channel, p.seed0, p.seed1)
    m = size * normals3(unity, p.member, view.step, p.channel + 1, p.seed0, p.seed1)
    w.force = w.force + (f.x * p.forcex + f.y * p.forcey + f.z * p.forcez)
    w.torque = w.torque + (f.x * p.momentx + f.y * p.momenty + f.z * p.momentz)
    w.torque = w.torque + (m.x * p.torquex + m.y * p.torquey + m.z * p.torquez)
    return w
