# SPDX-License-Identifier: Apache-2.0
"""Loops that turn a body about one axis or three, as scenes and written by hand."""

import numpy as np

import lgvi_warp as lw
from lgvi_warp.control import AllocationMatrix, HeadingPID, PosePID, SetPoint
from lgvi_warp.distributions import Choice, Uniform
from lgvi_warp.terms import ControlWrench

J, PERIOD, H, EVERY = 11.0, 0.1, 0.02, 5
LATE = [0.0, 0.06, 0.12]


def scene(law, inertia, delay=0.06, guidance=()):
    controller = lw.Controller(
        period=PERIOD, delay=delay, guidance=guidance or [SetPoint(heading=0.0)], laws=[law],
        allocation=[AllocationMatrix(to="control_wrench", matrix=np.eye(6))])  # fmt: skip
    vehicle = lw.Vehicle(
        20.0, inertia=inertia, added_mass=(0.0, 0.0, 0.0), buoyancy=200.0, center_of_buoyancy=(0.0, 0.0, 0.0)
    )
    return lw.Scene(vehicle, lw.Environment(10.0), [ControlWrench()], controller=controller)


def opened(kp, ki, kd, inertia, steps):
    """x' = A x + B w, w = C x: angles, rates, integrals of the errors, and the torques that are on their way."""
    inverse, unity = np.linalg.inv(np.atleast_2d(inertia)), np.eye(len(np.atleast_2d(inertia)))
    r, (q, s) = len(unity), divmod(steps, EVERY)
    late = s * H

    def push(t):
        return np.concatenate([0.5 * t**2 * inverse, t * inverse])

    n = 3 * r + (q + 2) * r
    A = np.zeros((n, n))
    A[: 2 * r, : 2 * r] = np.block([[unity, PERIOD * unity], [0.0 * unity, unity]])
    acting = slice(3 * r + q * r, 4 * r + q * r)
    older = slice(acting.stop, acting.stop + r)
    A[: 2 * r, acting] = push(PERIOD - late)
    A[: 2 * r, older] = push(PERIOD) - push(PERIOD - late)
    A[2 * r : 3 * r, :r], A[2 * r : 3 * r, 2 * r : 3 * r] = -PERIOD * unity, unity
    A[4 * r :, 3 * r : -r] = np.eye((q + 1) * r)
    B = np.zeros((n, r))
    B[3 * r : 4 * r] = unity
    C = -np.diag(kp) @ A[:r] - np.diag(kd) @ A[r : 2 * r] + np.diag(ki) @ A[2 * r : 3 * r]
    return A, B, C


def numbers(fleet, n):
    return {name: np.broadcast_to(v, (n, *v.shape[1:])) for name, v in fleet.parameters(0, n).items()}


def heading_loops(members):
    """Heading loops whose gains and delays vary."""
    vary = {"heading_pid.kp": Uniform(4.0, 8.0), "heading_pid.kd": Uniform(7.0, 12.0), "heading_pid.ki": Uniform(0.4, 1.2),
            "controller.delay": Choice(LATE)}  # fmt: skip
    return lw.Ensemble(scene(HeadingPID(kp=6.0, ki=0.8, kd=9.0), (5.0, 8.0, J)), members, 7, vary)


def loop_of(fleet, i):
    """Open loop of member i."""
    p = numbers(fleet, fleet.members)
    gains = [p[f"heading_pid.{k}"][i : i + 1] for k in ("kp", "ki", "kd")]
    return opened(*gains, J, round(p["controller.delay"][i] / H))


INERTIAS = [
    [[5.0, 2.0, 0.0], [2.0, 8.0, 0.0], [0.0, 0.0, 11.0]],
    [[5.0, 2.5, 1.0], [2.5, 8.0, 3.0], [1.0, 3.0, 11.0]],
    [[5.0, -3.0, 2.0], [-3.0, 9.0, 1.0], [2.0, 1.0, 7.0]],
]
# kr, ki_r, kw.
GAINS = np.array([4.0, 7.0, 9.0]), np.array([0.3, 0.5, 0.4]), np.array([8.0, 11.0, 13.0])


def turning(inertia, delay):
    """A body whose attitude is kept, about three axes that are coupled."""
    law = PosePID(kp=[0.0] * 3, kd=[0.0] * 3, **dict(zip(("kr", "ki_r", "kw"), GAINS, strict=True)))
    return scene(law, inertia, delay, [SetPoint(position=[0.0, 0.0, 0.0], heading=0.0)])
