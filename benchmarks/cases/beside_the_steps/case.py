# SPDX-License-Identifier: Apache-2.0
"""Cost of a launch beside its steps: a + b n of launches of n steps and one sample, beside the core's peak.

a, per vehicle: the state and the constants are read, the start and the end are looked at, a sample and the state are written.
"""

import numpy as np
import warp as wp

import lgvi_warp as lw
from benchmarks.timing import least
from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.peak import fma_peak
from lgvi_warp.runs.settle import make_plan

VEHICLES = ("nordkvist_sanyal", "remus_100", "bluerov2_heavy")
METHODS = ("rk4", "psi_x")
CHECKS = ("none", "safe")
# Shorter than a chunk, so that the checks look twice: at the start and at the end.
STEPS = (1, 2, 5, 10, 20, 40)
H = 0.02
IN_A_ROW = 4


def fleet(vehicle, members):
    """Members of a named vehicle under way, whose angular velocities differ."""
    start = {"velocity": [1.0, 0.1, 0.05], "angular_velocity": [0.02, 0.01, 0.03]}
    vary = {"start.angular_velocity": lw.distributions.Normal(relative=0.1)}
    return lw.Ensemble(lw.Scene.named(vehicle, start=start), members, 1, vary)


class Launch:
    """Launches of so many steps from the same start; only the position and attitude at the end are a sample."""

    def __init__(self, members, method, checks, steps):
        save = lw.SaveAt(fields=("position", "attitude"))
        plan = make_plan(members, method, h=H, t1=H * steps, save=save, dtype="float64", checks=checks)
        plan.compile()
        self._steps, self._packets = steps, Packets(plan, members.select(0, members.members))
        self._start = wp.clone(self._packets.state)

    def begin(self):
        """Put the start back."""
        wp.copy(self._packets.state, self._start)

    def make(self):
        """Make the steps."""
        self._packets.launch(0, self._steps)


def fitted(seconds, members):
    """(a, b) of a + b n: ns a vehicle beside the steps, and ns a vehicle and step."""
    ns = np.array(seconds) * 1e9 / members
    b, a = np.polyfit(STEPS, ns, 1, w=1.0 / ns)  # errors are in proportion
    return a, b


def run(quick):
    members, rounds = (256, 10) if quick else (1024, 60)
    peak = fma_peak("float64")
    for vehicle in VEHICLES[: 1 if quick else None]:
        around, few = fleet(vehicle, members), fleet(vehicle, 8)
        for method in METHODS:
            launches = [Launch(around, method, checks, n) for checks in CHECKS for n in STEPS]
            # What Python takes for any launch: one of a packet or less takes hardly more.
            launches.append(Launch(few, method, "none", 1))
            # Several times in a row: after a long launch of another kernel the first one finds cold caches.
            calls = [each for each in launches for _ in range(IN_A_ROW)]
            times = least([each.make for each in calls], rounds, [each.begin for each in calls])
            *seconds, launch = np.reshape(times, (-1, IN_A_ROW)).min(axis=1)
            for i, checks in enumerate(CHECKS):
                a, b = fitted(seconds[i * len(STEPS) : (i + 1) * len(STEPS)], members)
                yield {"vehicle": vehicle, "method": method, "checks": checks, "ns_beside_the_steps": round(a, 1),
                       "of_it_the_launch": round(1e9 * launch / members, 1), "ns_a_step": round(b, 2),
                       "steps_beside": round(a / b, 1), "fma_at_peak_beside_the_steps": round(a * 1e-9 * peak),
                       "fma_at_peak_a_step": round(b * 1e-9 * peak), "peak_gfma": round(peak / 1e9, 1)}  # fmt: skip
