# SPDX-License-Identifier: Apache-2.0
"""Measure how long 10,000 REMUS 100 take for 60 s, here and by other tools, keep the rows, and draw them as bars.

Each tool uses the cheapest of its settings that is right to 1e-2 (position [m] and attitude of every member that is
judged). Python Vehicle Simulator (github.com/cybergalactic/PythonVehicleSimulator) has no such settings: its REMUS, its
autopilots and its own step of 0.02 s, one vehicle after the other; `--simulator DIR` measures it, from a clone. The rows
stay in benchmarks/rows; `--kept` writes the table and the picture again without measuring the others. These:
`make .venv-peers/.done`.
"""

from __future__ import annotations

import argparse
import importlib
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from benchmarks.bars_picture import NAMES, draw, picture_of, rows_of, words
from benchmarks.pages import markdown, stamp
from benchmarks.peers import problem as problems
from benchmarks.peers import reference
from benchmarks.peers.run import keep_to_cores

PROBLEM, TARGET = "remus_100", 1e-2
PEERS = ("lgvi_warp", "numba_simd", "diffrax", "heyoka", "warp_ordinary")
ROUNDS = 3
LOOP, SAMPLE = "simulator", 0.02  # the simulator, and its own step [s]


class Size(NamedTuple):
    """Size of a run: members, seconds of a motion, and seconds of the simulator's one vehicle."""

    members: int
    t1: float
    alone: float


WHOLE, QUICK = Size(10_000, 60.0, 20.0), Size(64, 2.0, 0.2)


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--quick", action="store_true", help="64 members and 2 s, into --rows: to see that it runs")
    parser.add_argument("--rows", type=Path, default=rows_of(), help="where the rows go (default: those of the page)")
    clone = "a clone of Python Vehicle Simulator, which is measured anew; default: its row is kept"
    parser.add_argument("--simulator", type=Path, metavar="DIR", help=clone)
    parser.add_argument("--kept", action="store_true", help="measure nothing: the table and the picture from the rows")


def main(quick: bool, rows: Path, simulator: Path | None, kept: bool) -> str | None:
    if quick and rows == rows_of():
        raise SystemExit("table bars --quick: rows of a small run are none of the page; name another file by --rows")
    size, before = QUICK if quick else WHOLE, json.loads(rows.read_text()) if rows.exists() else {"rows": []}
    content = before if kept else measured(size)
    if simulator or not kept:
        loop = [alone(size, simulator)] if simulator else [row for row in before["rows"] if row["tool"] == LOOP]
        content["rows"] = [row for row in content["rows"] if row["tool"] != LOOP] + loop
        content["rows"].sort(key=lambda row: row["seconds"])
        keep(rows, content)
    if rows != rows_of():
        print(text_of(content))
        return None
    draw(content)
    return text_of(content)


def measured(size: Size) -> dict[str, Any]:
    """Measure all tools on one core, in turns; returns what is kept."""
    keep_to_cores(1)
    problem = problems.make_problem(size.members, size.t1, PROBLEM)
    truth = reference.solve(problem)
    found, missing = [], []
    for peer in PEERS:
        try:
            module = importlib.import_module(f"benchmarks.peers.peer_{peer}")
        except ModuleNotFoundError as error:
            missing.append(f"{NAMES[peer]} was not measured: {error.name} is missing")
            continue
        found += [(peer, run, error) for run, error in enough(module, problem, truth)]
    readings: list[list[float]] = [[] for _ in found]
    for _ in range(ROUNDS):
        for (_, run, _), times in zip(found, readings, strict=True):
            times.append(timed(run.call) * size.members / run.members)
    rows = [
        {"tool": peer, "method": run.method, "setting": run.setting, "dtype": run.dtype, "measured": run.members,
         "error": float(f"{error:.2g}"), "seconds": float(f"{median(times):.3g}")}
        for (peer, run, error), times in zip(found, readings, strict=True)
    ]  # fmt: skip
    cheapest = []
    for peer, dtype in dict.fromkeys((row["tool"], row["dtype"]) for row in rows):
        same = [row for row in rows if (row["tool"], row["dtype"]) == (peer, dtype)]
        cheapest.append(min(same, key=lambda row: row["seconds"]))
    return {"where": stamp("bars"), "members": size.members, "t1": size.t1, "target": TARGET,
            "judged": len(truth[0]), "missing": missing,
            "rows": cheapest}  # fmt: skip


def enough(module: Any, problem: problems.Problem, truth: problems.End) -> Iterator[tuple[problems.Run, float]]:
    """The coarsest setting of each method and precision that is right to TARGET, and its error."""
    done = set()
    for run in module.runs(problem, 1):
        if (run.method, run.dtype) in done:
            continue
        run.call()
        error = problems.error(run.end(), truth)["error_max"]
        if error <= TARGET:
            done.add((run.method, run.dtype))
            print(f"{module.__name__} {run.method} {run.dtype} {run.setting} {error:.1e}", file=sys.stderr, flush=True)
            yield run, error


def timed(call: Any, clock: Any = time.perf_counter) -> float:
    start = clock()
    call()
    return clock() - start


def alone(size: Size, clone: Path) -> dict[str, Any]:
    """The simulator's loop: one vehicle, as long as all members would take one after the other."""
    sys.path.append(str(clone / "src"))
    from python_vehicle_simulator.lib import simulate
    from python_vehicle_simulator.vehicles import remus100

    commit = subprocess.run(
        ["git", "-C", clone, "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True
    )
    steps = round(size.alone / SAMPLE)
    vehicle = remus100("depthHeadingAutopilot", 10, 30, 1525, 0, 0)
    seconds = median(timed(lambda: simulate(steps, SAMPLE, vehicle), time.process_time) for _ in range(ROUNDS))
    return {"tool": LOOP, "method": "Euler", "setting": f"h={SAMPLE:g}, commit {commit.stdout.strip()}", "dtype": "float64",
            "measured": 1, "error": None,
            "seconds": float(f"{seconds * size.members * size.t1 / size.alone:.3g}")}  # fmt: skip


def keep(path: Path, content: dict[str, Any]) -> None:
    """Write the rows, one to a line."""
    rows = ",\n  ".join(json.dumps(row) for row in content["rows"])
    head = json.dumps({key: value for key, value in content.items() if key != "rows"}, indent=1)
    path.write_text(f'{head[:-2]},\n "rows": [\n  {rows}\n ]\n}}\n')


def text_of(content: dict[str, Any]) -> str:
    """The text between the marks, from the rows that are kept."""
    home = next(row for row in content["rows"] if row["tool"] == "lgvi_warp" and row["dtype"] == "float64")
    rows = []
    for row in content["rows"]:
        error = "its own model and step" if row["error"] is None else f"{row['error']:.1e}"
        rows.append([NAMES[row["tool"]], row["dtype"], f"`{row['method']}`, {row['setting']}", error,
                     f"{row['measured']:,}", words(row["seconds"]), f"{row['seconds'] / home['seconds']:.2g}"])  # fmt: skip
    head = ["tool", "dtype", "cheapest setting", "largest error", "vehicles measured", "time", "times lgvi_warp's"]
    lines = [
        f"![Seconds for {content['members']:,} vehicles by tool]({picture_of().name})", "",
        f"{content['members']:,} REMUS 100 that sink under thrust for {content['t1']:g} s, one core, compiled before. "
        f"Errors are at the end, the largest of {content['judged']} members, position [m] and attitude; at most "
        f"{content['target']:g} is asked. Where fewer vehicles were measured, the time is scaled; "
        f"for the loop (`--simulator DIR`) it is processor time. {content['where']}", "",
        *(f"{line}." for line in content["missing"]),
        markdown(head, rows, "lllrrrr"),
    ]  # fmt: skip
    return "\n".join(lines)
