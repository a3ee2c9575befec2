# SPDX-License-Identifier: Apache-2.0
"""The NumPy twin of lgvi_kernels: one vehicle, float64, plain rotation matrices, numpy only.

It has the file and function names of the kernels, the paper's symbols, and one function per printed equation. In all files:

x, body, h: the state at the start, inertia and laws, the length of the step [s]; t, times: [s].
b, R, nu, Om: position (3,) [m]; attitude (3, 3), body to inertial axes; velocity (3,) [m/s] and angular velocity (3,)
    [rad/s], body axes.
p, pi: momentum (3,) [N s], angular momentum (3,) [N m s], body axes; origin: the point (3,) [m] of the body, from the
    user's origin (the default), about which they are taken.
a, J: h pi (3,) [N m s2], the right-hand side of equation (24); inertia (3, 3) [kg m2]; F: a rotation (3, 3).
solve: a solver of equation (24); iterations, newtons: its Newton steps, None (default) until round-off. Explicit
    solvers and sub-maps have this argument too, but do not use it.
program: (letter, coefficient) of each sub-map; wrench: (b, R) -> force [N], torque [N m]; rtol, atol: relative and
    absolute tolerance, the latter one number or (15,).
"""
