# SPDX-License-Identifier: Apache-2.0
"""A neutral spheroid that rocks and tumbles: Kirchhoff's equations in elliptic functions, and Lamb's table of added mass."""

from typing import Any

import numpy as np
from scipy.integrate import quad
from scipy.special import ellipj, ellipk

import lgvi_warp as lw
from benchmarks.pages import ROOT
from benchmarks.validated import COMPUTED, PUBLISHED, Content, Row, curve

TITLE = "A spheroid that rocks and tumbles"
AGAINST = "theory"
KNOWN = "closed form to rounding error; a table of 1918 to its last digit"
PICTURE = "Angle and path of a spheroid that rocks and of one that tumbles, as computed and in closed form"
HEADLINE = "rocks: period of the angle"
SCENES = ("examples/validation/tumbling_spheroid.toml",)
WAYS = {"rocks": 1.0, "tumbles": 1.5}
# Length by breadth and k1, Lamb (1918).
LAMB = ((1.50, 0.305), (2.00, 0.209), (2.51, 0.156), (2.99, 0.122), (3.99, 0.082), (4.99, 0.059), (6.01, 0.045), (6.97, 0.036),
        (8.01, 0.029), (9.02, 0.024), (9.97, 0.021))  # fmt: skip


def end_on(ratio: float) -> float:
    """k1 of a prolate spheroid: Lamb, Hydrodynamics, art. 114."""
    e2 = 1.0 - ratio**-2
    e = np.sqrt(e2)
    alpha = 2.0 * (1.0 - e2) / e**3 * (np.arctanh(e) - e)
    return float(alpha / (2.0 - alpha))


def pushed(scene: lw.Scene) -> list[float]:
    """k1 from runs that start from rest under a force: 1 + k1 = F t / (m u)."""
    mass, force, time = scene.vehicle.mass, 100.0, 2.0
    found = []
    for ratio, _ in LAMB:
        added = np.array([end_on(ratio), 0.5, 0.5]) * mass
        vehicle = lw.Vehicle(mass, inertia=scene.vehicle.inertia, added_mass=added, buoyancy=scene.vehicle.buoyancy)
        push = lw.Scene(vehicle, scene.environment, terms=[lw.terms.Wrench(force=(force, 0.0, 0.0))])
        speed = lw.solve(push, "rk4", h=0.1, t1=time).velocity[-1, 0, 0]
        found.append(force * time / (mass * speed) - 1.0)
    return found


class Exact:
    """Exact motion: the angle from broadside is half the angle of a pendulum, Lamb, art. 124 and following."""

    def __init__(self, scene: lw.Scene, turn: float):
        self.ahead, _, self.across = np.diag(scene.vehicle.mass_matrix)
        self.impulse = self.across * scene.start.velocity[2]
        self.omega = self.impulse * np.sqrt((1.0 / self.ahead - 1.0 / self.across) / scene.vehicle.inertia[1, 1])
        self.k = turn / self.omega

    def angle(self, t: Any) -> Any:
        """Angle from broadside [rad]."""
        if self.k < 1.0:
            return np.arcsin(self.k * ellipj(self.omega * t, self.k**2)[0])
        return ellipj(self.k * self.omega * t, self.k**-2)[3]

    @property
    def period(self) -> float:
        """Period of rocking, or of half a turn [s]."""
        if self.k < 1.0:
            return float(4.0 * ellipk(self.k**2) / self.omega)
        return float(2.0 * ellipk(self.k**-2) / (self.k * self.omega))

    def along(self, t: float) -> float:
        """Way along the impulse [m]."""
        return float(quad(lambda s: self._speeds(s)[0], 0.0, t, epsabs=1e-12, epsrel=1e-12, limit=500)[0])

    def aside(self, t: float) -> float:
        """Way across the impulse [m]."""
        return float(quad(lambda s: self._speeds(s)[1], 0.0, t, epsabs=1e-12, epsrel=1e-12, limit=500)[0])

    def _speeds(self, t: float) -> tuple[float, float]:
        """Path along and across the impulse (A u, B w), which is constant in space."""
        a = self.angle(t)
        s, c = np.sin(a), np.cos(a)
        return self.impulse * (c * c / self.across + s * s / self.ahead), self.impulse * s * c * (
            1.0 / self.across - 1.0 / self.ahead
        )


def measured() -> Content:
    """Run both members, and push one body after the other."""
    scene = lw.Scene.load(ROOT / SCENES[0])
    rows, curves = [], {}
    for way, factor in WAYS.items():
        turn = factor * scene.start.angular_velocity[1]
        result = lw.solve(scene.with_numbers({"start.angular_velocity": (0.0, turn, 0.0)}))
        exact, t = Exact(scene, turn), result.time
        R, place = result.attitude[:, 0], result.position[:, 0]
        angle = np.unwrap(np.arctan2(R[:, 0, 2], R[:, 2, 2]))
        at = np.flatnonzero((angle[:-1] < 0.0) & (angle[1:] >= 0.0)) if way == "rocks" else None
        if at is not None:
            zeros = t[at] - angle[at] * np.diff(t)[at] / np.diff(angle)[at]
            rows.append(Row(HEADLINE, "s", exact.period, None, np.diff(zeros).mean()))
        else:
            halves = np.interp(np.pi * np.arange(1, int(angle[-1] / np.pi) + 1), angle, t)
            rows.append(Row("tumbles: time of half a turn", "s", exact.period, None, np.diff(halves).mean()))
        rows += [
            Row(f"{way}: angle after 60 s", "deg", np.degrees(exact.angle(t[-1])), None, np.degrees(angle[-1])),
            Row(f"{way}: way along after 60 s", "m", exact.along(t[-1]), None, place[-1, 2]),
            Row(f"{way}: way across after 60 s", "m", exact.aside(t[-1]), None, place[-1, 0]),
        ]
        curves[f"{way}, angle"] = curve(t, np.degrees(angle))
        curves[f"{way}, exact"] = curve(t, np.degrees(exact.angle(t)), 121)
        curves[f"{way}, path"] = curve(place[:, 0], place[:, 2])
    # Both of the printed numbers are rounded: the ratio to 0.01, k1 to 0.001.
    rows += [
        Row(
            f"k1 of length / breadth {ratio:.2f}",
            "1",
            printed,
            0.0005 + 0.5 * (end_on(ratio - 0.005) - end_on(ratio + 0.005)),
            found,
        )
        for (ratio, printed), found in zip(LAMB, pushed(scene), strict=True)
    ]
    return Content(rows, curves)


def draw(content: Content, figure: Any) -> None:
    """Angles over time with the closed form, and both paths."""
    angles, paths = figure.subplots(1, 2, gridspec_kw={"width_ratios": (1.5, 1.0)})
    for way, style in zip(WAYS, ("-", "--"), strict=True):
        angles.plot(*content.curves[f"{way}, angle"], style, color=COMPUTED, label=f"{way}, computed")
        angles.plot(*content.curves[f"{way}, exact"], "o", color=PUBLISHED, markersize=3.5)
        paths.plot(*content.curves[f"{way}, path"], style, color=COMPUTED, label=way)
    angles.plot([], [], "o", color=PUBLISHED, markersize=3.5, label="elliptic functions")
    angles.set(xlabel="time [s]", ylabel="angle from broadside [deg]", xlim=(0.0, 20.5), ylim=(-150.0, 1150.0))
    angles.legend(loc="upper left")
    paths.set(xlabel="across the impulse [m]", ylabel="along it [m]", ylim=(20.0, 0.0), xlim=(-0.62, 0.22))
    paths.legend(loc="lower right")
