# SPDX-License-Identifier: Apache-2.0
"""The picture of a front: cost against error of at most seven methods, readable at the width of a page."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "docs"))

from site_parts import pictures as kept  # noqa: E402

SUBJECTS = {
    "paper": "The paper's vehicle over 20 s",
    "remus": "REMUS 100 in a turn, 60 s",
    "light": "A light plate that tumbles, 10 s",
    "short": "BlueROV2 over 2 s",
}
# Size in inches; at 100 pixels to the inch as wide as the column of README, and drawn twice as fine.
SIZE, FINE = (8.38, 5.2), 200
LOOKS = {"float64": ("-", 1.0), "float32": ("--", 0.55), "float32_compensated": (":", 0.55)}
# Method -> colour and marker, the same in all pictures.
METHODS = {
    "psi_x": ("#0072b2", "o"),
    "psi_s": ("#009e73", "D"),
    "bm4(psi_x)": ("#e69f00", "v"),
    "kl8(psi_x)": ("#56b4e9", "P"),
    "rkn6_14": ("#000000", "X"),
    "rkw3": ("#009e73", "D"),
    "rk4": ("#d55e00", "s"),
    "rk5": ("#e69f00", "v"),
    "rk8": ("#cc79a7", "^"),
}


def rows_of(name: str) -> Path:
    """Path of a scene's rows."""
    return ROOT / "benchmarks" / "rows" / f"fronts_{name}.json"


def picture_of(name: str) -> Path:
    """Path of a scene's picture."""
    return ROOT / "docs" / "guide" / f"accuracy_{name}.png"


def front_of(rows: list[list[Any]]) -> list[list[Any]]:
    """The rows that are more accurate than all cheaper ones.

    Args:
        rows: [method, dtype, step, cost, error] of each setting.

    Returns:
        Those of them, in order of rising cost and falling error.
    """
    front: list[list[Any]] = []
    for row in sorted(rows, key=lambda row: (row[3], row[4])):
        if not front or row[4] < front[-1][4]:
            front.append(row)
    return front


def lines_of(rows: list[list[Any]]) -> dict[tuple[str, str], list[list[Any]]]:
    """The front of each method and precision, by their names."""
    groups: dict[tuple[str, str], list[list[Any]]] = {}
    for row in rows:
        groups.setdefault((row[0], row[1]), []).append(row)
    return {key: front_of(group) for key, group in groups.items()}


def draw(name: str, content: dict[str, Any]) -> None:
    """Draw the picture of a scene from its rows, with the hash of what made it.

    Args:
        name: Name of the scene.
        content: What is kept of it.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    with plt.rc_context({"font.size": 13, "axes.titlesize": 14, "legend.fontsize": 12}):
        figure, axes = plt.subplots(figsize=SIZE, layout="constrained")
        lines = lines_of([row for row in content["rows"] if " " not in row[0]])
        methods = [method for method in METHODS if method in {name for name, _ in lines}]
        axes.plot(*points(front_of(content["rows"])), color="black", linewidth=9, alpha=0.13, solid_capstyle="round")
        for (method, dtype), rows in lines.items():
            (color, marker), (style, alpha) = METHODS[method], LOOKS[dtype]
            axes.plot(*points(rows), style, marker=marker, color=color, alpha=alpha, markersize=6, linewidth=1.8,
                      fillstyle="full" if dtype == "float64" else "none")  # fmt: skip
        axes.set(xscale="log", yscale="log", title=SUBJECTS[name], ylabel="cost [us per vehicle and second]",
                 xlabel=f"largest error of position up to {content['until']:g} s [m]")  # fmt: skip
        axes.invert_xaxis()
        axes.grid(True, alpha=0.3)
        axes.minorticks_off()
        legend(figure, axes, methods, {dtype for _, dtype in lines})
        target = picture_of(name)
        figure.savefig(target, dpi=FINE)
        plt.close(figure)
    kept.keep(target, target, script=kept.made_of(f"guide/{target.name}"))


def points(rows: list[list[Any]]) -> tuple[list[float], list[float]]:
    """Errors and costs of rows."""
    return [row[4] for row in rows], [row[3] for row in rows]


def legend(figure: Any, axes: Any, methods: list[str], dtypes: set[str]) -> None:
    """Say below the picture which colour is which method, and which line which precision."""
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=METHODS[name][0], marker=METHODS[name][1], linewidth=1.8, label=name) for name in methods
    ]
    handles += [
        Line2D([], [], color="0.3", linestyle=style, linewidth=1.8, label=dtype.replace("_", " "))
        for dtype, (style, _) in LOOKS.items()
        if dtype in dtypes
    ]
    handles.append(Line2D([], [], color="black", linewidth=9, alpha=0.13, label="cheapest"))
    figure.legend(handles=handles, loc="outside right upper", frameon=False, handlelength=1.8)
