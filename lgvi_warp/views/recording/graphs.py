# SPDX-License-Identifier: Apache-2.0
"""Graphs of a recording: fans, shares by outcome, commands and actuators, the log, and the histogram at the cursor."""

from __future__ import annotations

from typing import Any

import numpy as np

from lgvi_warp.common.status import Status
from lgvi_warp.control.signals import CHANNELS
from lgvi_warp.results.outcomes import outcome_text, outcomes
from lgvi_warp.views.choice import frames_of
from lgvi_warp.views.commands import channels, faults
from lgvi_warp.views.drawn import LEVELS, Drawn, Fan, at_levels, first_ended
from lgvi_warp.views.fleet import OUTCOME_STYLES
from lgvi_warp.views.recording.world import TIMELINE, log_static, send_columns

# Bands of a fan, outermost first: name, places of its levels, and opacity.
BANDS = (("all", 0, 6, 60), ("90 %", 1, 5, 110), ("50 %", 2, 4, 170))
# Bands are paler than bodies under way: they are seen through.
PALE = (120, 180, 255)
MEDIAN, WHITE, GREY, FAULT = LEVELS.index(0.5), (255, 255, 255), (130, 130, 130), (255, 200, 60)
BELIEVED = (255, 160, 60)
# Fewer samples than this are drawn with a marker each.
MARKED = 3
# Most histograms: each takes a message of its own.
HISTOGRAMS = 60
# Colours of channels: those of all outcomes, failures once.
COLORS = list(dict.fromkeys(look.rgb for look in OUTCOME_STYLES.values()))


def log_graphs(recording: Any, run: Drawn) -> None:
    """Log all curves of one run, the log of its outcomes and the histogram of its depths."""
    for fan in run.fans:
        _fan(recording, run, fan)
    _shares(recording, run)
    _channels(recording, run)
    _log(recording, run)
    _histogram(recording, run)


def _fan(recording: Any, run: Drawn, fan: Fan) -> None:
    """Log the bands of a fan and its median; for a single member, its curve."""
    import rerun as rr

    rgb, single = run.rgb or PALE, run.source.members == 1
    bands = BANDS[1:2] if run.label else BANDS
    for name, low, high, opacity in () if single else bands:
        entity = run.path(f"curves/{fan.name}", name.replace(" %", "_percent"))
        style = rr.Measurements.from_fields(colors=[(*rgb, opacity)], widths=[0.0], names=[name], units=[fan.unit])
        log_static(recording, entity, style)
        middle, half = 0.5 * (fan.levels[low] + fan.levels[high]), 0.5 * (fan.levels[high] - fan.levels[low])
        send_columns(recording, entity, run.time, rr.Measurements.columns(values=middle, variances=half**2))
    name = run.label or ("the member" if single else "median")
    color = run.color(Status.OK) if single or run.label else WHITE
    _series(recording, run.path(f"curves/{fan.name}", "median"), run.time, fan.levels[MEDIAN], name, color)
    if fan.believed is not None:
        label = f"{run.label}: as the filter believes" if run.label else "as the filter believes, rms"
        _series(recording, run.path(f"curves/{fan.name}", "believed"), run.time, fan.believed, label, BELIEVED)


def _series(
    recording: Any, entity: str, time: np.ndarray, values: np.ndarray, name: str, color: tuple[int, int, int],
    width: float = 2.0,
) -> None:  # fmt: skip
    """Log one curve, with gaps at values that are not finite; few values have markers."""
    import rerun as rr

    log_static(recording, entity, rr.SeriesLines(names=name, colors=color, widths=width))
    if len(time) < MARKED:
        log_static(recording, entity, rr.SeriesPoints(names=name, colors=color, marker_sizes=4.0))
    send_columns(recording, entity, time, rr.Scalars.columns(scalars=np.asarray(values, np.float64)))


def log_member(recording: Any, run: Drawn, place: int, member: int) -> None:
    """Log height and speed of one member while it is under way."""
    speed = np.linalg.norm(run.few.velocity[:, place], axis=-1)
    for name, values in (("height", -run.position[:, place, 2]), ("speed", speed)):
        under_way_values = np.where(run.counted[:, place], values, np.nan)
        entity = f"curves/{name}/{member}"
        _series(recording, entity, run.time, under_way_values, f"member {member:,}", OUTCOME_STYLES[Status.OK].rgb, 1.0)


# Marks of outcomes on the curves of a run that is compared, which are all in its colour; failures have one together.
MARKERS = {
    Status.SURFACE: "up",
    Status.FLOOR: "down",
    Status.BOX: "square",
    Status.TIME: "circle",
    Status.CONDITION: "diamond",
    Status.BATTERY: "plus",
    Status.OUTSIDE: "asterisk",
    Status.MISSION_DONE: "cross",
    Status.POSITION_UNCERTAIN: "left",
}
MOST_MARKS = 12


def _shares(recording: Any, run: Drawn) -> None:
    """Log the share of all members that is under way, and the shares that have ended, by outcome."""
    import rerun as rr

    for code, share in run.shares.items():
        name = code.name.lower() if code else "under way"
        label = f"{run.label}: {name}" if run.label else name
        entity = run.path("members", name.replace(" ", "_"))
        _series(recording, entity, run.time, 100.0 * share, label, run.color(code))
        if code and run.label:
            at, marks = frames_of(run.time, MOST_MARKS), f"{entity}/marks"
            marker = MARKERS.get(code, "cross")
            style = rr.SeriesPoints(names=label, colors=run.color(code), markers=marker, marker_sizes=5.0)
            log_static(recording, marks, style)
            send_columns(recording, marks, run.time[at], rr.Scalars.columns(scalars=100.0 * share[at]))


def _channels(recording: Any, run: Drawn) -> None:
    """Log medians of commands and actuators over the drawn members that are under way, and the actuators' limits."""
    for field in CHANNELS:
        if field not in run.few.samples:
            continue
        values = run.few.samples[field]
        for i, channel in enumerate(channels(run.few)):
            (row,) = at_levels(values[..., i], run.counted, [0.5])
            name = f"{channel.name} {field}"
            label = f"{run.label}: {name}" if run.label else name
            entity, color = run.path(field, str(i)), COLORS[i % len(COLORS)]
            _series(recording, entity, run.time, row, label, color, 1.0 if field == "command" else 2.5)
            for side, limit in zip(("lower", "upper"), channel.limits(row) if field == "command" else (), strict=False):
                at = run.path("limit", str(i), side)
                _series(recording, at, run.time, np.full(len(run.time), limit), f"{channel.name} limit", GREY, 1.0)


def _log(recording: Any, run: Drawn) -> None:
    """Log each outcome at its first member, with the number of members and the value, and each fault when it begins."""
    import rerun as rr

    def say(when: float, text: str, level: str, color: tuple[int, int, int]) -> None:
        text = f"{run.label}: {text}" if run.label else text
        columns = rr.TextLog.columns(text=[text], level=[level], color=[color])
        send_columns(recording, run.path("log"), np.array([when]), columns)

    for fault in faults(run.result):
        say(max(fault.time, float(run.time[0])), fault.text, "WARN", FAULT)
    for code in outcomes(run.result):
        when = first_ended(run.result, code) if code else float(run.time[-1])
        level = "INFO" if code == Status.OK or code.stopped else "ERROR"
        say(when, outcome_text(run.result, code), level, run.color(code))


def _histogram(recording: Any, run: Drawn) -> None:
    """Log the depths of the members under way as bars, at some times."""
    import rerun as rr

    centers, widths = 0.5 * (run.bins[1:] + run.bins[:-1]), np.diff(run.bins).astype(np.float32)
    color, entity = run.rgb or OUTCOME_STYLES[Status.OK].rgb, run.path("histogram", "depth")
    for frame in frames_of(run.time, HISTOGRAMS):
        recording.set_time(TIMELINE, duration=float(run.time[frame]))
        counts = run.heights[frame].astype(np.int64)
        recording.log(entity, rr.BarChart(counts, abscissa=centers, widths=widths, color=color), strict=True)
    recording.reset_time()
