"""A recording of a fleet for the rerun viewer: bodies, a few paths, and curves of depth, energy, commands and outcomes."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common import files as durable
from lgvi_warp.common.errors import MissingExtra, NothingToDraw
from lgvi_warp.common.status import Status, under_way
from lgvi_warp.physics import notation
from lgvi_warp.physics.control.signals import CHANNELS
from lgvi_warp.runs.outcomes import outcome_text, outcomes
from lgvi_warp.views.fleet import FAILURES, LOOKS, Curve, energy_curve, evenly, identity, quantiles, title

if TYPE_CHECKING:
    from lgvi_warp.runs.result import Result

# More bodies than this cannot be told apart in a window, and cost time and file size.
MOST_BODIES = 1000
TRAILS = 40
# Frames per chunk of columns: large enough to be quick to write, small enough to seek in.
FRAMES = 20
TIMELINE = "sim_time"
# Colours of channels: those of all outcomes but the failures.
_COLORS = [LOOKS[code].rgb for code in Status if code not in FAILURES]
# Name, quantile and colour of each curve.
CURVES = (("smallest", 0.0, (120, 150, 190)), ("median", 0.5, (255, 200, 60)), ("largest", 1.0, (190, 120, 120)))


def log_rerun(result: Result, path: str | os.PathLike[str]) -> Path:
    """Write the fleet as an .rrd recording; the file is there whole or not at all.

    At most MOST_BODIES members are shown, spread evenly. A member that an event stopped, or that failed, stays where it
    ended, in the colour of its outcome. Curves are of the members under way at each time; those of "command" and "actuator",
    where the result has them, are medians. The same run always gives the recording and the application the same ids: the
    viewer keeps recordings and layouts apart by them.

    Args:
        result: A result with position, attitude, velocity and angular velocity.
        path: The file.

    Returns:
        The path.

    Raises:
        ImportError: rerun-sdk is not installed (extra: viz).
        NothingToDraw: No member has a finite start.
        OSError: The file cannot be written.
    """
    try:
        import rerun as rr
    except ModuleNotFoundError as error:
        raise MissingExtra("recordings", "rerun-sdk", "viz") from error
    target = Path(path)
    finite = np.isfinite(result.position[0]).all(axis=-1) & np.isfinite(result.attitude[0]).all(axis=(-1, -2))
    if not finite.any():
        raise NothingToDraw("no member has a finite start: there is nothing to draw; see result.status")
    shown = evenly(np.flatnonzero(finite), MOST_BODIES)
    position = result.position[:, shown].astype(np.float32)
    curve, counted = energy_curve(result), under_way(result)
    of_actuators = [field for field in CHANNELS if field in result.samples]
    name = identity(result)
    recording = rr.RecordingStream(f"lgvi_warp_{name}", recording_id=name)
    try:
        with durable.placed(target) as beside:
            recording.save(beside, default_blueprint=_blueprint(result.time, position, curve, of_actuators))
            recording.send_recording_name(title(result))
            _world(recording, rr, result, shown, position, counted[:, shown])
            _fan(recording, rr, result.time, "depth", result.position[..., 2], counted)
            _fan(recording, rr, result.time, entity_of(curve), curve.values, counted)
            for field in of_actuators:
                _channels(recording, rr, result.time, field, result.samples[field], counted)
            _members(recording, rr, result, counted)
            recording.log("run", rr.TextDocument(_text(result), media_type="text/markdown"), static=True, strict=True)
            recording.flush()
            recording.disconnect()
    except RuntimeError as error:
        # rerun raises it for a writer that could not start or continue, and prints the reason on stderr.
        text = f"the recording could not be written ({error}); is the disk full, or the folder read-only?"
        raise OSError(text) from error
    return target


def _text(result: Result) -> str:
    """Outcomes of the members and the run's provenance, in Markdown."""
    lines = [title(result), "", *(f"- {outcome_text(result, code)}" for code in outcomes(result)), ""]
    return "\n".join([*lines, "```json", json.dumps(result.provenance, indent=2), "```"])


def _world(
    recording: Any, rr: Any, result: Result, shown: np.ndarray, position: np.ndarray, counted: np.ndarray
) -> None:
    """Log bodies and trails; x north, y east, z down. counted: which of the bodies shown are under way at each time."""
    recording.log("world", rr.ViewCoordinates.FRD, static=True, strict=True)
    quaternion = notation.quaternion_from_matrix(result.attitude[:, shown])[..., [1, 2, 3, 0]].astype(np.float32)
    size = max(_extent(position)) * 0.02
    for code, visible in _groups(result, np.asarray(result.status)[shown], counted):
        name = code.name.lower() if code else "fleet"
        if visible.any():
            recording.log(f"world/{name}", _body(rr, size, LOOKS[code].rgb), static=True, strict=True)
            _poses(recording, rr, f"world/{name}", result.time, position, quaternion, visible)
    trails = evenly(np.arange(len(shown)), TRAILS)
    strips = position[:, trails].transpose(1, 0, 2)
    lines = rr.LineStrips3D(list(strips), radii=size * 0.05, colors=(130, 150, 160))
    recording.log("world/trails", lines, static=True, strict=True)


# Scale of a hidden body: an entity without any pose would show a body at the origin.
UNSEEN = 1e-6


def _poses(
    recording: Any, rr: Any, entity: str, time: np.ndarray, position: np.ndarray, quaternion: np.ndarray,
    visible: np.ndarray,
) -> None:  # fmt: skip
    """Send the poses (k, m) of the bodies that are visible at each time (k, m), in chunks of frames."""
    empty = ~visible.any(axis=1)
    posed = visible.copy()
    posed[empty, 0] = True
    for first in range(0, len(time), FRAMES):
        frames = slice(first, first + FRAMES)
        at = posed[frames]
        scales = np.where(visible[frames][at], np.float32(1.0), np.float32(UNSEEN))
        columns = rr.InstancePoses3D.columns(
            translations=position[frames][at],
            quaternions=quaternion[frames][at],
            # Send scales at every time or never: one that is not sent again stays in force.
            scales=np.repeat(scales[:, None], 3, axis=1) if empty.any() else None,
        ).partition(at.sum(axis=1))
        recording.send_columns(entity, [rr.TimeColumn(TIMELINE, duration=time[frames])], columns, strict=True)


def _extent(position: np.ndarray) -> np.ndarray:
    """Size [m] of the box around all positions, at least 1 m along each axis."""
    flat = position.reshape(-1, 3)
    return np.maximum(flat.max(axis=0) - flat.min(axis=0), 1.0)


def _body(rr: Any, size: float, color: tuple[int, int, int]) -> Any:
    """A spindle along the body's x axis, with a bright nose and a fin on its upper side, which show its attitude."""
    s = 0.18 * size
    points = [(size, 0, 0), (0, s, 0), (0, 0, s), (0, -s, 0), (0, 0, -s), (-size, 0, 0), (-size, 0, -2.5 * s)]
    ring = [(i, i % 4 + 1) for i in range(1, 5)]
    faces = [(0, i, j) for i, j in ring] + [(5, j, i) for i, j in ring] + [(4, 6, 5), (4, 5, 6)]
    colors = [(255, 255, 255)] + [color] * 5 + [(255, 200, 60)]
    return rr.Mesh3D(vertex_positions=points, triangle_indices=faces, vertex_colors=colors)


def entity_of(curve: Curve) -> str:
    """Name of a curve's entity in the recording.

    Args:
        curve: The curve.

    Returns:
        The name in lower case without spaces, as "energy_error".
    """
    return curve.name.lower().replace(" ", "_")


def _fan(recording: Any, rr: Any, time: np.ndarray, name: str, values: np.ndarray, counted: np.ndarray) -> None:
    """Log the smallest, the median and the largest value of the members that count at each time."""
    rows = quantiles(values, counted, [quantile for _, quantile, _ in CURVES])
    for (curve, _, color), row in zip(CURVES, rows, strict=True):
        _series(recording, rr, f"{name}/{curve}", time, row, curve, color)


def _channels(recording: Any, rr: Any, time: np.ndarray, name: str, values: np.ndarray, counted: np.ndarray) -> None:
    """Log the median of each channel (k, n, channels) over the members that count at each time."""
    for i in range(values.shape[-1]):
        (row,) = quantiles(values[..., i], counted, [0.5])
        _series(recording, rr, f"{name}/{i}", time, row, f"{name}[{i}]", _COLORS[i % len(_COLORS)])


def _members(recording: Any, rr: Any, result: Result, counted: np.ndarray) -> None:
    """Log how many members are under way at each time, and how many ended, by outcome."""
    for code, group in _groups(result, np.asarray(result.status), counted):
        name = code.name.lower() if code else "under way"
        entity = f"members/{name.replace(' ', '_')}"
        _series(recording, rr, entity, result.time, group.sum(axis=1), name, LOOKS[code].rgb)


def _groups(result: Result, status: np.ndarray, counted: np.ndarray) -> list[tuple[Status, np.ndarray]]:
    """Masks (k, m) of the members under way, as OK, and of those that ended, by outcome."""
    ended = ((code, ~counted & (status == code)) for code in outcomes(result) if code)
    return [(Status.OK, counted), *ended]


def _series(
    recording: Any, rr: Any, entity: str, time: np.ndarray, values: np.ndarray, name: str, color: tuple[int, int, int]
) -> None:
    """Log one curve, broken where its values are not finite."""
    recording.log(entity, rr.SeriesLines(names=name, colors=color, widths=2.0), static=True, strict=True)
    columns = rr.Scalars.columns(scalars=values.astype(np.float64))
    recording.send_columns(entity, [rr.TimeColumn(TIMELINE, duration=time)], columns, strict=True)


def _blueprint(time: np.ndarray, position: np.ndarray, energy: Curve, of_actuators: Sequence[str]) -> Any:
    """First layout of the viewer: the fleet on the left, the curves and the run's facts on the right."""
    import rerun.blueprint as rrb

    flat = position.reshape(-1, 3)
    centre, extent = (flat.max(axis=0) + flat.min(axis=0)) / 2.0, _extent(position)
    # View across the fleet's way, from a little above: z points down.
    way = np.mean(position[-1] - position[0], axis=0)[:2]
    east, north = way / np.linalg.norm(way) if np.any(way) else (0.0, 1.0)
    eye = centre + np.linalg.norm(extent) * np.array([0.8 * north, -0.8 * east, -0.2])
    world = rrb.Spatial3DView(
        origin="world",
        name="Fleet (north, east, down)",
        eye_controls=rrb.EyeControls3D(position=eye, look_target=centre, eye_up=(0.0, 0.0, -1.0)),
    )
    full_time = rrb.TimeAxis(
        view_range=rrb.TimeRange(
            start=rrb.TimeRangeBoundary.absolute(seconds=float(time[0])),
            end=rrb.TimeRangeBoundary.absolute(seconds=float(time[-1])),
        )
    )
    side = rrb.Vertical(
        rrb.TimeSeriesView(origin="depth", name="Depth [m] of the members under way", axis_x=full_time),
        rrb.TimeSeriesView(
            origin=entity_of(energy), name=f"{energy.name} [J] of the members under way", axis_x=full_time
        ),
        *(
            rrb.TimeSeriesView(origin=field, name=f"{field.capitalize()}s, medians", axis_x=full_time)
            for field in of_actuators
        ),
        rrb.TimeSeriesView(origin="members", name="Members by outcome", axis_x=full_time),
        rrb.TextDocumentView(origin="run", name="Run"),
    )
    return rrb.Blueprint(
        rrb.Horizontal(world, side, column_shares=[3, 2]),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )
