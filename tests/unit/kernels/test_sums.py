# SPDX-License-Identifier: Apache-2.0
"""Addition of a change to a compensated state, number by number, to the bit: all are sums of float32."""

import numpy as np
import pytest
import warp as wp

from lgvi_kernels.lanes.arithmetic import lane, vec3
from lgvi_kernels.lanes.packet import put
from lgvi_kernels.lanes.state import state_struct
from lgvi_kernels.lanes.sums import choose, moved, moved_from, place, pushed, settled, twisted

pytestmark = pytest.mark.kernel

WIDTH = 4


@pytest.fixture(scope="module")
def added():
    """({name: vectors (4, 3) in}, {name: vectors (4, 3) out})."""
    Lane, State = lane(WIDTH, wp.float32), state_struct(WIDTH, wp.float32, True)

    @wp.kernel(module="unique", enable_backward=False)
    def evaluate(rows: wp.array2d(dtype=Lane), out: wp.array2d(dtype=Lane)):
        x = State()
        x.b = vec3(rows[0, 0], rows[0, 1], rows[0, 2])
        x.b_low = vec3(rows[0, 3], rows[0, 4], rows[0, 5])
        x.p = vec3(rows[0, 6], rows[0, 7], rows[0, 8])
        x.p_low = vec3(rows[0, 9], rows[0, 10], rows[0, 11])
        x.pi = vec3(rows[0, 12], rows[0, 13], rows[0, 14])
        x.pi_low = vec3(rows[0, 15], rows[0, 16], rows[0, 17])
        d = vec3(rows[0, 18], rows[0, 19], rows[0, 20])
        put(out, 0, 0, place(x))
        far = moved(moved(x, d), d)
        put(out, 0, 3, far.b)
        put(out, 0, 6, far.b_low)
        near = moved_from(far, x, d)
        put(out, 0, 9, near.b)
        put(out, 0, 12, near.b_low)
        y = settled(near)
        put(out, 0, 15, y.b)
        put(out, 0, 18, y.b_low)
        z = twisted(pushed(x, d), d)
        put(out, 0, 21, z.p)
        put(out, 0, 24, z.p_low)
        put(out, 0, 27, z.pi)
        put(out, 0, 30, z.pi_low)
        u = choose(rows[0, 18], far, near)
        put(out, 0, 33, u.b_low)

    rng = np.random.default_rng(7)
    names = ("b", "b_low", "p", "p_low", "pi", "pi_low", "d")
    sizes = {"b": 8.0, "p": 1.0, "pi": 2.0, "d": 1e-3}
    given = {name: (sizes.get(name, 1e-7) * rng.normal(size=(WIDTH, 3))).astype(np.float32) for name in names}
    rows = np.concatenate([given[name].T for name in names])[None]
    out = wp.zeros((1, 36), dtype=Lane, device="cpu")
    data = wp.array(np.ascontiguousarray(rows), dtype=Lane, shape=(1, 21), device="cpu")
    wp.launch(evaluate, 1, inputs=[data], outputs=[out], device="cpu")
    found = ("place", "far.b", "far.b_low", "near.b", "near.b_low", "settled.b", "settled.b_low",
             "p", "p_low", "pi", "pi_low", "chosen.b_low")  # fmt: skip
    return given, dict(zip(found, out.numpy()[0].reshape(12, 3, WIDTH).transpose(0, 2, 1), strict=True))


@pytest.mark.ci
def test_a_move_goes_into_the_low_part(added):
    x, found = added
    np.testing.assert_array_equal(found["place"], x["b"] + x["b_low"])
    np.testing.assert_array_equal(found["far.b"], x["b"])
    np.testing.assert_array_equal(found["far.b_low"], x["b_low"] + x["d"] + x["d"])
    np.testing.assert_array_equal(found["near.b"], x["b"])
    np.testing.assert_array_equal(found["near.b_low"], x["b_low"] + x["d"])


def test_a_place_is_settled(added):
    x, found = added
    low = x["b_low"] + x["d"]
    b = x["b"] + low
    np.testing.assert_array_equal(found["settled.b"], b)
    np.testing.assert_array_equal(found["settled.b_low"], low - (b - x["b"]))


@pytest.mark.parametrize("name", ["p", "pi"])
def test_a_momentum_keeps_what_it_cannot_hold(added, name):
    x, found = added
    change = x[f"{name}_low"] + x["d"]
    total = x[name] + change
    np.testing.assert_array_equal(found[name], total)
    np.testing.assert_array_equal(found[f"{name}_low"], change - (total - x[name]))


def test_lanes_are_chosen_with_their_low_parts(added):
    x, found = added
    expected = np.where(x["d"][:, :1] > 0.0, found["far.b_low"], found["near.b_low"])
    np.testing.assert_array_equal(found["chosen.b_low"], expected)
