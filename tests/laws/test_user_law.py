# SPDX-License-Identifier: Apache-2.0
"""Laws from a user's own file, those of examples/laws/own_law.py: in a run, in a scene file, and as a script."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.physics import terms
from lgvi_warp.scene import scene as scenes
from tests.support.refusals import says
from tests.support.tools import TURN, one

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "laws" / "own_law.py"
STEPS = (0.1, 0.05, 0.025)


def load(path, code=None):
    """A file as a module, as a user would import his own; written first, if its code is given."""
    if code is not None:
        path.write_text(code)
    spec = importlib.util.spec_from_file_location(path.stem.lstrip("0123456789_"), path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


own_law = load(EXAMPLE)
DOCK = dict(position=(2.0, 1.0, 3.0), nose=(0.6, 0.1, 0.0), energy=40.0, reach=2.0)
MUD = dict(floor=5.0, height=2.0, linear=30.0, angular=8.0)
# Without effect: the runs with a dock share a kernel with those with both.
UNFELT = own_law.Mud(**MUD | {"linear": 1e-30, "angular": 1e-30})
START = {"b": (0.0, 0.0, 2.0), "nu": (0.5, 0.2, 0.1), "Om": (0.1, 0.3, -0.2)}


def solve(laws, h=0.05, t1=5.0, vehicle=own_law.vehicle, **named):
    scene = lw.Scene(vehicle, lw.Environment(gravity=9.8), terms=laws)
    return lw.solve(one(scene, **START), "psi_s", h=h, t1=t1, **named)


@pytest.mark.ci
def test_each_law_is_right():
    near = lw.Scene(own_law.vehicle, start=lw.Start(position=[1.0, 1.0, 3.0]))
    assert lw.laws.check_law(own_law.Dock(**DOCK), scene=near).ok
    assert lw.laws.check_law(own_law.Mud(**MUD, center=(0.3, 0.0, -0.1)), scene=near).ok


@pytest.mark.slow
def test_the_dock_draws_and_the_mud_brakes():
    free, docked = solve([]), solve([own_law.Dock(**DOCK)])
    muddy = solve([own_law.Mud(**MUD | {"linear": 150.0})])
    assert np.abs(docked.position - free.position).max() > 0.1
    speeds = [np.linalg.norm(run.velocity[-1, 0]) for run in (free, muddy)]
    assert speeds[1] < 0.5 * speeds[0]
    # Without them is without them, to the bit.
    nothing = solve([own_law.Dock(**DOCK | {"energy": 0.0}), own_law.Mud(**MUD | {"linear": 0.0, "angular": 0.0})])
    np.testing.assert_allclose(nothing.position, free.position, atol=1e-12)


@pytest.mark.ci
def test_the_energy_is_kept_to_second_order():
    drifts = []
    for h in STEPS:
        energy = solve([own_law.Dock(**DOCK), UNFELT], h=h, save=lw.SaveAt(every=0.1)).energy[:, 0]
        drifts.append(np.abs(energy - energy[0]).max())
    assert 1e-6 < drifts[-1] < 0.05
    assert abs(np.polyfit(np.log(STEPS), np.log(drifts), 1)[0] - 2.0) < 0.2


@pytest.mark.ci
def test_mud_only_takes_energy():
    both = [own_law.Dock(**DOCK), own_law.Mud(**MUD)]
    energy = solve(both, h=0.01, save=lw.SaveAt(every=0.5)).energy[:, 0]
    assert np.all(np.diff(energy) < 0.0)


@pytest.mark.ci
def test_axes_do_not_matter():
    # The same vehicle in turned body axes: the kernel works in its principal axes, and packed() must turn the nose.
    v = own_law.vehicle
    turned = lw.Vehicle(
        v.mass, inertia=TURN.T @ v.inertia @ TURN, added_mass=TURN.T @ v.added_mass @ TURN, buoyancy=v.buoyancy,
        center_of_buoyancy=v.center_of_buoyancy @ TURN,
    )  # fmt: skip
    laws = [own_law.Dock(**DOCK), own_law.Mud(**MUD, center=(0.3, 0.0, -0.1))]
    other = [own_law.Dock(**DOCK | {"nose": DOCK["nose"] @ TURN}), own_law.Mud(**MUD, center=(0.3, 0.0, -0.1) @ TURN)]
    start = {"b": START["b"], "R": TURN, "nu": START["nu"] @ TURN, "Om": START["Om"] @ TURN}
    runs = []
    for vehicle, given, state in ((v, laws, START), (turned, other, start)):
        scene = lw.Scene(vehicle, lw.Environment(gravity=9.8), terms=given)
        runs.append(lw.solve(one(scene, **state), h=0.05, t1=5.0))
    np.testing.assert_allclose(runs[1].position, runs[0].position, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(runs[1].attitude, runs[0].attitude @ TURN, rtol=0.0, atol=1e-10)


@pytest.mark.ci
def test_numbers_vary_by_member():
    fleet = own_law.fleet([own_law.dock, own_law.mud], members=20)
    alone = fleet.subset([7])
    both = (lw.solve(ensemble, h=0.05, t1=5.0) for ensemble in (fleet, alone))
    whole, single = (run.position[-1] for run in both)
    np.testing.assert_array_equal(whole[7], single[0])


SCENE = """
environment = { gravity = 9.8 }
terms = [
  { type = "dock", position = [2.0, 1.0, 3.0], nose = [0.6, 0.1, 0.0], energy = 40.0, reach = 2.0 },
  { type = "mud", name = "silt", floor = 5.0, height = 2.0, linear = 30.0 },
]
ensemble = { members = 3, vary = { "silt.linear" = { lognormal = { sigma = 0.1 } } } }
[vehicle]
mass = 31.0
added_mass = [1.0, 30.0, 30.0]
inertia = [0.2, 8.0, 8.0]
buoyancy = 303.8
center_of_buoyancy = [0.0, 0.0, -0.02]
"""


@pytest.mark.ci
def test_a_scene_file_may_name_them():
    scene = scenes.loads(SCENE)
    assert [type(term) for term in scene.terms] == [own_law.Dock, own_law.Mud]
    assert scene.terms[1].key == "silt"
    assert {"dock.reach", "silt.height"} <= scene.parameters().keys()
    result = lw.solve(lw.Ensemble.from_scene(scene), h=0.05, t1=0.5)
    assert result.status.counts() == {"ok": 3}


def test_a_scene_file_without_them_is_refused(monkeypatch):
    for kind in (own_law.Dock, own_law.Mud):
        monkeypatch.delitem(terms.TYPES, kind.type)
    with pytest.raises(lw.SceneError, match="is not known"):
        scenes.loads(SCENE)


def test_a_type_is_taken_once(monkeypatch):
    monkeypatch.setattr(lw.laws.Term, "kinds", dict(lw.laws.Term.kinds))
    taken = type("Harbour", (lw.laws.Term,), {"type": "dock"})
    assert lw.laws.Term.kinds["dock"] is own_law.Dock
    assert lw.laws.register(own_law.Dock) is own_law.Dock
    for kind in (taken, type("Nameless", (own_law.Dock,), {}), type("Heavy", (lw.laws.Term,), {"type": "weight"})):
        with pytest.raises(ValueError, match="no other term has"):
            lw.laws.register(kind)


@pytest.mark.ci
def test_the_law_on_the_page_is_right(tmp_path):
    lines = (ROOT / "docs" / "develop" / "add_a_force.md").read_text().split("## Nine roles")[0].splitlines()
    code = "\n".join(line[4:] for line in lines if line.startswith("    ") or not line)
    page = load(tmp_path / "page.py", code)
    assert lw.laws.check_law(page.spring, scene=lw.Scene(own_law.vehicle, start=lw.Start(position=[0.0, 0.0, 20.0]))).ok
    energy = solve([page.spring], save=lw.SaveAt(every=1.0)).energy[:, 0]
    assert np.abs(energy - energy[0]).max() < 1e-3 * energy[0]


@pytest.mark.slow
def test_the_example_runs_as_a_script(tmp_path):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, EXAMPLE], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    says(done.stdout, "Dock (dock): ok", "Mud (mud): ok", "'ok': 500")
    assert done.stderr == ""
    assert (tmp_path / "own_law.png").stat().st_size > 10_000
