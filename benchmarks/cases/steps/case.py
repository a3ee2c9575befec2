"""Cost and memory as steps grow: time per vehicle and step, and the peak memory of a process that does that run alone."""

import json
import subprocess
import sys

SCRIPT = """
import json, resource
from lgvi_warp.studies import speed
from lgvi_warp.runs.run import run_plan
from lgvi_warp.runs.settle import make_plan
plan = make_plan(speed.fleet({members}), "psi_s", h=0.01, t1=0.01 * {steps})
result = run_plan(plan, 1)
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps({{"run_s": result.run_seconds, "peak_MiB": peak}}))
"""


def run(quick):
    members = 1024
    for steps in (10, 100, 1000) if quick else (10, 100, 1000, 10_000, 100_000):
        code = SCRIPT.format(members=members, steps=steps)
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        out = json.loads(done.stdout)
        yield {
            "members": members,
            "steps": steps,
            "ns_per_vehicle_step": round(1e9 * out["run_s"] / (members * steps), 2),
            "process_peak_MiB": round(out["peak_MiB"], 1),
        }
