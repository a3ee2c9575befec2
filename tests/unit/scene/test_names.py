# SPDX-License-Identifier: Apache-2.0
"""One grammar of names: all entries take each number of three shipped scenes, and set it as a file written with it does."""

import copy
import functools
import json

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.cli.settings import load_scene
from lgvi_warp.robustness.search.box import SearchBox
from lgvi_warp.scene.names import LISTS, by_key, single_number
from lgvi_warp.scene.scene import loads
from lgvi_warp.studies import Case
from tests.conftest import ROOT

SCENES = {
    name: ROOT / "examples" / name
    for name in ("paper.toml", "scenes/remus_100_autopilot.toml", "scenes/bluerov2_dead_thruster.toml")
}
FEW = {"ensemble.members": 4}
load = functools.cache(lambda path: lw.Scene.load(path, FEW))
# A fault of one kind has no other choice.
EVERY = [
    (file, name) for file, path in SCENES.items() for name in load(path).parameters() if not name.endswith("choice")
]
AUTOPILOT = SCENES["scenes/remus_100_autopilot.toml"]


def text(scene):
    """All that a scene says, to the last digit."""
    return json.dumps(scene.to_dict(), sort_keys=True)


def written(scene, name, value):
    """The scene of a file in which the number is written: the tables of the scene, with another value in one of them."""
    tables, (head, field) = copy.deepcopy(scene.to_dict()), name.rsplit(".", 1)
    controller = tables.get("controller", {})
    lists = [tables.get("terms", []), *(entries for entries in controller.values() if isinstance(entries, list))]
    parts = {part.get("name", part["type"]): part for entries in lists for part in entries if "type" in part}
    # A fault of an actuator may have no type in a file, and has one in tables.
    (tables if head in ("vehicle", "environment", "controller") else parts)[head][field] = value
    return lw.Scene.from_dict(tables)


def another_value(scene, name):
    """Another value of a number that the scene can have, as a file writes it, and the scene that has it."""
    value = scene.parameters()[name]
    for candidate in (2.0 * value, 0.5 * value, value + 0.25, value + 1.0, np.full(value.shape, 50.0)):
        try:
            changed = scene.with_numbers({name: candidate.tolist()})
        except lw.SceneError:
            continue
        if text(changed) != text(scene):
            return candidate.tolist(), changed
    raise AssertionError(f"{name}: no other value was found")


def on_the_command(path, *options):
    """The scene of the command's arguments."""
    return load_scene(
        cli.parser().parse_args(
            ["run", str(path), "--members", "4", *(word for each in options for word in ("--set", each))]
        )
    )


@pytest.mark.ci
@pytest.mark.parametrize(("file", "name"), EVERY)
def test_every_entry_takes_every_number(file, name):
    """File, --set, load, with_numbers and a sweep's set: the same scene, of which that of the written file is the witness."""
    path, scene = SCENES[file], load(SCENES[file])
    value, changed = another_value(scene, name)
    witness = text(written(scene, name, value))
    entries = {
        "with_numbers": changed,
        "load": lw.Scene.load(path, FEW | {name: value}),
        "--set": on_the_command(path, f"{name}={json.dumps(value)}"),
        "set of a sweep": Case("a", set={name: value}).of(scene),
    }
    for entry, result in entries.items():
        assert text(result) == witness, entry
    place = (0,) * np.ndim(value)
    if name == "vehicle.rigid_body_mass_matrix":
        return  # of which one entry alone is that of no body
    entry = f"{name}[{','.join(map(str, place))}]" if place else name
    first = np.array(value)[place]
    by_entry = np.array(scene.parameters()[name])
    by_entry[place] = first
    one = text(scene.with_numbers({name: by_entry.tolist()}))
    assert text(scene.with_numbers({entry: first})) == one
    assert text(lw.Scene.load(path, FEW | {entry: first})) == one == text(on_the_command(path, f"{entry}={first}"))
    # What --by, --within, --over and the columns of lw.prepare name.
    assert single_number(scene, entry)[1] == scene.parameters()[name][place]
    assert SearchBox.of("within", {entry: (0.0, 1.0)}, scene).names == (entry,)


def test_parts_by_their_places():
    scene, found = load(AUTOPILOT), set()
    for section in LISTS:
        owner, _, field = section.rpartition(".")
        for i, part in enumerate(getattr(scene.controller if owner else scene, field)):
            for name in part.parameters():
                place, key = f"{section}[{i}].{name}", f"{part.key}.{name}"
                assert by_key(scene, place) == key
                found.add(key)
            value, changed = another_value(scene, key)
            assert (
                text(lw.Scene.load(AUTOPILOT, FEW | {place: value}))
                == text(changed)
                == text(scene.with_numbers({place: value}))
            )
    heads = ("vehicle.", "environment.", "controller.")
    assert found == {name for name in scene.parameters() if not name.startswith(heads)}
    vary = {"controller.sensors[0].bias": lw.distributions.Normal(std=0.1)}
    assert set(lw.Ensemble(scene, 2, vary=vary).vary) == {"depth_cell.bias"}


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize(
    ("file", "name", "value"),
    [("scenes/remus_100_autopilot.toml", "heading_pid.kp", 1.25),
     ("scenes/remus_100_autopilot.toml", "vehicle.buoyancy", 301.0),
     ("scenes/bluerov2_dead_thruster.toml", "current.velocity[1]", 0.15), ("paper.toml", "start.position[2]", 350.0)],
)  # fmt: skip
def test_runs_have_the_same_bits(file, name, value):
    """A run of the scene that --set gives, of that of with_numbers, and of a row of lw.prepare."""
    path, settings = SCENES[file], {"h": 0.01, "t1": 2.0}
    scene = load(path)
    runs = [lw.solve(lw.Ensemble(each, 1), **settings)
            for each in (scene.with_numbers({name: value}), on_the_command(path, f"{name}={value}"))]  # fmt: skip
    prepared = lw.prepare(lw.Ensemble(scene, 1), [name], "position", **settings)
    for run in (runs[1].position[-1], prepared([[value]])):
        np.testing.assert_array_equal(run, runs[0].position[-1])
    assert not np.array_equal(lw.solve(lw.Ensemble(scene, 1), **settings).position[-1], runs[0].position[-1])


def test_what_follows_from_a_key_follows_from_its_new_value():
    """The centre of gravity is in the mass matrix, where the file does not say it: at z = S / m of the first moment S."""
    matrix = "[[10,0,0,0,{s},0],[0,10,0,-{s},0,0],[0,0,10,0,0,0],[0,-{s},0,2,0,0],[{s},0,0,0,2,0],[0,0,0,0,0,2]]"
    file = f"[vehicle]\nrigid_body_mass_matrix = {matrix.format(s=1)}\nbuoyancy = 98.0\n"
    changed = loads(file, {"vehicle.rigid_body_mass_matrix": matrix.format(s=2)})
    np.testing.assert_allclose(changed.vehicle.center_of_gravity, [0.0, 0.0, 0.2], rtol=1e-15)


REFUSED = {
    "two names of one number": (
        {"depth_cell.noise": 0.1, "controller.sensors[0].noise": 0.2}, ["is set by", "Keep one of them"]),
    "a whole and its entry": ({"start.velocity": [1, 0, 0], "start.velocity[0]": 2.0}, ["is set by"]),
    "two entries of a symmetric matrix": (
        {"vehicle.added_mass_matrix[0,1]": 1.0, "vehicle.added_mass_matrix[1,0]": 2.0}, ["is set by"]),
    "a wrong shape": ({"heading_pid.kp": [1.0, 2.0]}, ["heading_pid.kp", "shape (2,)"]),
    "no such entry": ({"matrix.matrix[5,0]": 1.0}, ["matrix.matrix", "shape (2, 6)"]),
    "no number": ({"heading_pid.kp": "high"}, ["heading_pid.kp", "'high'"]),
    "all faults at once": (
        {"headng_pid.kp": 1.0, "vehicle.bouyancy": 2.0, "run.step": -1.0},
        ["3 faults", "Did you mean 'heading_pid.kp'", "Did you mean 'buoyancy'", "run.step"]),
    "a field without its part": ({"pitch_limit": 1.0}, ["Did you mean 'depth_pid.pitch_limit'"]),
    "a key without its section": ({"methd": "rk4"}, ["Did you mean 'run.method'"]),
    "a name by place": ({"controller.laws[1].kpp": 1.0}, ["Did you mean 'heading_pid.kp'"]),
    "a place that is not there": ({"controller.laws[7].kp": 1.0}, ["controller.laws[7].kp"]),
    "several names": ({"heading_pid.kp, heading_pid.ki": 1.0}, ["is not a number"]),
    "no name": ({5: 1.0}, ["is not a name of a quantity"]),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused(case):
    settings, words = REFUSED[case]
    with pytest.raises(lw.SceneError) as caught:
        lw.Scene.load(AUTOPILOT, settings)
    for word in words:
        assert word in str(caught.value)


def test_a_name_is_set_once_on_the_command():
    for options in (
        ["--set", "heading_pid.kp=1", "--set", "heading_pid.kp=2"],
        ["--step", "0.1", "--set", "run.step=0.2"],
    ):
        with pytest.raises(lw.SceneError, match=r"as well. Keep one of them"):
            load_scene(cli.parser().parse_args(["run", str(AUTOPILOT), *options]))


def test_keys_within_tables_and_numbers_as_python_writes_them():
    scene = on_the_command(SCENES["paper.toml"], "vehicle.shape.length=.7", "run.step=5.e-3")
    assert (scene.vehicle.shape.length, scene.run.step) == (0.7, 0.005)
    assert on_the_command(AUTOPILOT, "ensemble.vary.heading_pid.kp={ normal = { std = 0.1 } }").ensemble_settings.vary


def test_what_varies_is_checked_with_the_values_that_are_set():
    vary = {"ensemble.vary.stuck_rudder.gain": "{ normal = { relative = 0.1 } }"}
    with pytest.raises(lw.SceneError, match="varies nothing"):
        lw.Scene.load(AUTOPILOT, vary)
    lw.Scene.load(AUTOPILOT, vary | {"stuck_rudder.gain": 0.5})
