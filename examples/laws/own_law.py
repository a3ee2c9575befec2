# SPDX-License-Identifier: Apache-2.0
"""Laws of one's own: a dock that draws vehicles in, and water that grows thick near the sea floor."""

import functools
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

import lgvi_warp as lw
from lgvi_kernels.law import (  # noqa: F401
    add,
    add_outer,
    add_rows,
    cross,
    div,
    dot,
    exponential,
    lane,
    lane3,
    mul,
    neg,
    ones,
    struct,
    sub,
    to_body,
    to_inertial,
    vec3,
)

# 1. A law with a potential: U = -energy exp(-|d|^2 / (2 reach^2)), d from the dock to the vehicle's nose.


@functools.cache
def dock_params(width, real):
    """Params: position [m, inertial], nose [m, body axes], energy [J], inverse_square = 1 / reach^2 [1/m2]."""
    numbers = {"energy": lane(width, real), "inverse_square": lane(width, real)}
    return struct("Dock", position=lane3(width, real), nose=lane3(width, real), **numbers)


@wp.func
def dock_law(w: Any, view: Any, p: Any):
    """f = -energy / reach^2 exp(...) d at the nose."""
    d = view.b + to_inertial(view, p.nose) - p.position
    size = view.h.dtype(0.5) * p.inverse_square * dot(d, d)
    f = to_body(view, -(p.energy * p.inverse_square * exponential(-size)) * d)
    w.force = w.force + f
    w.torque = w.torque + cross(p.nose, f)
    return w


class DockOnDevice:
    """Device code as a module of lgvi_kernels.laws would hold it."""

    POTENTIAL = True
    params = staticmethod(dock_params)
    law = dock_law


@dataclass(frozen=True, eq=False, kw_only=True)
class Dock(lw.laws.Term):
    """A dock that draws the nose in, out to a few times its reach."""

    type: ClassVar[str] = "dock"
    device: ClassVar[Any] = DockOnDevice

    position: Any = lw.laws.number((3,), "m")
    nose: Any = lw.laws.number((3,), "m", (0.0, 0.0, 0.0))
    energy: Any = lw.laws.number((), "J", least=0.0)
    reach: Any = lw.laws.number((), "m", least=1e-3)

    def packed(self, numbers, context):
        """Numbers in the order of dock_params(): the nose from the origin of the forces, in the kernel's axes."""
        values = {
            "position": numbers["position"],
            "energy": numbers["energy"],
            "inverse_square": numbers["reach"] ** -2.0,
        }
        return lw.laws.Packed(values | {"nose": context.frame.point(numbers["nose"])})

    def potential(self, numbers, position, attitude, parameters):
        """U [J]."""
        nose = position + (attitude @ numbers["nose"][..., None])[..., 0]
        d = nose - numbers["position"]
        return -numbers["energy"] * np.exp(-0.5 * np.sum(d * d, axis=-1) / numbers["reach"] ** 2)


# 2. A damping law: force -c v at the centre of drag, which moves at v, and torque -angular Om, both times e^(depth / height).


@wp.func
def along(D: Any, c: Any, angular: Any, r: Any, e: Any):
    """Drag along one body axis e at the point r, and about it."""
    arm = cross(r, e)
    D = add_outer(D, c * e, c * arm, e, arm)
    D.torque_rate = add_rows(D.torque_rate, angular * e, e)
    return D


@wp.func
def mud_damping(D: Any, view: Any, p: Any):
    """D (nu; Om) is the drag at the centre."""
    depth = view.b.z + dot(view.down, p.center)
    thick = exponential((depth - p.floor) / p.height)
    one = ones(thick)
    zero = one - one
    D = along(D, p.linear * thick, p.angular * thick, p.center, vec3(one, zero, zero))
    D = along(D, p.linear * thick, p.angular * thick, p.center, vec3(zero, one, zero))
    return along(D, p.linear * thick, p.angular * thick, p.center, vec3(zero, zero, one))


class MudOnDevice:
    """The same for the second law. Its struct follows from the numbers that Mud declares."""

    damping = mud_damping


@dataclass(frozen=True, eq=False, kw_only=True)
class Mud(lw.laws.Term):
    """Drag that grows towards the sea floor: by e every `height` metres, to what linear and angular say at the floor."""

    type: ClassVar[str] = "mud"
    device: ClassVar[Any] = MudOnDevice

    floor: Any = lw.laws.number((), "m")
    height: Any = lw.laws.number((), "m", least=1e-3)
    linear: Any = lw.laws.number((), "N s/m", 0.0, least=0.0)
    angular: Any = lw.laws.number((), "N m s", 0.0, least=0.0)
    # A point of the body, which the device gets from the origin of the forces and in the kernel's axes.
    center: Any = lw.laws.number((3,), "m", (0.0, 0.0, 0.0), axes="point")


# 3. A fleet that feels both.

FLOOR, DOCK = 30.0, (8.0, 0.0, 20.0)
dock = Dock(position=DOCK, nose=[0.6, 0.0, 0.0], energy=40.0, reach=4.0)
mud = Mud(floor=FLOOR, height=4.0, linear=150.0, angular=40.0)
vehicle = lw.Vehicle(
    mass=31.0,  # kg
    added_mass=[1.0, 30.0, 30.0],  # kg
    inertia=[0.2, 8.0, 8.0],  # kg m2
    buoyancy=31.0 * 9.8,  # N
    center_of_buoyancy=[0.0, 0.0, -0.02],  # m
)
start = lw.Start(position=[0.0, -1.0, 17.0], velocity=[0.6, 0.0, 0.0])
drag = lw.terms.Drag(linear=[2.0, 20.0, 20.0, 0.5, 5.0, 5.0], quadratic=[4.0, 100.0, 100.0, 0.0, 20.0, 20.0])


def fleet(terms, members=500):
    """Vehicles that pass the dock, each a little otherwise; the dock's energy differs as well, where there is one."""
    scene = lw.Scene(vehicle=vehicle, environment=lw.Environment(gravity=9.8), start=start, terms=terms)
    vary = {
        "start.position": lw.distributions.Normal(std=[0.5, 1.5, 1.5]),
        "start.velocity": lw.distributions.Normal(std=[0.1, 0.02, 0.02]),
    }
    if dock in terms:
        vary["dock.energy"] = lw.distributions.LogNormal(0.2)
    return lw.Ensemble(scene, members=members, seed=2, vary=vary)


def plot(runs, path):
    """Distance to the dock over time: median and the middle 80 %."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.subplots()
    for name, result in runs.items():
        low, middle, high = np.quantile(distance(result), (0.1, 0.5, 0.9), axis=1)
        (line,) = axes.plot(result.time, middle, label=name)
        axes.fill_between(result.time, low, high, color=line.get_color(), alpha=0.2, linewidth=0)
    axes.set(xlabel="time [s]", ylabel="distance of the nose to the dock [m]", ylim=(0.0, None))
    axes.legend()
    figure.savefig(path, dpi=100)
    return path


def distance(result):
    """From nose to dock (k, n) [m]."""
    return np.linalg.norm(result.position + result.attitude @ dock.nose - np.array(DOCK), axis=-1)


if __name__ == "__main__":
    for law in (dock, mud):
        report = lw.laws.check_law(law, scene=fleet([]).scene)
        print(report)
        assert report.ok
    runs = {"drag": fleet([drag]), "drag and dock": fleet([drag, dock]), "drag, dock and mud": fleet([drag, dock, mud])}
    runs = {name: lw.solve(one, h=0.02, t1=60.0, save=lw.SaveAt(every=0.25)) for name, one in runs.items()}
    for name, result in runs.items():
        early, late = (np.mean(distance(result)[result.time == t] < 1.0) for t in (20.0, 60.0))
        print(
            f"{name}: {result.status.counts()}, within 1 m of the dock: {early:.0%} after 20 s, {late:.0%} after 60 s"
        )
    print(plot(runs, "own_law.png"))
