# SPDX-License-Identifier: Apache-2.0
"""Driven, damped motion: error and cost of each method and step for REMUS 100 with its rudder at 4 degrees.

As published but in the plane, as in examples/papers/prestero_2001/remus_100.py; the same with its drag 100 and 1000 times as
strong; in six degrees of freedom with linear damping of its roll, at 80 1/s, and as shipped; in the plane with a thruster that
lags and fins whose rate is limited, the rudder to 4 degrees at 5 s and to -4 degrees at 15 s; and BlueROV2 Heavy, whose
thrusters push unevenly. From 1 to 1.6 m/s, BlueROV2 at a third of that; errors are those after
30 s, the largest of the members, against rk8 at a tenth of its shortest step here. Last, for each error, the cheapest of these
settings beside the cheapest that a run takes which is given the step alone.
"""

import dataclasses

import numpy as np

import lgvi_warp as lw
from lgvi_warp.measuring import cost
from lgvi_warp.runs.run import run_plan
from lgvi_warp.runs.settle import make_plan

TIME = 30.0  # s
ERRORS = (1e-1, 1e-2, 1e-3, 1e-4)  # m
RUDDER = np.radians(4.0)
STEPS = {
    "psi_x": (0.1, 0.05, 0.02, 0.01, 0.005, 0.002),
    "rk4": (0.5, 0.4, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01),
    "rk8": (1.0, 0.75, 0.5, 0.4, 0.3, 0.2, 0.1, 0.05),
    "rkw3": (0.5, 0.4, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01),
}


PLANE = {"center_of_gravity": [0.0] * 3, "rigid_body_mass_matrix": np.diag([30.48] * 3 + [0.177, 3.45, 3.45])}
# The propeller 10 % slower from 10 s on.
LAGGING = [{
    "type": "thrusters", "position": [[-0.7, 0.0, 0.0]], "direction": [[1.0, 0.0, 0.0]], "coefficient": [3.86],
    "time_constant": 0.3, "times": [0.0, 10.0, 10.001], "command_schedule": [[1.0], [1.0], [0.9]],
}]  # fmt: skip
TURNED_IN, RATE = 1e-3, 0.35  # s, rad/s
RUDDER_STEPS = {
    "times": [0.0, 5.0, 5.0 + TURNED_IN, 15.0, 15.0 + TURNED_IN], "rate_limit": RATE, "command": None,
    "command_schedule": [[angle, 0.0] for angle in (0.0, 0.0, RUDDER, RUDDER, -RUDDER)],
}  # fmt: skip
NO_TORQUE = [{"type": "wrench", "force": [3.86, 0.0, 0.0]}]
# Name -> changes of the vehicle and its terms, factor of its drag, damping of roll [N m s].
SCENES = {
    "published": (PLANE, NO_TORQUE, 1.0, 0.0),
    "drag x 100": (PLANE, NO_TORQUE, 100.0, 0.0),
    "drag x 1000": (PLANE, NO_TORQUE, 1000.0, 0.0),
    "roll damping": ({}, [], 1.0, 20.0),
    "six degrees": ({}, [], 1.0, 0.0),
    "lags": (PLANE, LAGGING, 1.0, 0.0),
    "BlueROV2": None,
}
UNEVENLY = [0.4, 0.5, 0.45, 0.4, 0.1, 0.1, 0.1, 0.1]


def scene(vehicle, terms, strength, rolling):
    """The vehicle with this drag."""
    named = lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0} | vehicle, terms=terms)
    linear = np.diag([0.0, 0.0, 0.0, rolling, 0.0, 0.0])

    def changed(term):
        if isinstance(term, lw.terms.DragMatrix):
            return dataclasses.replace(term, linear=linear, quadratic=strength * np.asarray(term.quadratic))
        if isinstance(term, lw.terms.ControlFins) and terms is LAGGING:
            return dataclasses.replace(term, **RUDDER_STEPS)
        return term

    return dataclasses.replace(named, terms=[changed(term) for term in named.terms])


def fleet(name, members):
    """Level, at speeds ahead from 1 to 1.6 m/s."""
    nu, zero = np.zeros((members, 3)), np.zeros((members, 3))
    nu[:, 0] = np.linspace(1.0, 1.6, members)
    if name == "BlueROV2":
        pushed = {"thrusters.command": np.broadcast_to(UNEVENLY, (members, 8))}
        return lw.Ensemble.from_states(
            lw.Scene.named("bluerov2_heavy"), zero, np.tile(np.eye(3), (members, 1, 1)), nu / 3.0, zero, pushed
        )
    held = {"control_fins.command": np.broadcast_to([RUDDER, 0.0], (members, 2))}
    level = np.broadcast_to(np.eye(3), (members, 3, 3))
    return lw.Ensemble.from_states(scene(*SCENES[name]), zero, level, nu, zero, {} if name == "lags" else held)


# What is measured quickly: the first scene, and these steps.
QUICK = {"psi_x": (0.1, 0.05), "rk4": (0.2, 0.1)}


def ends(plan):
    """Positions (n, 3) and yaw rates (n,) at the end."""
    result = run_plan(plan, 1)
    return result.position[-1], result.angular_velocity[-1, :, 2]


def beside_the_default(name, records, defaults):
    """Cost of the default for each error over that of the best method; defaults: (method, step) for each step."""
    for error in ERRORS:
        good = [one for one in records if one["error_m"] is not None and one["error_m"] <= error]
        best = min(good, key=lambda one: one["us_per_vehicle_and_second"], default=None)
        own = [one for one in good if (one["method"], one["h"]) in defaults]
        default = min(own, key=lambda one: one["us_per_vehicle_and_second"], default=None)
        if best and default:
            yield {
                "scene": name,
                "to_m": error,
                "best": [best["method"], best["h"]],
                "default": [default["method"], default["h"]],
                "times_best": round(default["us_per_vehicle_and_second"] / best["us_per_vehicle_and_second"], 2),
            }


def run(quick):
    members, every, time = (64, QUICK, 3.0) if quick else (512, STEPS, TIME)
    for name in list(SCENES)[:1] if quick else SCENES:
        records = []
        ensemble = fleet(name, members)
        b, r = ends(make_plan(ensemble, "rk8", h=0.1 * min(STEPS["rk8"]), t1=time))
        defaults = {h: make_plan(ensemble, h=h, t1=time) for h in sorted(set().union(*every.values()))}
        defaults = {(plan.method.name, h): plan for h, plan in defaults.items()}
        named = [(method, h) for method, steps in every.items() for h in steps]
        plans = [make_plan(ensemble, method, h=h, t1=time) for method, h in named]
        plans += [plan for setting, plan in defaults.items() if setting not in named]
        reached = [ends(plan) for plan in plans]
        for plan, (position, rate), price in zip(plans, reached, cost.costs(plans), strict=True):
            with np.errstate(all="ignore"):
                error, off = np.abs(position - b).max(), np.abs(rate / r - 1.0).max()
            records.append(
                {
                    "scene": name,
                    "method": plan.method.name,
                    "h": plan.grid.h,
                    "error_m": float(f"{error:.1e}") if error < 10.0 else None,
                    "yaw_rate_off": float(f"{off:.1e}") if error < 10.0 else None,
                    "us_per_vehicle_and_second": round(price.us_per_vehicle_second, 3),
                }
            )
            yield records[-1]
        yield from beside_the_default(name, records, defaults.keys())
