# SPDX-License-Identifier: Apache-2.0
"""Measure how much of the core's peak each method makes use of: paper's vehicle, REMUS 100, BlueROV2, each term alone.

Operations do not depend on the machine: they stay in benchmarks/rows/operations.json, and kernels that have changed since are
counted anew (`python -m benchmarks run operations`). Times are those of this machine, one core, beside its peak.
"""

import json
import time

from benchmarks.cases.operations import case
from benchmarks.pages import ROOT, markdown, show, stamp
from lgvi_warp.common.errors import SceneError
from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.peak import fma_peak
from lgvi_warp.measuring import speed
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.sampling.distributions.basic import Normal
from lgvi_warp.scene.ensemble import Ensemble

ROWS = ROOT / "benchmarks" / "rows" / "operations.json"
MEMBERS, STEPS, ROUNDS = 1024, 512, 11
SPREAD = {"start.angular_velocity": Normal(relative=0.1)}

TEXT = """{stamp}

One core, float64, default widths, {members} vehicles and {steps} steps, the least of {rounds} readings of processor
time. The peak of this core is {peak:.1f} thousand million fused multiply-adds a second in the same run: {flops:.0f} GFLOP/s.
The arrays of a launch hold {least} to {most} bytes a vehicle.

**The paper's vehicle**, every method of `lgvi-warp list methods`:

{paper}

**REMUS 100 and BlueROV2 Heavy** as shipped, under way:

{vehicles}

**Each term alone** on the paper's vehicle, with weight, buoyancy and restoring moment:

{terms}
"""
HEAD = ["operations", "fused as one", "slow", "ns", "GFLOP/s", "of the peak", "of the instructions"]


def add_options(parser):
    parser.add_argument("--count", action="store_true", help="count what has changed and keep it; measure nothing")
    parser.add_argument("--kept", dest="kept_alone", action="store_true", help="count nothing, leave out the rest")
    parser.add_argument("--quick", action="store_true", help="one reading of few steps: to see that it runs")


def kept():
    """The records of operations in their file."""
    return json.loads(ROWS.read_text()) if ROWS.exists() else []


def counted():
    """(scene, method) -> the record of its operations; those that changed are counted, and all are kept in the file."""
    known, records = kept(), {}
    for record in case.run(False, known):
        if "scene" not in record:
            raise SystemExit(f"table roofline: {record['operations']}")
        records[record["scene"], record["method"]] = record
        if record not in known:
            show(record)
            # At once: to count all takes long.
            keep({(one["scene"], one["method"]): one for one in known} | records)
    keep(records)
    return records


def keep(records):
    """Write the records of operations into their file."""
    ROWS.write_text("[\n" + ",\n".join(json.dumps(record) for record in records.values()) + "\n]\n")


def held(packets):
    """Bytes of a launch's arrays by vehicle."""
    laws = packets.laws
    arrays = [
        packets.state,
        packets.memory,
        packets.inertia.array,
        laws.table.array,
        *(one.array for one in laws.structs),
    ]
    return sum(array.capacity for array in arrays) / packets.members.count


def timed(chosen, quick):
    """[(scene's name, method, ns, bytes a vehicle)] of scenes that take turns."""
    members, steps, rounds = (256, 16, 1) if quick else (MEMBERS, STEPS, ROUNDS)
    plans = {}
    for name, scene, method, h in chosen:
        try:
            plans[name, method] = make_plan(Ensemble(scene, members, 1, SPREAD), method, h=h, t1=h * steps)
        except SceneError:
            continue
    fleets = []

    def packets_of(*arguments):
        fleets.append(Packets(*arguments))
        return fleets[-1]

    calls = [speed.stepper(plan, make=packets_of) for plan in plans.values()]
    seconds = speed.least(calls, rounds, clock=time.thread_time)
    return [(*key, 1e9 * one / (members * steps), held(packets))
            for key, one, packets in zip(plans, seconds, fleets, strict=True)]  # fmt: skip


def cells(record, ns, peak):
    """A line's numbers: what is counted, the time, and its parts of the peak [fused multiply-adds a second]."""
    rate = record["operations"] / ns
    return [
        f"{record['operations']:.0f}",
        f"{record['instructions']:.0f}",
        f"{record['slow']:.0f}",
        f"{ns:.1f}",
        f"{rate:.1f}",
        f"{50 * rate / (peak * 1e-9):.0f} %",
        f"{100 * record['instructions'] / ns / (peak * 1e-9):.0f} %",
    ]


def grouped(operations):
    """Table -> what is timed for it, where operations were counted."""
    groups = {"paper": [], "vehicles": [], "terms": []}
    for name, scene, method, h in case.entries(False):
        if (name, method) in operations:
            kind = {"paper": "paper", "remus_100": "vehicles", "bluerov2_heavy": "vehicles"}.get(name, "terms")
            groups[kind].append((name, scene, method, h))
    return groups


def main(count=False, kept_alone=False, quick=False):
    operations = {(one["scene"], one["method"]): one for one in kept()} if kept_alone else counted()
    if count:
        return None
    peak, tables = fma_peak("float64"), {}
    for kind, chosen in grouped(operations).items():
        tables[kind] = timed(chosen, quick)
        peak = max(peak, fma_peak("float64"))
    texts = {}
    for kind, found in tables.items():
        lines = [[name, f"`{method}`", *cells(operations[name, method], ns, peak)] for name, method, ns, _ in found]
        texts[kind] = markdown(["scene", "method", *HEAD], lines, "llrrrrrrr")
    sizes = [size for found in tables.values() for *_, size in found]
    return TEXT.format(
        stamp=stamp("roofline"), members=MEMBERS, steps=STEPS, rounds=ROUNDS, peak=peak * 1e-9, flops=2e-9 * peak,
        least=round(min(sizes)), most=round(max(sizes)), **texts,
    )  # fmt: skip
