# SPDX-License-Identifier: Apache-2.0
"""Turns about the axes by shears, of vectors and of sums of two: what a sine and a tangent, as rounded, make of them."""

import numpy as np
import pytest
import warp as wp

from lgvi_kernels.lanes.arithmetic import lane, vec3
from lgvi_kernels.lanes.packet import put
from lgvi_kernels.maps.turns import make_carried_turn, make_turn_of_vector

pytestmark = pytest.mark.kernel

WIDTH, COUNT, UNIT = 4, 64, 2.0**-24


@pytest.fixture(scope="module")
def turned():
    """(v, low, t, s), and of each axis (n, 4, 3): turned with either component early, and with compensation v and low."""
    Lane = lane(WIDTH, wp.float32)
    x_late, x_early, x_carried = make_turn_of_vector(0, 0), make_turn_of_vector(0, 1), make_carried_turn(0)
    y_late, y_early, y_carried = make_turn_of_vector(1, 1), make_turn_of_vector(1, 2), make_carried_turn(1)
    z_late, z_early, z_carried = make_turn_of_vector(2, 2), make_turn_of_vector(2, 0), make_carried_turn(2)

    @wp.kernel(module="unique", enable_backward=False)
    def evaluate(rows: wp.array2d(dtype=Lane), out: wp.array2d(dtype=Lane)):
        i = wp.tid()
        v = vec3(rows[i, 0], rows[i, 1], rows[i, 2])
        low = vec3(rows[i, 3], rows[i, 4], rows[i, 5])
        t = rows[i, 6]
        s = rows[i, 7]
        put(out, i, 0, x_late(v, t, s))
        put(out, i, 3, x_early(v, t, s))
        x, x_low = x_carried(v, low, t, s)
        put(out, i, 6, x)
        put(out, i, 9, x_low)
        put(out, i, 12, y_late(v, t, s))
        put(out, i, 15, y_early(v, t, s))
        y, y_low = y_carried(v, low, t, s)
        put(out, i, 18, y)
        put(out, i, 21, y_low)
        put(out, i, 24, z_late(v, t, s))
        put(out, i, 27, z_early(v, t, s))
        z, z_low = z_carried(v, low, t, s)
        put(out, i, 30, z)
        put(out, i, 33, z_low)

    rng = np.random.default_rng(4)
    v = rng.normal(size=(COUNT, 3))
    t = rng.uniform(-0.02, 0.02, COUNT)
    rows = np.column_stack([v, 0.3 * UNIT * rng.normal(size=(COUNT, 3)), t, 2.0 * t / (1.0 + t * t)]).astype(np.float32)
    given = rows.reshape(-1, WIDTH, 8).transpose(0, 2, 1).copy()
    out = wp.zeros((COUNT // WIDTH, 36), dtype=Lane, device="cpu")
    inputs = [wp.array(given, dtype=Lane, shape=given.shape[:2], device="cpu")]
    wp.launch(evaluate, COUNT // WIDTH, inputs=inputs, outputs=[out], device="cpu")
    values = out.numpy().transpose(0, 2, 1).reshape(COUNT, 3, 4, 3).astype(float)
    v, low, t, s = np.split(rows.astype(float), (3, 6, 7), axis=1)
    return v, low, t[:, 0], s[:, 0], values


@pytest.mark.ci
@pytest.mark.parametrize("axis", range(3))
def test_a_turn_about_an_axis(turned, axis):
    v, low, t, s, values = turned
    a, b = (axis + 1) % 3, (axis + 2) % 3
    for sum_of, kinds in ((v, (0, 1)), (v + low, (2,))):
        expected = sum_of.copy()
        u = sum_of[:, a] + t * sum_of[:, b]
        expected[:, b] = sum_of[:, b] - s * u
        expected[:, a] = u + t * expected[:, b]
        for kind in kinds:
            carried = kind == 2
            actual = values[:, axis, kind] + (values[:, axis, 3] if carried else 0.0)
            # A round-off of each of some sums of numbers below 4: plain of the number, carried of its change alone.
            allowed = (0.2 if carried else 6.0) * UNIT * 4.0
            np.testing.assert_allclose(actual, expected, rtol=0.0, atol=allowed)
