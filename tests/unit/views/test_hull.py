# SPDX-License-Identifier: Apache-2.0
"""Shape of a vehicle: the hull of its shape, or the user's mesh."""

import json
import struct

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.views.recording import hull as hulls


@pytest.mark.parametrize(("length", "diameter"), [(1.33, 0.191), (0.5, 0.5), (0.2, 0.9)])
def test_a_hull_has_the_size_of_its_shape(length, diameter):
    hull = hulls.hull_of(length, diameter)
    of_hull = hull.points[hull.parts < 2]
    np.testing.assert_allclose(np.ptp(of_hull, axis=0), [length, diameter, diameter], rtol=1e-6)
    np.testing.assert_allclose(of_hull[:, 0].max(), 0.5 * length, rtol=1e-6)
    assert np.isfinite(hull.points).all()
    assert np.isfinite(hull.normals).all()
    np.testing.assert_allclose(np.linalg.norm(hull.normals, axis=1), 1.0, rtol=1e-6)
    assert hull.triangles.max() == len(hull.points) - 1


def test_its_normals_and_triangles_point_outward():
    hull = hulls.hull_of(2.0, 0.5)
    corners = hull.points[hull.triangles[:-2]]
    turn = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward = corners.mean(axis=1) - np.clip(corners.mean(axis=1), [-0.75, 0, 0], [0.75, 0, 0])
    large = np.linalg.norm(turn, axis=1) > 1e-9
    assert (np.einsum("ti,ti->t", turn, outward)[large] > 0.0).all()
    from_axis = hull.points[:-3] - np.clip(hull.points[:-3], [-0.75, 0, 0], [0.75, 0, 0])
    np.testing.assert_allclose(hull.normals[:-3], from_axis / 0.25, atol=1e-5)


def test_nose_and_fin_tell_the_attitude():
    hull = hulls.hull_of(2.0, 0.5)
    assert (hull.points[hull.parts == 1, 0] > 0.75).all()
    assert (hull.points[hull.parts == 2, 2] < -0.1).all()
    colors = hull.colors((10, 20, 30))
    assert {tuple(color) for color in colors.tolist()} == {(10, 20, 30), hulls.LIGHT, hulls.FIN}


def test_without_a_shape_the_hull_holds_the_displaced_water():
    scene = lw.Scene(
        lw.Vehicle(30.0, inertia=(0.2, 3.0, 3.0), buoyancy=300.0), lw.Environment(gravity=10.0, water_density=1000.0)
    )
    parameters = {name: np.asarray(value, dtype=float)[None] for name, value in scene.parameters().items()}
    shape, words = hulls.shape_of(scene.to_dict(), parameters)
    assert np.pi / 6.0 * shape.length * shape.diameter**2 == pytest.approx(0.03)
    assert shape.length == pytest.approx(4.0 * shape.diameter)
    assert "no [vehicle.shape] is given" in words


def glb(path, size=2.0, **changes):
    """A binary glTF file of a pyramid, seen from both sides."""
    w = 0.25 * size
    corners = np.array([[2 * w, 0, 0], [-2 * w, w, w], [-2 * w, -w, w], [-2 * w, 0, -w]], np.float32)
    faces = [(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)]
    indices = np.array([*faces, *(face[::-1] for face in faces)], np.uint32)
    tables = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
                       "min": corners.min(axis=0).tolist(), "max": corners.max(axis=0).tolist()},
                      {"bufferView": 1, "componentType": 5125, "count": 24, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 96}],
        "buffers": [{"byteLength": 144}],
    } | changes  # fmt: skip
    text = json.dumps(tables).encode()
    text += b" " * (-len(text) % 4)
    data = corners.tobytes() + indices.tobytes()
    parts = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts)
    return path


def test_a_mesh_is_read_with_its_size(tmp_path):
    path = glb(tmp_path / "hull.glb", 3.0)
    mesh = hulls.mesh_of(str(path))
    assert mesh.length == 3.0
    assert mesh.content == path.read_bytes()


@pytest.mark.parametrize(("content", "words"), [
    (None, "cannot be read"), (b"", "is not a binary glTF"), (b"root:x:0:0" * 9, "is not a binary glTF"),
    (b"glTF" + b"\xff" * 60, "is not a binary glTF"),
    ({"buffers": [{"uri": "../secret.bin", "byteLength": 36}]}, "names further files"),
    ({"images": [{"uri": "file:///etc/passwd"}]}, "names further files"), ({"accessors": []}, "is not a binary glTF"),
    ({"meshes": 3}, "is not a binary glTF"), ({"accessors": [{"min": [0, 0, 0], "max": [0, 0, 0]}]}, "has no size"),
    ({"accessors": [{"min": ["a", 0, 0], "max": [1, 0, 0]}]}, "is not a binary glTF"),
])  # fmt: skip
def test_what_is_no_mesh_is_refused_in_one_line(tmp_path, content, words):
    path = tmp_path / "hull.glb"
    if isinstance(content, dict):
        glb(path, **content)
    elif content is not None:
        path.write_bytes(content)
    with pytest.raises(lw.SceneError, match=words) as caught:
        hulls.mesh_of(str(path))
    assert len(caught.value.faults) == 1
    assert "length and diameter" in str(caught.value)
