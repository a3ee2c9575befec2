# SPDX-License-Identifier: Apache-2.0
"""Cost against error of methods: the methods on the Pareto front in colour, all others in grey."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import of_kind
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.views.plots.canvas import COLORS, GREY, MARKERS, apart, panels, wrapped
from lgvi_warp.views.plots.picture import FilePath, picture

if TYPE_CHECKING:
    from lgvi_warp.accuracy.tradeoff import Measurement, Tradeoff

# Precision -> line style and fill of the markers.
PRECISIONS = {"float64": ("-", "full"), "float32": ("--", "none"), "float32_compensated": (":", "left")}
# Biases below this many standard errors are chance.
CHANCE = 1.4


@picture
def tradeoff(found: Tradeoff, of: str | None = None, *, figure: Any = None, path: FilePath | None = None) -> np.ndarray:
    """Draw cost against error, one line for each method and precision, and biases of statistics against the step.

    A method that is the cheapest for some error (on the Pareto front) is drawn in colour, with its name at its line.
    All other methods are grey.

    Args:
        found: Measurements from `lw.tradeoff`.
        of: Quantity whose error is drawn, such as "position"; default None: the quantity of the trade-off.

    Returns:
        The axes of costs and of biases, shape (2,).

    Raises:
        NothingToDraw: No setting was measured.
    """
    of_kind("found", found, "measurements of", "a trade-off", "give what lw.tradeoff returns")
    of = found.of if of is None else of
    if not found.measurements:
        raise NothingToDraw("no setting was measured: there is nothing to draw")
    shown, front = found.shown(of), found.front(of)
    groups: dict[tuple[str, str], list[Measurement]] = {}
    for point in sorted(found.measurements, key=lambda point: point.setting.h):
        groups.setdefault((point.setting.name, point.setting.dtype), []).append(point)
    best = list(dict.fromkeys(point.setting.name for point in front))
    with panels(figure, path, (1, 2), (14.0, 7.5), width_ratios=(1.15, 1.0)) as grid:
        costs, biases = grid[0]
        named: list[tuple[str, float, float, Any]] = []
        for (name, dtype), points in groups.items():
            line = _line_style(name, dtype, best)
            errors, prices = _errors_and_costs([point for point in points if point in shown], of)
            costs.plot(errors, prices, label=f"{name}, {dtype}", **line)
            biased = [point for point in points if point.biases]
            values = [point.biases.get(f"{of}_mean", np.nan) for point in biased]
            biases.plot([point.setting.h for point in biased], values, label=f"{name}, {dtype}", **line)
            if name in best and errors:
                named.append((name if dtype == "float64" else f"{name}, {dtype}", errors[0], prices[0], line["color"]))
        costs.plot(*_errors_and_costs(front, of), color="black", linewidth=6, alpha=0.2, solid_capstyle="round",
                   label="cheapest for each error", zorder=0)  # fmt: skip
        _words(costs, biases, found, of, any(point.error(of) > 0.0 for point in shown))
        if any(error > 0.0 for _, error, _, _ in named):
            _name(costs, [each for each in named if each[1] > 0.0])
        others = [name for name, _ in groups if name not in best]
        _legend(costs.figure, {dtype for _, dtype in groups}, others, bool(front))
    return grid[0]


def _line_style(name: str, dtype: str, best: list[str]) -> dict[str, Any]:
    """Colour and marker of a method, line style and fill of a precision."""
    line, fill = PRECISIONS.get(dtype, ("-.", "bottom"))
    common: dict[str, Any] = {"linestyle": line, "fillstyle": fill, "linewidth": 1.0}
    if name not in best:
        return common | {"color": GREY, "marker": ".", "markersize": 3, "zorder": 1, "alpha": 0.7}
    i = best.index(name)
    return common | {
        "color": COLORS[i % len(COLORS)],
        "marker": MARKERS[i % len(MARKERS)],
        "markersize": 6,
        "zorder": 2,
    }


def _errors_and_costs(points: list[Measurement], of: str) -> tuple[list[float], list[float]]:
    """Coordinates of settings in the picture of costs."""
    return [point.error(of) for point in points], [point.us_per_vehicle_second for point in points]


def _words(costs: Any, biases: Any, tradeoff: Tradeoff, of: str, any_shown: bool) -> None:
    """Label the axes, and say why one is empty."""
    figure = costs.figure
    costs.set(xlabel=f"largest error of {of} [{tradeoff.units[of]}], up to {tradeoff.until:g} s",
              ylabel="cost [us of core time per vehicle and second]", title="Cost of accuracy")  # fmt: skip
    biases.set(xlabel="step [s]", ylabel=f"bias / standard error of {tradeoff.members} members",
               title=wrapped(f"Bias of the mean of {of} up to {tradeoff.t1:g} s", figure, 0.4))  # fmt: skip
    for axes, drawn, reason in (
        (
            costs,
            any_shown,
            "no errors to draw: noise acts, the reference is too inaccurate, or all settings are exact",
        ),
        (biases, any(point.biases for point in tradeoff.measurements), "no statistics: the fleet has one member"),
    ):
        if drawn:
            axes.set(xscale="log", yscale="log")
            axes.minorticks_off()
        else:
            axes.text(0.5, 0.5, wrapped(reason, figure, 0.35), ha="center", transform=axes.transAxes)
            axes.set(xticks=[], yticks=[])
        axes.grid(True, alpha=0.3)
    if any_shown:
        costs.invert_xaxis()
    if any(point.biases for point in tradeoff.measurements):
        biases.axhline(CHANCE, color="black", linewidth=0.8, linestyle=":")
        biases.text(1.01, CHANCE, "limit of\nchance", va="center", transform=biases.get_yaxis_transform())
    sample = f"{tradeoff.members} members, 0 to {tradeoff.t1:g} s"
    without = f"no measurement of {', '.join(tradeoff.missing)}; " if tradeoff.missing else ""
    text = f"{without}{sample}; reference {tradeoff.reference}; better: lower right"
    figure.suptitle(wrapped(text, figure))


def _name(axes: Any, named: list[tuple[str, float, float, Any]]) -> None:
    """Write names beside the ends of lines, one above the other where ends are near; named: name, error, cost, colour."""
    if not named:
        return
    axes.margins(x=0.02)
    low, high = np.log(axes.get_ylim())
    named = sorted(named, key=lambda item: item[2])
    wanted = [(np.log(cost) - low) / (high - low) for _, _, cost, _ in named]
    places = apart(axes, wanted, [1] * len(named))
    for (name, error, cost, color), place in zip(named, places, strict=True):
        axes.annotate(name, (error, cost), (1.03, place), textcoords="axes fraction", color=color, va="center",
                      annotation_clip=False, arrowprops={"arrowstyle": "-", "color": color, "linewidth": 0.6,
                                                         "shrinkA": 0, "shrinkB": 4})  # fmt: skip


def _legend(figure: Any, dtypes: set[str], others: list[str], front: bool) -> None:
    """Explain line styles and grey lines below the panels."""
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color="black", linestyle=line, fillstyle=fill, marker="o", label=dtype)
        for dtype, (line, fill) in PRECISIONS.items()
        if dtype in dtypes
    ]
    if front:
        handles.append(Line2D([], [], color="black", linewidth=6, alpha=0.2, label="cheapest for each error"))
    if names := list(dict.fromkeys(others)):
        text = wrapped(f"not the cheapest: {', '.join(names)}", figure, 0.9)
        handles.append(Line2D([], [], color=GREY, marker=".", label=text))
    figure.legend(handles=handles, loc="outside lower center", ncols=4 if len(others) < 4 else 2, frameon=False)
