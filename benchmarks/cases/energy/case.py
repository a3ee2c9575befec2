# SPDX-License-Identifier: Apache-2.0
"""Joules per vehicle-second, all cores at work, as the processor's own counters tell them (Linux powercap, usually for root).

`joules` is what the packages of the processors took during a run, `joules_idle` what they take in as long a time without it,
and `joules_per_vehicle_second` their difference over the vehicles and the seconds that were simulated. The counters cover the
whole processor: other work counts too, so the machine should do nothing else.
"""

import time
from pathlib import Path

import lgvi_warp as lw
from lgvi_warp.common import machine
from lgvi_warp.measuring import speed
from lgvi_warp.runs.run import run_plan
from lgvi_warp.runs.settle import make_plan

COUNTERS = Path("/sys/class/powercap")
# AMD's too; "intel-rapl-mmio:0" counts a package a second time.
ZONES = "intel-rapl:*"
UNTOLD = "not told by this processor"


class Meter:
    """The energy counters of the packages of a machine's processors; none where they cannot be read."""

    def __init__(self, folder=COUNTERS):
        self.packages = [path for path in sorted(folder.glob(ZONES)) if is_package(path)]

    def read(self):
        """Joules that each package has taken so far, and the number at which its counter begins again."""
        return [tuple(1e-6 * float((path / name).read_text()) for name in ("energy_uj", "max_energy_range_uj"))
                for path in self.packages]  # fmt: skip

    def joules(self, call, clock=time.perf_counter):
        """(joules, seconds) of a call. A counter may begin again once meanwhile, which it does after some minutes."""
        before, begun = self.read(), clock()
        call()
        seconds = clock() - begun
        return sum((b - a) % span for (a, span), (b, _) in zip(before, self.read(), strict=True)), seconds


def is_package(path):
    """Whether a folder of powercap counts the energy of a whole processor, and can be read."""
    try:
        name, _ = (path / "name").read_text(), (path / "energy_uj").read_text()
    except OSError:
        return False
    return name.startswith("package")


def scenes(members):
    """Name -> members, method and step."""
    start = {"velocity": [1.5, 0.0, 0.0]}
    vary = {"start.angular_velocity": lw.distributions.Normal(std=0.01)}
    remus = lw.Scene.named("remus_100", vehicle={"buoyancy": 299.5}, start=start)
    return {
        "paper": (speed.fleet(members), "psi_s", 0.01),
        "remus_100": (lw.Ensemble(remus, members, 1, vary), "rk4", 0.02),
    }


def run(quick, meter=None):
    meter = meter or Meter()
    members, t1 = (2048, 1.0) if quick else (100_000, 60.0)
    for name, (fleet, method, h) in scenes(members).items():
        record = {"scene": name, "method": method, "h": h, "members": members, "t1": t1}
        if not meter.packages:
            yield record | {"joules_per_vehicle_second": UNTOLD}
            continue
        plan = make_plan(fleet, method, h=h, t1=t1, dtype="float64")
        plan.compile()
        joules, seconds = meter.joules(lambda plan=plan: run_plan(plan, machine.thread_count()))
        idle, idle_seconds = meter.joules(lambda seconds=seconds: time.sleep(seconds))
        idle *= seconds / idle_seconds
        yield record | {
            "seconds": round(seconds, 2),
            "joules": round(joules, 2),
            "joules_idle": round(idle, 2),
            "joules_per_vehicle_second": float(f"{(joules - idle) / (members * t1):.3g}"),
        }
