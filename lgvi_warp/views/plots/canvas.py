# SPDX-License-Identifier: Apache-2.0
"""Common parts of all pictures: figures, size of text, colours with a second cue, the axis of depth, and files."""

from __future__ import annotations

import io
import textwrap
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from lgvi_warp.common import files as durable
from lgvi_warp.common.arguments import file_path, of_kind
from lgvi_warp.common.errors import MissingExtra
from lgvi_warp.common.status import Status
from lgvi_warp.views.fleet import OUTCOME_STYLES
from lgvi_warp.views.plots.picture import STYLE, WIDTHS, FilePath

# Colours of Okabe & Ito 2008, Color universal design, without the yellow, which is hardly seen on white.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
# With each colour goes a style, so that no two lines differ by colour alone.
STYLES = ("-", "--", "-.", ":", (0, (7, 1.5)), (0, (4, 1, 1, 1, 1, 1)), (0, (1, 3)))
MARKERS = "os^vDPX*<>dphH"
HATCHES = ("", "///", "...", "\\\\\\", "xxx", "---", "+++", "ooo")
# Tints of the first colour for the bands of a fan, outermost first.
TINTS = ("#DCEAF4", "#A3C9E2", "#5C9FCC")
GREY = "#9A9A9A"
# Points of text to an inch of width: 8.75 pixels where the picture is 700 pixels wide.
TEXT = 0.9
LEAST_TEXT = 9.0
# Matplotlib's settings of the size of text, but for titles.
TEXTS = (
    "font.size",
    "axes.labelsize",
    "legend.fontsize",
    "legend.title_fontsize",
    "xtick.labelsize",
    "ytick.labelsize",
)
# Matplotlib's settings are those of the process, and pictures are drawn side by side in threads; one picture draws in another.
LOCK = threading.RLock()
DPI = 100
# Of pictures for a printed page.
PRINTED_TEXT, PRINTED_DPI = 8.0, 300
# The least height of a picture for a printed page, in parts of its width.
LEAST_SHAPE = 0.75


def figure_class() -> Any:
    """Load Matplotlib's Figure. Raises ImportError with the remedy where it is not installed."""
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError as error:
        raise MissingExtra("plots", "matplotlib", "viz") from error
    return Figure


def narrow() -> bool:
    """Tell whether the picture is for one column of a printed page, where panels stand below each other."""
    return STYLE.get() == "one_column"


def printed_size(size: tuple[float, float]) -> tuple[float, float]:
    """Size of a figure [in] in the style that is asked for: its shape stays, but that legends need room."""
    style = STYLE.get()
    return size if style is None else (WIDTHS[style], max(size[1] / size[0], LEAST_SHAPE) * WIDTHS[style])


def save_figure(figure: Any, path: FilePath) -> Path:
    """Write a picture in the format of the file's ending; the file is there whole or not at all."""
    dpi = DPI if STYLE.get() is None else PRINTED_DPI
    of_kind("figure", figure, "savefig", "a figure of Matplotlib", "give one, as axes.figure")
    target = file_path("path", path)
    with durable.placed(target) as beside, durable.new_file(beside) as file:
        # Drawn in memory: on a full disk a library would raise what it likes, and leave the file open.
        drawn = io.BytesIO()
        figure.savefig(drawn, dpi=dpi, format=target.suffix.removeprefix(".") or "png")
        file.write(drawn.getbuffer())
    return target


@contextmanager
def panel(
    ax: Any, path: FilePath | None, size: tuple[float, float] = (8.0, 5.0), projection: str | None = None
) -> Iterator[Any]:
    """Give axes to draw on, the user's or those of a figure of this size [in]; then write the file, if there is a path."""
    of_class = figure_class()
    if ax is not None:
        of_kind("ax", ax, "figure plot", "axes of Matplotlib", "give those that plt.subplots returns, or leave it out")
    figure = of_class(figsize=printed_size(size), layout="constrained") if ax is None else ax.figure
    with drawing(figure, path, ax is None):
        yield figure.add_subplot(projection=projection) if ax is None else ax


@contextmanager
def panels(
    figure: Any,
    path: FilePath | None,
    shape: tuple[int, int],
    size: tuple[float, float],
    used: int | None = None,
    **options: Any,
) -> Iterator[np.ndarray]:
    """Give axes (rows, columns) on the user's figure or one of this size [in]; then write the file, if there is a path.

    used: How many of them are drawn on; the others are not seen. Default None, all.
    """
    of_class = figure_class()
    if figure is not None:
        of_kind("figure", figure, "subplots get_figure", "a figure of Matplotlib", "give plt.figure(), or leave it out")
    target = of_class(figsize=printed_size(size), layout="constrained") if figure is None else figure
    with drawing(target, path, figure is None):
        grid = target.subplots(*shape, squeeze=False, **options)
        for axes in grid.flat[used:] if used is not None else ():
            axes.set_axis_off()
        yield grid


@contextmanager
def drawing(figure: Any, path: FilePath | None, sized: bool) -> Iterator[None]:
    """Draw with text that can be read in a small picture; then write the file, if there is a path."""
    import matplotlib as mpl

    if path is not None:
        durable.place_of(file_path("path", path))  # before anything is drawn
    size = text_size(figure)
    settings = dict.fromkeys(TEXTS, size) | dict.fromkeys(("axes.titlesize", "figure.titlesize"), 1.1 * size)
    with LOCK, mpl.rc_context(settings | {"hatch.linewidth": 0.6, "pdf.fonttype": 42}):
        yield
        if sized:
            for axes in figure.axes:
                axes.tick_params(which="both", labelsize=size)
        if path is not None:
            save_figure(figure.get_figure(root=True), path)


def text_size(figure: Any) -> float:
    """Find the size of text for a figure."""
    if STYLE.get() is not None:
        return PRINTED_TEXT
    return max(LEAST_TEXT, TEXT * float(figure.get_figure(root=True).get_figwidth()))


def wrapped(text: str, figure: Any, share: float = 1.0) -> str:
    """Break a text into lines that a figure has room for."""
    width = float(figure.get_figure(root=True).get_figwidth())
    return "\n".join(textwrap.wrap(text, int(share * 72.0 * width / (0.6 * text_size(figure)))))


def wrap_each(lines: Iterable[str], figure: Any) -> str:
    """Break each of several lines into as many as a figure has room for."""
    return "\n".join(wrapped(line, figure) for line in lines)


def style(i: int) -> dict[str, Any]:
    """Colour and line style of the i-th of several lines, pairwise different for 49 of them."""
    turn = i // len(COLORS)
    return {"color": COLORS[i % len(COLORS)], "linestyle": STYLES[(i + turn) % len(STYLES)]}


def mark(code: Status) -> dict[str, Any]:
    """Colour and marker of an outcome, a dot for members under way; filled markers have a black edge."""
    color, marker = OUTCOME_STYLES[code]
    if code == Status.OK:
        return {"color": color, "marker": "o", "linewidths": 0}
    edge = {"edgecolors": "black", "linewidths": 0.5} if code.stopped else {"linewidths": 1.4}
    return {"color": color, "marker": marker} | edge


def outcome_style(code: Status) -> dict[str, Any]:
    """Colour and line style of paths with an outcome."""
    line = "-" if code == Status.OK else "--" if code.stopped else ":"
    return {"color": OUTCOME_STYLES[code].color, "linestyle": line}


def hatch(i: int) -> str:
    """Hatch of the i-th of several areas."""
    return HATCHES[i % len(HATCHES)]


def shade(axes: Any, time: np.ndarray, low: np.ndarray, high: np.ndarray, i: int, hatched: int | None = None,
          alpha: float = 0.2, label: str | None = None) -> None:  # fmt: skip
    """Fill the i-th of several bands against time with its colour and a hatch, by default the i-th one."""
    color, pattern = COLORS[i % len(COLORS)], hatch(i if hatched is None else hatched)
    axes.fill_between(time, low, high, facecolor=color, alpha=alpha, hatch=pattern, edgecolor=color, linewidth=0,
                      label=label)  # fmt: skip


def line_marker(time: np.ndarray) -> str:
    """Marker of a line against so many times: two alone would hardly be seen."""
    return "o" if len(time) < 3 else ""


def band(low: float, high: float) -> str:
    """Name the band between two quantiles."""
    return f"{100.0 * (high - low):.4g}%"


# The surface and the floor are drawn where they are within this share of the depths shown.
NEAR = 0.5


def point_down(axes: Any, floors: Mapping[str, Iterable[float]] = MappingProxyType({})) -> None:
    """Turn the vertical axis, which has depths [m], downwards; draw the surface, and the floors that are near.

    Their names stand beside the axes, where no data are. A text says how far away the surface is where it is not drawn.
    floors: Depths [m] by what is said of them, as {"floor": [20.0]}; default none.
    """
    low, high = sorted(axes.get_ylim())
    reach = NEAR * (high - low)
    lines = [(0.0, "surface", "#0072B2"), *((depth, name, "#7A4A00") for name in floors for depth in floors[name])]
    near = [line for line in lines if low - reach <= line[0] <= high + reach]
    for depth, _, color in near:
        low, high = min(low, depth - 0.1 * reach), max(high, depth + 0.1 * reach)
        axes.axhline(depth, color=color, linestyle=(0, (8, 3)), linewidth=1.2, zorder=1.5)
    axes.set_ylim(high, low)
    texts = [(1.0 - (depth - low) / (high - low), name, color) for depth, name, color in near]
    if lines[0] not in near:
        far = f"{low:.3g} m\nabove" if low > 0.0 else f"{-high:.3g} m\nbelow"
        texts.append((float(low > 0.0), f"surface\n{far}", lines[0][2]))
    texts.sort()
    places = apart(axes, [place for place, *_ in texts], [text.count("\n") + 1 for _, text, _ in texts])
    for place, (_, text, color) in zip(places, texts, strict=True):
        axes.text(1.01, place, text, color=color, ha="left", va="center", transform=axes.transAxes)


def apart(axes: Any, wanted: Sequence[float], lines: Sequence[int]) -> np.ndarray:
    """Move texts beside axes up and down, as little as keeps one from another."""
    high = 0.8 * axes.get_position().height * axes.get_figure(root=True).get_figheight()
    half = 0.5 * 1.35 * text_size(axes.figure) / 72.0 / high * np.asarray(lines, dtype=float)
    # Where each would stand if all below it stood side by side from the bottom.
    order = np.cumsum(2.0 * half) - half
    places = np.maximum.accumulate(np.maximum(np.asarray(wanted), half) - order) + order
    # Where the highest would leave the axes, all are moved down as far as is needed.
    return np.minimum(places, 1.0 - order[-1:] - half[-1:] + order) if len(order) else places


def widen(axis: Any) -> None:
    """Show at least a ten-thousandth of the numbers' size: the labels of a narrower range cannot be told apart."""
    low, high = sorted(axis.get_view_interval())
    least = 1e-4 * max(abs(low), abs(high))
    if high - low < least:
        middle = 0.5 * (low + high)
        axis.axes.set(**{f"{axis.axis_name}lim": (middle - 0.5 * least, middle + 0.5 * least)})


def legend_below(axes: Any, ncols: int = 1, **options: Any) -> None:
    """Draw the legend below the axes and their label, where it hides nothing."""
    from matplotlib.transforms import ScaledTranslation

    lines = ScaledTranslation(0.0, -3.2 * text_size(axes.figure) / 72.0, axes.get_figure(root=True).dpi_scale_trans)
    place = {"bbox_to_anchor": (0.5, 0.0), "bbox_transform": axes.transAxes + lines, "loc": "upper center"}
    entries = max(1, len(axes.get_legend_handles_labels()[0]))
    rows = -(-entries // ncols)
    axes.legend(**place, frameon=False, ncols=-(-entries // rows), **options)
