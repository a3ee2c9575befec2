# SPDX-License-Identifier: Apache-2.0
"""A perceptron: layers of weighted sums and a function of each."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_kernels.laws.control.integral import remember3, remembered3
from lgvi_kernels.laws.control.pose_error import attitude_error

# Numbers that it may look at, in the order in which `see` writes them; components of a demand.
SEEN = 22
DEMAND = 6
TANH = 1
CLIP = 2
RELU = 3


# Scale of force and torque; first row of the table; scratch rows; counts; functions of hidden and last layers.
# The table has places of the inputs; of each layer its sizes, W line by line and b; then places of the outputs.
params = make_params("Policy", vectors="force torque", words="first work inputs layers outputs widest hidden last")


@wp.func
def see(r: Any, y: Any, row: int):
    """Write all that a policy may look at."""
    remember(y, row, r.position.z - y.position.z)
    remember(y, row + 1, heading_error(r, y))
    remember(y, row + 2, r.speed - y.water_velocity.x)
    remember(y, row + 3, y.position.z)
    remember3(y, row + 4, to_body(y, r.position - y.position))
    remember3(y, row + 7, attitude_error(r, y))
    remember3(y, row + 10, y.velocity)
    remember3(y, row + 13, y.water_velocity)
    remember3(y, row + 16, y.angular_velocity)
    remember3(y, row + 19, y.down)


@wp.func
def activated(x: Any, kind: int):
    """The function of a layer."""
    unity = ones(x)
    if kind == wp.static(TANH):
        x = hyperbolic_tangent(x)
    if kind == wp.static(CLIP):
        x = clamp(x, unity - unity - unity, unity)
    if kind == wp.static(RELU):
        x = greatest(x, unity - unity)
    return x


@wp.func
def whole(y: Any, row: int):
    """A whole number of the table, the same in all lanes."""
    return int(row1(y, row)[0])


@wp.func
def control(w: Any, r: Any, y: Any, p: Any):
    """Inputs, layer by layer, and the outputs as parts of the demand."""
    see(r, y, p.work)
    demand = p.work + wp.static(SEEN)
    source = int(demand + wp.static(DEMAND))
    target = int(source + p.widest)
    for i in range(p.inputs):
        remember(y, source + i, remembered(y, p.work + whole(y, p.first + i)))
    at = int(p.first + p.inputs)
    for layer in range(p.layers):
        wide = whole(y, at)
        count = whole(y, at + 1)
        kind = p.hidden
        if layer == p.layers - 1:
            kind = p.last
        weights = at + 2
        biases = weights + wide * count
        for i in range(count):
            total = row1(y, biases + i)
            for j in range(wide):
                total = total + row1(y, weights + i * wide + j) * remembered(y, source + j)
            remember(y, target + i, activated(total, kind))
        at = biases + count
        swap = source
        source = target
        target = swap
    for i in range(wp.static(DEMAND)):
        remember(y, demand + i, ones(w.force.x) - ones(w.force.x))
    for i in range(p.outputs):
        remember(y, demand + whole(y, at + i), remembered(y, source + i))
    w.force = w.force + p.force * remembered3(y, demand)
    w.torque = w.torque + p.torque * remembered3(y, demand + 3)
    return w
