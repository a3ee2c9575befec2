# SPDX-License-Identifier: Apache-2.0
"""One sweep written three ways: two TOML files, vectorised NumPy, a loop over a public simulator; lines and seconds.

A vehicle holds its place in a current under two laws, with and without delay; five metrics, success, intervals. NumPy and ours
step by rk4; auv_sim_bench (on PyPI) steps by its own Euler method. All must say the same of each member, within what their
methods err, or nothing is measured. Processor time, in turn. The programs by hand are given the numbers of the members; they
run a part of them, and their seconds are scaled to all. A package that is missing gives a line that says so.
"""

import ast
import importlib
import io
import time
import tokenize
from functools import partial
from pathlib import Path

import numpy as np

import lgvi_warp as lw
from benchmarks.timing import least
from lgvi_warp.robustness.sweeps.file import arguments_of_file

HERE = Path(__file__).parent
OURS = ("scene.toml", "sweep.toml")
# Module, order of its method, how many members are timed and compared.
PEERS = {"NumPy": ("numpy_sweep", 4, 1024, 64), "auv_sim_bench": ("simulator_sweep", 1, 2, 2)}


def code_lines(text, suffix):
    """The number of lines with more than a comment, and outside of docstrings, of a file ".toml" or ".py"."""
    if suffix == ".toml":
        return sum(bool(line.split("#")[0].strip()) for line in text.splitlines())
    nodes = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    documented = [
        node.body[0] for node in ast.walk(ast.parse(text)) if isinstance(node, nodes) and ast.get_docstring(node)
    ]
    words = {line for text_node in documented for line in range(text_node.lineno, text_node.end_lineno + 1)}
    silent = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    spans = [range(token.start[0], token.end[0] + 1) for token in tokens if token.type not in silent]
    return len({line for span in spans for line in span} - words)


def lines_of(*names):
    """The lines of some files of this folder."""
    return sum(code_lines((HERE / name).read_text(), Path(name).suffix) for name in names)


def our_sweep(members=None):
    """The sweep of the two files; members: of every case, by default as many as the file says."""
    arguments = arguments_of_file(HERE / OURS[1])
    return lw.sweep(**arguments | ({} if members is None else {"members": members}), threads=1)


def numbers_of(sweep, count):
    """The numbers of the first members, as the programs by hand take them."""
    inputs = sweep.inputs(sweep.cells[0])
    current = [inputs["current.velocity[0]"], inputs["current.velocity[1]"], np.zeros(sweep.members_count)]
    return {"buoyancy": inputs["vehicle.buoyancy"][:count], "current": np.stack(current, axis=1)[:count]}


def differences(sweep, cells, fine):
    """For each metric the largest difference of a member from ours, and what it may be by what half the step changes.

    Args:
        sweep: ours.
        cells: metrics of a program by hand, by cell.
        fine: the same with half the step.

    Returns:
        {metric: (difference, change by half the step)}; infinite where a number is finite in one and not in the other.
    """
    largest = {}
    for cell in sweep.cells:
        key = (cell.case.name, cell.point["controller.delay"])
        for name, numbers in cells[key].items():
            ours = sweep.record(cell).numbers[name][: len(numbers)]
            pair = (_apart(ours, numbers), _apart(fine[key][name], numbers))
            largest[name] = tuple(map(max, largest.get(name, (0.0, 0.0)), pair))
    return largest


def _apart(first, second):
    """The largest difference; where both are infinite it is 0."""
    return float(np.max(np.where(first == second, 0.0, np.abs(first - np.where(np.isinf(second), -1e300, second)))))


def disagreements(apart, order):
    """The metrics that differ by more than the methods err.

    A method of order p errs by 2^p / (2^p - 1) of what half its step changes; of rk4 both programs err, in numbers of their
    own for the attitude. Ticks are 0.1 s apart: a band or a limit may be met one tick earlier or later.
    """
    of_ticks = {"settling_time depth": 0.101, "saturation_share": 1.01 / 300.0}
    # A quarter more for what higher orders leave; the errors of two programs that step by rk4.
    error = 1.25 * 2.0**order / (2.0**order - 1.0) * (2.0 if order == 4 else 1.0)

    def most(name, change):
        return error * change + of_ticks.get(name, 0.0) + 1e-9

    return [name for name, (difference, change) in apart.items() if difference > most(name, change)]


def compared(sweep, way):
    """Line on a program by hand, and the call that is timed; no call where a package is missing."""
    module, order, timed, count = PEERS[way]
    row = {"way": way, "lines": lines_of("by_hand.py", f"{module}.py")}
    try:
        program = importlib.import_module(f"benchmarks.cases.sweep_peers.{module}")
    except ModuleNotFoundError as error:
        return row | {"missing": error.name}, None
    few = numbers_of(sweep, count)
    apart = differences(sweep, program.sweep(few)[0], program.sweep(few, 2)[0])
    if wrong := disagreements(apart, order):
        raise SystemExit(
            f"sweep_peers: {way} says another {', '.join(wrong)}; until it does not, its time says nothing"
        )
    within = {name: float(f"{difference:.1g}") for name, (difference, _) in apart.items()}
    some = numbers_of(sweep, timed)
    return row | {"members_timed": len(some["buoyancy"]), "differs_by": within}, partial(program.sweep, some)


def run(quick):
    """Yield a line for each way."""
    sweep = our_sweep(64 if quick else None)
    members = sweep.members_count
    row = {"way": "lgvi_warp", "lines": lines_of(*OURS), "members_timed": members}
    lines = [(row, partial(our_sweep, members)), *(compared(sweep, way) for way in PEERS)]
    yield from (row for row, call in lines if call is None)
    ready = [(row, call) for row, call in lines if call]
    times = least([call for _, call in ready], 1 if quick else 3, clock=time.process_time)
    for (row, _), taken in zip(ready, times, strict=True):
        seconds = taken * members / row["members_timed"]
        numbers = {"seconds": float(f"{seconds:.3g}"), "over_ours": round(seconds / times[0], 1)}
        yield row | {"members": members, "cells": len(sweep.cells)} | numbers
