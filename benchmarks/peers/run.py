# SPDX-License-Identifier: Apache-2.0
"""The same problem solved by lgvi_warp and by other systems: time against error, one JSON line for each setting.

With --out DIR the lines also go to DIR/peers.jsonl, DIR/peers.png is drawn and its table printed to stderr; --draw DIR
does the latter two again from DIR/peers.jsonl.
A peer that is not installed gives a line with "missing". All settings take turns, so that what slows the machine for a
while slows them all; times leave out compilation. The first round times all settings; later ones those that are
near the front of their peer. Versions: requirements.txt.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.pages import read, show
from benchmarks.peers.plot import TITLES
from lgvi_warp.measuring import cost

# What is measured, its members times seconds, its errors.
Setting = tuple[dict[str, Any], float, dict[str, float]]

PEERS = (
    "lgvi_warp", "hand_lanes", "heyoka", "numba", "numba_simd", "jax", "diffrax", "warp_ordinary", "mujoco", "newton",
)  # fmt: skip
RIGID_MEMBERS = 1024
# Later rounds repeat settings whose time is at most this many times their peer's cheapest of the same error.
NEAR_FRONT = 1.3
# Finer settings of a method are left out after a first call, compiling included, of more seconds.
LONGEST = 30.0


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--quick", action="store_true", help="512 members and 5 s: to see that it runs")
    parser.add_argument("--problems", default=",".join(TITLES), help=f"of {', '.join(TITLES)}")
    parser.add_argument("--peers", default=",".join(PEERS), help=f"of {', '.join(PEERS)}")
    parser.add_argument("--threads", type=int, default=1, help="for every peer (default 1)")
    parser.add_argument("--rounds", type=int, default=3, help="of all settings in turn; times are medians")
    parser.add_argument("--out", type=Path, metavar="DIR", help="a folder for peers.jsonl and peers.png")
    parser.add_argument("--draw", type=Path, metavar="DIR", help="measure nothing: draw the lines of an earlier --out")


def main(
    problems: str, peers: str, quick: bool, threads: int, rounds: int, out: Path | None, draw: Path | None
) -> None:
    if draw:
        return picture(draw)
    names, chosen = peers.split(","), problems.split(",")
    for option, given, known in (("peers", names, PEERS), ("problems", chosen, TITLES)):
        if unknown := set(given) - set(known):
            raise SystemExit(f"no {option}: {', '.join(sorted(unknown))}; --{option} takes some of {', '.join(known)}")
    keep_to_cores(threads)
    lines = [show(record) for record in measure(names, chosen, quick, threads, rounds)]
    if out:
        out.mkdir(parents=True, exist_ok=True)
        (out / "peers.jsonl").write_text("\n".join(lines) + "\n")
        picture(out)


def picture(folder: Path) -> None:
    """Draw the lines of a folder, and print their table."""
    from benchmarks.peers import plot

    records = read(folder / "peers.jsonl")
    plot.draw(records, folder / "peers.png")
    note("\n" + plot.table(records))


def keep_to_cores(threads: int) -> None:
    """Keep this process to as many cores as threads, before any peer counts them: JAX has no other setting."""
    if hasattr(os, "sched_setaffinity"):
        cores = sorted(os.sched_getaffinity(0))
        if threads > len(cores):
            raise SystemExit(f"{threads} threads, but this process may use {len(cores)} cores only")
        os.sched_setaffinity(0, cores[-threads:])


def note(text: str) -> None:
    """To stderr: what is going on."""
    print(text, file=sys.stderr, flush=True)


def measure(names: list[str], chosen: list[str], quick: bool, threads: int, rounds: int) -> Iterator[dict[str, Any]]:
    """One record for the machine, each problem's reference, each peer that is missing, and each setting."""
    from benchmarks.peers import problem as problems
    from benchmarks.peers import reference
    from lgvi_warp.common import machine, warp_setup

    warp_setup.start()
    yield {"machine": machine.describe(), "versions": machine.versions(), "threads": threads, "quick": quick}
    modules = {}
    for name in names:
        try:
            module = importlib.import_module(f"benchmarks.peers.peer_{name}")
            if hasattr(module, "ready"):
                module.ready()
            modules[name] = module
        except ModuleNotFoundError as error:
            yield {"peer": name, "missing": error.name}
    members, t1 = (512, 5.0) if quick else (4096, 20.0)
    records: list[Setting] = []
    calls, closest = [], {}
    for kind in chosen:
        taking = [name for name, module in modules.items() if kind in getattr(module, "PROBLEMS", ("vehicle",))]
        if taking in ([], ["lgvi_warp"]) and kind == "rigid":
            continue
        problem = problems.make_problem(min(members, RIGID_MEMBERS) if kind == "rigid" else members, t1, kind)
        note(f"reference of {kind}")
        truth = reference.solve(problem)
        agreement = reference.agreement(problem, truth)
        closest[kind] = min(agreement.values())
        yield {
            "problem": kind,
            "members": problem.members,
            "judged": len(truth[0]),
            "t1": t1,
            "reference_agrees_to": agreement,
        }
        for name in taking:
            slow = set()
            for run in modules[name].runs(problem, threads):
                if (run.method, run.dtype) in slow:
                    continue
                start = time.perf_counter()
                run.call()
                if time.perf_counter() - start > LONGEST:
                    slow.add((run.method, run.dtype))
                found = problems.error(run.end(), truth)
                note(f"{kind} {name} {run.method} {run.setting} {found['error_max']:.1e}")
                about = {"peer": name, "problem": kind, "method": run.method, "setting": run.setting}
                about |= {"dtype": run.dtype, "threads": threads, "members": run.members}
                records.append((about, run.members * t1, {key: float(f"{x:.3g}") for key, x in found.items()}))
                calls.append(run.call)
    for kind, difference in closest.items():
        smallest = min(found["error_max"] for about, _, found in records if about["problem"] == kind)
        yield {"problem": kind, "smallest_error": smallest, "reference_differs_by": float(f"{difference:.3g}")}
    note(f"{rounds} rounds of {len(calls)} settings")
    for (about, _, found), us in zip(records, costs_in_rounds(records, calls, rounds), strict=True):
        yield about | {"us_per_vehicle_second": float(f"{us:.4g}")} | found


def costs_in_rounds(records: list[Setting], calls: list[Callable[[], None]], rounds: int) -> list[float]:
    """Median time of each setting [us per vehicle and second]: of one reading where it is far from the front."""
    from benchmarks.peers import plot

    def timed(which: list[int]) -> list[float]:
        seconds = cost.in_turn([calls[i] for i in which], 1, time.perf_counter)
        return [1e6 * s / records[i][1] for i, (s,) in zip(which, seconds, strict=True)]

    readings = [[us] for us in timed(list(range(len(calls))))]
    first = [about | found | {"us_per_vehicle_second": us}
             for (about, _, found), (us,) in zip(records, readings, strict=True)]  # fmt: skip
    near = []
    for i, line in enumerate(first):
        cheapest, _ = plot.front(first, line["problem"], line["dtype"], line["peer"], line["error_max"])
        if line["us_per_vehicle_second"] <= NEAR_FRONT * cheapest:
            near.append(i)
    note(f"{rounds - 1} more of {len(near)} settings")
    for _ in range(rounds - 1):
        for i, us in zip(near, timed(near), strict=True):
            readings[i].append(us)
    return [median(us) for us in readings]
