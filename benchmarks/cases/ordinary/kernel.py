# SPDX-License-Identifier: Apache-2.0
"""The peer: an ordinary Warp kernel, one vehicle a thread, as a competent Warp user would write it.

wp.mat33 and wp.vec3 throughout, equation (24) by the paper's Newton iteration on the exponential map to a tolerance,
Warp's default module options. It makes the paper's Psi, or psi_s, step by step inside the kernel.
"""

import functools

import numpy as np
import warp as wp


@functools.cache
def make_ordinary(real, method):
    """The kernel of "psi" or "psi_s" in wp.float64 or wp.float32."""
    mat33, vec3 = wp.types.matrix((3, 3), real), wp.types.vector(3, real)
    tolerance = 1e-14 if real == wp.float64 else 1e-6

    @wp.func
    def equation_24(a: vec3, J: mat33, J_inverse: mat33):
        """F = exp(hat(f)), sin|f|/|f| J f + (1 - cos|f|)/|f|^2 f x J f = a, by Newton-Raphson (section III-G)."""
        f = J_inverse * a
        alpha = real(1.0)
        beta = real(0.5)
        for _ in range(20):
            n2 = wp.dot(f, f)
            n = wp.sqrt(n2)
            dalpha = real(-1.0 / 3.0) + n2 * real(1.0 / 30.0)
            dbeta = real(-1.0 / 12.0) + n2 * real(1.0 / 180.0)
            alpha = real(1.0) - n2 * real(1.0 / 6.0)
            beta = real(0.5) - n2 * real(1.0 / 24.0)
            if n > real(1e-3):
                s = wp.sin(n)
                c = wp.cos(n)
                alpha = s / n
                beta = (real(1.0) - c) / n2
                dalpha = (c - alpha) / n2
                dbeta = (alpha - real(2.0) * beta) / n2
            Jf = J * f
            fJf = wp.cross(f, Jf)
            g = alpha * Jf + beta * fJf - a
            if wp.dot(g, g) <= real(wp.static(tolerance * tolerance)) * wp.dot(a, a):
                break
            dG = alpha * J + dalpha * wp.outer(Jf, f) + beta * (wp.skew(f) * J - wp.skew(Jf)) + dbeta * wp.outer(fJf, f)
            f = f - wp.inverse(dG) * g
        hat = wp.skew(f)
        return wp.identity(n=3, dtype=real) + alpha * hat + beta * hat * hat

    @wp.kernel(module="unique")
    def psi(
        b: wp.array(dtype=vec3),
        R: wp.array(dtype=mat33),
        nu: wp.array(dtype=vec3),
        Om: wp.array(dtype=vec3),
        M: mat33,
        M_inverse: mat33,
        J: mat33,
        J_inverse: mat33,
        net: real,
        moment: vec3,
        h: real,
        steps: int,
    ):
        i = wp.tid()
        # A product makes a copy; b[i] alone would be a reference into the array.
        one = real(1.0)
        x, A, v, w = one * b[i], one * R[i], one * nu[i], one * Om[i]
        e3 = vec3(real(0.0), real(0.0), real(1.0))
        half = real(0.5) * h
        for _ in range(steps):
            # Phi_{h/2}: (10)-(14)
            F = equation_24(half * (J * w), J, J_inverse)
            x = x + half * (A * v)
            A = A * F
            z = wp.transpose(A) * e3
            p = wp.transpose(F) * (M * v) + half * (net * z)
            v = M_inverse * p
            q = wp.transpose(F) * (J * w) + half * (wp.cross(p, v) - wp.cross(moment, z))
            # Phi*_{h/2}: (19)-(23)
            q = q + half * (wp.cross(p, v) - wp.cross(moment, z))
            G = equation_24(half * q, J, J_inverse)
            v = M_inverse * (wp.transpose(G) * (p + half * (net * z)))
            w = J_inverse * (wp.transpose(G) * q)
            A = A * G
            x = x + half * (A * v)
        b[i] = x
        R[i] = A
        nu[i] = v
        Om[i] = w

    @wp.kernel(module="unique")
    def psi_s(
        b: wp.array(dtype=vec3),
        R: wp.array(dtype=mat33),
        nu: wp.array(dtype=vec3),
        Om: wp.array(dtype=vec3),
        M: mat33,
        M_inverse: mat33,
        J: mat33,
        J_inverse: mat33,
        net: real,
        moment: vec3,
        h: real,
        steps: int,
    ):
        i = wp.tid()
        one = real(1.0)
        x, A = one * b[i], one * R[i]
        p = M * nu[i]
        q = J * Om[i]
        e3 = vec3(real(0.0), real(0.0), real(1.0))
        half = real(0.5) * h
        for _ in range(steps):
            v = M_inverse * p
            x = x + half * (A * v)
            q = q + half * wp.cross(p, v)
            F = equation_24(half * q, J, J_inverse)
            A = A * F
            z = wp.transpose(A) * e3
            p = wp.transpose(F) * p + h * (net * z)
            q = wp.transpose(F) * q - h * wp.cross(moment, z)
            F = equation_24(half * q, J, J_inverse)
            A = A * F
            p = wp.transpose(F) * p
            q = wp.transpose(F) * q
            v = M_inverse * p
            x = x + half * (A * v)
            q = q + half * wp.cross(p, v)
        b[i] = x
        R[i] = A
        nu[i] = M_inverse * p
        Om[i] = J_inverse * q

    return {"psi": psi, "psi_s": psi_s}[method]


def command(states, M, J, net, moment, h, steps, method="psi", dtype="float64"):
    """(arrays, call): the fleet's b, R, nu, Om, shapes (n, 3), (n, 3, 3), (n, 3), (n, 3), and a call that advances them."""
    real = wp.float64 if dtype == "float64" else wp.float32
    mat33, vec3 = wp.types.matrix((3, 3), real), wp.types.vector(3, real)
    types = (vec3, mat33, vec3, vec3)
    arrays = [
        wp.array(np.ascontiguousarray(x, dtype), dtype=t, device="cpu") for x, t in zip(states, types, strict=True)
    ]
    constants = [mat33(x) for x in (M, np.linalg.inv(M), J, np.linalg.inv(J))]
    inputs = [*arrays, *constants, real(net), vec3(*moment), real(h), steps]
    launch = wp.launch(make_ordinary(real, method), len(states[0]), inputs=inputs, device="cpu", record_cmd=True)
    return arrays, launch.launch
