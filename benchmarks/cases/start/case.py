# SPDX-License-Identifier: Apache-2.0
"""Processor time of a new Python that imports lgvi_warp, reads a name of it, or solves once, beside one that imports NumPy."""

import os
import resource
import subprocess
import sys
import tempfile
from statistics import median

from benchmarks.pages import ROOT

FLEET = "import lgvi_warp as lw; fleet = lw.Ensemble(lw.Scene.load('examples/paper.toml'), 16, 1)"
CODES = {
    "numpy": "import numpy",
    "package": "import lgvi_warp",
    "scene": "import lgvi_warp; lgvi_warp.Scene",
    "solve": "import lgvi_warp; lgvi_warp.solve",
    "warp": "import warp",
    "fleet": FLEET,
    "first_solve": f"{FLEET}; lw.solve(fleet, 'psi_s', 0.01, 0.1)",
}


def processor_seconds(code, bytecode):
    """Processor time of one new Python [s]. All packages are compiled to bytecode in that folder, as an installer does."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-c", code],
        check=True,
        capture_output=True,
        cwd=ROOT,
        env=environment | {"PYTHONPYCACHEPREFIX": bytecode},
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def run(quick):
    with tempfile.TemporaryDirectory() as bytecode:
        # The first round writes the bytecode, and compiles the kernel where no cache has it.
        rounds = [
            [processor_seconds(code, bytecode) for code in CODES.values()] for _ in range(1 + (2 if quick else 7))
        ][1:]
    seconds = dict(zip(CODES, map(median, zip(*rounds, strict=True)), strict=True))
    yield {"numpy_s": round(seconds["numpy"], 3)} | {
        f"{name}_over_numpy": round(seconds[name] / seconds["numpy"], 2) for name in CODES if name != "numpy"
    }
    # Sixteen members, ten steps: what Warp, the device code and the run need beyond a scene that is there.
    yield {"first_solve_s": round(seconds["first_solve"] - seconds["fleet"], 3)}
