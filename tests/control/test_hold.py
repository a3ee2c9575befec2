# SPDX-License-Identifier: Apache-2.0
"""The hold of order zero: commands are constant over a period, in every method; loops converge with the method's order."""

import numpy as np
import pytest

import lgvi_warp as lw
from tests.control.test_loop import DEPTH, HEADING, LAG, LIMIT, MATRIX, STATE, H, scene

NONE = (0.0,) * 6


def ends(result):
    """Position, attitude and velocities at the end."""
    return np.concatenate(
        [getattr(result, name)[-1, 0].ravel() for name in ("position", "attitude", "velocity", "angular_velocity")]
    )


@pytest.mark.slow
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("method", ["psi_s", "psi_x", "psi_w", "kl6(psi_s)", "rk8", "rk4"])
def test_a_period_is_its_steps_under_the_held_wrench(method, dtype):
    steps = 5
    plain = scene(NONE)
    first = lw.solve(
        plain, method, h=H, t1=steps * H, dtype=dtype, save=lw.SaveAt(every=H, fields=("position", "command"))
    )
    command = first.command[0, 0]
    assert np.array_equal(first.command[:steps, 0], np.repeat(command[None], steps, axis=0))
    held = lw.terms.Wrench(name="held", force=command[:3], torque=command[3:])
    others = [term for term in plain.terms if term.type != "control_wrench"]
    bare = lw.Scene(plain.vehicle, plain.environment, [*others, held], plain.start)
    looped = lw.solve(plain, method, h=H, t1=steps * H, dtype=dtype)
    free = lw.solve(bare, method, h=H, t1=steps * H, dtype=dtype)
    # Five steps: the two kernels differ by round-off alone.
    assert np.abs(ends(looped) - ends(free)).max() < {"float64": 1e-13, "float32": 5e-6}[dtype]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "order", "parts"), [("psi_x", 2, 8), ("psi_s", 2, 8), ("psi_w", 2, 8), ("rk4", 4, 4)]
)
def test_closed_loops_converge_with_their_order(method, order, parts):
    period = 5 * H

    def end(name, h):
        return ends(lw.solve(scene(LAG), name, h=h, t1=10.0, save=lw.SaveAt(every=10.0)))

    exact = end("rk8", period / 32)
    # Longer steps may take another side of a limit of an integral: that is no error of a step.
    errors = np.array([np.abs(end(method, h) - exact).max() for h in period / (parts * np.array([1, 2, 4]))])
    ratios = errors[:-1] / errors[1:]
    # The next order of the error is still seen at these steps; a wrong order would be 1 off.
    assert np.all(np.abs(np.log2(ratios) - order) < 0.5), (errors, ratios)


@pytest.mark.slow
def test_the_loop_meets_an_independent_one():
    """The same loop by SciPy's integrator on Newton and Euler's equations, period by period."""
    from scipy.integrate import solve_ivp
    from scipy.spatial.transform import Rotation

    gravity, mass, weight, center = 9.8, 20.0, 20.0 * 9.8, np.array((0.01, 0.005, -0.02))
    linear, quadratic = np.array((3.0, 4.0, 5.0, 0.3, 0.4, 0.5)), np.array((10.0, 30.0, 40.0, 1.0, 2.0, 3.0))
    from lgvi_warp.reference.control import Integral, heading_error

    plain = scene(NONE)
    inertia6 = np.diag(np.concatenate([plain.vehicle.mass_matrix.diagonal(), plain.vehicle.inertia.diagonal()]))

    def rates(t, y, u):
        R = Rotation.from_quat(y[3:7]).as_matrix()
        nu, Om = y[7:10], y[10:13]
        twist = np.concatenate([nu, Om])
        momenta = inertia6 @ twist
        force = -linear * twist - quadratic * np.abs(twist) * twist + u + np.array((15.0, 0, 0, 0, 0, 0))
        force[3:] += np.cross(center, -weight * R[2])
        force[:3] += (mass * gravity - weight) * R[2]
        coriolis = np.concatenate([np.cross(Om, momenta[:3]), np.cross(Om, momenta[3:]) + np.cross(nu, momenta[:3])])
        x, yq, z, w = y[3:7]
        quaternion = 0.5 * np.array([
            w * Om[0] + yq * Om[2] - z * Om[1], w * Om[1] + z * Om[0] - x * Om[2],
            w * Om[2] + x * Om[1] - yq * Om[0], -x * Om[0] - yq * Om[1] - z * Om[2],
        ])  # fmt: skip
        return np.concatenate([R @ nu, quaternion, np.linalg.solve(inertia6, force - coriolis)])

    y = np.concatenate([STATE["position"], (0, 0, 0, 1), STATE["velocity"], STATE["angular_velocity"]]).astype(float)
    period, heading_I, depth_I, pitch_I, beyond, unmet = 5 * H, Integral(), Integral(), Integral(), 0.0, np.zeros(6)
    inverse = np.linalg.pinv(MATRIX)
    Rd = Rotation.from_euler("z", 2.5).as_matrix()
    for _ in range(100):
        R = Rotation.from_quat(y[3:7]).as_matrix()
        e = 6.0 - y[2]
        wanted = -(DEPTH["kp"] * e + DEPTH["ki"] * depth_I.at_tick(period, 2.0, -beyond, True))
        theta_d = np.clip(wanted, -DEPTH["pitch_limit"], DEPTH["pitch_limit"])
        beyond, depth_I.error = wanted - theta_d, e
        e_theta = theta_d - np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
        w = np.zeros(6)
        w[4] = (
            DEPTH["kp_pitch"] * e_theta
            + DEPTH["ki_pitch"] * pitch_I.at_tick(period, 1.0, unmet[4], True)
            - DEPTH["kd_pitch"] * y[11]
        )
        pitch_I.error = e_theta
        e_psi = heading_error(Rd, R)
        w[5] = (
            HEADING["kp"] * e_psi
            + HEADING["ki"] * heading_I.at_tick(period, 0.8, unmet[5], True)
            - HEADING["kd"] * y[12]
        )
        heading_I.error = e_psi
        command = np.clip(MATRIX @ w, np.negative(LIMIT), LIMIT)
        unmet = inverse @ (MATRIX @ w - command)
        y = solve_ivp(rates, (0.0, period), y, "DOP853", args=(command,), rtol=1e-12, atol=1e-13).y[:, -1]
        y[3:7] /= np.linalg.norm(y[3:7])
    result = lw.solve(plain, "rk8", h=H, t1=10.0, save=lw.SaveAt(every=10.0))
    # After some ten metres: ten digits of the integrator, and the method's own error at this step.
    assert np.abs(result.position[-1, 0] - y[:3]).max() < 1e-8
    assert np.abs(result.attitude[-1, 0] - Rotation.from_quat(y[3:7]).as_matrix()).max() < 1e-8
