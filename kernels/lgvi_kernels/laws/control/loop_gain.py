# SPDX-License-Identifier: Apache-2.0
"""A factor on the demand of the laws between two places of a controller's list, and what is added, for margins."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *


@wp.func
def by_component(a: Any, b: Any):
    return vec3(a.x * b.x, a.y * b.y, a.z * b.z)


@functools.cache
def made(features):
    """The code of the first place, "begin", which notes the demand so far, or of the second, "end"."""
    ends = "end" in features

    def params(width, real):
        """Params: factors on force and torque by component, what is added to them; first of six rows that both share."""
        factors = dict.fromkeys(("of_force", "of_torque", "force", "torque"), lane3(width, real)) if ends else {}
        return struct("LoopGain", **factors, demand=wp.int32)

    @wp.func
    def begin(w: Any, r: Any, y: Any, p: Any):
        at = p.demand
        remember(y, at, w.force.x)
        remember(y, at + 1, w.force.y)
        remember(y, at + 2, w.force.z)
        remember(y, at + 3, w.torque.x)
        remember(y, at + 4, w.torque.y)
        remember(y, at + 5, w.torque.z)
        return w

    @wp.func
    def end(w: Any, r: Any, y: Any, p: Any):
        at = p.demand
        force = vec3(remembered(y, at), remembered(y, at + 1), remembered(y, at + 2))
        torque = vec3(remembered(y, at + 3), remembered(y, at + 4), remembered(y, at + 5))
        w.force = force + by_component(p.of_force, w.force - force) + p.force
        w.torque = torque + by_component(p.of_torque, w.torque - torque) + p.torque
        return w

    return device(__name__, features, params=params, control=end if ends else begin)
