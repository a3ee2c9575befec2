# SPDX-License-Identifier: Apache-2.0
"""Steps of a BlueROV2's thrusters: the equations of von Benzon et al. (2022), integrated by SciPy."""

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import tf2ss
from scipy.spatial.transform import Rotation

import lgvi_warp as lw
from benchmarks.pages import ROOT
from benchmarks.validated import COMPUTED, PUBLISHED, Content, Row, curve

TITLE = "BlueROV2: steps ahead, down and about"
AGAINST = "published code"
KNOWN = "equations and coefficients in two transcripts of the article; no measured step"
PICTURE = "Surge, heave and yaw rate of a BlueROV2 after steps of its thrusters, by this package and by SciPy"
HEADLINE = "all terms: largest distance of the paths"
# The largest distance is a part of this way.
OF, OF_WORDS = "all terms: way ahead at 10.9 s", "the way ahead"
SCENES = ("examples/validation/bluerov2_steps.toml",)
# Von Benzon et al. (2022), table A1: mass, weight, buoyancy, its centre; inertia and added mass; drag.
MASS, GRAVITY, BUOYANCY, ABOVE = 13.5, 9.82, 1000.0 * 9.82 * 0.0134, -0.01
INERTIA = np.array([13.5, 13.5, 13.5, 0.26, 0.23, 0.37])
ADDED = np.array([6.36, 7.12, 18.68, 0.189, 0.135, 0.222])
LINEAR, QUADRATIC = np.array([13.7, 0.0, 33.0, 0.0, 0.8, 0.0]), np.array([141.0, 217.0, 190.0, 1.19, 0.47, 1.5])
HALF = np.sqrt(0.5)
PLACES = [[0.156 * a, 0.111 * b, 0.085] for a in (1, -1) for b in (1, -1)] + [
    [0.12 * a, 0.218 * b, 0.0] for a in (1, -1) for b in (1, -1)
]
WAYS = [[HALF, -HALF, 0.0], [HALF, HALF, 0.0], [-HALF, -HALF, 0.0], [-HALF, HALF, 0.0]] + [[0.0, 0.0, -1.0]] * 4
WRENCHES = np.concatenate([np.array(WAYS).T, np.cross(PLACES, WAYS).T])
AHEAD, DOWN, ABOUT = (
    [0.12, 0.12, -0.12, -0.12, 0, 0, 0, 0],
    [0, 0, 0, 0, -0.3, -0.3, -0.3, -0.3],
    [-0.2, 0.2, 0.2, -0.2, 0, 0, 0, 0],
)
STEPS = ((0.0, [0.0] * 8), (1.0, AHEAD), (11.0, DOWN), (21.0, ABOUT), (31.0, None))
LAG = tf2ss([6136.0, 108700.0], [1.0, 89.0, 9258.0, 108700.0])[:3]
FIRST_ORDER = 0.0287  # s


def thrust(command: Any) -> Any:
    """Eq. 18 [N], of commands from -1 to 1."""
    n = np.asarray(command, float)
    return -140.3 * n**9 + 389.9 * n**7 - 404.1 * n**5 + 176.0 * n**3 + 8.9 * n


def rates(y: Any, thrusts: Any) -> Any:
    """Rates of position, roll, pitch, yaw and twist."""
    angles, nu = y[3:6], y[6:12]
    R = Rotation.from_euler("ZYX", angles[::-1]).as_matrix()
    whole = INERTIA + ADDED
    momentum, spin = np.split(whole * nu, 2)
    inertial = np.concatenate([np.cross(nu[3:], momentum), np.cross(nu[:3], momentum) + np.cross(nu[3:], spin)])
    lift = np.concatenate([(MASS * GRAVITY - BUOYANCY) * R[2], -BUOYANCY * np.cross([0.0, 0.0, ABOVE], R[2])])
    change = (WRENCHES @ thrusts + lift - inertial - (LINEAR + QUADRATIC * np.abs(nu)) * nu) / whole
    (a, b, _), (p, q, r) = angles, nu[3:]
    turning = (q * np.sin(a) + r * np.cos(a)) / np.cos(b)
    return np.concatenate([R @ nu[:3], [p + turning * np.sin(b), q * np.cos(a) - r * np.sin(a), turning], change])


def independent(t: Any, published: bool) -> Any:
    """States (12, k) at given times. published: the thrust has a third-order lag, else the command a first-order lag."""
    A, B, C = LAG
    states = 8 * (3 if published else 1)
    y, found = np.concatenate([[0.0, 0.0, 10.0], np.zeros(9 + states)]), []

    def change(s: float, y: Any, command: Any) -> Any:
        memory = y[12:].reshape(8, -1)
        if published:
            asked = thrust(command)
            moved = memory @ A.T + np.outer(asked, B[:, 0])
            return np.concatenate([rates(y, memory @ C[0]), moved.ravel()])
        return np.concatenate([rates(y, thrust(memory[:, 0])), ((command - memory[:, 0]) / FIRST_ORDER)])

    for (begin, command), (end, _) in zip(STEPS[:-1], STEPS[1:], strict=True):
        at = t[(t >= begin - 1e-9) & (t < end - 1e-9)]
        at = np.append(np.clip(at, begin, end), end)
        part = solve_ivp(
            change, (begin, end), y, "DOP853", t_eval=at, args=(np.array(command, float),), rtol=1e-9, atol=1e-10
        )
        found.append(part.y[:12, :-1])
        y = part.y[:, -1]
    return np.concatenate([*found, y[:12, None]], axis=1)


def measured() -> Content:
    """Run the scene, and both forms of the equations."""
    result = lw.solve(lw.Scene.load(ROOT / SCENES[0]))
    t, place, nu = result.time, result.position[:, 0].T, result.velocity[:, 0].T
    R, spin = result.attitude[:, 0], result.angular_velocity[:, 0].T
    ends = [int(np.argmin(np.abs(t - s))) for s in (10.9, 20.9, 31.0)]
    here = _numbers(ends, place, nu, np.degrees(np.arcsin(-R[:, 2, 0])), np.degrees(spin[2]))
    rows, curves = [], {"surge": curve(t, nu[0]), "heave": curve(t, nu[2]), "yaw": curve(t, np.degrees(spin[2]))}
    for published, words in ((False, "the scene's terms"), (True, "all terms")):
        y = independent(t, published)
        there = _numbers(ends, y[:3], y[6:9], np.degrees(y[4]), np.degrees(y[11]))
        rows += [Row(f"{words}: {name}", unit, there[name, unit], None, value) for (name, unit), value in here.items()]
        apart = np.linalg.norm(place - y[:3], axis=0).max()
        rows.append(Row(f"{words}: largest distance of the paths", "m", 0.0, None, apart))
        if published:
            for name, line in (("surge", y[6]), ("heave", y[8]), ("yaw", np.degrees(y[11]))):
                curves[f"{name}, SciPy"] = curve(t, line, 80)
    return Content(rows, curves)


def _numbers(ends: Any, place: Any, nu: Any, pitch: Any, yaw: Any) -> dict[tuple[str, str], float]:
    """Rows of compared numbers at the ends of the three steps."""
    ahead, down, about = ends
    return {
        ("surge at 10.9 s", "m/s"): nu[0, ahead],
        ("largest pitch", "deg"): np.abs(pitch).max(),
        ("way ahead at 10.9 s", "m"): place[0, ahead],
        ("heave at 20.9 s", "m/s"): nu[2, down],
        ("depth at 20.9 s", "m"): place[2, down],
        ("yaw rate at 31 s", "deg/s"): yaw[about],
    }


def draw(content: Content, figure: Any) -> None:
    """Surge and heave, and yaw rate, over time."""
    speeds, turning = figure.subplots(1, 2)
    for name, style in (("surge", "-"), ("heave", "--")):
        speeds.plot(*content.curves[name], style, color=COMPUTED, label=f"{name}, this package")
        speeds.plot(*content.curves[f"{name}, SciPy"], ".", color=PUBLISHED)
    speeds.plot([], [], ".", color=PUBLISHED, label="published equations, SciPy")
    speeds.set(xlabel="time [s]", ylabel="speed [m/s]", ylim=(-0.02, 0.42))
    speeds.legend(loc="upper left")
    turning.plot(*content.curves["yaw"], color=COMPUTED)
    turning.plot(*content.curves["yaw, SciPy"], ".", color=PUBLISHED)
    turning.set(xlabel="time [s]", ylabel="yaw rate [deg/s]")
