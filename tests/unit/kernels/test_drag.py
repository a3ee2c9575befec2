# SPDX-License-Identifier: Apache-2.0
"""Momentum that drag removes, as compensated sums need it: v (1 - loss) / (1 + gain |v|) - v on each axis."""

import numpy as np
import pytest
import warp as wp

from lgvi_kernels.lanes.arithmetic import lane, vec3
from lgvi_kernels.lanes.packet import put
from lgvi_kernels.laws.drag import make_taken

pytestmark = pytest.mark.kernel


@pytest.mark.ci
def test_what_drag_takes():
    Lane = lane(2, wp.float64)
    linear, quadratic, whole = make_taken(True, False), make_taken(False, True), make_taken(True, True)

    @wp.kernel(module="unique", enable_backward=False)
    def evaluate(rows: wp.array2d(dtype=Lane), out: wp.array2d(dtype=Lane)):
        v = vec3(rows[0, 0], rows[0, 1], rows[0, 2])
        gain = vec3(rows[0, 3], rows[0, 4], rows[0, 5])
        loss = vec3(rows[0, 6], rows[0, 7], rows[0, 8])
        put(out, 0, 0, linear(v, gain, loss))
        put(out, 0, 3, quadratic(v, gain, loss))
        put(out, 0, 6, whole(v, gain, loss))

    rng = np.random.default_rng(6)
    v, gain, loss = rng.normal(size=(3, 2)), rng.uniform(size=(3, 2)), rng.uniform(size=(3, 2))
    rows = wp.array(np.concatenate([v, gain, loss])[None], dtype=Lane, shape=(1, 9), device="cpu")
    out = wp.zeros((1, 9), dtype=Lane, device="cpu")
    wp.launch(evaluate, 1, inputs=[rows], outputs=[out], device="cpu")
    ways = ((0.0 * gain, loss), (gain, 0.0 * loss), (gain, loss))
    expected = np.concatenate([v * (1.0 - away) / (1.0 + k * np.abs(v)) - v for k, away in ways])
    # Some roundings of numbers of order 1.
    np.testing.assert_allclose(out.numpy()[0], expected, rtol=0.0, atol=1e-15)
