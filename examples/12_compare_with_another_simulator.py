# SPDX-License-Identifier: Apache-2.0
"""Compare with another simulator: the same vehicle in SciPy, by independently written equations.

DOP853 solves the Newton-Euler equations of a body with added mass, weight, buoyancy and drag. Its steps are at most
10 ms: its error estimate misses the kinks of |v| v, and with longer steps it is 3.5e-8 m off. The difference of the two
programs decreases with the step at the order of the method. So it is the error of the step, not a difference of the
models. Put your simulator in the place of `other`.
"""

import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import lgvi_warp as lw

MASS, BUOYANCY, GRAVITY = 50.0, 488.0, 9.81  # kg, N, m/s2
ADDED, INERTIA = np.array([5.0, 40.0, 40.0]), np.array([1.0, 9.0, 9.0])  # kg, kg m2
CENTER = np.array([0.0, 0.0, -0.03])  # m: of buoyancy
LINEAR, QUADRATIC = np.array([4.0, 30.0, 30.0, 2.0, 8.0, 8.0]), np.array([6.0, 90.0, 90.0, 0.5, 20.0, 20.0])
START = {"position": [0.0, 0.0, 20.0], "velocity": [1.2, 0.1, -0.1], "angular_velocity": [0.3, 0.1, 0.4]}
T1, STEPS = 20.0, (0.2, 0.1, 0.05, 0.025)  # s

scene = lw.Scene(
    lw.Vehicle(MASS, inertia=INERTIA, added_mass=ADDED, buoyancy=BUOYANCY, center_of_buoyancy=CENTER),
    environment=lw.Environment(gravity=GRAVITY),
    start=lw.Start(**START),
    terms=[lw.terms.Drag(linear=LINEAR, quadratic=QUADRATIC)],
)


def rates(t, y):
    """Derivatives of position, quaternion (x y z w), velocity and angular velocity in body axes."""
    attitude = Rotation.from_quat(y[3:7]).as_matrix()
    v, w = y[7:10], y[10:13]
    down = attitude.T @ np.array([0.0, 0.0, 1.0])
    speeds = np.concatenate([v, w])
    drag = (LINEAR + QUADRATIC * np.abs(speeds)) * speeds
    p, j = (MASS + ADDED) * v, INERTIA * w
    force = np.cross(p, w) + (MASS * GRAVITY - BUOYANCY) * down - drag[:3]
    torque = np.cross(j, w) + np.cross(p, v) - BUOYANCY * np.cross(CENTER, down) - drag[3:]
    turn = 0.5 * np.concatenate([y[6] * w + np.cross(y[3:6], w), [-(y[3:6] @ w)]])
    return np.concatenate([attitude @ v, turn, force / (MASS + ADDED), torque / INERTIA])


def other():
    """Position (3,) [m] at the end by SciPy."""
    y = np.concatenate([START["position"], [0.0, 0.0, 0.0, 1.0], START["velocity"], START["angular_velocity"]])
    return solve_ivp(rates, (0.0, T1), y, "DOP853", max_step=0.01, rtol=1e-12, atol=1e-12).y[:3, -1]


if __name__ == "__main__":
    reference, figure = other(), Figure(figsize=(8.0, 5.0), layout="constrained")
    axes = figure.subplots()
    for method, look in {"psi_s": "o-", "rk4": "s--", "rk5": "^-."}.items():
        ends = [lw.solve(scene, method, h=h, t1=T1).position[-1, 0] for h in STEPS]
        errors = np.linalg.norm(np.array(ends) - reference, axis=1)
        order = np.log2(errors[:-1] / errors[1:])
        print(f"{method}: {errors[-1]:.1e} m apart with {STEPS[-1]} s; orders {', '.join(f'{p:.2f}' for p in order)}")
        axes.loglog(STEPS, errors, look, label=method)
    axes.set(
        xlabel="step [s], logarithmic", ylabel="difference of position after 20 s [m]", title="lgvi_warp against SciPy"
    )
    axes.set_xticks(STEPS, STEPS)
    axes.minorticks_off()
    axes.grid(True, alpha=0.3)
    axes.legend()
    figure.savefig("12_compare_with_another_simulator.png", dpi=100)
    print("12_compare_with_another_simulator.png")
