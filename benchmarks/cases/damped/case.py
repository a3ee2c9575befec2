"""Driven, damped motion: error and cost of each method and step for REMUS 100 with its rudder at 4 degrees.

As published but in the plane, as in examples/03_remus_100.py; the same with its drag 100 and 1000 times as strong; and in six
degrees of freedom with linear damping of its roll, at 80 1/s. From 1 to 1.6 m/s; errors are those after 30 s, the largest of
the members, against rk8 at a tenth of its shortest step here.
"""

import dataclasses

import numpy as np

import lgvi_warp as lw
from lgvi_warp.runs.run import run_plan
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.studies import cost

TIME = 30.0  # s
RUDDER = np.radians(4.0)
STEPS = {
    "psi_x": (0.1, 0.05, 0.02, 0.01, 0.005, 0.002),
    "rk4": (0.5, 0.4, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01),
    "rk8": (1.0, 0.75, 0.5, 0.4, 0.3, 0.2, 0.1, 0.05),
    "rkw3": (0.5, 0.4, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01),
}


PLANE = {"center_of_gravity": [0.0] * 3, "rigid_body_mass_matrix": np.diag([30.48] * 3 + [0.177, 3.45, 3.45])}
NO_TORQUE = [{"type": "wrench", "force": [3.86, 0.0, 0.0]}]
# Name -> changes of the vehicle and its terms, factor of its drag, damping of roll [N m s].
SCENES = {
    "published": (PLANE, NO_TORQUE, 1.0, 0.0),
    "drag x 100": (PLANE, NO_TORQUE, 100.0, 0.0),
    "drag x 1000": (PLANE, NO_TORQUE, 1000.0, 0.0),
    "roll damping": ({}, [], 1.0, 20.0),
}


def scene(vehicle, terms, strength, rolling):
    """The vehicle with this drag."""
    named = lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0} | vehicle, terms=terms)
    linear = np.diag([0.0, 0.0, 0.0, rolling, 0.0, 0.0])

    def damped(term):
        return dataclasses.replace(term, linear=linear, quadratic=strength * np.asarray(term.quadratic))

    terms = [damped(term) if isinstance(term, lw.DragMatrix) else term for term in named.terms]
    return dataclasses.replace(named, terms=terms)


def fleet(name, members):
    """Level, at speeds ahead from 1 to 1.6 m/s."""
    nu, zero = np.zeros((members, 3)), np.zeros((members, 3))
    nu[:, 0] = np.linspace(1.0, 1.6, members)
    command = {"control_fins.command": np.broadcast_to([RUDDER, 0.0], (members, 2))}
    level = np.broadcast_to(np.eye(3), (members, 3, 3))
    return lw.Ensemble.from_states(scene(*SCENES[name]), zero, level, nu, zero, command)


def ends(plan):
    """Positions (n, 3) and yaw rates (n,) at the end."""
    result = run_plan(plan, 1)
    return result.position[-1], result.angular_velocity[-1, :, 2]


def run(quick):
    members = 64 if quick else 512
    for name in SCENES:
        ensemble = fleet(name, members)
        b, r = ends(make_plan(ensemble, "rk8", h=0.1 * min(STEPS["rk8"]), t1=TIME))
        plans = [make_plan(ensemble, method, h=h, t1=TIME) for method, steps in STEPS.items() for h in steps]
        reached = [ends(plan) for plan in plans]
        for plan, (position, rate), price in zip(plans, reached, cost.costs(plans), strict=True):
            with np.errstate(all="ignore"):
                error, off = np.abs(position - b).max(), np.abs(rate / r - 1.0).max()
            yield {
                "scene": name,
                "method": plan.method.name,
                "h": plan.grid.h,
                "error_m": float(f"{error:.1e}") if error < 10.0 else None,
                "yaw_rate_off": float(f"{off:.1e}") if error < 10.0 else None,
                "us_per_vehicle_and_second": round(price.us_per_vehicle_second, 3),
            }
