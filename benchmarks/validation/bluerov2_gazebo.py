# SPDX-License-Identifier: Apache-2.0
"""Steps of a BlueROV2 Heavy in Gazebo, ahead, sideways and down: another team's simulation compared with this package."""

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import lgvi_warp as lw
from benchmarks.pages import ROOT
from benchmarks.validated import COMPUTED, PUBLISHED, Content, Row, curve

TITLE = "BlueROV2 in Gazebo: steps ahead, sideways and down"
AGAINST = "published code"
KNOWN = (
    "readings of a simulation to 0.001 m/s, at times of the clock; its speed is printed as 0.59 to 0.71 of real time"
)
PICTURE = "Surge, sway and heave of a BlueROV2 Heavy after steps of its thrusters, as computed and as read in Gazebo"
HEADLINE = "surge: mean of the last three readings"
SCENES = ("examples/validation/bluerov2_gazebo.toml",)
# sim/src/duburi_sim_description/models/duburi_heavy/RESULTS.md: force [N], closed form of drag and measured speed [m/s].
SPEEDS = {
    "surge": (100.0 * np.sqrt(0.5), 0.661, 0.658),
    "sway": (100.0 * np.sqrt(0.5), 0.571, 0.563),
    "heave": (48.0, 0.423, 0.395),
}
READ_TO = 0.0005  # m/s: half of the last digit
# thruster_rig.py and drag_survey.py: one reading for each second of the clock. The last three of 13 count; heave has one.
READINGS = {"surge": (11.0, 12.0, 13.0), "sway": (11.0, 12.0, 13.0), "heave": (1.0,)}
# Seconds of the simulation in a second of the clock: .context/PHYSICS.md, the empty pool without ArduSub.
RATES = np.linspace(0.59, 0.71, 13)
AXES = ("surge", "sway", "heave")
HOLD, BEGIN, EARLY = 0.1 * 9.80665, 3.25, 1.5  # N, s, s
TIMES = (0.0, BEGIN - 0.01, BEGIN + 0.01)  # s: a ramp in place of the jump
# Mass [kg] and place [m] of hull, cameras and propellers, body axes with z up.
CORNERS = [(a, b) for a in (1.0, -1.0) for b in (-1.0, 1.0)]
HULL, HULL_INERTIA = 13.5, np.diag([0.26, 0.23, 0.37])
SMALL = [(0.001, (0.2, 0.0, 0.0)), (0.001, (0.0, 0.0, -0.1))] + [
    (0.002, (x * a, y * b, z)) for x, y, z in ((0.14, 0.092, 0.0), (0.118, 0.215, 0.064)) for a, b in CORNERS
]
DOWN = np.diag([1.0, -1.0, -1.0])


def cross(v: Any) -> Any:
    """The matrix of v x."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def rigid_body() -> tuple[Any, Any]:
    """Mass matrix about the hull's origin [kg, kg m, kg m2], and centre of gravity [m], body axes with z down."""
    mass = HULL + sum(m for m, _ in SMALL)
    center = DOWN @ sum(m * np.array(r) for m, r in SMALL) / mass
    inertia = HULL_INERTIA - sum(m * cross(r) @ cross(r) for m, r in SMALL)
    lever = mass * cross(center)
    return np.block([[mass * np.eye(3), -lever], [lever, DOWN @ inertia @ DOWN]]), center


def pushed(scene: lw.Scene, axis: str) -> lw.Scene:
    """Scene with a step of thrust along an axis. Except for heave, the vertical thrusters hold the depth."""
    force = np.array([0.0, 0.0, 0.0 if axis == "heave" else HOLD])
    force[AXES.index(axis)] += SPEEDS[axis][0]
    push = lw.terms.WrenchSchedule(times=TIMES, force=[[0.0, 0.0, HOLD], [0.0, 0.0, HOLD], force])
    return lw.Scene(scene.vehicle, scene.environment, start=scene.start, terms=[scene.terms[0], push], run=scene.run)


def independent(scene: lw.Scene, t: Any) -> Any:
    """States at given times, integrated by SciPy: position, quaternion, and velocities in body axes."""
    vehicle, (drag, push) = scene.vehicle, scene.terms
    M = np.asarray(vehicle.rigid_body_mass_matrix) + vehicle.added_mass_matrix
    inverse, linear, quadratic = np.linalg.inv(M), np.asarray(drag.linear), np.asarray(drag.quadratic)
    weight, lift = float(vehicle.weight), float(vehicle.buoyancy)
    places = np.asarray(vehicle.center_of_gravity), np.asarray(vehicle.center_of_buoyancy)

    def change(s: float, y: Any) -> Any:
        force = [np.interp(s, TIMES, row) for row in np.transpose(push.force)]
        R, nu, spin = Rotation.from_quat(y[3:7]).as_matrix(), y[7:10], y[10:]
        p, turning = np.split(M @ y[7:], 2)
        down = R[2]
        pull = np.concatenate(
            [(weight - lift) * down, weight * np.cross(places[0], down) - lift * np.cross(places[1], down)]
        )
        inertial = np.concatenate([np.cross(p, spin), np.cross(turning, spin) + np.cross(p, nu)])
        loads = np.append(force, np.zeros(3)) + pull + inertial - (linear + quadratic * np.abs(y[7:])) * y[7:]
        turn = 0.5 * np.append(y[6] * spin + np.cross(y[3:6], spin), -y[3:6] @ spin)
        return np.concatenate([R @ nu, turn, inverse @ loads])

    y, found = np.zeros(13), []
    y[:3], y[6] = scene.start.position, 1.0
    for begin, end in ((0.0, TIMES[1]), TIMES[1:], (TIMES[2], t[-1])):
        at = t[(t >= begin - 1e-9) & (t < end - 1e-9)]
        at = np.append(np.clip(at, begin, end), end)
        part = solve_ivp(change, (begin, end), y, "DOP853", t_eval=at, rtol=1e-11, atol=1e-13)
        found.append(part.y[:, :-1])
        y = part.y[:, -1]
    return np.concatenate([*found, y[:, None]], axis=1)


def reading(axis: str, rate: float, t: Any, speed: Any) -> float:
    """Mean speed [m/s] at the times of the source's readings. rate: simulated seconds per second."""
    return float(np.interp(rate * np.array(READINGS[axis]), t, speed).mean())


def measured() -> Content:
    """Run the three steps, and read the speeds as the source's script does."""
    scene = lw.Scene.load(ROOT / SCENES[0])
    read, early, apart, curves, runs = [], [], [], {}, {}
    for i, axis in enumerate(AXES):
        step = pushed(scene, axis)
        result = lw.solve(step)
        t, speed = result.time, result.velocity[:, 0, i]
        runs[axis] = t - BEGIN, speed
        readings = [reading(axis, rate, *runs[axis]) for rate in RATES]
        words = "the only reading" if axis == "heave" else "mean of the last three readings"
        _, closed, number = SPEEDS[axis]
        read.append(Row(f"{axis}: {words}", "m/s", number, READ_TO + 0.5 * np.ptp(readings), float(np.mean(readings))))
        # Heave does not turn the vehicle: it is steady at the end.
        when = f"after {EARLY:g} s" if axis != "heave" else "steady"
        value = np.interp(BEGIN + EARLY, t, speed) if axis != "heave" else speed[-1]
        early.append(Row(f"{axis} {when}; theirs is the closed form of drag alone", "m/s", closed, READ_TO, value))
        y = independent(step, t)
        distance = np.linalg.norm(result.position[:, 0].T - y[:3], axis=0).max()
        apart.append(Row(f"{axis}: largest distance from SciPy's path", "m", 0.0, None, distance))
        curves[axis] = curve(t - BEGIN, speed)
        curves[f"{axis}, SciPy"] = curve(t - BEGIN, y[7 + i], 60)
        R = result.attitude[:, 0]
        if axis == "surge":
            curves["pitch"] = curve(t - BEGIN, np.degrees(np.arcsin(-R[:, 2, 0])))
        if axis == "sway":
            curves["roll"] = curve(t - BEGIN, np.degrees(np.arctan2(R[:, 2, 1], R[:, 2, 2])))
    # The only reading of heave is on the way up: it has the time of the simulation.
    t, speed = runs["heave"]
    own = float(np.interp(SPEEDS["heave"][2], speed[t > 0.0], t[t > 0.0]))
    told = float(RATES.mean()), float(0.5 * np.ptp(RATES))
    at_own = [Row("seconds of the simulation in one of the clock, by the reading of heave", "1", *told, own)]
    at_own += [
        Row(f"{axis} by that rate", "m/s", SPEEDS[axis][2], READ_TO, reading(axis, own, *runs[axis]))
        for axis in AXES[:2]
    ]
    return Content([*read, *at_own, *early, *apart], curves)


def draw(content: Content, figure: Any) -> None:
    """Draw the speeds over time with the readings, and the growing angles."""
    rows = {row.what: row for row in content.rows}
    speeds, angles = figure.subplots(1, 2, gridspec_kw={"width_ratios": (1.6, 1.0)})
    for axis, style in zip(AXES, ("-", "--", ":"), strict=True):
        speeds.plot(*content.curves[axis], style, color=COMPUTED, label=f"{axis}, this package")
        speeds.plot(*content.curves[f"{axis}, SciPy"], ".", color="0.4", markersize=4)
        (row,) = (row for what, row in rows.items() if what.startswith(f"{axis}: ") and "reading" in what)
        times = np.outer(READINGS[axis], (RATES[0], RATES[-1]))
        speeds.plot([times.min(), times.max()], [row.published] * 2, color=PUBLISHED, linewidth=4.0)
    speeds.plot([], [], ".", color="0.4", markersize=4, label="SciPy")
    speeds.plot([], [], color=PUBLISHED, linewidth=4.0, label="readings in Gazebo, over their possible times")
    speeds.set(xlabel="time of the step [s]", ylabel="speed [m/s]", xlim=(0.0, 10.0), ylim=(0.15, 0.72))
    speeds.legend(loc="lower right", fontsize=9.5)
    angles.plot(*content.curves["pitch"], color=COMPUTED, label="pitch, ahead")
    angles.plot(*content.curves["roll"], "--", color=COMPUTED, label="roll, sideways")
    angles.set(xlabel="time of the step [s]", ylabel="angle [deg]", xlim=(0.0, 10.0))
    angles.legend(loc="upper left")
