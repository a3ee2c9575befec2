# SPDX-License-Identifier: Apache-2.0
"""A turn of the NPS AUV II: the equations of Healey and Lienard (1993), integrated by SciPy."""

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import lgvi_warp as lw
from benchmarks.pages import ROOT
from benchmarks.validated import COMPUTED, PUBLISHED, Content, Row, curve

TITLE = "NPS AUV II: a turn"
AGAINST = "published code"
KNOWN = "equations and coefficients in a public program; no sea trial"
PICTURE = "Path and yaw rate of the NPS AUV II under 10 degrees of rudder, by this package and by SciPy"
HEADLINE = "all terms: steady yaw rate"
SCENES = ("examples/validation/nps_auv_2.toml",)
RUDDER, REVOLUTIONS = np.radians(10.0), 1500.0 * 2.0 * np.pi / 60.0  # rad, rad/s
LENGTH, DENSITY, WEIGHT, GRAVITY, BELOW = 5.3, 1025.0, 53400.0, 9.81, 0.061
BREADTH, SIDE, TOP = 0.53, 0.5, 0.6  # m, and drag of the sections across and up
RESISTANCE, ADVANCE = 0.00385, 0.012  # of the hull; m/s ahead for each rad/s of the propeller
MASS = WEIGHT / GRAVITY
INERTIA = np.array([[2038.0, 13.58, 13.58], [13.58, 13587.0, 13.58], [13.58, 13.58, 13587.0]])
# Dimensionless, as printed; one velocity alone stands beside u.
HULL = {
    "Xpp": 7.0e-3, "Xqq": -1.5e-2, "Xrr": 4.0e-3, "Xpr": 7.5e-4, "Xwq": -2.0e-1, "Xvp": -3.0e-3, "Xvr": 2.0e-2, "Xvv": 5.3e-2,
    "Xww": 1.7e-1,
    "Ypq": 4.0e-3, "Yqr": -6.5e-3, "Yp": 3.0e-3, "Yr": 3.0e-2, "Yvq": 2.4e-2, "Ywp": 2.3e-1, "Ywr": -1.9e-2, "Yv": -1.0e-1,
    "Yvw": 6.8e-2,
    "Zpp": 1.3e-4, "Zpr": 6.7e-3, "Zrr": -7.4e-3, "Zq": -1.4e-1, "Zvp": -4.8e-2, "Zvr": 4.5e-2, "Zw": -3.0e-1, "Zvv": -6.8e-2,
    "Kpq": -6.9e-5, "Kqr": 1.7e-2, "Kp": -1.1e-2, "Kr": -8.4e-4, "Kvq": -5.1e-3, "Kwp": -1.3e-4, "Kwr": 1.4e-2, "Kv": 3.1e-3,
    "Kvw": -1.9e-1,
    "Mpp": 5.3e-5, "Mpr": 5.0e-3, "Mrr": 2.9e-3, "Mq": -6.8e-2, "Mvp": 1.2e-3, "Mvr": 1.7e-2, "Mw": 1.0e-1, "Mvv": -2.6e-2,
    "Npq": -2.1e-2, "Nqr": 2.7e-3, "Np": -8.4e-4, "Nr": -1.6e-2, "Nvq": -1.0e-2, "Nwp": -1.7e-2, "Nwr": 7.4e-3, "Nv": -7.4e-3,
    "Nvw": -2.7e-2,
}  # fmt: skip
# Of the rudder: by its angle, or by its square.
STEERING = {"Xr": -1.0e-3, "Xv": 1.7e-3, "Xdd": -1.0e-2, "Y": 2.7e-2, "N": -1.3e-2}
# Of the propeller's load: times what is above self-propulsion.
LOAD = {"Zq": -2.9e-3, "Zw": -5.1e-3, "Kp": -5.7e-4, "Mq": -1.6e-3, "Mw": -2.9e-3}
ADDED = {"Xu": -7.6e-3, "Yp": 1.2e-4, "Yr": 1.2e-3, "Yv": -5.5e-2, "Zq": -6.8e-3, "Zw": -2.4e-1, "Kp": -1.0e-3, "Kr": -3.4e-5,
         "Kv": 1.2e-4, "Mq": -1.7e-2, "Mw": -6.8e-3, "Np": -3.4e-5, "Nr": -3.4e-3, "Nv": 1.2e-3}  # fmt: skip
FORCES, VELOCITIES = "XYZKMN", "uvwpqr"


def size(name: str) -> float:
    """Factor of a dimensionless coefficient of two velocities."""
    return 0.5 * DENSITY * LENGTH ** (2 + (name[0] in "KMN") + sum(letter in "pqr" for letter in name[1:]))


def added_mass() -> Any:
    """The added mass matrix [kg, kg m, kg m2]."""
    A = np.zeros((6, 6))
    for name, value in ADDED.items():
        power = 3 + (name[0] in "KMN") + (name[1] in "pqr")
        A[FORCES.index(name[0]), VELOCITIES.index(name[1])] = -0.5 * DENSITY * LENGTH**power * value
    return A


def tables() -> dict[str, Any]:
    """Content of the scene file, from the printed numbers."""
    added, lever = added_mass(), lw.notation.hat(np.array([0.0, 0.0, BELOW]))
    rigid = np.block([[MASS * np.eye(3), -MASS * lever], [MASS * lever, INERTIA]])
    # What the added mass makes is taken off; the rudder is held, and so makes products of velocities, as the propeller does.
    form = lw.terms.QuadraticForm.gertler_hagen(HULL, rho=DENSITY, length=LENGTH, added_mass=added)
    products = dict(zip(form.products, np.asarray(form.values).tolist(), strict=True))
    for name, value in (
        ("X_ur", STEERING["Xr"] * RUDDER),
        ("X_uv", STEERING["Xv"] * RUDDER),
        ("X_uu", STEERING["Xdd"] * RUDDER**2 - RESISTANCE),
        ("Y_uu", STEERING["Y"] * RUDDER),
        ("N_uu", STEERING["N"] * RUDDER),
    ):
        products[name] = products.get(name, 0.0) + size(name.replace("_", "")) * value
    stations = np.linspace(-0.5, 0.5, 11) * LENGTH
    thrust = size("Xuu") * RESISTANCE * (ADVANCE * REVOLUTIONS) ** 2
    return {
        "vehicle": {
            "rigid_body_mass_matrix": rigid.tolist(),
            "added_mass_matrix": added.tolist(),
            "weight": WEIGHT,
            "center_of_gravity": [0.0, 0.0, BELOW],
            "buoyancy": WEIGHT,
            "center_of_buoyancy": [0.0, 0.0, 0.0],
            "title": "NPS AUV II",
            "shape": {"length": LENGTH, "diameter": BREADTH},
        },
        "environment": {"gravity": GRAVITY, "water_density": DENSITY},
        "start": {"velocity": [ADVANCE * REVOLUTIONS, 0.0, 0.0]},
        "run": {"method": "rk4", "step": 0.05, "duration": 120.0, "save_every": 0.5},
        "terms": [
            {"type": "quadratic_form", "products": list(products), "values": list(products.values())},
            {
                "type": "cross_flow",
                "stations": stations.tolist(),
                "diameters": [BREADTH] * 11,
                "drag_coefficient": [SIDE] * 11,
            },
            {"type": "wrench", "force": [thrust, 0.0, 0.0]},
        ],
    }


STRIPS = np.linspace(-0.5, 0.5, 11) * LENGTH, np.full(11, 0.1 * LENGTH)
GAUSS = tuple(0.5 * LENGTH * numbers for numbers in np.polynomial.legendre.leggauss(40))
# Force, both velocities and factor of each product of the hull.
PRODUCTS = [
    (FORCES.index(name[0]), *(VELOCITIES.index(letter) for letter in (name[1:] if len(name) == 3 else f"u{name[1]}")),
     value * size(name if len(name) == 3 else f"{name[0]}u{name[1]}"))
    for name, value in HULL.items()
]  # fmt: skip
FORCE, FIRST, SECOND, FACTOR = (np.array(column) for column in zip(*PRODUCTS, strict=True))


def across(nu: Any, published: bool) -> Any:
    """Cross-flow drag of the hull. published: sum of the published program's eleven strips, else the integral."""
    _, v, w, _, q, r = nu
    x, dx = STRIPS if published else GAUSS
    side, up = v + x * r, w - x * q
    flow = np.hypot(side, up) + 1e-6
    load = 0.5 * DENSITY * BREADTH * dx * (SIDE * side**2 + (TOP if published else SIDE) * up**2) / flow
    # The published program has w + x q in the pitching moment alone, and its sign.
    pitching = (w + x * q) if published else -up
    return -np.array([0.0, load @ side, load @ up, 0.0, (load * x) @ pitching, (load * x) @ side])


def force(nu: Any, published: bool) -> Any:
    """Forces and moments that depend on the velocities, without the inertia of the dry body."""
    u, v, _, _, _, r = nu
    total = across(nu, published) + np.bincount(FORCE, FACTOR * nu[FIRST] * nu[SECOND], 6)
    plane, turned = 0.5 * DENSITY * LENGTH**2, 0.5 * DENSITY * LENGTH**3
    total[0] += RUDDER * u * (turned * STEERING["Xr"] * r + plane * STEERING["Xv"] * v)
    total[0] += plane * (STEERING["Xdd"] * (RUDDER * u) ** 2 + RESISTANCE * ((ADVANCE * REVOLUTIONS) ** 2 - u * u))
    total[1] += plane * STEERING["Y"] * RUDDER * u * u
    total[5] += turned * STEERING["N"] * RUDDER * u * u
    if published:
        thrust = 0.008 * LENGTH**2 / 2.0
        above = (np.sqrt(thrust * (ADVANCE * REVOLUTIONS / u) ** 2 + 1.0) - 1.0) / (np.sqrt(thrust + 1.0) - 1.0) - 1.0
        for name, value in LOAD.items():
            product = u * nu[VELOCITIES.index(name[1])]
            total[FORCES.index(name[0])] += size(f"{name[0]}u{name[1]}") * value * above * product
    return total


def independent(t: Any, published: bool) -> Any:
    """States (12, k) at times: position, roll, pitch, yaw, velocities; by DOP853. published: all terms, as MSS has them."""
    lever = np.array([0.0, 0.0, BELOW])
    S = np.cross(np.eye(3), lever)  # S x = lever x x
    rigid = np.block([[MASS * np.eye(3), -MASS * S], [MASS * S, INERTIA]])
    whole = rigid + added_mass()

    def rates(_: float, y: Any) -> Any:
        angles, nu = y[3:6], y[6:]
        R = Rotation.from_euler("ZYX", angles[::-1]).as_matrix()
        momentum, spin = np.split(rigid @ nu, 2)
        inertial = np.concatenate([np.cross(nu[3:], momentum), np.cross(nu[:3], momentum) + np.cross(nu[3:], spin)])
        weight = np.concatenate([np.zeros(3), np.cross(lever, WEIGHT * R[2])])
        change = np.linalg.solve(whole, force(nu, published) - inertial + weight)
        (a, b, _), (p, q, r) = angles, nu[3:]
        turning = (q * np.sin(a) + r * np.cos(a)) / np.cos(b)
        return np.concatenate([R @ nu[:3], [p + turning * np.sin(b), q * np.cos(a) - r * np.sin(a), turning], change])

    start = np.zeros(12)
    start[6] = ADVANCE * REVOLUTIONS
    return solve_ivp(rates, (0.0, t[-1]), start, "DOP853", t_eval=t, rtol=1e-9, atol=1e-9).y


def measured() -> Content:
    """Run the scene, and both forms of the equations."""
    result = lw.solve(lw.Scene.load(ROOT / SCENES[0]))
    t, R, place, nu = result.time, result.attitude[:, 0], result.position[:, 0], result.velocity[:, 0]
    late = t >= 0.75 * t[-1]
    yaw = np.degrees(result.angular_velocity[:, 0, 2])
    roll = np.degrees(np.arctan2(R[:, 2, 1], R[:, 2, 2]))
    here = _steady(nu[late, 0], nu[late, 1], np.radians(yaw[late]), roll[late])
    names = (("surge", "m/s"), ("sway", "m/s"), ("yaw rate", "deg/s"), ("turning diameter", "m"), ("roll", "deg"))
    rows, curves = [], {"path": curve(place[:, 1], place[:, 0]), "yaw": curve(t, yaw)}
    for published, words in ((False, "the scene's terms"), (True, "all terms")):
        y = independent(t, published)
        there = _steady(y[6, late], y[7, late], y[11, late], np.degrees(y[3, late]))
        for (name, unit), value, own in zip(names, there, here, strict=True):
            rows.append(Row(f"{words}: steady {name}", unit, value, None, own))
        rows.append(Row(f"{words}: depth at the end", "m", y[2, -1], None, place[-1, 2]))
        apart = np.linalg.norm(place.T - y[:3], axis=0).max()
        rows.append(Row(f"{words}: largest distance of the paths", "m", 0.0, None, apart))
        curves[f"path, {words}"], curves[f"yaw, {words}"] = curve(y[1], y[0], 120), curve(t, np.degrees(y[11]), 60)
    return Content(rows, curves)


def _steady(u: Any, v: Any, r: Any, roll: Any) -> tuple[float, ...]:
    """Means of surge, sway, yaw rate [deg/s], turning diameter and roll."""
    return u.mean(), v.mean(), np.degrees(r.mean()), 2.0 * np.hypot(u, v).mean() / abs(r.mean()), roll.mean()


def draw(content: Content, figure: Any) -> None:
    """Path from above and yaw rate."""
    above, rates = figure.subplots(1, 2, gridspec_kw={"width_ratios": (1.0, 1.4)})
    for axes, name in ((above, "path"), (rates, "yaw")):
        axes.plot(*content.curves[name], color=COMPUTED, label="this package")
        axes.plot(
            *content.curves[f"{name}, all terms"],
            ".",
            color=PUBLISHED,
            markersize=4,
            label="all published terms, SciPy",
        )
        axes.plot(
            *content.curves[f"{name}, the scene's terms"],
            "+",
            color="0.3",
            markersize=6,
            label="the scene's terms, SciPy",
        )
    above.set(xlabel="east [m]", ylabel="north [m]", aspect="equal")
    rates.set(xlabel="time [s]", ylabel="yaw rate [deg/s]")
    rates.legend(loc="upper right")
