# SPDX-License-Identifier: Apache-2.0
"""The initial layout of the viewer."""

from __future__ import annotations

from typing import Any

import numpy as np

from lgvi_warp.control.signals import CHANNELS, ENERGY_USED
from lgvi_warp.views.drawn import OFF, Drawn, Fan
from lgvi_warp.views.recording.eye import ASPECT, SIGHT, distance
from lgvi_warp.views.recording.world import TIMELINE, WorldBox

# The whole run is played in this time [s].
PLAYED = 20.0
BACKGROUND = (9, 24, 38)


def layout(runs: list[Drawn], box: WorldBox, scales: list[int]) -> Any:
    """Lay out the views: the world on the left, curves and the run's facts on the right."""
    import rerun.blueprint as rrb
    from rerun.blueprint.encodings import TextLogColumn

    ends = [max(float(run.time[-1]) for run in runs), min(float(run.time[0]) for run in runs)]
    played = ends[0] - ends[1]
    names = [f"{run.label}: {run.text}" if run.label else run.text for run in runs]
    aspect = ASPECT / len(runs)
    worlds = [_world(run, name, box, scale, aspect) for run, name, scale in zip(runs, names, scales, strict=True)]
    below = rrb.Horizontal(
        _curve("members", "Members by outcome [%]", _all_times(runs[0].time), (0.0, 102.0), True),
        rrb.TextLogView(
            origin="/log",
            name="Outcomes: how many, and the first",
            columns=rrb.TextLogColumns(text_log_columns=[TextLogColumn("Body")]),
        ),
    )
    world_side = rrb.Vertical(worlds[0] if len(runs) == 1 else rrb.Horizontal(*worlds), below, row_shares=[4, 1.3])
    return _whole_window(rrb.Horizontal(world_side, _right(runs), column_shares=[3, 2]), played)


def live_layout(run: Drawn, box: WorldBox, scale: int) -> Any:
    """Lay out the views of a run in progress: the world on the left, curves of single members on the right."""
    import rerun.blueprint as rrb

    titles = {fan.name: fan.title for fan in run.fans}
    curves = [_curve(f"curves/{name}", f"{titles[name]}, of some members", _all_times(run.time), None, False)
              for name in ("height", "speed")]  # fmt: skip
    words = rrb.TextDocumentView(origin="run/summary", name="Run")
    right = rrb.Vertical(words, *curves, row_shares=[1, 3, 3])
    world = _world(run, "Members that are done", box, scale, ASPECT)
    return _whole_window(rrb.Horizontal(world, right, column_shares=[3, 2]), float(run.time[-1] - run.time[0]))


def _whole_window(views: Any, played: float) -> Any:
    """Blueprint of views; it plays a run of this time [s]."""
    import rerun.blueprint as rrb

    panel = rrb.TimePanel(timeline=TIMELINE, state="collapsed", play_state="playing", loop_mode="all",
                          playback_speed=played / PLAYED if played > 0.0 else 1.0)  # fmt: skip
    others = rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed")
    return rrb.Blueprint(views, panel, *others, auto_views=False)


def _right(runs: list[Drawn]) -> Any:
    """Curves, and the run's facts below them."""
    import rerun.blueprint as rrb

    all_times = _all_times(runs[0].time)
    names = [fan.name for fan in runs[0].fans]
    fans = {name: [fan for run in runs for fan in run.fans if fan.name == name] for name in names}
    views = {}
    for name, group in fans.items():
        limits = _limits(np.concatenate([fan.levels for fan in group], axis=1))
        # All have the same legend; it would cover their curves.
        below = _high(group[0], limits)
        views[name] = _curve(f"curves/{name}", group[0].title, all_times, limits, name == "height", below)
    height = views.pop("height")
    energies = [views[name] for name in ("energy", ENERGY_USED) if name in views]
    motion = rrb.Tabs(views["speed"], *energies, active_tab=0)
    angles = rrb.Tabs(*(views[name] for name in ("pitch", "roll", "heading")), active_tab=0)
    beliefs = [views[name] for name in (OFF, "nees") if name in views]
    navigation = [rrb.Tabs(*beliefs, active_tab=0)] if beliefs else []
    commands = [_curve_of_channels(all_times)] if any(name in runs[0].few.samples for name in CHANNELS) else []
    facts = rrb.Tabs(
        *(rrb.TextDocumentView(origin=run.path("run/summary"), name=run.label or "Run") for run in runs),
        rrb.BarChartView(origin="/histogram", name="Depths [m] at the cursor"),
        *(
            rrb.TextDocumentView(origin=run.path("run/provenance"), name=f"Provenance {run.label}".strip())
            for run in runs
        ),
        active_tab=0,
    )
    shares = [2.6, 2.0, 2.0, *[2.0 for _ in (*navigation, *commands)], 4.0]
    return rrb.Vertical(height, angles, motion, *navigation, *commands, facts, row_shares=shares)


def _high(fan: Fan, limits: tuple[float, float] | None) -> bool:
    """Whether the median begins in the upper half of its axis."""
    early = fan.levels[3, : max(1, fan.levels.shape[1] // 5)]
    return limits is not None and bool(np.nanmean(early) > 0.5 * sum(limits)) if np.isfinite(early).any() else False


def _curve(
    origin: str, name: str, time_range: Any, limits: tuple[float, float] | None, legend: bool, below: bool = False
) -> Any:
    """View of curves over the whole time, with the legend above or below them."""
    import rerun.blueprint as rrb

    return rrb.TimeSeriesView(
        origin=f"/{origin}", name=name, axis_x=time_range, axis_y=rrb.ScalarAxis(range=limits) if limits else None,
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftBottom if below else rrb.Corner2D.LeftTop, visible=legend),
    )  # fmt: skip


def _curve_of_channels(time_range: Any) -> Any:
    """View of commands, actuators and limits."""
    import rerun.blueprint as rrb

    return rrb.TimeSeriesView(
        origin="/", contents=["+ /command/**", "+ /actuator/**", "+ /limit/**"], axis_x=time_range,
        name="Commands (thin) and actuators, medians", plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop),
    )  # fmt: skip


def _limits(levels: np.ndarray) -> tuple[float, float] | None:
    """Limits of an axis, a little wider than the values; None if no value is finite."""
    finite = levels[np.isfinite(levels)]
    if not finite.size:
        return None
    low, high = float(finite.min()), float(finite.max())
    wide = max(high - low, 1e-3 * max(abs(low), abs(high)), 1e-9)
    return low - 0.05 * wide, high + 0.05 * wide


def _all_times(time: np.ndarray) -> Any:
    """Time axis from the first to the last time."""
    import rerun.blueprint as rrb

    start, end = (rrb.TimeRangeBoundary.absolute(seconds=float(time[i])) for i in (0, -1))
    return rrb.TimeAxis(view_range=rrb.TimeRange(start=start, end=end))


def _world(run: Drawn, name: str, box: WorldBox, scale: int, aspect: float) -> Any:
    """View of one run's world: from the side of the fleet's path and a little above; trails up to the cursor."""
    import rerun.blueprint as rrb

    middle = 0.5 * (box.low + box.high)
    eye = middle - distance(box.low, box.high, aspect) * SIGHT
    now = rrb.TimeRangeBoundary.cursor_relative(seconds=0)
    past = rrb.VisibleTimeRange(TIMELINE, start=rrb.TimeRangeBoundary.infinite(), end=now)
    hulls = f", hulls {scale} times their size" if scale > 1 else ""
    return rrb.Spatial3DView(
        origin=run.path("world"), name=f"{name}{hulls}, grid {box.grid:g} m", background=BACKGROUND,
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(position=eye, look_target=middle, eye_up=(0.0, 0.0, -1.0)),
        overrides={run.path("world", "trails"): [rrb.VisibleTimeRanges([past])]},
        time_ranges=[rrb.VisibleTimeRange(TIMELINE, start=now, end=now)],
    )  # fmt: skip
