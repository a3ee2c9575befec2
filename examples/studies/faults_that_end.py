# SPDX-License-Identifier: Apache-2.0
"""Rudder of a REMUS 100 that fails for some seconds in a turn: which kind, onset and duration does its autopilot bear?

    python examples/studies/faults_that_end.py [members]

It prints, for each kind, onset and duration, how many vehicles hold: the integral of their heading's error over the minute
stays below a bound. The last line tells the worst of them.
"""

import sys

import numpy as np

import lgvi_warp as lw

KINDS = ["stuck", "slow", "delay", "intermittent"]
ONSETS, LASTS, END = [0.5, 2.0], [1.0, 3.0, 10.0], 60.0  # s
ALLOWED = 4.5  # rad s, of the integral of the heading's error


def scene():
    """The vehicle turns by 60 degrees within some 7 s; its rudder has one of the kinds, as the sweep chooses."""
    fault = lw.control.Fault(
        name="rudder", of="control_fins", kind=KINDS, time=5.0, until=7.0, time_constant=5.0, delay=2.0, period=2.0
    )
    controller = lw.Controller(
        period=0.1,  # s between ticks
        sensors=[lw.control.Sensor(name="compass", of="heading", noise=0.01, outlier=0.02, outlier_std=0.2)],
        guidance=[lw.control.SetPoint(depth=10.0, heading=np.pi / 3.0)],
        laws=[
            lw.control.DepthPID(kp=0.1, ki=0.001, pitch_limit=0.5, kp_pitch=5.0, ki_pitch=0.3, kd_pitch=2.0),
            lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0),
        ],
        allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])],
        faults=[fault],
    )
    start = {"velocity": [1.54, 0.0, 0.0], "position": [0.0, 0.0, 10.0]}
    return lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0}, start=start, controller=controller)


def swept(members):
    """Sweep over kind, onset and duration: the same vehicles in each cell."""
    cases = {
        f"{kind} for {lasts:g} s from {onset:g} s": {
            "rudder.choice": float(i), "rudder.time": onset, "rudder.until": onset + lasts,
        }
        for i, kind in enumerate(KINDS) for onset in ONSETS for lasts in LASTS
    }  # fmt: skip
    vary = {
        "vehicle.buoyancy": lw.distributions.Uniform(297.0, 302.0),
        "heading_pid.kp": lw.distributions.Uniform(0.7, 1.3),
    }
    return lw.sweep(
        scene(), cases=cases, members=members, seed=1, vary=vary, t1=END, h=0.05,
        metrics=[lw.metrics.IAE("heading")], success={"status": "ok", "iae heading": {"below": ALLOWED}},
    )  # fmt: skip


if __name__ == "__main__":
    found = swept(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
    shares = {name: 100.0 * found.passed(found.cell(name)).mean() for name in found.cases}
    for name, share in shares.items():
        error = found.record(found.cell(name)).numbers["iae heading"].mean()
        print(f"{name}: {share:.0f} % hold, error of the heading {error:.1f} rad s")
    worst = min(shares, key=shares.get)
    print(f"Worst of {len(shares)}: {worst}, of which {shares[worst]:.0f} % hold")
