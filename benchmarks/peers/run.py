"""The same problem solved by lgvi_warp and by other systems: time against error, one JSON line for each setting.

python benchmarks/peers/run.py                        all peers, one thread
python benchmarks/peers/run.py --quick --peers numba,lgvi_warp --out DIR

With --out the lines also go to DIR/peers.jsonl, and plot.py draws DIR/peers.png and prints its table to stderr.
A peer that is not installed gives a line with "missing". All settings take turns, so that what slows the machine for a
while slows them all; times leave out compilation. Versions: requirements.txt.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

PEERS = ("lgvi_warp", "heyoka", "numba", "numba_simd", "jax", "diffrax", "warp_ordinary", "mujoco", "newton")
RIGID_MEMBERS = 1024


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--quick", action="store_true", help="512 members and 5 s: to see that it runs")
    arguments.add_argument("--peers", default=",".join(PEERS), help=f"of {', '.join(PEERS)}")
    arguments.add_argument("--threads", type=int, default=1, help="for every peer (default 1)")
    arguments.add_argument("--rounds", type=int, default=3, help="of all settings in turn; times are medians")
    arguments.add_argument("--out", type=Path, help="a folder for peers.jsonl and peers.png")
    chosen = arguments.parse_args()
    names = chosen.peers.split(",")
    if unknown := set(names) - set(PEERS):
        arguments.error(f"no peers: {', '.join(sorted(unknown))}")
    keep_to_cores(chosen.threads)
    lines = []
    for record in measure(names, chosen.quick, chosen.threads, chosen.rounds):
        lines.append(json.dumps(record))
        print(lines[-1], flush=True)
    if chosen.out:
        chosen.out.mkdir(parents=True, exist_ok=True)
        (chosen.out / "peers.jsonl").write_text("\n".join(lines) + "\n")
        from benchmarks.peers import plot

        plot.draw([json.loads(line) for line in lines], chosen.out / "peers.png")
        note("\n" + plot.table([json.loads(line) for line in lines]))


def keep_to_cores(threads: int) -> None:
    """As many cores as threads for this process, before any peer counts them: JAX has no other setting."""
    if hasattr(os, "sched_setaffinity"):
        cores = sorted(os.sched_getaffinity(0))
        if threads > len(cores):
            raise SystemExit(f"{threads} threads, but this process may use {len(cores)} cores only")
        os.sched_setaffinity(0, cores[-threads:])


def note(text: str) -> None:
    """To stderr: what is going on."""
    print(text, file=sys.stderr, flush=True)


def measure(names: list[str], quick: bool, threads: int, rounds: int) -> Iterator[dict[str, Any]]:
    """One record for the machine, each problem's reference, each peer that is missing, and each setting."""
    from benchmarks.peers import problem as problems
    from benchmarks.peers import reference
    from lgvi_warp.common import machine, warp_setup
    from lgvi_warp.studies import speed

    warp_setup.start()
    yield {"machine": machine.describe(), "versions": machine.versions(), "threads": threads, "quick": quick}
    modules = {}
    for name in names:
        try:
            modules[name] = importlib.import_module(f"benchmarks.peers.peer_{name}")
        except ModuleNotFoundError as error:
            yield {"peer": name, "missing": error.name}
    members, t1 = (512, 5.0) if quick else (4096, 20.0)
    records, calls, closest = [], [], {}
    for kind in ("vehicle", "rigid"):
        taking = [name for name, module in modules.items() if kind in kinds(name, module)]
        if taking in ([], ["lgvi_warp"]) and kind == "rigid":
            continue
        problem = problems.make_problem(members if kind == "vehicle" else min(members, RIGID_MEMBERS), t1, kind)
        note(f"reference of {kind}")
        truth = reference.solve(problem)
        agreement = reference.agreement(problem, truth)
        closest[kind] = min(agreement.values())
        yield {"problem": kind, "members": problem.members, "t1": t1, "reference_agrees_to": agreement}
        for name in taking:
            for run in modules[name].runs(problem, threads):
                run.call()
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
    for (about, work, found), seconds in zip(records, speed.interleaved(calls, rounds), strict=True):
        yield about | {"us_per_vehicle_second": float(f"{1e6 * seconds / work:.4g}")} | found


def kinds(name: str, module: Any) -> tuple[str, ...]:
    """The problems that a peer takes."""
    return ("vehicle", "rigid") if name == "lgvi_warp" else (getattr(module, "PROBLEM", "vehicle"),)


if __name__ == "__main__":
    main()
