# SPDX-License-Identifier: Apache-2.0
"""Where it breaks: steps and rates of turn where methods are accurate, bounded, flagged, failed or silently wrong.

Each cell of the map has four runs, three of them from random starts, and the class of the worst run. The lines are
analytic limits of the methods. The package warns of these limits before and during a run.
"""

from collections import Counter
from pathlib import Path

import lgvi_warp as lw

scene = lw.Scene.load(Path(__file__).parent / "paper.toml")

if __name__ == "__main__":
    found = lw.stability_map(scene, "h=0.01:2", "angular_velocity=0.1:20", ["psi_s", "psi_x", "rk4", "rk8"])
    for method in found.methods:
        counts = Counter(int(cell) for cell in found.classes[method].ravel())
        words = ("accurate", "bounded", "flagged", "failed", "silently wrong")
        print(f"{method}: " + ", ".join(f"{counts[i]} {word}" for i, word in enumerate(words) if counts[i]))
    lw.plots.stability(found, path="08_where_it_breaks.png")
    print("08_where_it_breaks.png")
