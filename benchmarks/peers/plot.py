# SPDX-License-Identifier: Apache-2.0
"""Draw time against error from the lines of run.py, and tabulate the cheapest time of each peer for each error."""

from __future__ import annotations

import math
from collections import defaultdict
from pathlib import Path
from typing import Any

Record = dict[str, Any]
DECADES = tuple(range(-1, -12, -1))
HOME = "lgvi_warp"
TITLES = {
    "vehicle": "the paper's vehicle",
    "rigid": "its rigid body alone: no added mass, no restoring moment",
    "remus_100": "REMUS 100 as shipped: drag, lift, fins, thrust",
    "bluerov2_heavy": "BlueROV2 heavy as shipped: drag, eight thrusters",
}
DRIVEN = ("remus_100", "bluerov2_heavy")


def curves(records: list[Record], problem: str) -> dict[tuple[str, str], list[tuple[float, float]]]:
    """(peer, method): its settings as (largest error, microseconds per vehicle and second), the cheapest first."""
    found = defaultdict(list)
    for one in records:
        if one.get("problem") == problem and "error_max" in one and math.isfinite(one["error_max"]):
            name = one["method"] if one["dtype"] == "float64" else f"{one['method']}, {one['dtype']}"
            found[one["peer"], name].append((one["error_max"], one["us_per_vehicle_second"]))
    return {key: sorted(points, key=lambda point: point[1]) for key, points in found.items()}


def cost(points: list[tuple[float, float]], target: float) -> float:
    """The cheapest time for an error, straight lines in logarithms between settings; infinite where none is as good."""
    found = [time for error, time in points if error <= target]
    for (e0, t0), (e1, t1) in zip(points[:-1], points[1:], strict=True):
        if e1 <= target < e0:
            part = math.log(e0 / target) / math.log(e0 / e1)
            found.append(t0 * (t1 / t0) ** part)
    return min(found, default=math.inf)


def front(records: list[Record], problem: str, dtype: str, peer: str, target: float) -> tuple[float, str]:
    """The cheapest time of a peer's methods in a precision, and which method."""
    chosen = [one for one in records if one.get("dtype") == dtype]
    found = [(cost(points, target), name) for (one, name), points in curves(chosen, problem).items() if one == peer]
    time, name = min(found, default=(math.inf, ""))
    return time, name.removesuffix(f", {dtype}") if math.isfinite(time) else ""


def table(records: list[Record]) -> str:
    """A block for each problem and precision: times of each peer, and how many times that of lgvi_warp."""
    lines = []
    for problem, title in TITLES.items():
        for dtype in ("float64", "float32"):
            chosen = [one for one in records if one.get("dtype") == dtype]
            peers = list(dict.fromkeys(peer for peer, _ in curves(chosen, problem)))
            others = [peer for peer in peers if peer != HOME]
            if not others:
                continue
            what = f"us per vehicle and simulated second (times {HOME}'s), cheapest method"
            lines += ["", f"{title}, {dtype}: {what}"]
            for exponent in DECADES:
                home, name = front(records, problem, dtype, HOME, 10.0**exponent)
                cells = [f"{HOME} {_number(home)} {name}"]
                for peer in others:
                    time, name = front(records, problem, dtype, peer, 10.0**exponent)
                    ratio = f" (x{time / home:.2f})" if math.isfinite(time) and math.isfinite(home) else ""
                    cells.append(f"{peer} {_number(time)}{ratio} {name}")
                lines.append(f"1e{exponent:<4}" + " | ".join(cell.strip() for cell in cells))
    return "\n".join(lines).strip()


def _number(time: float) -> str:
    return f"{time:.3g}" if math.isfinite(time) else "-"


def draw(records: list[Record], path: Path) -> None:
    """A panel for each problem; a colour for each peer, a marker for each of its methods, dashes for single precision.

    The thick line is lgvi_warp's front in double precision.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    problems = [problem for problem in TITLES if curves(records, problem)]
    figure, panels = plt.subplots(1, len(problems), figsize=(11 * len(problems), 11), squeeze=False)
    for panel, problem in zip(panels[0], problems, strict=True):
        _panel(panel, curves(records, problem), plt.get_cmap("tab10").colors)
        targets = [10.0 ** (-0.05 * i) for i in range(-10, 280)]
        times = [front(records, problem, "float64", HOME, target)[0] for target in targets]
        panel.plot(targets, times, color=plt.get_cmap("tab10").colors[0], lw=3, label=f"{HOME}: front, float64")
        panel.set_title(TITLES[problem])
        panel.legend(fontsize=8, ncol=2, loc="upper left")
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    plt.close(figure)


def _panel(panel: Any, answer: dict[tuple[str, str], list[tuple[float, float]]], colors: Any) -> None:
    peers = [HOME, *dict.fromkeys(peer for peer, _ in answer if peer != HOME)]
    seen: dict[str, int] = defaultdict(int)
    for (peer, name), points in answer.items():
        marker = "os^vDPX*<>dphH1"[seen[peer] % 15]
        seen[peer] += 1
        style = {"color": colors[peers.index(peer)], "marker": marker, "ms": 5}
        style |= {"lw": 0.6, "alpha": 0.6} if peer == HOME else {"lw": 1.4}
        errors, times = zip(*points, strict=True)
        panel.loglog(errors, times, "--" if "float32" in name else "-", label=f"{peer}: {name}", **style)
    panel.set_xlim(10.0, 1e-14)
    panel.set_ylim(top=panel.get_ylim()[1] * 30.0)  # room for the legend
    panel.set_xlabel("largest error at the end (position [m] or attitude), smaller to the right")
    panel.set_ylabel("microseconds per vehicle and simulated second")
    panel.grid(True, which="major", alpha=0.3)
