# SPDX-License-Identifier: Apache-2.0
"""Why the attitude is carried as three rows: psi_s with rows and with a unit quaternion, bare loops, float64, 8 lanes.

Also the drift from orthogonality after all steps, neither renormalised.
"""

import numpy as np
import warp as wp

from benchmarks.timing import interleaved
from lgvi_kernels.lanes import native
from lgvi_kernels.lanes.arithmetic import (  # noqa: F401
    add,
    cross,
    div,
    dot,
    lane,
    lane3,
    mul,
    neg,
    ones,
    sub,
    vec3,
)
from lgvi_kernels.lanes.flags import CPU_FLAGS
from lgvi_kernels.lanes.rotations import rotation_struct, transpose_apply
from lgvi_kernels.maps.rotation import quartic_rotation, quartic_series
from lgvi_warp.measuring import speed
from lgvi_warp.physics import notation

WIDTH, REAL = 8, wp.float64
Lane, Lane3, Rotation = lane(WIDTH, REAL), lane3(WIDTH, REAL), rotation_struct(WIDTH, REAL)


@wp.func_native(native.code(WIDTH, REAL, "A", "__builtin_elementwise_sqrt(A)"))
def root(a: Lane) -> Lane: ...


@wp.struct
class Body:
    J: Lane3
    mean: Lane
    anisotropy: Lane3
    net: Lane
    moment: Lane3


@wp.struct
class Rows:
    b: Lane3
    R0: Lane3
    R1: Lane3
    R2: Lane3
    p: Lane3
    pi: Lane3


@wp.struct
class Unit:
    b: Lane3
    w: Lane
    v: Lane3
    p: Lane3
    pi: Lane3


@wp.func
def rows_T(x: Rows, c: Body, h: REAL):
    d = h * (c.anisotropy * x.p)
    n = (h * c.mean) * x.p + d
    x.b = x.b + vec3(dot(x.R0, n), dot(x.R1, n), dot(x.R2, n))
    x.pi = x.pi + cross(x.p, d)
    return x


@wp.func
def rows_D(x: Rows, c: Body, h: REAL):
    a = h * x.pi
    F = quartic_rotation(Rotation(), quartic_series(a, c.J), a, c.J)
    x.p = transpose_apply(F, x.p)
    x.pi = transpose_apply(F, x.pi)
    x.R0 = transpose_apply(F, x.R0)
    x.R1 = transpose_apply(F, x.R1)
    x.R2 = transpose_apply(F, x.R2)
    return x


@wp.func
def unit_T(x: Unit, c: Body, h: REAL):
    d = h * (c.anisotropy * x.p)
    n = (h * c.mean) * x.p + d
    t = cross(x.v, n)
    t = t + t
    x.b = x.b + n + x.w * t + cross(x.v, t)
    x.pi = x.pi + cross(x.p, d)
    return x


@wp.func
def unit_D(x: Unit, c: Body, h: REAL):
    a = h * x.pi
    s = quartic_series(a, c.J)
    A = dot(a, a)
    k = c.J + c.J - vec3(s, s, s)
    kk = vec3(k.y * k.z, k.z * k.x, k.x * k.y)
    n = (kk + vec3(A, A, A)) * a + cross(k * a, a)
    det = k.x * kk.x + dot(a * a, k)
    size = ones(s) / root(det * det + dot(n, n))
    u = size * n
    w = size * det
    # F^T y = y + 2 (u x (u x y) - w u x y)
    t = cross(u, x.p)
    t = t + t
    x.p = x.p + cross(u, t) - w * t
    t = cross(u, x.pi)
    t = t + t
    x.pi = x.pi + cross(u, t) - w * t
    v = x.v
    x.v = x.w * u + w * v + cross(v, u)
    x.w = x.w * w - dot(v, u)
    return x


def kernel_of(State, T, D, down, read, write):
    """The loop of psi_s over a state, T merged from step to step."""

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": CPU_FLAGS})
    def advance(state: wp.array2d(dtype=Lane), body: wp.array(dtype=Body), h: REAL, steps: int):
        i = wp.tid()
        c = body[0]
        half = REAL(0.5) * h
        x = T(read(State(), state, i), c, half)
        for _ in range(steps):
            x = D(x, c, half)
            z = down(x)
            x.p = x.p + (h * c.net) * z
            x.pi = x.pi - h * cross(c.moment, z)
            x = T(D(x, c, half), c, h)
        write(T(x, c, -half), state, i)

    return advance


@wp.func
def rows_down(x: Rows):
    return x.R2


@wp.func
def unit_down(x: Unit):
    two = x.w + x.w
    q = x.v
    return vec3(
        (q.x + q.x) * q.z - two * q.y, (q.y + q.y) * q.z + two * q.x, x.w * x.w - q.x * q.x - q.y * q.y + q.z * q.z
    )


@wp.func
def load(state: wp.array2d(dtype=Lane), i: int, j: int):
    return vec3(state[i, j], state[i, j + 1], state[i, j + 2])


@wp.func
def store(v: Lane3, state: wp.array2d(dtype=Lane), i: int, j: int):
    state[i, j] = v.x
    state[i, j + 1] = v.y
    state[i, j + 2] = v.z


@wp.func
def rows_read(x: Rows, state: wp.array2d(dtype=Lane), i: int):
    x.b = load(state, i, 0)
    x.p = load(state, i, 3)
    x.pi = load(state, i, 6)
    x.R0 = load(state, i, 9)
    x.R1 = load(state, i, 12)
    x.R2 = load(state, i, 15)
    return x


@wp.func
def rows_write(x: Rows, state: wp.array2d(dtype=Lane), i: int):
    store(x.b, state, i, 0)
    store(x.p, state, i, 3)
    store(x.pi, state, i, 6)
    store(x.R0, state, i, 9)
    store(x.R1, state, i, 12)
    store(x.R2, state, i, 15)


@wp.func
def unit_read(x: Unit, state: wp.array2d(dtype=Lane), i: int):
    x.b = load(state, i, 0)
    x.p = load(state, i, 3)
    x.pi = load(state, i, 6)
    x.w = ones(x.b.x) * state[i, 9]
    x.v = load(state, i, 10)
    return x


@wp.func
def unit_write(x: Unit, state: wp.array2d(dtype=Lane), i: int):
    store(x.b, state, i, 0)
    store(x.p, state, i, 3)
    store(x.pi, state, i, 6)
    state[i, 9] = x.w
    store(x.v, state, i, 10)


def packed(members, attitude):
    """b, p, pi and the attitude of the fleet, in packets; pi and J in their own units."""
    vehicle = speed.example().vehicle
    p, pi = notation.to_momenta(vehicle.mass_matrix, vehicle.inertia, members.velocity, members.angular_velocity)
    rows = np.concatenate([members.position, p, pi, attitude], axis=1)
    return np.ascontiguousarray(rows.reshape(-1, WIDTH, rows.shape[1]).transpose(0, 2, 1))


def body():
    """The example's constants, shared."""
    vehicle = speed.example().vehicle
    inverse = 1.0 / np.diag(vehicle.mass_matrix)
    one = np.zeros(1, Body.numpy_dtype())
    one["mean"], one["net"] = inverse.mean(), vehicle.mass * 9.8 - vehicle.buoyancy
    vectors = {"J": np.diag(vehicle.inertia), "anisotropy": inverse - inverse.mean()}
    for name, values in (vectors | {"moment": vehicle.buoyancy * vehicle.center_of_buoyancy}).items():
        for axis, value in zip("xyz", values, strict=True):
            one[name][axis] = value
    return wp.array(one, dtype=Body, device="cpu")


def run(quick):
    count, steps = (512, 100) if quick else (4096, 2000)
    members = speed.fleet(count).select(0, count)
    variants = {
        "rows": (kernel_of(Rows, rows_T, rows_D, rows_down, rows_read, rows_write), members.attitude.reshape(count, 9)),
        "quaternion": (
            kernel_of(Unit, unit_T, unit_D, unit_down, unit_read, unit_write),
            notation.quaternion_from_matrix(members.attitude),
        ),
    }
    states, calls = {}, []
    for name, (kernel, attitude) in variants.items():
        states[name] = wp.array(packed(members, attitude), dtype=Lane, device="cpu")
        inputs = [states[name], body(), REAL(0.01), steps]
        calls.append(wp.launch(kernel, count // WIDTH, inputs=inputs, device="cpu", record_cmd=True).launch)
    for call in calls:
        call()
    end = {name: state.numpy() for name, state in states.items()}
    R = end["rows"][:, 9:].transpose(0, 2, 1).reshape(-1, 3, 3)
    q = end["quaternion"][:, 9:].transpose(0, 2, 1).reshape(-1, 4)
    drift = {"rows": np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(), "quaternion": np.abs((q * q).sum(1) - 1).max()}
    apart = np.abs(end["rows"][:, :3] - end["quaternion"][:, :3]).max()
    seconds = interleaved(calls)
    for name, one in zip(variants, seconds, strict=True):
        yield {
            "attitude": name,
            "ns_per_vehicle_step": round(1e9 * one / (count * steps), 2),
            "over_rows": round(one / seconds[0], 2),
            "orthogonality_drift": float(f"{drift[name]:.1e}"),
            "position_difference_m": float(f"{apart:.1e}"),
        }
