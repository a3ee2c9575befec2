# SPDX-License-Identifier: Apache-2.0
"""A rescue submarine by the printed coefficients of its standard equations: how fast must it go for its pitch to settle?

    python examples/laws/rescue_vehicle.py

It is pushed off its trim by 5 degrees of pitch, at 200 speeds at once. Slow, it swings like a pendulum, for weight and
buoyancy right it and little brakes; fast, the water brakes the swing.
"""

import sys
from pathlib import Path

import numpy as np

import lgvi_warp as lw

# Deep submergence rescue vehicle of 5 m (Healey 1992, lecture notes, Naval Postgraduate School), as MSS prints it.
LENGTH, RHO, GRAVITY = 5.0, 1025.0, 9.81
MASS, INERTIA, RIGHTING = 0.036391, 0.001925, 0.156276  # dimensionless; the last in m2/s2
Z_WDOT, M_QDOT = -0.031545, -0.001573
PRINTED = {"Z'w": -0.043938, "Z'q": -0.017455, "M'w": 0.011175, "M'q": -0.01131}
PUSHED = 5.0  # deg
MEMBERS, SLOW, FAST = 200, 0.2, 6.0  # m/s

unit = 0.5 * RHO * LENGTH**3
mass, below = unit * MASS, RIGHTING / (MASS * GRAVITY)
added = np.diag([0.0, 0.0, -unit * Z_WDOT, 0.0, -unit * LENGTH**2 * M_QDOT, 0.0])
submarine = lw.Vehicle(
    rigid_body_mass_matrix=np.diag([mass] * 3 + [unit * LENGTH**2 * INERTIA] * 3),
    added_mass_matrix=added,
    weight=mass * GRAVITY,
    buoyancy=mass * GRAVITY,
    center_of_buoyancy=[0.0, 0.0, -below],
)
hull = lw.terms.QuadraticForm.gertler_hagen(PRINTED, rho=RHO, length=LENGTH, added_mass=added)
start = lw.Start(euler_deg=[0.0, PUSHED, 0.0], position=[0.0, 0.0, 100.0], velocity=[1.0, 0.0, 0.0])
scene = lw.Scene(submarine, lw.Environment(GRAVITY, water_density=RHO), terms=[hull], start=start)


def run():
    """Time [s], speeds [m/s] and pitch [deg] of the members."""
    speeds = np.linspace(SLOW, FAST, MEMBERS)
    attitude = np.tile(lw.notation.matrix_from_rotation_vector(np.deg2rad([[0.0, PUSHED, 0.0]])), (MEMBERS, 1, 1))
    still = np.zeros((MEMBERS, 3))
    place = np.tile([0.0, 0.0, 100.0], (MEMBERS, 1))
    fleet = lw.Ensemble.from_states(scene, place, attitude, speeds[:, None] * [1.0, 0.0, 0.0], still)
    result = lw.solve(fleet, "rk4", h=0.05, t1=60.0, save=lw.SaveAt(every=0.2, fields=("attitude",)))
    return result.time, speeds, -np.rad2deg(np.arcsin(result.attitude[:, :, 2, 0]))


def plot(time, speeds, pitch, path):
    """Pitch over time at some speeds, and when it stays within a tenth of the push, at all of them."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2)
    for speed, color, style in ((0.5, "#0072B2", "-"), (1.5, "#009E73", "--"), (4.0, "#D55E00", "-.")):
        i = np.abs(speeds - speed).argmin()
        left.plot(time, pitch[:, i], style, color=color, label=f"{speeds[i]:.1f} m/s")
    left.axhline(0.0, color="0.7", linewidth=0.8)
    left.set(xlabel="time [s]", ylabel="pitch [deg]", xlim=(0.0, 30.0), title="Slow it swings, fast it settles")
    left.legend(title="speed at first")
    right.plot(speeds, settled(time, pitch), color="0.2")
    right.set(xlabel="speed at first [m/s]", ylabel="pitch stays within 0.5 deg after [s]", xlim=(0.0, FAST), ylim=(0.0, None),
              title="Above 1.3 m/s within 6 s")  # fmt: skip
    figure.savefig(path, dpi=100)
    return path


def settled(time, pitch):
    """The last time [s] at which the pitch is beyond a tenth of the push."""
    beyond = np.abs(pitch) > PUSHED / 10.0
    return time[len(time) - 1 - np.argmax(beyond[::-1], axis=0)]


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/rescue_vehicle.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    time, speeds, pitch = run()
    for speed in (0.5, 1.5, 4.0):
        i = np.abs(speeds - speed).argmin()
        print(f"{speeds[i]:.1f} m/s: within 0.5 deg after {settled(time, pitch)[i]:.0f} s")
    print(plot(time, speeds, pitch, target))
