# SPDX-License-Identifier: Apache-2.0
"""Five scenes whose derivatives are known, by closed forms or long doubles: differences of whole runs beside tangents."""

import numpy as np

import lgvi_warp as lw
from benchmarks.peers.tableaus import TABLEAUS
from lgvi_warp.measuring import speed

MASS, ADDED, GRAVITY = 100.0, 20.0, 9.8
M = MASS + ADDED
HEAVY, QUADRATIC, LINEAR, SPEED, CURRENT, DEPTH = 24.0, 30.0, 12.0, 1.5, 0.3, 2.0
GAINS, PERIOD, T1 = (20.0, 40.0), 0.1, 8.0


def body(heavy, *terms, linear=0.0, quadratic=0.0, **sections):
    """A body with the same mass along all axes and nothing that turns it."""
    vehicle = lw.Vehicle(
        MASS,
        added_mass=[ADDED] * 3,
        inertia=[5.0, 6.0, 7.0],
        buoyancy=MASS * GRAVITY - heavy,
        center_of_buoyancy=[0.0] * 3,
    )
    drag = lw.terms.Drag(linear=[linear] * 3 + [1.0] * 3, quadratic=[quadratic] * 3 + [0.0] * 3)
    return lw.Scene(vehicle, lw.Environment(gravity=GRAVITY), [*terms, drag], **sections)


def fall():
    """With drag: from rest, m v' = F - k v^2, z = m / k ln cosh s with s = t sqrt(F k) / m."""
    F, k = HEAVY, QUADRATIC
    s = T1 * np.sqrt(F * k) / M
    by_force = M / k * np.tanh(s) * s / (2.0 * F)
    by_drag = -M / k**2 * np.log(np.cosh(s)) + M / k * np.tanh(s) * s / (2.0 * k)
    by = {"vehicle.buoyancy": -by_force, "drag.quadratic[2]": by_drag}
    return body(HEAVY, quadratic=k), by, T1, 2


def drift(t1=T1):
    """With a current c: w = u - c, w' = -k / m w^2, x = c t + m / k ln(1 + k / m w t)."""
    w, a = SPEED - CURRENT, QUADRATIC / M
    grown = 1.0 + a * w * t1
    by = {
        "current.velocity[0]": t1 - t1 / grown,
        "drag.quadratic[0]": (w * t1 / (a * grown) - np.log(grown) / a**2) / M,
    }
    current = lw.terms.Current(velocity=[CURRENT, 0.0, 0.0])
    return body(0.0, current, quadratic=QUADRATIC, start=lw.Start(velocity=[SPEED, 0.0, 0.0])), by, t1, 0


def loop():
    """With a controller: feedback of depth and its rate, held from tick to tick, in linear drag: a product of matrices."""
    K = np.zeros((6, 12))
    K[2, [2, 8]] = GAINS
    controller = lw.Controller(
        period=PERIOD,
        guidance=[lw.control.SetPoint(position=[0.0] * 3, heading=0.0)],
        laws=[lw.control.StateFeedback(K=K)],
        allocation=[lw.control.AllocationMatrix(to="control_wrench", matrix=np.eye(6))],
    )
    actuator = lw.terms.ControlWrench(limit=1e3, time_constant=(0.0,) * 6)
    scene = body(0.0, actuator, linear=LINEAR, start=lw.Start([0.0, 0.0, DEPTH]), controller=controller)
    decay = np.exp(-LINEAR * PERIOD / M)
    way = M / LINEAR * (1.0 - decay)
    B = np.array([(PERIOD - way) / LINEAR, (1.0 - decay) / LINEAR])
    A = np.array([[1.0, way], [0.0, decay]]) - np.outer(B, GAINS)
    x, slopes = np.array([DEPTH, 0.0]), np.zeros((2, 2))
    for _ in range(round(T1 / PERIOD)):
        x, slopes = A @ x, A @ slopes - np.outer(B, x)
    return scene, dict(zip(("state_feedback.K[2,2]", "state_feedback.K[2,8]"), slopes[0], strict=True)), T1, 2


def free(t1=10.0):
    """Without a controller, the paper's vehicle: long doubles, and differences of five points."""
    scene = speed.example()
    by = {"vehicle.center_of_buoyancy[2]": 0.0, "start.angular_velocity[0]": 0.0}
    return scene, dict(zip(by, _slopes(scene, t1), strict=True)), t1, 2


def long():
    """A current and drag for 400 s."""
    return drift(400.0)


SCENES = {"controller": loop, "no controller": free, "drag": fall, "current": drift, "long run": long}


def _slopes(scene, t1, h=0.02, increment=1e-5):
    """Derivatives of the depth at the end by height of the centre of buoyancy and by the first rate of turn."""
    start, real = lw.Ensemble(scene, 1).select(0, 1), np.longdouble
    stencil = np.array([1.0, -8.0, 8.0, -1.0], real) / 12.0
    by = np.zeros((8, 2), real)
    by[:4, 0] = by[4:, 1] = increment * np.array([-2.0, -1.0, 1.0, 2.0], real)
    lever = np.tile(np.array(scene.vehicle.center_of_buoyancy, real), (8, 1))
    lever[:, 2] += by[:, 0]
    state = [np.repeat(np.array(x, real), 8, axis=0) for x in (start.position, start.attitude, start.velocity)]
    Om = np.repeat(np.array(start.angular_velocity, real), 8, axis=0)
    Om[:, 0] += by[:, 1]
    ends = _paths(scene.vehicle, lever, [*state, Om], h, round(t1 / h))
    return [float(stencil @ ends[i : i + 4] / increment) for i in (0, 4)]


def _paths(vehicle, lever, y, h, steps):
    """Depths at the end, by DOP853's weights."""
    mass = np.diag(vehicle.mass_matrix).astype(np.longdouble)
    inertia = np.diag(vehicle.inertia).astype(np.longdouble)
    net, moment = np.longdouble(vehicle.mass) * GRAVITY - np.longdouble(vehicle.buoyancy), vehicle.buoyancy * lever
    rows, b = TABLEAUS["dop853"]

    def rates(y):
        _, R, nu, Om = y
        z = R[:, 2, :]
        turns = np.stack([np.cross(R[:, i, :], Om) for i in range(3)], axis=1)
        forces, torques = np.cross(mass * nu, Om) + net * z, np.cross(inertia * Om, Om) + np.cross(mass * nu, nu)
        return [np.einsum("nij,nj->ni", R, nu), turns, forces / mass, (torques - np.cross(moment, z)) / inertia]

    def moved(y, weights, slopes):
        return [x + h * sum(w * k[i] for w, k in zip(weights, slopes, strict=True)) for i, x in enumerate(y)]

    for _ in range(steps):
        slopes = [rates(y)]
        for row in rows:
            slopes.append(rates(moved(y, row, slopes)))
        y = moved(y, b, slopes)
    return y[0][:, 2]
