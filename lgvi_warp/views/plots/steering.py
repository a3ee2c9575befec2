# SPDX-License-Identifier: Apache-2.0
"""Steering and attitude of members: commands with limits and faults, and roll, pitch and yaw, against time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.status import under_way
from lgvi_warp.views.choice import MOST_BODIES
from lgvi_warp.views.commands import channels, faults
from lgvi_warp.views.drawn import at_levels
from lgvi_warp.views.plots.canvas import GREY, legend_below, line_marker, shade, style
from lgvi_warp.views.plots.read import quantity_of, selected, survey_of
from lgvi_warp.views.plots.words import WORDS

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result

LEVELS = (0.05, 0.5, 0.95)
# Members whose middle 90 % take more than so much of a turn [deg] point all ways.
ALL_WAYS = 270.0


def draw_commands(result: Result, axes: Any) -> list[str]:
    """Draw the commands of members under way: medians, bands of 90 %, limits that are near, and when faults begin."""
    result, _, some = selected(result, MOST_BODIES, ("position", "command"), "a picture of commands")
    counted, lined = under_way(some), set()
    for i, channel in enumerate(channels(some)):
        levels = at_levels(some.samples["command"][..., i], counted, LEVELS)
        _band(axes, some.time, levels, i, channel.name)
        lined |= set(channel.limits(levels))
    for limit in lined:
        axes.axhline(limit, color=GREY, linestyle=(0, (6, 2)), linewidth=1.0, label="limit" if limit > 0.0 else None)
    fault_texts = _mark_faults(axes, result)
    axes.set(xlabel="time [s]", ylabel="command [unit of its channel]", title=f"Commands{_bands(some.members)}")
    legend_below(axes, ncols=3)
    return fault_texts


def draw_angles(result: Result, axes: Any) -> list[str]:
    """Draw roll, pitch and yaw of members under way: medians and bands of 90 %, and when faults begin."""
    for i, name in enumerate(("euler[0]", "euler[1]", "euler[2]")):
        survey = survey_of(result, quantity_of(name))
        levels = np.degrees(at_levels(survey.values, survey.counted, LEVELS))
        # Members that point all ways have no mean direction about which an angle could be told.
        scattered = levels[2] - levels[0] > ALL_WAYS
        if len(scattered) > 2:  # a time between two such ones makes no line, and would stretch the axis
            padded = np.pad(scattered, 1, constant_values=True)
            scattered |= padded[:-2] & padded[2:]
        levels[:, scattered] = np.nan
        gaps = ": no mean direction" if scattered.all() else "; gaps: no mean direction" if scattered.any() else ""
        label = f"{WORDS[name]}{gaps}"
        _band(axes, survey.time, levels, i, label, banded=survey.total > 1)
    fault_texts = _mark_faults(axes, result)
    axes.set(xlabel="time [s]", ylabel="angle [deg]", title=f"Attitude{_bands(survey.total)}")
    legend_below(axes, ncols=4)
    return fault_texts


def _bands(members: int) -> str:
    """Meaning of the lines of so many members, for a title; "" for one."""
    return ": medians, bands of 90 %" if members > 1 else ""


def _band(axes: Any, time: np.ndarray, levels: np.ndarray, i: int, label: str, banded: bool = True) -> None:
    """Draw a median and the band about it (3, f)."""
    if banded and (levels[2] > levels[0]).any():
        shade(axes, time, levels[0], levels[2], i)
    axes.plot(time, levels[1], label=label, marker=line_marker(time), linewidth=1.4, **style(i))
    axes.grid(True, alpha=0.3)


def _mark_faults(axes: Any, result: Result) -> list[str]:
    """Draw a line where each fault begins; return what each does."""
    broken = faults(result)
    for i, fault in enumerate(broken):
        axes.axvline(max(fault.time, float(result.time[0])), color="black", linestyle=":", linewidth=1.4,
                     label="fault" if i == 0 else None)  # fmt: skip
    return [fault.text for fault in broken]
