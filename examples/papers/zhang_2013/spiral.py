# SPDX-License-Identifier: Apache-2.0
"""The Seawing glider's steady spiral, as computed and as published by Zhang et al. (2013).

    python examples/papers/zhang_2013/spiral.py

Its battery is shifted ahead and turned about the hull's axis, and it is 0.3 kg heavy: after the transient it spirals down.
"""

import numpy as np

import lgvi_warp as lw

HULL, HULL_AT, HULL_INERTIA = 54.28, np.array([-0.0814, 0.0, 0.0032]), np.diag([0.60, 15.27, 15.32])
BATTERY, BATTERY_RADIUS, BATTERY_INERTIA = 11.0, 0.014, np.diag([0.02, 0.16, 0.17])
AHEAD, TURNED, HEAVY = 0.4216, np.deg2rad(45.0), 0.3
# Roll, pitch [deg], rate of turn [rad/s], angle of attack, sideslip [deg], speed [m/s].
NAMES = ("roll [deg]", "pitch [deg]", "turn [rad/s]", "attack [deg]", "sideslip [deg]", "speed [m/s]")
PUBLISHED = (-13.703, -35.641, 0.0039, 1.267, -1.283, 0.490)


def hat(r):
    """The matrix of r x."""
    return np.cross(np.eye(3), r)


def scene():
    """The glider with the battery where the paper has it."""
    c, s = np.cos(TURNED), np.sin(TURNED)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    at = np.array([AHEAD, -BATTERY_RADIUS * s, BATTERY_RADIUS * c])
    mass, first = HULL + BATTERY, HULL * HULL_AT + BATTERY * at
    second = (
        HULL_INERTIA
        + turn @ BATTERY_INERTIA @ turn.T
        - HULL * hat(HULL_AT) @ hat(HULL_AT)
        - BATTERY * hat(at) @ hat(at)
    )
    rigid = np.block([[mass * np.eye(3), -hat(first)], [hat(first), second]])
    vehicle = {"rigid_body_mass_matrix": rigid, "center_of_gravity": first / mass}
    ballast = lw.terms.Ballast(command=[-HEAVY / 1025.0])
    return lw.Scene.named("seawing", vehicle=vehicle, terms=[ballast], start={"velocity": [0.4, 0.0, 0.0]})


def main():
    """Run until it is steady, and print it beside what is published."""
    result = lw.solve(scene(), "rk4", h=0.1, t1=2000.0)
    (u, v, w), R = result.velocity[-1, 0], result.attitude[-1, 0]
    speed = np.linalg.norm([u, v, w])
    roll, pitch = np.arctan2(R[2, 1], R[2, 2]), -np.arcsin(R[2, 0])
    turn = R[2] @ result.angular_velocity[-1, 0]
    degrees = np.rad2deg([roll, pitch, np.arctan2(w, u), np.arcsin(v / speed)])
    computed = (degrees[0], degrees[1], turn, degrees[2], degrees[3], speed)
    print(f"{'':16} computed  published")
    for name, value, printed in zip(NAMES, computed, PUBLISHED, strict=True):
        print(f"{name:16} {value:8.4f}  {printed:9.4f}")


if __name__ == "__main__":
    main()
