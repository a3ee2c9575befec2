# SPDX-License-Identifier: Apache-2.0
"""A scene knows what its vehicle is called, and the file that it was read from."""

import copy
import dataclasses
import pickle

import pytest

import lgvi_warp as lw
from tests.support.refusals import says

TEXT = """# A heavy REMUS.
[vehicle]
name = "remus_100"   # of the package
buoyancy = 285.0
[run]
step = 0.02
duration = 0.1
"""


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "dive.toml"
    path.write_text(TEXT)
    return path


def test_a_scene_names_its_vehicle(path):
    for scene in (lw.Scene.named("remus_100"), lw.Scene.load(path), lw.Scene.from_dict(lw.Scene.load(path).to_dict())):
        assert scene.vehicle.title == "remus_100"
        assert scene.to_dict()["vehicle"]["title"] == "remus_100"
        says(repr(scene), "  vehicle  ", "remus_100")
        assert "remus_100" in repr(scene.vehicle)
    moved = dataclasses.replace(lw.Scene.named("sphere"), start=lw.Start([0.0, 0.0, 5.0]))
    assert moved.vehicle.title == "sphere"
    assert lw.Scene(moved.vehicle).vehicle.title == "sphere"
    assert lw.Scene.named("sphere", vehicle={"title": "a ball"}).vehicle.title == "a ball"
    nameless = lw.Vehicle(mass=1.0, inertia=(1.0, 1.0, 1.0))
    assert nameless.title is None
    assert "title" not in nameless.to_dict()
    assert "title" not in repr(nameless)
    with pytest.raises(lw.SceneError, match=r"vehicle\.title = 3 is not a text"):
        lw.Vehicle(mass=1.0, inertia=(1.0, 1.0, 1.0), title=3)


def test_a_scene_keeps_the_text_of_its_file(path):
    scene = lw.Scene.load(path, {"run.step": "0.01", "ensemble.members": 3})
    assert scene.source == {"file": "dive.toml", "text": TEXT, "changes": {"run.step": "0.01", "ensemble.members": "3"}}
    assert copy.deepcopy(scene).source == pickle.loads(pickle.dumps(scene)).source == scene.source
    # What a script changed is not the file's any more.
    assert dataclasses.replace(scene, start=lw.Start()).source == {} == lw.Scene.named("sphere").source


@pytest.mark.ci
@pytest.mark.kernel
def test_the_provenance_of_a_run_has_both(path, tmp_path):
    result = lw.solve(lw.Scene.load(path))
    assert result.provenance["source"]["text"] == TEXT
    assert result.provenance["scene"]["vehicle"]["title"] == "remus_100"
    result.save(tmp_path / "result.npz")
    assert lw.Result.load(tmp_path / "result.npz").provenance == result.provenance


@pytest.mark.ci
@pytest.mark.kernel
def test_a_comment_and_a_title_make_no_other_run(path, tmp_path):
    """A store goes on after both were changed: no number depends on them."""
    pytest.importorskip("zarr")
    store = lw.Store(tmp_path / "run.zarr")
    lw.solve(lw.Scene.load(path), store=store)
    path.write_text(TEXT.replace("# A heavy REMUS.", "# Another word.").replace("285.0", '285.0\ntitle = "Rosa"'))
    again = lw.solve(lw.Scene.load(path), store=dataclasses.replace(store, existing="resume"))
    assert again.members == 1
