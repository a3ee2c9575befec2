# SPDX-License-Identifier: Apache-2.0
"""Floors on grids in pictures: contours at the depths they say, within the view of the paths; a mesh on the floor."""

import numpy as np
import pytest
from rerun.chunk import RrdReader

import lgvi_warp as lw
from lgvi_warp.views import sea_floor
from tests.unit.views.test_recording import fleet

X = np.arange(-100.0, 201.0, 10.0)
DEPTH = 20.0 + 0.05 * X[:, None] + 0.02 * X
FLOOR = lw.events.Floor(depth=DEPTH, origin=[-100.0, -100.0], spacing=[10.0, 10.0])


def run_over(*events):
    return fleet(scene=lw.Scene.named("remus_100", events=list(events)))


def test_contours_lie_at_their_depths_and_do_not_widen_the_view():
    axes = lw.plots.plan_view(run_over(FLOOR, lw.events.Surface(depth=4.0)))
    bare = lw.plots.plan_view(run_over(lw.events.Surface(depth=4.0)))
    for picture in (axes, bare):
        picture.figure.draw_without_rendering()
    np.testing.assert_allclose(axes.get_xlim(), bare.get_xlim())
    np.testing.assert_allclose(axes.get_ylim(), bare.get_ylim())
    (contours,) = [item for item in axes.collections if hasattr(item, "levels")]
    drawn = 0
    for level, path in zip(contours.levels, contours.get_paths(), strict=True):
        east, north = path.vertices.T if len(path.vertices) else np.zeros((2, 0))
        np.testing.assert_allclose(20.0 + 0.05 * north + 0.02 * east, level, atol=1e-9)
        drawn += len(east) > 0
    assert drawn >= 3
    # They reach over all that is in view.
    (low, high), (left, right) = axes.get_ylim(), axes.get_xlim()
    relief = sea_floor.reliefs(run_over(FLOOR).provenance["scene"], np.array([low, left]), np.array([high, right]))[0]
    assert np.ptp(relief.depth) > 1.0


def test_a_flat_floor_and_a_level_grid_have_no_contours():
    level = lw.events.Floor(depth=np.full((3, 3), 30.0), spacing=[50.0, 50.0])
    axes = lw.plots.plan_view(run_over(lw.events.Floor(depth=20.0, name="flat"), level))
    assert not any(hasattr(item, "levels") for item in axes.collections)


def test_side_views_draw_the_flat_floor_alone():
    axes = lw.plots.paths(run_over(lw.events.Floor(depth=20.0, name="flat"), FLOOR))
    assert [text.get_text() for text in axes.texts].count("floor") == 1


def test_a_relief_ends_where_the_box_or_the_grid_does():
    scene = {"events": [FLOOR.to_dict()]}
    (relief,) = sea_floor.reliefs(scene, np.array([-500.0, 12.0]), np.array([-43.0, 33.0]))
    np.testing.assert_allclose(relief.north, [-100.0, -90.0, -80.0, -70.0, -60.0, -50.0, -43.0])
    np.testing.assert_allclose(relief.east, [12.0, 20.0, 30.0, 33.0])
    np.testing.assert_allclose(relief.depth, 20.0 + 0.05 * relief.north[:, None] + 0.02 * relief.east, rtol=1e-12)
    assert sea_floor.reliefs(scene, np.array([500.0, 500.0]), np.array([600.0, 600.0])) == []
    fine = lw.events.Floor(depth=np.zeros((500, 2)), spacing=[1.0, 1.0])
    (relief,) = sea_floor.reliefs({"events": [fine.to_dict()]}, np.zeros(2), np.array([400.0, 1.0]))
    assert relief.depth.shape == (sea_floor.MOST_PLACES, 2)


def test_a_recording_has_a_mesh_on_the_floor(tmp_path):
    path = lw.record(run_over(FLOOR), tmp_path / "fleet.rrd")
    parts = {}
    for chunk in RrdReader(path).stream().filter(content="/world/water/relief"):
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name.startswith("Mesh3D"):
                parts[name.partition(":")[2]] = np.array(batch.column(name).to_pylist()[0], dtype=float)
    points, corners = parts["vertex_positions"], parts["triangle_indices"].astype(int)
    np.testing.assert_allclose(points[:, 2], 20.0 + 0.05 * points[:, 0] + 0.02 * points[:, 1], rtol=1e-6)
    # The triangles of one side cover the whole rectangle, once.
    a, b, c = (points[corners[: len(corners) // 2, i], :2] for i in range(3))
    area = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert area.min() > 0.0
    assert area.sum() == pytest.approx(np.prod(np.ptp(points[:, :2], axis=0)), rel=1e-5)
