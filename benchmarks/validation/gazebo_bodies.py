# SPDX-License-Identifier: Apache-2.0
"""Bodies of the test suite of Gazebo: three shaken bodies with added mass, and three that rise or sink without drag."""

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import lgvi_warp as lw
from benchmarks.pages import ROOT
from benchmarks.validated import COMPUTED, PUBLISHED, Content, Row, curve

TITLE = "Gazebo: bodies that are shaken, rise and sink"
AGAINST = "published code"
KNOWN = "final states in the test suite of gz-sim, with its tolerances"
PICTURE = (
    "Velocities of three shaken bodies with added mass, by this package and by SciPy, and their final states in Gazebo"
)
HEADLINE = "body 1: rate about z"
SCENES = ("examples/validation/gazebo_bodies_shaken.toml", "examples/validation/gazebo_bodies_rising.toml")
# test/worlds/added_mass_ellipsoids.sdf: rigid body, added mass of body 1; that of the others is a tenth and ten times of it.
MASS, INERTIA = 1073.3774899765126, np.array([107.33774899765126, 268.34437249412815, 268.34437249412815])
ADDED = np.array([236.14304779483277, 901.6370915802705, 901.6370915802705, 0.0, 64.40264939859075, 64.40264939859075])
SHARES = {"body 1": 1.0, "body 2": 0.1, "body 3": 10.0}
# test/integration/added_mass.cc: force and torque along (1, 1, 0), in axes fixed in space.
ALONG, FORCE, TORQUE, FORCE_RATE, TORQUE_RATE = np.array([1.0, 1.0, 0.0]), 2000.0, 200.0, 3.0 * np.pi, 2.0 * np.pi
# Position [m], angle [rad], velocity [m/s] and angular velocity [rad/s] after 1 s, in axes fixed in space; their tolerances.
STATES = {
    "body 1": ((0.1615036362557803, 0.10710173528687592), 0.31351100787675423, (0.32087488227940963, 0.212772641112832),
               -0.052564274312245286),
    "body 2": ((0.19339397146633158, 0.18238590690754014), 0.3185857744101227, (0.386607475883442, 0.36477533916100213),
               -0.012889587224151892),
    "body 3": ((0.0616809222579082, 0.020951194425796703), 0.2990323477528498, (0.12296544056644206, 0.04157265120194949),
               -0.014274584996716126),
}  # fmt: skip
PLACE_TO, ANGLE_TO, SPEED_TO, RATE_TO = 1e-3, 1e-5, 2e-5, 1e-4
KNOTS, STEP = 101, 0.005
# test/worlds/buoyancy.sdf.in and test/integration/buoyancy.cc: mass [kg], volume [m3], height after 1000 steps of 1 ms [m].
BLADES = 4.0 * 0.5 * 0.154178 * 0.05455
HULL = np.pi * 0.3**2 * 2.6
RISING = {
    "sinking submarine": (1102.6990214100174 + 25.2312297, HULL + BLADES, -1.64),
    "buoyant submarine": (367.5663404700058 + 8.410409900000001, HULL + BLADES, 4.90),
    "duck": (39.0, 1.40186, 171.4),
}
HEIGHT_TO, GAZEBO_STEP, GRAVITY, DENSITY = 1e-2, 1e-3, 9.8, 1000.0
FINE = 1e-4  # s: the step of order 1 that explains the printed rates


def independent(body: str) -> Any:
    """Solution by SciPy from rest, as a function of time: position, quaternion, and velocities in body axes."""

    def change(t: float, y: Any) -> Any:
        R, (nu, spin) = Rotation.from_quat(y[3:7]).as_matrix(), np.split(y[7:], 2)
        turn = 0.5 * np.append(y[6] * spin + np.cross(y[3:6], spin), -y[3:6] @ spin)
        return np.concatenate([R @ nu, turn, *rates(body, t, R, nu, spin)])

    start = np.zeros(13)
    start[6] = 1.0
    return solve_ivp(change, (0.0, 1.0), start, "DOP853", rtol=1e-12, atol=1e-14, dense_output=True).sol


def wrench(t: float) -> tuple[Any, Any]:
    """Force [N] and torque [N m], in axes fixed in space."""
    return FORCE * np.sin(FORCE_RATE * t) * ALONG, TORQUE * np.sin(TORQUE_RATE * t) * ALONG


def rates(body: str, t: float, R: Any, nu: Any, spin: Any) -> tuple[Any, Any]:
    """Rates of both velocities in body axes: Kirchhoff's equations."""
    mass, inertia = MASS + SHARES[body] * ADDED[:3], INERTIA + SHARES[body] * ADDED[3:]
    force, torque = wrench(t)
    push = R.T @ force - np.cross(spin, mass * nu)
    return push / mass, (R.T @ torque - np.cross(spin, inertia * spin) - np.cross(nu, mass * nu)) / inertia


def euler(body: str) -> float:
    """Rate about z after 1 s [rad/s], computed by Euler steps of 0.1 ms."""
    R, nu, spin = np.eye(3), np.zeros(3), np.zeros(3)
    for i in range(round(1.0 / FINE)):
        push, twist = rates(body, i * FINE, R, nu, spin)
        nu, spin = nu + FINE * push, spin + FINE * twist
        R = R @ Rotation.from_rotvec(FINE * spin).as_matrix()
    return float((R @ spin)[2])


def tables(body: str) -> dict[str, Any]:
    """Scene from the printed numbers. The wrench in body axes is computed with the attitude from SciPy.

    It is linear between the times; a least-squares fit gives it the impulse of the exact curve.
    """
    solution, times = independent(body), np.linspace(0.0, 1.0, KNOTS)
    places, weights = np.polynomial.legendre.leggauss(4)
    gap = times[1]
    t = (times[:-1, None] + 0.5 * gap * (1.0 + places)).ravel()
    turns = Rotation.from_quat(solution(t)[3:7].T).inv()
    curves = np.hstack([turns.apply(np.array([wrench(s)[part] for s in t])) for part in (0, 1)])
    hats = np.maximum(0.0, 1.0 - np.abs(t[:, None] - times) / gap)
    weighted = hats.T * np.tile(0.5 * gap * weights, KNOTS - 1)
    values = np.linalg.solve(weighted @ hats, weighted @ curves)
    added = SHARES[body] * ADDED
    return {
        "vehicle": {
            "rigid_body_mass_matrix": np.diag([*[MASS] * 3, *INERTIA]).tolist(),
            "added_mass_matrix": np.diag(added).tolist(),
            "weight": 0.0,
            "buoyancy": 0.0,
            "center_of_gravity": [0.0, 0.0, 0.0],
            "center_of_buoyancy": [0.0, 0.0, 0.0],
            "shape": {"length": 2.0, "diameter": 1.0},
        },
        "environment": {"gravity": GRAVITY, "water_density": 1025.0},
        "terms": [
            {
                "type": "wrench_schedule",
                "times": times.round(9).tolist(),
                "force": values[:, :3].round(6).tolist(),
                "torque": values[:, 3:].round(6).tolist(),
            }
        ],
        "run": {"method": "rk4", "step": STEP, "duration": 1.0, "save_every": 0.01},
    }


def shaken(body: str) -> lw.Scene:
    """Scene of a body; body 1 is the scene file itself."""
    return lw.Scene.load(ROOT / SCENES[0]) if body == "body 1" else lw.Scene.from_dict(tables(body))


def heights(scene: lw.Scene) -> dict[str, tuple[float, float]]:
    """Height [m] of each rising body after 1 s, exact and by Gazebo's steps, which move with the new velocity."""
    found = {}
    for name, (mass, volume, _) in RISING.items():
        vehicle = lw.Vehicle(
            mass, inertia=scene.vehicle.inertia, added_mass=(0.0, 0.0, 0.0), buoyancy=DENSITY * volume * GRAVITY
        )
        result = lw.solve(lw.Scene(vehicle, scene.environment, start=scene.start, run=scene.run))
        height = scene.start.position[2] - result.position[-1, 0, 2]
        found[name] = height, height - 0.5 * GAZEBO_STEP * result.velocity[-1, 0, 2]
    return found


def measured() -> Content:
    """Run the three shaken bodies, and the three that rise or sink."""
    rows, curves = [], {}
    for body, (place, angle, speed, rate) in STATES.items():
        result = lw.solve(shaken(body))
        R, t = result.attitude[:, 0], result.time
        velocity, spin = (
            np.einsum("tij,tj->ti", R, values[:, 0]) for values in (result.velocity, result.angular_velocity)
        )
        turned = np.arccos(0.5 * (np.trace(R[-1]) - 1.0))
        rows += [
            Row(f"{body}: way along x", "m", place[0], PLACE_TO, result.position[-1, 0, 0]),
            Row(f"{body}: way along y", "m", place[1], PLACE_TO, result.position[-1, 0, 1]),
            Row(f"{body}: angle of the attitude", "rad", angle, ANGLE_TO, turned),
            Row(f"{body}: speed along x", "m/s", speed[0], SPEED_TO, velocity[-1, 0]),
            Row(f"{body}: speed along y", "m/s", speed[1], SPEED_TO, velocity[-1, 1]),
            Row(f"{body}: rate about z", "rad/s", rate, RATE_TO, spin[-1, 2]),
        ]
        y = independent(body)(t)
        step = euler(body) - Rotation.from_quat(y[3:7, -1]).apply(y[10:, -1])[2]
        rows.append(
            Row(f"{body}: rate about z, with the error of a step of 0.1 ms", "rad/s", rate, RATE_TO, spin[-1, 2] + step)
        )
        exact = np.einsum("tij,jt->it", Rotation.from_quat(y[3:7].T).as_matrix(), y[7:10])
        for i, axis in enumerate("xy"):
            curves[f"{body}, {axis}"] = curve(t, velocity[:, i])
            curves[f"{body}, {axis}, SciPy"] = curve(t, exact[i], 26)
        apart = np.linalg.norm(result.position[:, 0].T - y[:3], axis=0).max()
        rows.append(Row(f"{body}: largest distance from SciPy's path", "m", 0.0, None, apart))
    both = heights(lw.Scene.load(ROOT / SCENES[1]))
    rows += [Row(f"{name}: height", "m", RISING[name][2], HEIGHT_TO, height) for name, (height, _) in both.items()]
    rows += [
        Row(f"{name}: height, by Gazebo's step", "m", RISING[name][2], HEIGHT_TO, height)
        for name, (_, height) in both.items()
    ]
    return Content(rows, curves)


def draw(content: Content, figure: Any) -> None:
    """Velocities along both axes over time, with SciPy's solution and the printed final states."""
    rows = {row.what: row for row in content.rows}
    for axes, axis in zip(figure.subplots(1, 2), "xy", strict=True):
        for body, style in zip(STATES, ("-", "--", ":"), strict=True):
            axes.plot(*content.curves[f"{body}, {axis}"], style, color=COMPUTED, label=f"{body}, this package")
            axes.plot(*content.curves[f"{body}, {axis}, SciPy"], ".", color="0.4", markersize=4)
            axes.plot(1.0, rows[f"{body}: speed along {axis}"].published, "o", color=PUBLISHED, clip_on=False)
        axes.plot([], [], ".", color="0.4", markersize=4, label="SciPy")
        axes.plot([], [], "o", color=PUBLISHED, label="Gazebo's test, at 1 s")
        axes.set(xlabel="time [s]", ylabel=f"speed along {axis} [m/s]", xlim=(0.0, 1.0), ylim=(-0.02, 0.6))
    figure.axes[0].legend(loc="upper left", ncols=2, fontsize=9.5)
