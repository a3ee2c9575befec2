"""Samplings side by side: the error of a mean, the time to check all members and to draw a block, and memory.

python benchmarks/sampling_table.py [--quick]      writes docs/reference/sampling_costs.md
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

import lgvi_warp as lw
from lgvi_warp.common import machine

ROOT = Path(__file__).parent.parent
SAMPLINGS: dict[str, Any] = {
    "random": "random",
    "latin_hypercube (group of 256)": {"latin_hypercube": {"group": 256}},
    "sobol": "sobol",
    "halton": "halton",
}
VARY = {
    "vehicle.mass": lw.Normal(relative=0.001),
    "vehicle.inertia": lw.PhysicalInertia(sigma=0.05),
    "vehicle.center_of_buoyancy": lw.Normal(std=0.001),
    "start.angular_velocity": lw.Normal(std=(0.03, 0.02, 0.01)),
}
MEMBERS = (256, 1024, 4096)
T1 = 10.0
BLOCK = 4096
TRIALS = 3


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


def costs(sampling: Any, members: int) -> tuple[float, float, float]:
    """Seconds to make and check an ensemble, milliseconds to draw a block (least of 5), MB at the most; in a process."""
    code = f"from benchmarks import sampling_table as t; t.measure({sampling!r}, {members})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    made, drawn, memory = (float(word) for word in done.stdout.split())
    return made, drawn, memory


def most_memory() -> float:
    """Of this process so far [MB]. (What getrusage says begins with the parent's.)"""
    found = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    assert found is not None
    return int(found[1]) / 1e3


def measure(sampling: Any, members: int) -> None:
    """Print them."""
    scenery = scene()
    lw.Ensemble(scenery, BLOCK, 1, VARY, sampling).select(0, BLOCK)
    before = most_memory()
    begun = time.perf_counter()
    fleet = lw.Ensemble(scenery, members, 1, VARY, sampling)
    made = time.perf_counter() - begun
    times = []
    for i in range(5):
        begun = time.perf_counter()
        fleet.select(members - (i + 1) * BLOCK, members - i * BLOCK)
        times.append(time.perf_counter() - begun)
    print(made, 1e3 * min(times), most_memory() - before)


def page(seeds: int, members: int) -> str:
    """The page."""
    exact = float(np.mean([mean_depth(lw.Ensemble(scene(), 2**15, seed, VARY, "sobol")) for seed in range(100, 108)]))
    lines = [
        "# What samplings cost, and what they gain", "",
        "The paper's vehicle with mass, second moments of mass, center of buoyancy and angular velocity varied: 10 columns.",
        f"Mean depth after {T1:g} s; root mean square error over {seeds} seeds [m], from the mean of 8 Sobol sequences of",
        f"32,768 members. Then the time to make an ensemble of {members:,} members (all are drawn and checked), to draw its",
        f"last blocks of {BLOCK}, and the memory that both took beyond that of a small ensemble, in a process of its own, one",
        f"thread; the least of {TRIALS} processes.", "",
        f"Machine: {machine.describe()['cpu']}. Written by `python -m benchmarks table sampling`; do not edit.", "",
        "| sampling | " + " | ".join(f"error, {n}" for n in MEMBERS) + " | make and check [s] | block [ms] | memory [MB] |",
        "| --- |" + " ---: |" * (len(MEMBERS) + 3),
    ]  # fmt: skip
    # One after the other, three times: what else the machine does meets all alike.
    trials = [{name: costs(one, members // 256 * 256) for name, one in SAMPLINGS.items()} for _ in range(TRIALS)]
    least = {name: np.min([trial[name] for trial in trials], axis=0) for name in SAMPLINGS}
    for name, sampling in SAMPLINGS.items():
        found, (made, drawn, memory) = errors(sampling, exact, seeds), least[name]
        cells = [*(f"{one:.1e}" for one in found), f"{made:.2f}", f"{drawn:.1f}", f"{memory:.0f}"]
        lines.append(f"| `{name.split()[0]}`{name.removeprefix(name.split()[0])} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few seeds and members, printed and not written")
    quick = parser.parse_args().quick
    text = page(2 if quick else 24, 40_960 if quick else 1_000_000)
    if quick:
        print(text)
    else:
        (ROOT / "docs" / "reference" / "sampling_costs.md").write_text(text)


if __name__ == "__main__":
    main()
