# SPDX-License-Identifier: Apache-2.0
"""The shape of a vehicle is drawn, and nothing else: no dynamics, no kernel, no bits depend on it."""

import os

import pytest

import lgvi_warp as lw
from lgvi_warp.results.provenance import provenance
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.store.recipe import same_run

BODY = "[vehicle]\nmass = 30.0\ninertia = [0.2, 3.0, 3.0]\nbuoyancy = 290.0\n"


@pytest.mark.parametrize(("shape", "words"), [
    ({"length": 1.0}, "vehicle.shape.diameter = None is missing"),
    ({"length": 1.0, "diameter": 0.0}, "vehicle.shape.diameter = 0.0 is not positive"),
    ({"length": "x", "diameter": 1.0}, "vehicle.shape.length = 'x'"),
    ({"mesh": "hull.stl"}, "is not a name of a .glb file"), ({"mesh": 3}, "is not a name of a .glb file"),
    ({"mesh": "a.glb", "length": 1.0}, "stands beside a length"), ({"lenght": 1.0}, "Did you mean 'length'"),
    (3, "is not a table"),
])  # fmt: skip
def test_a_wrong_shape_is_refused(shape, words):
    with pytest.raises(lw.SceneError) as caught:
        lw.Vehicle(30.0, inertia=(0.2, 3.0, 3.0), shape=shape)
    assert words in str(caught.value)
    assert all(". " in fault for fault in caught.value.faults)


@pytest.mark.parametrize("name", lw.vehicles.names())
def test_the_vehicles_of_the_package_have_one_that_holds_their_water(name):
    vehicle = lw.Scene.named(name).vehicle
    shape = vehicle.shape
    volume = vehicle.buoyancy / (1025.0 * 9.81)
    # From a slender spheroid to the cylinder around it; an open frame displaces less.
    spheroid = 0.5236 * shape.length * shape.diameter**2
    assert (0.2 if name in ("bluerov2_heavy", "rexrov") else 0.95) < volume / spheroid < 1.5
    again = lw.Scene.from_dict(lw.Scene.named(name).to_dict()).vehicle.shape
    assert again == shape
    other = lw.Scene.named(name, vehicle={"shape": {"length": 9.0, "diameter": 1.0}})
    assert other.vehicle.shape.length == 9.0


def test_it_is_no_part_of_the_dynamics():
    plain, shaped = (
        make_plan(lw.Ensemble(lw.Scene(lw.Vehicle(30.0, inertia=(0.2, 3.0, 3.0), shape=shape)), 2), h=0.1, t1=1.0)
        for shape in (None, {"length": 2.0, "diameter": 0.3})
    )
    assert (plain.kernel.hash, plain.spec) == (shaped.kernel.hash, shaped.spec)
    tables = [provenance(plan) for plan in (plain, shaped)]
    assert tables[0] != tables[1]
    assert same_run(*tables) == []


def load(folder, mesh):
    path = folder / "scene.toml"
    path.write_text(f"{BODY}[vehicle.shape]\nmesh = {mesh!r}\n")
    return lw.Scene.load(path)


def test_a_mesh_lies_in_the_folder_of_its_scene(tmp_path):
    folder = tmp_path / "scenes"
    (folder / "meshes").mkdir(parents=True)
    for place in (tmp_path / "out.glb", folder / "in.glb", folder / "meshes" / "in.glb"):
        place.write_bytes(b"glTF")
    os.symlink(tmp_path / "out.glb", folder / "link.glb")
    assert load(folder, "in.glb").vehicle.shape.mesh == str(folder / "in.glb")
    assert load(folder, "meshes/in.glb").vehicle.shape.mesh == str(folder / "meshes" / "in.glb")
    for name in ("../out.glb", str(tmp_path / "out.glb"), str(folder / "in.glb"), "link.glb", "meshes/../../out.glb"):
        with pytest.raises(lw.SceneError, match=r"lies outside the scene file's folder. Put the mesh beside"):
            load(folder, name)
    for name in ("none.glb", "a\\0.glb", "meshes"):
        with pytest.raises(lw.SceneError, match=r"vehicle\.shape\.mesh"):
            load(folder, name)
    # What a run's provenance names is its own.
    assert lw.Scene.from_dict(load(folder, "in.glb").to_dict()).vehicle.shape.mesh == str(folder / "in.glb")
