# SPDX-License-Identifier: Apache-2.0
"""Paths of some members: from the side, from above, in a plane of two quantities, and of their axes on the sphere."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import listed, whole_number
from lgvi_warp.common.errors import refusal
from lgvi_warp.common.status import Status, under_way
from lgvi_warp.views.plots.canvas import COLORS, STYLES, legend_below, mark, outcome_style, panel, point_down, wrap_each
from lgvi_warp.views.plots.picture import FilePath, picture
from lgvi_warp.views.plots.read import quantity_of, selected, values_of, with_samples
from lgvi_warp.views.plots.words import HINT, floors, is_depth, label_of, some_of
from lgvi_warp.views.sea_floor import reliefs

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result

MOST_PATHS = 12
MOST_AXES = 1
# A view from above shows at least this much [m].
LEAST_VIEW = 0.01
# Contours of a floor, about so many, and the coast, where its depth is zero; their colour.
LEVELS, FLOOR = 8, "#7A4A00"
# Places on a contour of which one takes the label.
LABEL_PLACES = 201


@picture
def paths(result: Result, most: int = MOST_PATHS, *, ax: Any = None, path: FilePath | None = None) -> Any:
    """Draw paths of some members from the side: depth against horizontal distance from the members' mean start.

    Args:
        result: A result with positions, in memory or in a store.
        most: Largest number of members to draw, chosen by `lw.select_members`; default 12.

    Returns:
        The axes.

    Raises:
        NothingToDraw: No positions were kept, or no member has a finite start.

    Examples:
        >>> import lgvi_warp as lw
        >>> fleet = lw.Ensemble(lw.Scene.named("remus_100"), members=8)
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, save=lw.SaveAt(every=1.0))
        >>> lw.plots.paths(result, most=3, path="paths.svg").get_title()
        'Paths of 3 of 8 members'
    """
    return _titled(draw_paths, with_samples(result), most, ax, path, (8.0, 5.0))


def draw_paths(axes: Any, result: Result, most: int = MOST_PATHS) -> None:
    """Draw paths from the side."""
    result, choice, some = selected(result, most, ("position",), "paths")
    first = result.samples["position"][0] if result.store is None else some.position[0]
    start = first[np.isfinite(first).all(axis=-1), :2].mean(axis=0)
    distance = np.hypot(*np.moveaxis(some.position[..., :2] - start, -1, 0))
    _lines(axes, some, distance, some.position[..., 2])
    axes.set(title=f"Paths of {some_of(result, len(choice.members))}",
             xlabel="horizontal distance [m]", ylabel="depth [m], down")  # fmt: skip
    point_down(axes, floors(result))


@picture
def plan_view(result: Result, most: int = MOST_PATHS, *, ax: Any = None, path: FilePath | None = None) -> Any:
    """Draw paths of some members from above: north up, east to the right, equal scales, depth contours of the floor.

    Args:
        result: A result with positions, in memory or in a store.
        most: Largest number of members to draw, chosen by `lw.select_members`; default 12.

    Returns:
        The axes.

    Raises:
        NothingToDraw: No positions were kept, or no member has a finite start.
    """
    return _titled(draw_plan, result, most, ax, path, (8.0, 6.5))


def draw_plan(axes: Any, result: Result, most: int = MOST_PATHS) -> None:
    """Draw paths from above, north up, in the same scale both ways."""
    result, choice, some = selected(result, most, ("position",), "a view from above")
    _lines(axes, some, some.position[..., 1], some.position[..., 0], start=True)
    title = f"{some_of(result, len(choice.members))} from above"
    axes.set(title=title[:1].upper() + title[1:], xlabel="east [m]", ylabel="north [m]")
    show_at_least(axes)
    axes.locator_params(nbins=6)
    draw_floor(axes, result.provenance["scene"])


def show_at_least(axes: Any) -> None:
    """Show all data of a view from above in the same scale both ways, and at least a square of a centimetre."""
    middle = 0.5 * (axes.dataLim.min + axes.dataLim.max)
    axes.update_datalim([middle - 0.5 * LEAST_VIEW, middle + 0.5 * LEAST_VIEW])
    axes.autoscale_view()
    axes.set_aspect("equal", adjustable="datalim")


def draw_floor(axes: Any, scene: Mapping[str, Any], label: str | None = None) -> None:
    """Draw the depths of floors on grids, in what is in view and as far beyond it as an equal scale may show."""
    across, up = np.array(axes.get_xlim()), np.array(axes.get_ylim())
    shown = axes.dataLim.frozen()
    reach = 0.75 * max(np.ptp(across), np.ptp(up))
    middle = np.array([up.mean(), across.mean()])
    for relief in reliefs(scene, middle - reach, middle + reach):
        if np.ptp(relief.depth) > 0.0:
            lines = axes.contour(relief.east, relief.north, relief.depth, levels=LEVELS, colors=FLOOR, linewidths=0.6,
                                 linestyles="solid", alpha=0.6, zorder=0.5)  # fmt: skip
            axes.clabel(lines, fmt="%g m", fontsize="x-small", manual=_in_view(lines, across, up))
            if label is not None:
                axes.plot([], [], color=FLOOR, linewidth=0.6, label=label)
            if relief.depth.min() < 0.0 < relief.depth.max():
                axes.contour(relief.east, relief.north, relief.depth, levels=[0.0], colors=FLOOR, linewidths=1.6)
    # What is in view is that of the paths.
    axes.dataLim.set(shown)
    axes.autoscale_view()


def _in_view(lines: Any, across: np.ndarray, up: np.ndarray) -> list[tuple[float, float]]:
    """A place on each contour for its label: near one end of what is in view."""
    found = []
    for line in (line for path in lines.get_paths() for line in path.to_polygons(closed_only=False)):
        share = np.linspace(0.0, len(line) - 1.0, LABEL_PLACES)
        x, y = (np.interp(share, np.arange(len(line)), line[:, i]) for i in (0, 1))
        (seen,) = np.nonzero((x > across[0]) & (x < across[1]) & (y > up[0]) & (y < up[1]))
        if len(seen):
            place = seen[len(seen) // 10]
            found.append((float(x[place]), float(y[place])))
    return found


@picture
def phase(
    result: Result,
    of: tuple[Any, Any] = ("depth", "velocity_inertial[2]"),
    most: int = MOST_PATHS,
    *,
    ax: Any = None,
    path: FilePath | None = None,
) -> Any:
    """Draw paths of some members in the plane of two quantities.

    Args:
        result: A result with the samples that the quantities need, in memory or in a store.
        of: The horizontal and the vertical quantity; default depth and downward velocity.
        most: Largest number of members to draw, chosen by `lw.select_members`; default 12.

    Returns:
        The axes.

    Raises:
        NothingToDraw: Required samples were not kept, or no member has a finite start.
        SceneError: A quantity is unknown, or has several components.
    """
    names = listed("of", of, "two quantities")
    if len(names) != 2:
        raise refusal("of", of, f"names {len(names)} quantities", "name two, the horizontal one and the vertical one")
    across, upward = map(quantity_of, names)
    fields = tuple(dict.fromkeys(("position", *across.fields, *upward.fields)))
    result, choice, some = selected(result, most, fields, "a phase portrait")
    x, y = (values_of(result, meaning, choice.members, choice.frames) for meaning in (across, upward))
    with panel(ax, path) as axes:
        _lines(axes, some, x, y, start=True)
        x_label = label_of(across).removesuffix(", down")
        axes.set(title=_title(axes, some_of(result, len(choice.members)), result), xlabel=x_label,
                 ylabel=label_of(upward))  # fmt: skip
        if is_depth(upward):
            point_down(axes, floors(result))
    return axes


def _titled(
    draw: Callable[..., None], result: Result, most: int, ax: Any, path: FilePath | None, size: tuple[float, float]
) -> Any:
    """Draw paths of some members, and hint in the title that start and end alone were kept where that is so."""
    with panel(ax, path, size) as axes:
        draw(axes, result, most)
        axes.set_title(_title(axes, axes.get_title(), result))
    return axes


def _title(axes: Any, text: str, result: Result) -> str:
    """A title, with the hint that start and end alone were kept where that is so."""
    return wrap_each((text, *([HINT] if len(result.time) < 3 else [])), axes.figure)


def _lines(axes: Any, some: Result, x: np.ndarray, y: np.ndarray, start: bool = False) -> None:
    """Draw a line for each member while it is under way, with a mark where it ended; start: mark where it began."""
    counted = under_way(some)
    marker = "." if len(some.time) < 3 else ""
    labelled: set[Status] = set()
    for i, status in enumerate(np.asarray(some.status)):
        code, going = Status(int(status)), counted[:, i]
        label = None if code in labelled else code.name.lower()
        labelled.add(code)
        # The last sample is where the member stays: the event lies between two samples.
        until = min(int(going.sum()) + 1, len(going))
        axes.plot(x[:until, i], y[:until, i], linewidth=1.1, marker=marker, label=label, **outcome_style(code))
        if code != Status.OK:
            axes.scatter(x[-1, i], y[-1, i], s=26, zorder=3, **mark(code))
    if start:
        axes.scatter(x[0], y[0], s=22, marker="o", facecolors="white", edgecolors="black", zorder=3, label="start")
    axes.grid(True, alpha=0.3)
    if start or labelled != {Status.OK}:
        legend_below(axes, ncols=4)


# Cosine of 30 degrees.
FAR = 0.866
BODY_AXES = ("forward (x)", "starboard (y)", "down (z)")


@picture
def attitude(result: Result, most: int = MOST_AXES, *, ax: Any = None, path: FilePath | None = None) -> Any:
    """Draw the directions of the body axes of some members as paths on the unit sphere; the top of the sphere is up.

    Args:
        result: A result with attitudes, in memory or in a store.
        most: Largest number of members to draw; default 1.
        ax: Matplotlib axes with projection="3d" to draw on; default None: the axes of a new figure.

    Returns:
        The axes.

    Raises:
        NothingToDraw: No attitudes were kept, or no member has a finite start.
    """
    candidates = max(whole_number("most", most, 1), MOST_PATHS)
    result, choice, some = selected(result, candidates, ("position", "attitude"), "attitudes")
    # Of the choice those that are under way longest: one that fails at once has no path.
    longest = np.sort(np.argsort(-under_way(some).sum(axis=0), kind="stable")[:most])
    choice, some = replace(choice, members=choice.members[longest]), some.part(longest)
    # East, north, up: right-handed, with up at the top of the picture.
    points = np.where(under_way(some)[..., None, None], some.attitude[:, :, (1, 0, 2)], np.nan)
    points[:, :, 2] *= -1.0
    with panel(ax, path, (7.0, 6.5), "3d") as axes:
        _sphere(axes)
        for k, name in enumerate(BODY_AXES):
            for i in range(len(choice.members)):
                line = points[:, i, :, k]
                line_style = {"color": COLORS[k], "linestyle": STYLES[k], "linewidth": 1.4}
                if _coarse(line):
                    line_style |= {"linestyle": "", "marker": "osD"[k], "markersize": 3}
                axes.plot(*line.T, label=name if i == 0 else None, **line_style)
                axes.plot(*line[:1].T, "osD"[k], color=COLORS[k], markeredgecolor="black", markersize=8)
        axes.set_title(f"Directions of the body axes of {some_of(result, len(choice.members))}; marks: start")
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.04), ncols=3, frameon=False)
    return axes


def _coarse(line: np.ndarray) -> bool:
    """Whether an axis (f, 3) turns so far between most samples that a line between them says nothing."""
    cosines = np.sum(line[1:] * line[:-1], axis=-1)
    return bool(np.median(cosines[np.isfinite(cosines)]) < FAR) if np.isfinite(cosines).any() else False


def _sphere(axes: Any) -> None:
    """Draw the unit sphere with its circles every 30 degrees, and the names of directions."""
    turn = np.radians(np.arange(0.0, 361.0, 5.0))
    for angle in np.radians(np.arange(-60.0, 61.0, 30.0)):
        wide = 1.2 if abs(angle) < 1e-9 else 0.5
        ring = np.cos(angle) * np.cos(turn), np.cos(angle) * np.sin(turn), np.full(len(turn), np.sin(angle))
        axes.plot(*ring, color="#BBBBBB", linewidth=wide)
    for angle in np.radians(np.arange(0.0, 180.0, 30.0)):
        ring = np.cos(angle) * np.cos(turn), np.sin(angle) * np.cos(turn), np.sin(turn)
        axes.plot(*ring, color="#BBBBBB", linewidth=0.5)
    for place, name in (((0, 1.2, 0), "north"), ((1.2, 0, 0), "east"), ((0, 0, 1.12), "up"), ((0, 0, -1.15), "down")):
        axes.text(*place, name, ha="center", va="center")
    axes.set_box_aspect((1, 1, 1), zoom=1.3)
    axes.set_axis_off()
