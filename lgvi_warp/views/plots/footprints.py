# SPDX-License-Identifier: Apache-2.0
"""A footprint from above: the regions that hold shares of the members, with the ellipse, the centre and the floor."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.errors import refusal
from lgvi_warp.uncertainty.footprint.answer import Footprint, number_text
from lgvi_warp.uncertainty.footprint.density import FAR
from lgvi_warp.uncertainty.footprint.footprint import footprint as footprint_of
from lgvi_warp.views.plots.canvas import COLORS, STYLES, TINTS, legend_below, panel, wrapped
from lgvi_warp.views.plots.picture import FilePath, picture
from lgvi_warp.views.plots.tracks import draw_floor, show_at_least

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result


@picture
def footprint(
    result: Result | Footprint, at: str | float = "end", *, ax: Any = None, path: FilePath | None = None
) -> Any:
    """Draw the smallest regions that contain 50, 90, 95 and 99 % of the members, with north up and depth contours.

    Also drawn are the 95 % ellipse of a normal distribution, the 95 % circle, the centre, and at most 1,000 members.

    Args:
        result: A result with positions, in memory or in a store; or a footprint from `lw.studies.footprint`.
        at: As in `lw.studies.footprint`, by default "end"; omit it if `result` is a footprint.

    Returns:
        The axes.

    Raises:
        SceneError: As in `lw.studies.footprint`.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=40, vary={"start.position": lw.distributions.Normal(std=[3.0, 2.0, 0.0])})
        >>> result = lw.solve(fleet, h=0.1, t1=2.0)
        >>> lw.plots.footprint(result, path="footprint.png").get_ylabel()
        'north [m]'
    """
    if isinstance(result, Footprint) and at not in ("end", result.at):
        raise refusal("at", at, f"is given for a footprint at {result.at}", "leave it out, or give the result")
    found = result if isinstance(result, Footprint) else footprint_of(result, at)
    with panel(ax, path, (8.0, 7.5)) as axes:
        draw_footprint(axes, found)
        if ax is None:
            axes.set_title(wrapped(found.answer.rstrip("."), axes.figure, 0.9))
    return axes


def draw_footprint(axes: Any, answer: Footprint) -> None:
    """Draw regions, ellipse, circle, centre, members and the floor."""
    from matplotlib.patches import Circle, Ellipse, PathPatch
    from matplotlib.path import Path

    tints = dict(zip((0.99, 0.95, 0.9, 0.5), (*TINTS, COLORS[0]), strict=True))
    for region in sorted(answer.regions, key=lambda region: -region.share):
        rings = [ring[:, ::-1] for rings in region.polygons for ring in rings]
        if rings:
            outline = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
            axes.add_patch(PathPatch(outline, facecolor=tints[region.share], edgecolor=COLORS[0], linewidth=0.6, alpha=0.8,
                                     label=f"{region.percent}: {number_text(region.area, region.area)} m$^2$"))  # fmt: skip
            axes.update_datalim(np.concatenate(rings))
    lengths, turns = np.linalg.eigh(answer.covariance)
    region = answer.main
    sides = 2.0 * np.sqrt(-2.0 * np.log1p(-region.share) * np.maximum(lengths, 0.0))
    # Of the longer axis, counted from east.
    angle = float(np.degrees(np.arctan2(turns[0, 1], turns[1, 1])))
    north, east = map(float, answer.centre)
    middle = east, north
    axes.add_patch(Ellipse(middle, sides[1], sides[0], angle=angle, fill=False, edgecolor=COLORS[1], linestyle=STYLES[1],
                           label=f"{region.percent} ellipse: "
                           f"{number_text(region.ellipse_area, region.ellipse_area)} m$^2$"))  # fmt: skip
    axes.add_patch(Circle(middle, region.radius, fill=False, edgecolor=COLORS[2], linestyle=STYLES[3],
                          label=f"{region.percent} circle: {number_text(region.radius, region.radius)} m"))  # fmt: skip
    axes.update_datalim([(east - region.radius, north - region.radius), (east + region.radius, north + region.radius)])
    some = len(answer.places) < answer.members
    who = f"{len(answer.places):,} of {answer.members:,} members" if some else f"{answer.members:,} members"
    shown, away = axes.dataLim.frozen(), np.hypot(*(answer.places - answer.centre).T)
    axes.scatter(*answer.places.T[::-1], s=4, color="black", alpha=0.5, linewidths=0, label=who)
    # Members far away would make all others a dot.
    axes.dataLim.set(shown)
    axes.update_datalim(answer.places[away <= max(region.radius, FAR * math.sqrt(max(lengths[-1], 0.0)))][:, ::-1])
    axes.scatter(*middle, s=70, marker="+", color=COLORS[1], linewidths=1.8, zorder=4, label="centre")
    axes.set(xlabel="east [m]", ylabel="north [m]")
    axes.grid(True, alpha=0.3)
    axes.locator_params(nbins=6)
    show_at_least(axes)
    draw_floor(axes, answer.provenance.get("scene", {}), "depth of the floor")
    legend_below(axes, ncols=3)
