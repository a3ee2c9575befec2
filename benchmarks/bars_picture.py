# SPDX-License-Identifier: Apache-2.0
"""The bars of README: how long 10,000 vehicles take by each tool."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "docs"))

from site_parts import pictures as kept  # noqa: E402

NAMES = {
    "lgvi_warp": "lgvi_warp",
    "numba_simd": "numba, SIMD lanes by hand",
    "diffrax": "diffrax",
    "heyoka": "heyoka",
    "warp_ordinary": "ordinary Warp kernel",
    "simulator": "Python Vehicle Simulator, its own step",
}
# In inches; at 100 pixels to the inch as wide as the column of README, and drawn twice as fine.
SIZE, FINE = (8.38, 3.4), 200
OURS, OTHERS = "#0072b2", "#9aa5b1"


def rows_of() -> Path:
    """Path of the rows."""
    return ROOT / "benchmarks" / "rows" / "bars.json"


def picture_of() -> Path:
    """The picture on its page."""
    return ROOT / "docs" / "guide" / "beside_others.png"


def words(seconds: float) -> str:
    """A time as people say it."""
    if seconds < 100.0:
        return f"{seconds:.2g} s" if seconds < 10.0 else f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"


def label(row: dict[str, Any]) -> str:
    """The name of a bar."""
    return NAMES[row["tool"]] + (", float32" if row["dtype"] == "float32" else "")


def draw(content: dict[str, Any]) -> None:
    """Draw the bars from the rows, with the hash of what made them."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    rows = content["rows"][::-1]
    with plt.rc_context({"font.size": 12, "axes.titlesize": 13}):
        figure, axes = plt.subplots(figsize=SIZE, layout="constrained")
        colors = [OURS if row["tool"] == "lgvi_warp" else OTHERS for row in rows]
        bars = axes.barh([label(row) for row in rows], [row["seconds"] for row in rows], color=colors, height=0.7)
        axes.bar_label(bars, [words(row["seconds"]) for row in rows], padding=4)
        axes.set_xscale("log")
        axes.set_xlim(right=axes.get_xlim()[1] * 2.5)
        axes.set_title(
            f"{content['members']:,} REMUS 100 for {content['t1']:g} s on one core, right to 1 cm", loc="left"
        )
        axes.set_xlabel("time, logarithmic")
        axes.xaxis.set_major_formatter(lambda seconds, _: f"{seconds:,.3g} s" if seconds < 1e3 else f"{seconds:,.0f} s")
        axes.grid(True, axis="x", alpha=0.3)
        axes.set_axisbelow(True)
        axes.minorticks_off()
        axes.spines[["top", "right", "left"]].set_visible(False)
        axes.tick_params(axis="y", length=0)
        target = picture_of()
        figure.savefig(target, dpi=FINE)
        plt.close(figure)
    kept.keep(target, target, script=kept.made_of(f"guide/{target.name}"))
