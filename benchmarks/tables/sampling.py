# SPDX-License-Identifier: Apache-2.0
"""Samplings side by side: the error of a mean, the time to check all members and to draw a block, and memory."""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np

import lgvi_warp as lw
from benchmarks import own_process
from benchmarks.pages import ROOT, markdown, stamp

SAMPLINGS: dict[str, Any] = {
    "random": "random",
    "latin_hypercube (group of 256)": {"latin_hypercube": {"group": 256}},
    "sobol": "sobol",
    "halton": "halton",
}
VARY = {
    "vehicle.mass": lw.distributions.Normal(relative=0.001),
    "vehicle.inertia": lw.distributions.PhysicalInertia(sigma=0.05),
    "vehicle.center_of_buoyancy": lw.distributions.Normal(std=0.001),
    "start.angular_velocity": lw.distributions.Normal(std=(0.03, 0.02, 0.01)),
}
MEMBERS = (256, 1024, 4096)
T1 = 10.0
BLOCK = 4096
TRIALS = 3

TEXT = """Mean depth after {t1:g} s; root mean square error over {seeds} seeds [m], from the mean of 8 Sobol sequences of
32,768 members. Then the time to make an ensemble of {members:,} members (all are drawn and checked), to draw its
last blocks of {block}, and the memory that both took beyond that of a small ensemble, in a process of its own, one
thread; the least of {trials} processes."""


def scene() -> lw.Scene:
    """The paper's vehicle and start."""
    return lw.Scene.load(ROOT / "examples" / "paper.toml")


def mean_depth(fleet: lw.Ensemble) -> float:
    """Mean depth after T1 [m]."""
    result = lw.solve(fleet, h=0.02, t1=T1, save=lw.SaveAt(fields=("position",)))
    return float(result.position[-1, :, 2].mean())


def errors(sampling: Any, exact: float, seeds: int) -> list[float]:
    """Root mean square error of the mean depth over seeds [m], for each number of members."""
    found = []
    for n in MEMBERS:
        means = [mean_depth(lw.Ensemble(scene(), n, seed, VARY, sampling)) for seed in range(seeds)]
        found.append(float(np.sqrt(np.mean((np.array(means) - exact) ** 2))))
    return found


def measure(sampling: Any, members: int) -> tuple[float, float, float]:
    """Seconds to make and check an ensemble, milliseconds to draw a block (least of 5), MB at the most; in this process."""
    scenery = scene()
    lw.Ensemble(scenery, BLOCK, 1, VARY, sampling).select(0, BLOCK)
    before = own_process.peak_memory()
    begun = time.perf_counter()
    fleet = lw.Ensemble(scenery, members, 1, VARY, sampling)
    made = time.perf_counter() - begun
    times = []
    for i in range(5):
        begun = time.perf_counter()
        fleet.select(members - (i + 1) * BLOCK, members - i * BLOCK)
        times.append(time.perf_counter() - begun)
    return made, 1e3 * min(times), (own_process.peak_memory() - before) / 1e6


def table(seeds: int, members: int) -> str:
    """The text of the page."""
    exact = float(np.mean([mean_depth(lw.Ensemble(scene(), 2**15, seed, VARY, "sobol")) for seed in range(100, 108)]))
    # One after the other, three times: what else the machine does meets all alike.
    trials = [
        [own_process.call(measure, one, members // 256 * 256) for one in SAMPLINGS.values()] for _ in range(TRIALS)
    ]
    rows = []
    for (name, sampling), (made, drawn, memory) in zip(SAMPLINGS.items(), np.min(trials, axis=0), strict=True):
        kind, _, group = name.partition(" ")
        found = [f"{one:.1e}" for one in errors(sampling, exact, seeds)]
        rows.append([f"`{kind}` {group}".strip(), *found, f"{made:.2f}", f"{drawn:.1f}", f"{memory:.0f}"])
    head = ["sampling", *(f"error, {n}" for n in MEMBERS), "make and check [s]", "block [ms]", "memory [MB]"]
    about = TEXT.format(t1=T1, seeds=seeds, members=members, block=BLOCK, trials=TRIALS)
    return "\n\n".join([about, stamp("sampling"), markdown(head, rows, "l" + 6 * "r")])


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--quick", action="store_true", help="few seeds and members, printed and not written")


def main(quick: bool) -> str | None:
    if not quick:
        return table(24, 1_000_000)
    print(table(2, 40_960))
    return None
