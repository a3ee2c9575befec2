# SPDX-License-Identifier: Apache-2.0
"""The world of a recording: hulls, trails, spread, forces, water, surface and floor; x north, y east, z down."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.physics import energy as invariants
from lgvi_warp.physics import vehicle
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.views.choice import finite_rows
from lgvi_warp.views.drawn import Drawn, quaternion_xyzw
from lgvi_warp.views.recording.eye import ASPECT, far_pixel
from lgvi_warp.views.recording.hull import Mesh, hull_of, mesh_of, shape_of
from lgvi_warp.views.sea_floor import Relief, flat_depths, reliefs

TIMELINE = "sim_time"
TRAILS = 40
# Frames per chunk of columns: large enough to be quick to write, small enough to seek in.
CHUNK = 20
# Scale of a hidden body: an entity without any pose would show a body at the origin.
UNSEEN = 1e-6
# A hull across the sight is drawn at least so many pixels long and thick, at the far end of what is in view.
LONG, THICK = 25.0, 5.0
TRAIL, WATER, SAND, CURRENT = (150, 165, 180, 150), (90, 170, 230, 40), (78, 88, 102, 120), (0, 200, 200)
# Colours of a floor on a grid, at its deepest and at its shallowest place.
DEEP, SHALLOW = (52, 60, 76), (176, 152, 112)
# How far the surface and the floor are drawn beyond the paths, as a part of the diagonal of what is in view.
AROUND = 0.08
# Axes are labelled at the corner of the grid.
AXES = (("north", (230, 90, 90)), ("east", (90, 200, 90)), ("down", (110, 140, 255)))


@dataclass(frozen=True, eq=False)
class WorldBox:
    """The visible part of the world: smallest and largest coordinates (3,) [m], and whether the surface is in it."""

    low: np.ndarray
    high: np.ndarray
    surface: bool

    @property
    def size(self) -> float:
        """Length of the box's diagonal [m]."""
        return float(np.linalg.norm(self.high - self.low))

    @property
    def grid(self) -> float:
        """Distance between lines of the grid [m], a power of ten."""
        return float(10.0 ** np.floor(np.log10(max(self.high[:2] - self.low[:2]) / 2.0)))

    def joined(self, box: WorldBox) -> WorldBox:
        """Find the box around this one and another of the same water."""
        return WorldBox(np.minimum(self.low, box.low), np.maximum(self.high, box.high), self.surface or box.surface)


def box_of(runs: list[Drawn]) -> WorldBox:
    """Find the box around all paths, with all floors, and with the surface if it is near."""
    paths = [run.position[finite_rows(run.position)] for run in runs]
    low = np.min([path.min(axis=0) for path in paths], axis=0).astype(float)
    high = np.max([path.max(axis=0) for path in paths], axis=0).astype(float)
    least = max(4.0 * _length(runs[0])[1], 0.05 * float((high - low).max()))
    narrow = np.maximum(least - (high - low), 0.0)
    low, high = low - 0.5 * narrow, high + 0.5 * narrow
    high[2] = max([high[2], *(floor for run in runs for floor in floors_of(run))])
    high[2] = max([high[2], *(float(relief.depth.max()) for run in runs for relief in reliefs_of(run, low, high))])
    reach = float(np.linalg.norm(high - low))
    surface = bool(low[2] < 0.5 * reach)
    if surface:
        low[2], high[2] = min(low[2], 0.0), max(high[2], 0.0)
    return WorldBox(low, high, surface)


def floors_of(run: Drawn) -> list[float]:
    """Depths of the flat floors of a run's own scene [m], the shallowest first."""
    return sorted(flat_depths(run.result.provenance["scene"]))


def reliefs_of(run: Drawn, low: np.ndarray, high: np.ndarray) -> list[Relief]:
    """The floors on grids of a run's own scene, within a box (3,) and around it."""
    around = AROUND * float(np.linalg.norm(high - low))
    return reliefs(run.result.provenance["scene"], low[:2] - around, high[:2] + around)


def _length(run: Drawn) -> tuple[Mesh | tuple[float, float], float]:
    """The user's mesh, or length and diameter [m] of the hull; and the length [m]."""
    shape, _ = shape_of(run.result.provenance["scene"], run.few.parameters)
    if shape.mesh is not None:
        mesh = mesh_of(shape.mesh)
        return mesh, mesh.length
    assert shape.length is not None
    assert shape.diameter is not None
    return (shape.length, shape.diameter), max(shape.length, shape.diameter)


def scale_of(run: Drawn, box: WorldBox, aspect: float = ASPECT) -> int:
    """Scale of a hull at which it is visible in the box."""
    form, length = _length(run)
    thickness = length if isinstance(form, Mesh) else min(form)
    wanted = max(LONG / length, THICK / thickness) * far_pixel(box.low, box.high, aspect)
    return max(1, int(np.ceil(wanted)))


def log_world(recording: Any, run: Drawn, box: WorldBox, scale: int) -> None:
    """Log everything in one run's world."""
    log_frame(recording, run, box)
    log_bodies(recording, run, scale)
    _trails(recording, run)
    _spread(recording, run)
    _forces(recording, run, box, scale)


def log_frame(recording: Any, run: Drawn, box: WorldBox) -> None:
    """Log the surroundings of one run's members: surface, floor, axes and current."""
    import rerun as rr

    log_static(recording, run.path("world"), rr.ViewCoordinates.FRD)
    _planes(recording, run, box)
    _axes(recording, run, box)
    _current(recording, run, box)


def log_static(recording: Any, entity: str, archetype: Any) -> None:
    """Log an object that is the same at all times."""
    recording.log(entity, archetype, static=True, strict=True)


def send_columns(recording: Any, entity: str, time: np.ndarray, columns: Any) -> None:
    """Log data that change with time [s]."""
    import rerun as rr

    recording.send_columns(entity, [rr.TimeColumn(TIMELINE, duration=time)], columns, strict=True)


def log_bodies(recording: Any, run: Drawn, scale: int) -> None:
    """Log one hull for each outcome, and at each time the poses of the members that have this outcome."""
    import rerun as rr

    form, _ = _length(run)
    quaternion = quaternion_xyzw(run.few.attitude)
    for code, visible in run.groups():
        if not visible.any():
            continue
        entity, color = run.path("world", "bodies", code.name.lower()), run.color(code)
        if isinstance(form, Mesh):
            asset = rr.Asset3D(contents=form.content, media_type="model/gltf-binary", albedo_factor=color)
            log_static(recording, entity, asset)
        else:
            hull = hull_of(scale * form[0], scale * form[1])
            body = rr.Mesh3D(vertex_positions=hull.points, triangle_indices=hull.triangles,
                             vertex_normals=hull.normals, vertex_colors=hull.colors(color))  # fmt: skip
            log_static(recording, entity, body)
        size = float(scale) if isinstance(form, Mesh) else 1.0
        _poses(recording, entity, run.time, run.position, quaternion, visible, size)


def _poses(
    recording: Any, entity: str, time: np.ndarray, position: np.ndarray, quaternion: np.ndarray, visible: np.ndarray,
    size: float,
) -> None:  # fmt: skip
    """Send the poses (f, m) of the bodies that are visible at each time (f, m), in chunks of frames."""
    import rerun as rr

    empty = ~visible.any(axis=1)
    posed = visible.copy()
    posed[empty, 0] = True
    position, quaternion = (np.nan_to_num(values) for values in (position, quaternion))
    for first in range(0, len(time), CHUNK):
        frames = slice(first, first + CHUNK)
        at = posed[frames]
        scales = np.where(visible[frames][at], np.float32(size), np.float32(UNSEEN))
        columns = rr.InstancePoses3D.columns(
            translations=position[frames][at],
            quaternions=quaternion[frames][at],
            # Send scales at every time or never: one that is not sent again stays in force.
            scales=np.repeat(scales[:, None], 3, axis=1) if empty.any() or size != 1.0 else None,
        ).partition(at.sum(axis=1))
        send_columns(recording, entity, time[frames], columns)


def _trails(recording: Any, run: Drawn) -> None:
    """Log the path of some members in parts; the view shows the parts up to its time."""
    import rerun as rr

    if len(run.time) < 2:
        return
    members = np.unique(np.linspace(0, len(run.choice.members) - 1, min(TRAILS, len(run.choice.members))).astype(int))
    path, entity = run.position[:, members], run.path("world", "trails")
    moving = run.counted[:-1, members] & finite_rows(path[:-1]) & finite_rows(path[1:])
    color = (*run.rgb, TRAIL[3]) if run.rgb else TRAIL
    log_static(recording, entity, rr.LineStrips3D.from_fields(colors=[color], radii=rr.Radius.ui_points(0.7)))
    strips = np.stack([path[:-1], path[1:]], axis=2)[moving]
    columns = rr.LineStrips3D.columns(strips=list(strips)).partition(moving.sum(axis=1))
    send_columns(recording, entity, run.time[1:], columns)


def log_paths(recording: Any, run: Drawn) -> None:
    """Log the whole paths of some members, shown at all times."""
    import rerun as rr

    members = slice(None, None, -(-run.few.members // TRAILS))
    ways = zip(run.position[:, members].swapaxes(0, 1), run.counted[:, members].T, strict=True)
    strips = [way[going & finite_rows(way)] for way, going in ways]
    lines = rr.LineStrips3D(strips, colors=[TRAIL], radii=rr.Radius.ui_points(0.7))
    log_static(recording, run.path("world", "paths"), lines)


def _spread(recording: Any, run: Drawn) -> None:
    """Log the ellipsoids of the members under way; they are cleared at times with too few members."""
    import rerun as rr

    spread, entity = run.spread, run.path("world", "spread")
    if not len(spread.at):
        return
    color = (*(run.rgb or (255, 255, 255)), 120)
    style = {"fill_mode": "majorwireframe", "line_radii": [rr.Radius.ui_points(0.8)]}
    log_static(recording, entity, rr.Ellipsoids3D.from_fields(colors=[color], **style))
    has_one = np.zeros(len(run.time), int)
    has_one[spread.at] = 1
    turns = quaternion_xyzw(spread.axes)
    columns = rr.Ellipsoids3D.columns(centers=spread.center, half_sizes=spread.half, quaternions=turns)
    send_columns(recording, entity, run.time, columns.partition(has_one))


def _planes(recording: Any, run: Drawn, box: WorldBox) -> None:
    """Log the surface and the floor if they are in view, with a grid in metres; unbounded water has no surface."""
    import rerun as rr

    margin = AROUND * box.size
    low, high = box.low - margin, box.high + margin
    floors = floors_of(run)
    planes = [("surface", 0.0, WATER)] * box.surface
    planes += [(f"floor_{i}" if i else "floor", depth, SAND) for i, depth in enumerate(floors)]
    for name, depth, color in planes:
        corners = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
        both_sides = [(0, 1, 2), (0, 2, 3), (0, 2, 1), (0, 3, 2)]
        if name == "surface" and not run.watered:
            continue
        points = [(*corner, depth) for corner in corners]
        sheet = rr.Mesh3D(vertex_positions=points, triangle_indices=both_sides, albedo_factor=color)
        log_static(recording, run.path("world", "water", name), sheet)
    uneven = reliefs_of(run, box.low, box.high)
    for i, relief in enumerate(uneven):
        log_static(recording, run.path("world", "water", f"relief_{i}" if i else "relief"), _mesh(relief))
    # Without a floor, a grid below the fleet tells sizes.
    below = [] if floors or uneven else [("depth", high[2], TRAIL)]
    for name, depth, color in [*planes, *below]:
        lines = _grid(low[:2], high[:2], float(depth), box.grid)
        grid = rr.LineStrips3D(lines, colors=[(*color[:3], 120)], radii=rr.Radius.ui_points(0.5))
        log_static(recording, run.path("world", "water", f"{name}_grid"), grid)


def _mesh(relief: Relief) -> Any:
    """Make a mesh of a floor that is visible from both sides, lighter where it is shallower."""
    import rerun as rr

    a, b = relief.depth.shape
    points = np.stack([*np.meshgrid(relief.north, relief.east, indexing="ij"), relief.depth], axis=-1)
    corner = (np.arange(a - 1)[:, None] * b + np.arange(b - 1)).reshape(-1, 1)
    one_side = np.concatenate([corner + np.array(side) for side in ((0, 1, b + 1), (0, b + 1, b))])
    share = (relief.depth.max() - relief.depth) / max(float(np.ptp(relief.depth)), 1e-9)
    light = np.array(DEEP) + share.reshape(-1, 1) * np.subtract(SHALLOW, DEEP)
    return rr.Mesh3D(vertex_positions=points.reshape(-1, 3), vertex_colors=np.round(light).astype(np.uint8),
                     triangle_indices=np.concatenate([one_side, one_side[:, ::-1]]))  # fmt: skip


def _grid(low: np.ndarray, high: np.ndarray, depth: float, step: float) -> list[np.ndarray]:
    """Lines of a horizontal grid at whole multiples of a step [m]."""
    lines = []
    for axis in (0, 1):
        for value in np.arange(np.ceil(low[axis] / step), np.floor(high[axis] / step) + 1) * step:
            line = np.array([[*low, depth], [*high, depth]])
            line[:, axis] = value
            lines.append(line)
    return lines


def _axes(recording: Any, run: Drawn, box: WorldBox) -> None:
    """Log arrows to the north, to the east and down, at a corner of the box."""
    import rerun as rr

    # At the left of what the eye sees, where they hide little.
    corner = np.array([box.high[0], box.low[1], box.low[2]])
    labels, colors = zip(*AXES, strict=True)
    arrows = rr.Arrows3D(origins=[corner] * 3, vectors=0.12 * box.size * np.eye(3), colors=colors, labels=labels,
                         radii=rr.Radius.ui_points(1.5))  # fmt: skip
    log_static(recording, run.path("world", "axes"), arrows)


def water_at(run: Drawn, points: np.ndarray) -> np.ndarray:
    """Compute the velocity of the water at points (g, 3) [m], for the numbers of the first drawn member: (f, g, 3) [m/s].

    It is zero if the motion of the water is not known after the run.
    """
    places = np.broadcast_to(points, (len(run.time), *points.shape))
    total = np.zeros(places.shape)
    shared = {name: values[:1] for name, values in run.few.parameters.items()}
    for term in run.few.terms:
        numbers = {name: values[:1] for name, values in run.few.own(term).items()}
        velocity = term.water(numbers, places, run.time, shared)
        total = total if velocity is None else total + velocity
    return total


def _current(recording: Any, run: Drawn, box: WorldBox) -> None:
    """Log arrows of the water's velocity at the side of the box, if it moves."""
    import rerun as rr

    middle = 0.5 * (box.low + box.high)
    top = max(box.low[2], 0.0)
    depths = top + (box.high[2] - top) * np.array([0.1, 0.5, 0.9])
    norths = np.linspace(box.low[0], box.high[0], 3)
    points = np.array([(north, box.high[1], depth) for depth in depths for north in norths])
    velocity = water_at(run, points)
    fastest = float(np.linalg.norm(velocity, axis=-1).max())
    if fastest == 0.0:
        return
    # Arrows begin where the water comes from, so that they point at the fleet.
    if (velocity.mean(axis=(0, 1)) @ (middle - points.mean(axis=0))) < 0.0:
        points[:, 1] = box.low[1]
        velocity = water_at(run, points)
    vectors = (velocity * (0.14 * box.size / fastest)).astype(np.float32)
    labels = [f"current, up to {fastest:.2g} m/s", *[""] * (len(points) - 1)]
    style = {"colors": [CURRENT], "radii": rr.Radius.ui_points(1.5), "labels": labels}
    entity = run.path("world", "current")
    if (vectors == vectors[0]).all():
        log_static(recording, entity, rr.Arrows3D(origins=points, vectors=vectors[0], **style))
        return
    log_static(recording, entity, rr.Arrows3D.from_fields(origins=points, **style))
    columns = rr.Arrows3D.columns(vectors=vectors.reshape(-1, 3)).partition([len(points)] * len(run.time))
    send_columns(recording, entity, run.time, columns)


def chosen_member(run: Drawn) -> int:
    """Choose the member whose forces are drawn: the first of the drawn members with the longest run."""
    return int(run.counted.sum(axis=0).argmax())


FORCES = (("weight", (230, 160, 60)), ("buoyancy", (90, 200, 250)), ("other forces", (250, 120, 200)))
# Other forces below this share of the weight are round-off of differences between samples.
LITTLE = 1e-3


def forces_on(run: Drawn) -> tuple[np.ndarray, np.ndarray]:
    """Compute weight, buoyancy and the sum of other forces on the chosen member, inertial axes (f, 3, 3) [N].

    The other forces are computed from the balance of momentum, as means between the drawn times.
    Returns: The forces, and their points of action in body axes, shape (3, 3) [m].
    """
    member = np.array([chosen_member(run)])
    few = run.few.part(member)
    numbers, down = few.parameters, np.array([0.0, 0.0, 1.0])
    weight, buoyancy = float(vehicle.weight(numbers)[0]), float(numbers["vehicle.buoyancy"][0])
    center = numbers.get("vehicle.center_of_gravity", vehicle.center_of_mass(numbers))
    steady = np.stack([weight * down, -buoyancy * down])
    others = np.zeros((len(run.time), 1, 3))
    if len(run.time) > 1 and set(FIELDS) <= set(few.samples):
        others = np.gradient(invariants.linear_momentum(few), run.time, axis=0) - steady.sum(axis=0)
    forces = np.concatenate([np.broadcast_to(steady, (len(run.time), 2, 3)), others], axis=1)
    # A member that has ended stands still, held by nothing that is computed.
    forces[~run.counted[:, member[0]], 2] = 0.0
    return forces, np.stack([center[0], numbers["vehicle.center_of_buoyancy"][0], np.zeros(3)])


def _forces(recording: Any, run: Drawn, box: WorldBox, scale: int) -> None:
    """Log the forces on the chosen member as arrows; the viewer shows their magnitudes at the cursor."""
    import rerun as rr

    forces, points = forces_on(run)
    size = np.linalg.norm(forces, axis=-1)
    largest = float(size.max())
    if not (np.isfinite(largest) and largest > 0.0):
        return
    member = chosen_member(run)
    shown_ones = [i for i in range(3) if size[:, i].max() > LITTLE * largest]
    names, colors = zip(*(FORCES[i] for i in shown_ones), strict=True)
    arms = np.einsum("fij,aj->fai", run.few.attitude[:, member], scale * points[shown_ones])
    origins = run.few.position[:, member, None] + arms
    vectors = forces[:, shown_ones] * (0.06 * box.size / largest)
    labels = [f"{name} {value:.3g} N" for row in size[:, shown_ones] for name, value in zip(names, row, strict=True)]
    entity, many = run.path("world", "forces"), len(shown_ones)
    style = rr.Arrows3D.from_fields(colors=colors, radii=rr.Radius.ui_points(1.2), show_labels=False)
    log_static(recording, entity, style)
    ends = {
        name: values.reshape(-1, 3).astype(np.float32) for name, values in (("vectors", vectors), ("origins", origins))
    }
    columns = rr.Arrows3D.columns(**ends, labels=labels)
    send_columns(recording, entity, run.time, columns.partition([many] * len(run.time)))
