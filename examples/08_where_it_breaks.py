# SPDX-License-Identifier: Apache-2.0
"""Where it breaks: for which steps and rates of turn each method is accurate, bounded, flagged, failed or silently wrong.

Each cell of the map is a few runs from starts turned at random; its class is that of the worst. The lines are limits known
from analysis, which the package warns of before and during a run.
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
