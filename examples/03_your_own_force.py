# SPDX-License-Identifier: Apache-2.0
"""Your own force, in one file: a dock that draws vehicles in.

A function of this file runs in the kernel. Before the run `lw.laws.check_law` compares its force with its potential.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

import lgvi_warp as lw
from lgvi_kernels.law import add, cross, dot, exponential, mul, neg, sub, to_body, to_inertial  # noqa: F401


@wp.func
def dock_law(w: Any, view: Any, p: Any):
    """Add the force of U = -energy exp(-|d|^2 / (2 reach^2)), d from the dock to the vehicle's nose."""
    d = view.b + to_inertial(view, p.nose) - p.place
    size = view.h.dtype(0.5) * p.inverse_square * dot(d, d)
    f = to_body(view, -(p.energy * p.inverse_square * exponential(-size)) * d)
    w.force = w.force + f
    w.torque = w.torque + cross(p.nose, f)
    return w


class DockOnDevice:
    """Device code that the kernel takes from this file."""

    POTENTIAL, law = True, dock_law


@dataclass(frozen=True, eq=False, kw_only=True)
class Dock(lw.laws.Term):
    """A dock that draws the nose in, out to a few times its reach."""

    type: ClassVar[str] = "dock"
    device: ClassVar[Any] = DockOnDevice
    place: Any = lw.laws.number((3,), "m")
    nose: Any = lw.laws.number((3,), "m", axes="point")
    energy: Any = lw.laws.number((), "J", least=0.0)
    inverse_square: Any = lw.laws.number((), "1/m2", least=0.0)  # 1 / reach^2

    def potential(self, numbers, position, attitude, parameters):
        """U [J]."""
        d = position + (attitude @ numbers["nose"][..., None])[..., 0] - numbers["place"]
        return -numbers["energy"] * np.exp(-0.5 * numbers["inverse_square"] * np.sum(d * d, axis=-1))


PLACE, NOSE = np.array([8.0, 0.0, 20.0]), np.array([0.6, 0.0, 0.0])  # m
dock = Dock(place=PLACE, nose=NOSE, energy=40.0, inverse_square=1.0 / 16.0)
drag = lw.terms.Drag(linear=[2.0, 20.0, 20.0, 0.5, 5.0, 5.0], quadratic=[4.0, 100.0, 100.0, 0.0, 20.0, 20.0])
body = {"mass": 31.0, "inertia": [0.2, 8.0, 8.0], "added_mass": [1.0, 30.0, 30.0]}  # kg, kg m2, kg
vehicle = lw.Vehicle(**body, buoyancy=304.0, center_of_buoyancy=[0.0, 0.0, -0.02])  # N, m
start = lw.Start(position=[0.0, -1.0, 17.0], velocity=[0.6, 0.0, 0.0])


def distance(samples, members=None):
    """Distance of each nose to the dock (k, n) [m]."""
    return np.linalg.norm(samples["position"] + samples["attitude"] @ NOSE - PLACE, axis=-1)


def solve(terms):
    """Run 500 vehicles with these terms."""
    scene = lw.Scene(vehicle=vehicle, environment=lw.Environment(gravity=9.8), start=start, terms=terms)
    fleet = lw.Ensemble(scene, 500, seed=2, vary={"start.position": lw.distributions.Normal(std=[0.5, 1.5, 1.5])})
    return lw.solve(fleet, h=0.02, t1=60.0, save=lw.SaveAt(every=0.25))


if __name__ == "__main__":
    print(lw.laws.check_law(dock))
    results = {"drag": solve([drag]), "drag and dock": solve([drag, dock])}
    for label, result in results.items():
        near = np.mean(distance(result.samples)[-1] < 1.0)
        print(f"{label}: {near:.0%} of the noses within 1 m of the dock after 60 s")
    far = lw.statistics.Quantity("distance to the dock", distance, "m")
    lw.plots.compare(results, far, path="03_your_own_force.png")
    print("03_your_own_force.png")
