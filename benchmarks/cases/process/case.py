# SPDX-License-Identifier: Apache-2.0
"""The whole process `lgvi-warp run examples/paper.toml` beside a bare process, and the kernel's own time.

Plots and recording are included; the bare process imports warp, matplotlib and rerun. Both caches are warm.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

from lgvi_warp.common import machine
from lgvi_warp.runs.run import run_plan
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene

ROOT = Path(__file__).resolve().parents[3]
BARE = "import warp, matplotlib.figure, rerun"
COMMAND = "from lgvi_warp.cli import entry; import sys; sys.argv = {argv!r}; entry()"


def seconds(code):
    start = time.perf_counter()
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
    return time.perf_counter() - start


def run(quick):
    scene = Scene.load(ROOT / "examples" / "paper.toml")
    plan = make_plan(Ensemble.from_scene(scene))
    plan.compile()
    kernel = min(run_plan(plan, machine.thread_count()).run_seconds for _ in range(3))
    with tempfile.TemporaryDirectory() as folder:
        argv = ["lgvi-warp", "run", str(ROOT / "examples" / "paper.toml"), "--out", folder]
        command = COMMAND.format(argv=argv)
        rounds = 2 if quick else 7
        seconds(command), seconds(BARE)
        pairs = [(seconds(command), seconds(BARE)) for _ in range(rounds)]
    whole, bare = (median(column) for column in zip(*pairs, strict=True))
    yield {
        "process_s": round(whole, 2),
        "bare_imports_s": round(bare, 2),
        "kernel_s": round(kernel, 2),
        "over_twice_imports_plus_twice_kernel": round(whole / (2 * bare + 2 * kernel), 2),
    }
