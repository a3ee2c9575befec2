# SPDX-License-Identifier: Apache-2.0
"""Scene files: the paper's in full, round trip, overrides, and every fault of every section in one message."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.physics import notation
from lgvi_warp.scene import scene as scenes
from lgvi_warp.scene.scene import from_dict
from lgvi_warp.scene.settings import RunSettings
from tests.support.refusals import says

PAPER = Path(__file__).parents[3] / "examples" / "paper.toml"
SMALL = "[vehicle]\nmass = 10.0\ninertia = [1.0, 2.0, 2.5]\n"


def faults(text, overrides=None):
    with pytest.raises(lw.SceneError) as caught:
        scenes.loads(text, overrides)
    return caught.value.faults


def only_fault(text, overrides=None):
    (fault,) = faults(text, overrides)
    return fault


def test_the_paper_in_numbers():
    """Section IV of Nordkvist & Sanyal 2010; mathematics.md section 4: net = (m - rho V) g = -2.56 N."""
    scene = lw.Scene.load(PAPER)
    v, g = scene.vehicle, scene.environment.gravity
    # 123.8 * 9.8 = 1213.24: one rounding of it is 2e-13.
    assert v.mass * g - v.buoyancy == pytest.approx(-2.56, abs=5e-13)
    np.testing.assert_array_equal(np.diag(v.inertia), [5.46, 5.29, 5.72])
    np.testing.assert_allclose(np.diag(v.mass_matrix), [188.8, 193.8, 198.8], rtol=1e-15)
    np.testing.assert_array_equal(v.center_of_buoyancy, [0.0, 0.0, -0.007])
    assert scene.run.to_dict() == {
        "method": "psi_s", "step": 0.01, "duration": 150.0, "save_every": 1.0, "dtype": "float64",
    }  # fmt: skip
    settings = scene.ensemble_settings
    assert (settings.members, settings.seed) == (4096, 1)
    assert settings.vary["start.angular_velocity"] == lw.distributions.Normal(std=[0.03, 0.02, 0.01])
    assert settings.vary["vehicle.mass"] == lw.distributions.Normal(relative=0.001)


def test_the_papers_start(example):
    m = lw.Ensemble(lw.Scene.load(PAPER, {"start.position": example["params"]["x0"]["b"]})).select(0, 1)
    x0 = example["params"]["x0"]
    for value, key in ((m.position, "b"), (m.attitude, "R"), (m.velocity, "nu"), (m.angular_velocity, "Omega")):
        np.testing.assert_allclose(value[0], x0[key], rtol=0, atol=1e-15)
    R = notation.matrix_from_rotation_vector(np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(R @ m.velocity[0], [0.1, 0.2, 1.0], rtol=0, atol=1e-15)


def test_nothing_of_the_papers_example_rises_above_the_surface():
    """Momentum in inertial axes changes by the net weight alone; masses bound the velocity that goes with it."""
    scene = lw.Scene.load(PAPER)
    fleet = lw.Ensemble.from_scene(scene)
    members = fleet.select(0, fleet.members)
    mass, buoyancy = members.parameters["vehicle.mass"], scene.vehicle.buoyancy
    masses = mass[:, None] + np.diag(scene.vehicle.added_mass)
    momentum = np.einsum("nij,nj,nj->ni", members.attitude, masses, members.velocity)
    time = np.linspace(0.0, scene.run.duration, 301)
    down = momentum[:, 2] + (mass * scene.environment.gravity - buoyancy) * time[:, None]
    slowest = np.minimum(down / masses.max(axis=1), down / masses.min(axis=1))
    turned = 0.5 * (1.0 / masses.min(axis=1) - 1.0 / masses.max(axis=1)) * np.hypot(momentum[:, 0], momentum[:, 1])
    depth = members.position[:, 2] + np.cumsum(slowest - turned, axis=0) * time[1]
    assert depth.shape == (301, 4096)
    assert depth.min() > 0.0


def test_round_trip():
    content = lw.Scene.load(PAPER).to_dict()
    assert from_dict(content).to_dict() == content
    printed = tomllib.loads(PAPER.read_text())
    # The file leaves one default out; all else is as it was written.
    assert content["environment"].pop("water_density") == 1025.0
    assert content == printed


def test_a_small_scene_needs_a_vehicle_only():
    scene = scenes.loads(SMALL)
    assert scene.ensemble_settings is None
    assert scene.run.step is None
    assert scene.run.method is None
    assert from_dict(scene.to_dict()).to_dict() == scene.to_dict()
    assert lw.Ensemble.from_scene(scene).members == 1


def test_overrides():
    changes = {"vehicle.mass": "120.5", "run.method": "psi", "run.dtype": '"float32_compensated"', "run.duration": 2,
               "start.position": "[0, 0, 5]", "ensemble.members": "7",
               "ensemble.vary.vehicle.mass": "{ uniform = { half_width = 0.5 } }",
               'ensemble.vary."vehicle.buoyancy"': "{ normal = { std = 0.1 } }"}  # fmt: skip
    scene = lw.Scene.load(PAPER, changes)
    assert (scene.vehicle.mass, scene.run.method, scene.run.duration) == (120.5, "psi", 2)
    assert scene.run.dtype == "float32_compensated"
    np.testing.assert_array_equal(scene.start.position, [0.0, 0.0, 5.0])
    settings = scene.ensemble_settings
    assert settings.members == 7
    assert settings.vary["vehicle.mass"] == lw.distributions.Uniform(half_width=0.5)
    assert settings.vary["vehicle.buoyancy"] == lw.distributions.Normal(std=0.1)


@pytest.mark.parametrize("key", ["mas", "terms.x", "ensemble.vary.x"])
def test_overrides_that_fit_nothing(key):
    vary = 'ensemble = { vary = "none" }\n' if "vary" in key else ""
    assert key in only_fault(f"terms = []\n{vary}" + SMALL, {key: "1"})


def test_unknown_names_are_told_what_was_meant():
    assert "Did you mean 'vehicle'?" in faults(SMALL.replace("[vehicle]", "[vehicel]"))[0]
    assert only_fault(SMALL + "buoyency = 1.0\n").startswith("vehicle.buoyency = 1.0 is an unknown key. Did you mean")
    assert "Did you mean 'save_every'?" in only_fault(SMALL + "[run]\nsave_evry = 1.0\n")
    assert "Did you mean 'members'?" in only_fault(SMALL + "[ensemble]\nmember = 5\n")
    vary = SMALL + "[ensemble.vary]\n"
    assert "Did you mean 'vehicle.mass'?" in only_fault(vary + '"vehicle.mas" = { normal = { std = 1.0 } }\n')
    assert "Did you mean 'normal'?" in only_fault(vary + '"vehicle.mass" = { norml = { std = 1.0 } }\n')
    assert "Did you mean 'std'?" in only_fault(vary + '"vehicle.mass" = { normal = { sdt = 0.1 } }\n').split("\n")[0]


def test_a_faulty_term_is_no_reason_to_doubt_the_names_of_its_numbers():
    """Variations of a term that cannot be built are unknown; in other sections a wrong name is still one."""
    text = SMALL + '[[terms]]\ntype = "drag"\nlinear = [1.0, 2.0]\n[ensemble.vary]\n'
    text += '"drag.linear[0]" = { normal = { std = 1.0 } }\n"vehicle.mas" = { normal = { std = 1.0 } }\n'
    term, name = faults(text)
    assert term.startswith("drag.linear = [1.0, 2.0]")
    assert "Did you mean 'vehicle.mass'?" in name


def test_what_is_missing_is_named():
    says(only_fault(""), "vehicle", "mass and inertia")
    assert only_fault("[vehicle]\nmass = 1.0\n").startswith("vehicle.inertia = None is missing")


def test_toml_errors_name_the_file_and_line(tmp_path):
    path = tmp_path / "torn.toml"
    path.write_text("[vehicle]\nmass = \n")
    with pytest.raises(lw.SceneError, match=r"torn\.toml.*line 2"):
        lw.Scene.load(path)


@pytest.mark.parametrize("line, start", [
    ("[ensemble]\nvary = 3", "ensemble.vary = 3"),
    ('[ensemble.vary]\n"vehicle.mass" = 3', 'ensemble.vary."vehicle.mass" = 3'),
    ('[ensemble.vary]\n"vehicle.mass" = { normal = 3 }', 'ensemble.vary."vehicle.mass".normal = 3'),
    ('[ensemble.vary]\n"vehicle.mass" = { normal = { std = -1.0 } }', 'ensemble.vary."vehicle.mass": normal.std'),
    ('[ensemble.vary]\n"vehicle.mass" = { normal = { std = 20.0 } }', "vehicle.mass of member"),
    ('[[terms]]\ntype = "drga"', "terms[0].type = 'drga'"),
    ('[controller]\nkind = "pid"\nperiod = 0.1', "controller.kind = "),
])  # fmt: skip
def test_one_bad_line_is_one_fault(line, start):
    # Twenty members about a mass of 10 with a spread of 20: some are negative whatever the seed (31 % each).
    text = SMALL + line + "\n"
    assert only_fault(text, {"ensemble.members": 20} if "20.0" in line else None).startswith(start)


@pytest.mark.parametrize("section", ["environment", "start", "run", "ensemble"])
def test_sections_must_be_tables(section):
    assert only_fault(f"{section} = 3\n{SMALL}").startswith(f"{section} = 3 is not a table")


def test_start_and_run_may_be_objects():
    start, run = lw.Start(position=[0.0, 0.0, 5.0]), RunSettings(step=0.02)
    scene = lw.Scene.named("remus_100", start=start, run=run)
    assert scene.start is start
    assert scene.run is run
    with pytest.raises(lw.SceneError, match="is not a table"):
        lw.Scene.named("remus_100", start=run)


def test_all_faults_of_all_sections_come_in_one_message():
    text = """
        [vehicle]
        mass = -1.0
        inertia = [1.0, 2.0]
        colour = "red"
        [environment]
        gravity = -9.8
        [start]
        position = "here"
        velocity = [1.0, 0.0, 0.0]
        velocity_inertial = [1.0, 0.0, 0.0]
        [run]
        step = 0.0
        dtype = "float16"
        [ensemble]
        members = 0
        [ensemble.vary]
        "vehicle.mass" = { normal = { std = -1.0 } }
        "vehicle.volume" = { normal = { std = 1.0 } }
        [[terms]]
        type = "drga"
        [strat]
        x = 1
        """
    found = faults(text)
    keys = ["vehicle.mass", "vehicle.inertia", "vehicle.colour", "environment.gravity", "start.position",
            "start.velocity and velocity_inertial", "run.step", "run.dtype", "ensemble.members",
            'ensemble.vary."vehicle.mass"', 'ensemble.vary."vehicle.volume"', "terms", "strat"]  # fmt: skip
    assert len(found) == len(keys), found
    for key in keys:
        assert sum(fault.startswith(key) for fault in found) == 1, key


SOLVING = """
[vehicle]
mass = 1.0
inertia = [1.0, 1.0, 1.0]
[run]
"""


def test_solver_settings_of_a_run():
    text = SOLVING + 'method = "rk8"\nrtol = 1e-9\natol = 1e-10\nchecks = "all"\non_failure = "raise"'
    run = scenes.loads(text).run
    assert run.method_of() == lw.Method("rk8", rtol=1e-9, atol=1e-10)
    assert (run.checks, run.on_failure) == ("all", "raise")
    assert run.to_dict() == {"method": "rk8", "dtype": "float64", "rtol": 1e-9, "atol": 1e-10, "checks": "all",
                             "on_failure": "raise"}  # fmt: skip
    text = SOLVING + 'solver = "cayley"\niterations = 2\ntolerance = 1e-9'
    assert scenes.loads(text).run.method_of() == lw.Method("psi_s", "cayley", 2, 1e-9)
    assert scenes.loads(SOLVING + 'iterations = "auto"').run.method_of().iterations == "auto"
    # Another method, named later, does not inherit what was said of this one.
    assert run.method_of("psi_s") == lw.Method("psi_s")
