# SPDX-License-Identifier: Apache-2.0
"""Other systems on the same problem, from the lines of one or more runs of `python -m benchmarks peers`."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from benchmarks.pages import markdown, read
from benchmarks.peers.plot import DECADES, DRIVEN, HOME, TITLES, front

NAMES = {
    "hand_lanes": "lanes by hand, C++",
    "numba_simd": "numba, written by hand over SIMD lanes",
    "heyoka": "heyoka, batch Taylor or its ensemble",
    "diffrax": "diffrax",
    "jax": "JAX",
    "numba": "numba, scalar",
    "warp_ordinary": "ordinary Warp kernel",
    "mujoco": "MuJoCo",
    "newton": "Newton",
}
# How many times faster than each peer the float64 front is meant to be, and down to which error.
WANTED = {"hand_lanes": (1.0 / 1.3, 0.0), "heyoka": (3.0, 1e-6), "diffrax": (10.0, 0.0)}

INTRODUCTION = """{title}: {members:,} members 10 % apart in their rates, {t1:g} s, {threads}.
Microseconds per vehicle and simulated second for each largest error of position [m] and attitude at the end, and in
brackets how many times lgvi_warp's in float64. {cpu}, {simd}.
"""
JUDGED = "Errors are those of the first {members} members; the reference is known to {known:.0e}.\n"


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("lines", type=Path, nargs="+", metavar="FILE", help="peers.jsonl of a run")
    parser.add_argument("--write", action="store_true", help="into the page; default: print only")


def main(lines: list[Path], write: bool) -> str | None:
    text = "\n".join(section(read(path)) for path in lines)
    if write:
        return text
    print(text)
    return None


def section(records: list[dict[str, Any]]) -> str:
    """The tables of one run, one for each problem, and where lgvi_warp is behind."""
    machine, parts = records[0]["machine"], []
    threads = records[0]["threads"]
    for problem in TITLES:
        about = next((one for one in records if one.get("problem") == problem and "t1" in one), None)
        others = [
            name for name in NAMES if any(one.get("peer") == name and one.get("problem") == problem for one in records)
        ]
        if about is None or not others:
            continue
        parts.append(
            INTRODUCTION.format(
                title=TITLES[problem][0].upper() + TITLES[problem][1:],
                members=about["members"],
                t1=about["t1"],
                threads="one thread" if threads == 1 else f"{threads} threads",
                cpu=machine["cpu"],
                simd=machine["simd"],
            )
        )
        if problem in DRIVEN:
            known = min(about["reference_agrees_to"].values())
            parts.append(JUDGED.format(members=about["judged"], known=known))
        parts.append(table(records, problem, others))
        if problem != "rigid":
            parts.append(behind(records, problem, others))
    return "\n".join(parts)


def table(records: list[dict[str, Any]], problem: str, others: list[str]) -> str:
    """A row for each decade."""
    head = ["error", HOME, f"{HOME}, float32", *(NAMES[name] for name in others)]
    rows = []
    for exponent in DECADES:
        target = 10.0**exponent
        home, method = front(records, problem, "float64", HOME, target)
        single, method32 = front(records, problem, "float32", HOME, target)
        cells = [f"1e{exponent}", cell(home, method), cell(single, method32)]
        for name in others:
            time, _ = front(records, problem, "float64", name, target)
            beside = f" ({ratio(time / home)})" if math.isfinite(home) else ""
            cells.append(f"{time:.3g}{beside}" if math.isfinite(time) else "")
        if any(cells[1:]):
            rows.append(cells)
    return markdown(head, rows) + "\n"


def ratio(value: float) -> str:
    """Two digits after the point, where they say something."""
    return f"{value:.2f}" if value < 2.0 else f"{value:.2g}"


def cell(time: float, method: str) -> str:
    """A time and by which method."""
    return f"{time:.3g} `{method}`" if math.isfinite(time) else ""


def behind(records: list[dict[str, Any]], problem: str, others: list[str]) -> str:
    """Notes on problems where another system is faster, or the lead is less than the goal."""
    lines = []
    for name in others:
        most, until = WANTED.get(name, (1.0, 0.0))
        short = []
        for exponent in DECADES:
            target = 10.0**exponent
            home, time = (front(records, problem, "float64", peer, target)[0] for peer in (HOME, name))
            single = front(records, problem, "float32", HOME, target)[0]
            wanted = most if target >= until else 1.0
            if math.isfinite(time) and time < wanted * home:
                also = f", float32 {ratio(time / single)}" if math.isfinite(single) else ""
                how = f"{ratio(time / home)}{also}" if math.isfinite(home) else "where none was measured of lgvi_warp"
                short.append(f"1e{exponent} ({how})")
        if short:
            what = "faster, or not slower," if most == 1.0 else f"less than {most:g} times slower"
            what = what if most >= 1.0 else f"more than {1.0 / most:g} times faster"
            lines.append(f"* {NAMES[name]} is {what} at {', '.join(short)}.")
    if not lines:
        return "lgvi_warp is ahead of each at every error.\n"
    return "**Where lgvi_warp is behind, or leads by less than was wanted:**\n\n" + "\n".join(lines) + "\n"
