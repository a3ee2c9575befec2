# SPDX-License-Identifier: Apache-2.0
"""Operations on a packet between steps: every row and entry of an attitude, momentum and position counts alike."""

import numpy as np
import pytest
import warp as wp

from lgvi_kernels.advance import monitor
from lgvi_kernels.lanes import packet
from lgvi_kernels.lanes.arithmetic import lane, lane3, vec3
from lgvi_kernels.lanes.flags import CPU_FLAGS
from lgvi_kernels.lanes.state import state_struct, struct

pytestmark = pytest.mark.kernel

ENTRIES = 18
LIMIT, TINY = 1e-3, 1e-4
TURN = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]


@pytest.fixture(scope="module")
def between_steps():
    """(states of shape (n, 18), alarms, frozen, others) -> what each function makes of them, by name."""
    width, real = 8, wp.float64
    Lane, Lane3, State = lane(width, real), lane3(width, real), state_struct(width, real)
    Limits = monitor.limits_struct(width, real, ("orthogonality",))
    Constants = struct("PacketConstants", inertia=Lane)

    @wp.func
    def velocities(inertia: Lane, p: Lane3, pi: Lane3):
        return p, pi

    look = monitor.make_look(("orthogonality",), width, real, velocities, None)

    @wp.func
    def read(rows: wp.array2d(dtype=Lane), i: int):
        x = State()
        x.R0 = vec3(rows[0, i], rows[1, i], rows[2, i])
        x.R1 = vec3(rows[3, i], rows[4, i], rows[5, i])
        x.R2 = vec3(rows[6, i], rows[7, i], rows[8, i])
        x.b = vec3(rows[9, i], rows[10, i], rows[11, i])
        x.p = vec3(rows[12, i], rows[13, i], rows[14, i])
        x.pi = vec3(rows[15, i], rows[16, i], rows[17, i])
        return x

    @wp.func
    def write(out: wp.array2d(dtype=Lane), i: int, j: int, x: State):
        out[j, i] = x.R0.x
        out[j + 1, i] = x.R0.y
        out[j + 2, i] = x.R0.z
        out[j + 3, i] = x.R1.x
        out[j + 4, i] = x.R1.y
        out[j + 5, i] = x.R1.z
        out[j + 6, i] = x.R2.x
        out[j + 7, i] = x.R2.y
        out[j + 8, i] = x.R2.z
        out[j + 9, i] = x.b.x
        out[j + 10, i] = x.b.y
        out[j + 11, i] = x.b.z
        out[j + 12, i] = x.p.x
        out[j + 13, i] = x.p.y
        out[j + 14, i] = x.p.z
        out[j + 15, i] = x.pi.x
        out[j + 16, i] = x.pi.y
        out[j + 17, i] = x.pi.z

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": CPU_FLAGS})
    def evaluate(rows: wp.array2d(dtype=Lane), marks: wp.array2d(dtype=Lane), out: wp.array2d(dtype=Lane)):
        i = wp.tid()
        x = read(rows, i)
        x.alarm.code = marks[0, i]
        x.alarm.size = marks[1, i]
        frozen = marks[2, i]
        limits = Limits()
        limits.orthogonality_limit = real(wp.static(LIMIT**2))
        seen = look(x, Constants(), limits, frozen)
        out[0, i] = seen.bits
        out[1, i] = seen.size
        out[2, i] = packet.failures(x, frozen)
        alarm = packet.turned_too_far(x.alarm)
        out[3, i] = alarm.code
        out[4, i] = alarm.size
        write(out, i, 5, packet.renormalise(x, real(0.0)))
        rest = packet.vectors_at_rest(x)
        write(out, i, 23, rest)
        write(out, i, 41, packet.choose_vectors(frozen, x, rest))

    def run(states, code=0.0, size=0.0, frozen=0.0):
        n = len(states)
        marks = np.stack([np.broadcast_to(value, n) for value in (code, size, frozen)]).astype(float)
        padded = -(-n // width) * width
        rows, marks = (np.pad(a, ((0, 0), (0, padded - n)), mode="edge") for a in (np.asarray(states).T, marks))
        given = [wp.array(np.ascontiguousarray(a).reshape(len(a), -1, width), dtype=Lane, shape=(len(a), padded // width),
                          device="cpu") for a in (rows, marks)]  # fmt: skip
        out = wp.zeros((59, padded // width), dtype=Lane, device="cpu")
        wp.launch(evaluate, padded // width, inputs=given, outputs=[out], device="cpu")
        values = out.numpy().reshape(59, padded)[:, :n]
        names = {"bits": 0, "value": 1, "failure": 2, "code": 3, "size": 4}
        columns = {"renormalised": 5, "at_rest": 23, "chosen": 41}
        return {k: values[i] for k, i in names.items()} | {k: values[i : i + 18].T for k, i in columns.items()}

    return run


def states_of(attitudes):
    """States with these attitudes (n, 3, 3) and other numbers."""
    rest = np.tile(np.arange(1.0, 10.0), (len(attitudes), 1))
    return np.concatenate([np.reshape(attitudes, (-1, 9)), rest], axis=1)


def sheared(size):
    """Attitudes S R with S = I + size on one entry or on two that are each other's mirror: six ways to be no rotation."""
    found = []
    for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)):
        shear = np.eye(3)
        shear[i, j] += size
        shear[j, i] = shear[i, j]
        found.append(shear @ TURN)
    return np.array(found)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_all_six_entries_of_an_attitude_are_looked_at(between_steps, sign):
    crossed = between_steps(states_of(sheared(sign * LIMIT)))
    assert (crossed["bits"] == 2.0 ** monitor.BITS["orthogonality"]).all()
    assert (between_steps(states_of(sheared(sign * TINY)))["bits"] == 0.0).all()
    # R R^T - I has 2 size in the sheared entry.
    np.testing.assert_allclose(np.sqrt(crossed["value"]), 2.0 * LIMIT, rtol=2e-3)


@pytest.mark.parametrize("size", [3e-2, -3e-2])
def test_an_attitude_is_renormalised_in_every_direction(between_steps, size):
    rotations = between_steps(states_of(sheared(size)))["renormalised"][:, :9].reshape(-1, 3, 3)
    departure = np.abs(rotations @ np.swapaxes(rotations, 1, 2) - np.eye(3)).max()
    assert departure < 4.0 * size**2
    # The nearest rotation is the one without the shear.
    np.testing.assert_allclose(rotations, np.broadcast_to(TURN, rotations.shape), atol=2.0 * size**2)
    twice = between_steps(states_of(rotations))["renormalised"][:, :9].reshape(-1, 3, 3)
    assert np.abs(twice @ np.swapaxes(twice, 1, 2) - np.eye(3)).max() < 4.0 * departure**2


def test_what_is_no_number_is_seen_in_every_entry(between_steps):
    for value in (np.nan, np.inf, -np.inf):
        states = np.repeat(states_of(TURN[None]), ENTRIES + 1, axis=0)
        states[np.arange(ENTRIES), np.arange(ENTRIES)] = value
        assert between_steps(states)["failure"].tolist() == [packet.NON_FINITE] * ENTRIES + [0]
        assert (between_steps(states, frozen=1.0)["failure"] == 0).all()
    # An alarm of the step says more.
    assert (between_steps(states, code=2.0)["failure"] == 2).all()


def test_a_quarter_turn_is_too_far(between_steps):
    """The alarm's size is the square of half the largest turn's tangent; at 1 it is too far."""
    states = np.repeat(states_of(TURN[None]), 3, axis=0)
    seen = between_steps(states, size=[0.99, 1.01, 4.0])
    assert seen["code"].tolist() == [0, packet.STEP_TOO_LARGE, packet.STEP_TOO_LARGE]
    assert seen["size"].tolist() == [0.0, 1.01, 4.0]


def test_frozen_lanes_wait_at_rest_and_keep_all_of_their_state(between_steps):
    states = np.random.default_rng(1).normal(size=(8, ENTRIES))
    frozen = np.arange(8) % 2
    seen, rest = between_steps(states, frozen=frozen), np.concatenate([np.eye(3).ravel(), np.zeros(9)])
    np.testing.assert_array_equal(seen["at_rest"], np.tile(rest, (8, 1)))
    np.testing.assert_array_equal(seen["chosen"], np.where(frozen[:, None] > 0, states, rest))
