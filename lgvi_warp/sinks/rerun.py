"""A recording of a fleet for the rerun viewer: bodies that move, a few paths, depth and energy as curves."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp import durable, notation

if TYPE_CHECKING:
    from lgvi_warp.result import Result

# More bodies than this cannot be told apart in a window, and cost time and file size.
MOST_BODIES = 1000
TRAILS = 40
# Frames per chunk of columns: large enough to be quick to write, small enough to seek in.
FRAMES = 20
TIMELINE = "sim_time"
# Name, quantile and colour of each curve.
CURVES = (
    ("smallest", 0.0, (120, 150, 190)),
    ("median", 0.5, (255, 200, 60)),
    ("largest", 1.0, (190, 120, 120)),
)


def log_rerun(result: Result, path: str | os.PathLike[str]) -> Path:
    """Write the fleet as an .rrd recording. Returns the path.

    At most MOST_BODIES members are shown, spread evenly; members that failed stay where they stopped, in red.
    Needs all fields. The file is there whole or not at all. Raises ImportError without rerun-sdk (extra: viz), OSError.
    """
    try:
        import rerun as rr
    except ImportError as error:
        raise ImportError("recordings need rerun-sdk: pip install 'lgvi-warp[viz]'") from error
    target = Path(path)
    recording = rr.RecordingStream("lgvi_warp", recording_id="fleet")
    finite = np.isfinite(result.position[0]).all(axis=-1) & np.isfinite(result.attitude[0]).all(axis=(-1, -2))
    shown = np.flatnonzero(finite)
    shown = shown[np.unique(np.linspace(0, len(shown) - 1, min(MOST_BODIES, len(shown))).astype(int))]
    position = result.position[:, shown].astype(np.float32)
    try:
        with durable.placed(target) as beside:
            recording.save(beside, default_blueprint=_blueprint(result.time, position))
            _world(recording, rr, result, shown, position)
            _curves(recording, rr, result)
            text = "```json\n" + json.dumps(result.provenance, indent=2) + "\n```"
            recording.log("run", rr.TextDocument(text, media_type="text/markdown"), static=True, strict=True)
            recording.flush()
            recording.disconnect()
    except RuntimeError as error:
        # rerun's word for a writer that could not begin, or not go on; it says why on stderr.
        text = f"the recording could not be written ({error}); is the disk full, or the folder read-only?"
        raise OSError(text) from error
    return target


def _world(recording: Any, rr: Any, result: Result, shown: np.ndarray, position: np.ndarray) -> None:
    """Bodies and trails. x north, y east, z down."""
    recording.log("world", rr.ViewCoordinates.FRD, static=True, strict=True)
    failed = np.asarray(result.status)[shown] != 0
    quaternion = notation.quaternion_from_matrix(result.attitude[:, shown])[..., [1, 2, 3, 0]].astype(np.float32)
    size = max(_extent(position)) * 0.02
    for name, members, color in (("fleet", ~failed, (90, 160, 255)), ("failed", failed, (255, 70, 70))):
        if not members.any():
            continue
        recording.log(f"world/{name}", _body(rr, size, color), static=True, strict=True)
        for first in range(0, len(result.time), FRAMES):
            frames = slice(first, first + FRAMES)
            times = result.time[frames]
            columns = rr.InstancePoses3D.columns(
                translations=position[frames, members].reshape(-1, 3),
                quaternions=quaternion[frames, members].reshape(-1, 4),
            ).partition([int(members.sum())] * len(times))
            recording.send_columns(f"world/{name}", [rr.TimeColumn(TIMELINE, duration=times)], columns, strict=True)
    trails = np.unique(np.linspace(0, len(shown) - 1, min(TRAILS, len(shown))).astype(int))
    strips = position[:, trails].transpose(1, 0, 2)
    lines = rr.LineStrips3D(list(strips), radii=size * 0.05, colors=(130, 150, 160))
    recording.log("world/trails", lines, static=True, strict=True)


def _extent(position: np.ndarray) -> np.ndarray:
    """Size of the box around all positions, at least 1 m along each axis."""
    flat = position.reshape(-1, 3)
    return np.maximum(flat.max(axis=0) - flat.min(axis=0), 1.0)


def _body(rr: Any, size: float, color: tuple[int, int, int]) -> Any:
    """A spindle along the body's x axis, with a bright nose and a fin on its upper side: attitude can be read off it."""
    s = 0.18 * size
    points = [(size, 0, 0), (0, s, 0), (0, 0, s), (0, -s, 0), (0, 0, -s), (-size, 0, 0), (-size, 0, -2.5 * s)]
    faces = [
        (0, 1, 2),
        (0, 2, 3),
        (0, 3, 4),
        (0, 4, 1),
        (5, 2, 1),
        (5, 3, 2),
        (5, 4, 3),
        (5, 1, 4),
        (4, 6, 5),
        (4, 5, 6),
    ]
    colors = [(255, 255, 255)] + [color] * 5 + [(255, 200, 60)]
    return rr.Mesh3D(vertex_positions=points, triangle_indices=faces, vertex_colors=colors)


def _curves(recording: Any, rr: Any, result: Result) -> None:
    """Smallest, median and largest depth and energy error of the members that did not fail."""
    good = np.asarray(result.status) == 0
    if not good.any():
        return
    error = result.energy[:, good] - result.energy[:1, good]
    for name, values in (("depth", result.position[:, good, 2]), ("energy_error", error)):
        for curve, quantile, color in CURVES:
            entity = f"{name}/{curve}"
            recording.log(entity, rr.SeriesLines(names=curve, colors=color, widths=2.0), static=True, strict=True)
            columns = rr.Scalars.columns(scalars=np.quantile(values.astype(np.float64), quantile, axis=1))
            recording.send_columns(entity, [rr.TimeColumn(TIMELINE, duration=result.time)], columns, strict=True)


def _blueprint(time: np.ndarray, position: np.ndarray) -> Any:
    """What is seen first: the fleet from the side and above on the left, the curves and the run's facts on the right."""
    import rerun.blueprint as rrb

    flat = position.reshape(-1, 3)
    centre, extent = (flat.max(axis=0) + flat.min(axis=0)) / 2.0, _extent(position)
    # From the side of the way the fleet goes, and a little above: z points down.
    way = np.mean(position[-1] - position[0], axis=0)[:2]
    east, north = way / np.linalg.norm(way) if np.any(way) else (0.0, 1.0)
    eye = centre + np.linalg.norm(extent) * np.array([0.8 * north, -0.8 * east, -0.2])
    world = rrb.Spatial3DView(
        origin="world",
        name="Fleet (north, east, down)",
        eye_controls=rrb.EyeControls3D(position=eye, look_target=centre, eye_up=(0.0, 0.0, -1.0)),
    )
    whole = rrb.TimeAxis(
        view_range=rrb.TimeRange(
            start=rrb.TimeRangeBoundary.absolute(seconds=float(time[0])),
            end=rrb.TimeRangeBoundary.absolute(seconds=float(time[-1])),
        )
    )
    side = rrb.Vertical(
        rrb.TimeSeriesView(origin="depth", name="Depth [m]", axis_x=whole),
        rrb.TimeSeriesView(origin="energy_error", name="Energy error [J]", axis_x=whole),
        rrb.TextDocumentView(origin="run", name="Run"),
    )
    return rrb.Blueprint(
        rrb.Horizontal(world, side, column_shares=[3, 2]),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )
