# SPDX-License-Identifier: Apache-2.0
"""The JSON schema of scene files: what the loader takes fits it, what the loader refuses as unknown does not."""

import copy
import inspect
import tomllib

import pytest

import lgvi_warp as lw
from lgvi_warp.cli.lists import NEW_SCENE
from lgvi_warp.scene.schema import meanings, schema
from lgvi_warp.vehicles.fossen import vehicle_file, vehicle_names
from tests.conftest import ROOT
from tests.support.json_schema import faults

SCHEMA = schema()
FILES = [*sorted((ROOT / "examples").glob("*.toml")), *sorted((ROOT / "examples" / "scenes").glob("*.toml")),
         *map(vehicle_file, vehicle_names())]  # fmt: skip
PAPER = tomllib.loads((ROOT / "examples" / "paper.toml").read_text())


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_scene_of_the_project_fits(path):
    assert faults(tomllib.loads(path.read_text()), SCHEMA) == []


@pytest.mark.parametrize("name", vehicle_names())
def test_what_a_scene_writes_of_itself_fits(name):
    events = [
        lw.events.Floor(depth=100.0),
        lw.events.Box(lower=(-1.0, -1.0, 0.0), upper=(9.0, 9.0, 90.0)),
        lw.events.StopTime(at=50.0),
    ]
    run = {"step": 0.01, "duration": 1.0, "statistics": [{"type": "quantiles", "of": "depth"}],
           "until": {"statistic": "mean depth", "half_width": 0.1}}  # fmt: skip
    vary = {"vehicle.buoyancy": {"normal": {"relative": 0.01}}, "start.position": {"gamma": {"a": 2.0}}}
    ensemble = {"members": 4, "vary": vary, "sampling": {"sobol": {"replicates": 2}}}
    scene = lw.Scene.named(name, start={"position": [0.0, 0.0, 10.0]}, events=events, run=run, ensemble=ensemble)
    assert faults(scene.to_dict(), SCHEMA) == []


def test_a_current_of_a_file_fits():
    term = {"type": "current_field", "file": "roms.nc", "origin": [41.5, -70.5], "start": "2024-05-01", "speed": 2.0}
    content = {"vehicle": {"name": "sphere"}, "terms": [term]}
    assert faults(content, SCHEMA) == []
    assert faults({**content, "terms": [term | {"velocity": 1.0}]}, SCHEMA) != []
    assert faults({**content, "terms": [term | {"fill": 1.0, "speed": "fast"}]}, SCHEMA) != []


@pytest.mark.parametrize(("key", "value", "place"), [
    ("vehicle.mas", 1.0, ".vehicle.mas: unknown"),
    ("vehicle.mass", "heavy", ".vehicle.mass: 'heavy' is not a number"),
    ("start.position", [0.0, 0.0], ".start.position: 2 entries"),
    ("start.position", [0.0, 0.0, "deep"], ".start.position[2]: 'deep' is not a number"),
    ("environment.gravity", True, ".environment.gravity: True is not a number"),
    ("run.step", [0.1], ".run.step: [0.1] is not a number"),
    ("run.until", {"statistic": "mean depth"}, ".run.until.half_width: missing"),
    ("terms", [{"type": "current"}], ".terms[0].velocity: missing"),
    (
        "terms",
        [{"type": "tether", "anchor": [0, 0, 0], "stiffness": -1.0}],
        ".terms[0].stiffness: -1.0 is out of bounds",
    ),
    ("events", [{"type": "floor", "deph": 1.0, "depth": 2.0}], ".events[0].deph: unknown"),
    ("controller", {"laws": []}, ".controller.period: missing"),
    ("ensemble.sampling", {"sobol": {"replicas": 2}}, ".ensemble.sampling.sobol.replicas: unknown"),
    ("ensemble.vary", {"vehicle.mass": {"norml": {}}}, ".ensemble.vary.vehicle.mass.norml: unknown"),
    ("boat", {}, ".boat: unknown"),
])  # fmt: skip
def test_what_the_loader_refuses_does_not_fit(key, value, place):
    content = copy.deepcopy(PAPER)
    section, dot, name = key.partition(".")
    if dot:
        content.setdefault(section, {})[name] = value
    else:
        content[section] = value
    with pytest.raises(lw.SceneError):
        lw.Scene.from_dict(content)
    assert place in faults(content, SCHEMA)


def test_meanings_are_found_without_indentation():
    # As Python 3.13 keeps docstrings.
    dedented = type("Vehicle", (), {"__doc__": inspect.cleandoc(lw.Vehicle.__doc__)})
    assert meanings(dedented) == meanings(lw.Vehicle)
    assert meanings(dedented)["mass"] == "Dry mass [kg]. Simple form."


def test_keys_are_described():
    mass = SCHEMA["properties"]["vehicle"]["properties"]["mass"]
    assert mass == {"type": "number", "description": "Dry mass [kg]. Simple form."}
    floor = next(entry for entry in SCHEMA["properties"]["events"]["items"]["anyOf"]
                 if entry["properties"]["type"] == {"const": "floor"})  # fmt: skip
    assert floor["properties"]["depth"]["description"].startswith("Depth of the floor [m]; or an array of depths")
    assert sorted(floor["required"]) == ["depth", "type"]


def test_a_registered_term_is_in_it():
    before = dict(lw.laws.Term.kinds)
    try:

        class Anchor(lw.laws.Term):
            type = "anchor_of_a_test"

        types = [entry["properties"]["type"]["const"] for entry in schema()["properties"]["terms"]["items"]["anyOf"]]
        assert "anchor_of_a_test" in types
        assert "restoring" not in types
        assert "weight" not in types
    finally:
        lw.laws.Term.kinds.clear()
        lw.laws.Term.kinds.update(before)


def test_the_scene_of_new_has_comments_on_every_key():
    lines = [
        line
        for line in NEW_SCENE.splitlines()
        if "=" in line and not line.startswith(("#", "[", '"', "type", "of", "members"))
    ]
    assert lines
    assert all("#" in line for line in lines if not line.startswith("seed"))
