# SPDX-License-Identifier: Apache-2.0
"""Processor time of a new Python that imports lgvi_warp, reads a name of it, or solves once, beside one that imports NumPy."""

import os
import resource
import subprocess
import sys
import tempfile
from statistics import median

from benchmarks.pages import ROOT

# Sixteen members, ten steps: what Warp, the device code and the run need beyond a scene that is there.
FIRST_SOLVE = """
import time
import lgvi_warp as lw
fleet = lw.Ensemble(lw.Scene.load('examples/paper.toml'), 16, 1)
begun = time.process_time()
lw.solve(fleet, 'psi_s', 0.01, 0.1)
print(time.process_time() - begun)
"""
CODES = {
    "numpy": "import numpy",
    "package": "import lgvi_warp",
    "scene": "import lgvi_warp; lgvi_warp.Scene",
    "solve": "import lgvi_warp; lgvi_warp.solve",
    "warp": "import warp",
}


def new_python(code, bytecode):
    """Output of a new Python. All packages are compiled to bytecode in that folder, as an installer does."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    environment["PYTHONPYCACHEPREFIX"] = bytecode
    run = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=ROOT, env=environment
    )
    return run.stdout


def processor_seconds(code, bytecode):
    """Processor time of one new Python [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    new_python(code, bytecode)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def run(quick):
    count = 1 + (2 if quick else 7)
    with tempfile.TemporaryDirectory() as bytecode:
        # The first round writes the bytecode, and compiles the kernel where no cache has it.
        rounds = [
            [*(processor_seconds(code, bytecode) for code in CODES.values()), float(new_python(FIRST_SOLVE, bytecode))]
            for _ in range(count)
        ][1:]
    seconds = dict(zip((*CODES, "first"), map(median, zip(*rounds, strict=True)), strict=True))
    yield {"numpy_s": round(seconds["numpy"], 3)} | {
        f"{name}_over_numpy": round(seconds[name] / seconds["numpy"], 2) for name in CODES if name != "numpy"
    }
    yield {"first_solve_s": round(seconds["first"], 3)}
