# SPDX-License-Identifier: Apache-2.0
"""Odd values, most likely units, are reported: on both sides of each limit, by members, and never of what is right."""

import math
from pathlib import Path

import numpy as np
import pytest

import lgvi_warp as lw
from benchmarks import problems
from lgvi_warp.cli import main
from lgvi_warp.distributions import Choice, Normal, Uniform
from lgvi_warp.engine.heights import Heights
from lgvi_warp.results.outcomes import above_surface
from lgvi_warp.scene import plausibility, slices
from lgvi_warp.scene.plausibility import LIMITS
from tests.conftest import ROOT
from tests.support.refusals import says

BODY = {"mass": 30.0, "inertia": [0.2, 3.0, 3.0], "buoyancy": 290.0}
POINT, AHEAD, ACROSS = [[-0.6, 0.0, 0.0]], [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]
RUDDER = {"type": "control_fins", "position": POINT, "chord": AHEAD, "normal": ACROSS, "area": 0.01, "lift_slope": 3.0,
          "drag": 0.02}  # fmt: skip
# The hull of the vehicle above: 1.6 m long, 0.2 m wide. Its inertia may be 30 (1.6^2 + 0.2^2)/4 = 19.5 kg m2.
HULL = {"type": "cross_flow", "stations": [-0.8, 0.0, 0.8], "diameters": [0.1, 0.2, 0.1], "drag_coefficient": 1.1}
LOADS = HULL | {"type": "hull_loads"}
WEIGHT = 30.0 * 9.80665
HOT = 1.0 + 1e-6


def scene(body=None, **sections):
    return lw.Scene.from_dict({"vehicle": BODY | (body or {}), **sections})


def said(fleet):
    ensemble = fleet if isinstance(fleet, lw.Ensemble) else lw.Ensemble.from_scene(fleet)
    return plausibility.of_ensemble(ensemble).messages(ensemble.members)


def term(**table):
    return {"terms": [table]}


def full(largest):
    """The same vehicle by 6x6 matrices, with this largest inertia about its centre of gravity, 0.1 m ahead."""
    rigid = np.diag([30.0, 30.0, 30.0, 0.2, largest + 0.3, largest + 0.3])
    rigid[1, 5] = rigid[5, 1] = 3.0
    rigid[2, 4] = rigid[4, 2] = -3.0
    return {"rigid_body_mass_matrix": rigid.tolist(), "mass": None, "inertia": None}


def carried(inertia):
    """6x6 with this added inertia, of 40 kg of added mass across."""
    return full(3.0) | {"added_mass_matrix": np.diag([1.0, 40.0, 40.0, 0.0, inertia, inertia]).tolist()}


LARGEST = 30.0 * (1.6**2 + 0.2**2) / 4.0
STRIPS = 40.0 * (0.8**2 + 0.2**2 / 4.0)

PROFILE, STILL = {"type": "current_profile", "depths": [0.0, 9.0]}, [0.0, 0.0, 0.0]
WANDERING = {"type": "gauss_markov_current", "time_constant": 9.0}

# A scene of a value, the value at its limit, that beyond, and words of the message.
LIMITED = {
    "net weight down": (lambda N: scene({"buoyancy": N}), 0.5 * WEIGHT * HOT, 0.5 * WEIGHT / HOT,
                        "vehicle.buoyancy", "N down", "half the weight"),
    "net weight up": (lambda N: scene({"buoyancy": N}), 1.5 * WEIGHT / HOT, 1.5 * WEIGHT * HOT, "vehicle.buoyancy", "N up"),
    "no buoyancy": (lambda N: scene({"buoyancy": N}), 290.0, 0.0, "vehicle.buoyancy", "left out"),
    "light water": (lambda rho: scene(environment={"water_density": rho}), 100.0, 99.9,
                    "environment.water_density", "99.9 kg/m3"),
    "heavy water": (lambda rho: scene(environment={"water_density": rho}), 3000.0, 3000.1,
                    "environment.water_density", "3000.1 kg/m3"),
    "current": (lambda w: scene(**term(type="current", velocity=[3.0, 4.0, w])), 0.0, 0.1, "current.velocity", "m/s"),
    "profile": (lambda v: scene(**term(**PROFILE, velocities=[STILL, [0.0, v, 0.0]])), 5.0, 5.1,
                "current_profile.velocities", "5.1 m/s"),
    "tide": (lambda u: scene(**term(type="current_harmonics", amplitudes=[u], periods=[9.0])), [5.0, 0.0, 0.0],
             [0.0, -5.1, 0.0], "current_harmonics.amplitudes", "5.1 m/s"),
    "wandering current": (lambda u: scene(**term(**WANDERING, standard_deviation=[u, 0.0, 0.0])), 5.0, 5.1,
                          "gauss_markov_current.standard_deviation"),
    "fin's limit": (lambda a: scene(**term(**RUDDER, limit=a)), math.pi / 2.0, 20.0,
                    "control_fins.limit", "20 rad", "degrees"),
    "fin's command": (lambda a: scene(**term(**RUDDER, command=[a])), -math.pi / 2.0, -1.6,
                      "control_fins.command:", "1.6 rad"),
    "fin's schedule": (lambda a: scene(**term(**RUDDER, times=[0.0, 1.0], command_schedule=[[0.0], [a]])), 1.5, 15.0,
                       "control_fins.command_schedule", "15 rad"),
    "speed": (lambda w: scene(start={"velocity": [18.0, 24.0, w]}), 0.0, 1.0, "start.velocity", "30.02 m/s"),
    "inertial speed": (lambda start: scene(start=start), {"velocity_inertial": [0.0, 30.0, 0.0], "euler_deg": STILL},
                       {"velocity_inertial": [0.0, 30.1, 0.0], "euler_deg": [10.0, 20.0, 30.0]},
                       "start.velocity", "30.1 m/s"),
    "depth": (lambda z: scene(start={"position": [0.0, 0.0, z]}), 0.0, -0.1, "start.position", "-0.1 m", "positive down"),
    "floor": (lambda z: scene(events=[{"type": "floor", "depth": z}]), 0.0, -26.0, "floor.depth", "-26 m"),
    "heights for depths": (lambda z: scene(**term(**PROFILE | {"depths": z}, velocities=[STILL, [0.1, 0.0, 0.0]])),
                           [-1.0, 9.0], [-9.0, 0.0], "current_profile.depths", "-9 m"),
    "inertia": (lambda J: scene({"inertia": [0.2, J, 3.0]}, terms=[HULL]), LARGEST / HOT, LARGEST * HOT,
                "vehicle.inertia", "kg m2", "1.6 m"),
    "inertia with added": (lambda J: scene({"inertia": [0.2, J, 3.0], "added_mass": [1.0, 40.0, 40.0]}, terms=[HULL]),
                           LARGEST + STRIPS / HOT, LARGEST + STRIPS * HOT, "vehicle.inertia"),
    "rigid body's inertia": (lambda J: scene(full(J), terms=[HULL]), LARGEST / HOT, LARGEST * HOT,
                             "vehicle.rigid_body_mass_matrix"),
    "added inertia": (lambda J: scene(carried(J), terms=[HULL]), STRIPS / HOT, STRIPS * HOT, "vehicle.added_mass_matrix"),
    "drag ahead": (lambda X: scene(**term(type="quadratic_form", products=["X_uu", "X_u|u|", "Z_ww"], values=[X, -2.0, 9.0])),
                   2.0, 2.1, "quadratic_form.values", "X of u|u| is 0.1", "sign"),
    "drag across": (lambda Z: scene(**term(type="quadratic_form", products=["Z_w|w|", "Z_w|vw|"], values=[Z, -2.0])),
                    2.0, 3.0, "quadratic_form.values", "Z of w|w| is 1"),
    "damping": (lambda N: scene(**term(type="quadratic_form", products=["N_uv", "N_ur", "N_|u|r"], values=[9.0, N, -2.0])),
                2.0, 3.0, "quadratic_form.values", "N of u r is 1"),
    "two hulls": (lambda Cd: scene(terms=[HULL, LOADS | {"drag_coefficient": Cd}]), 0.0, 1.1,
                  "hull_loads.drag_coefficient", "cross_flow", "twice"),
    "bow and stern": (lambda x: scene(terms=[HULL, LOADS | {"drag_coefficient": 1.1, "stations": [x, x + 0.1, 2.0]}]), 0.8,
                      0.7, "hull_loads.drag_coefficient", "cross_flow"),
}  # fmt: skip
LOOKS = {name: (make(usual), make(odd), words) for name, (make, usual, odd, *words) in LIMITED.items()}


@pytest.mark.parametrize("name", LOOKS)
def test_beyond_a_limit_is_said_and_at_it_is_not(name):
    usual, odd, words = LOOKS[name]
    assert said(usual) == ()
    (message,) = said(odd)
    assert all(word in message for word in words), message


def changed(usual, odd):
    """The numbers by which two scenes of the same parts differ, by the names by which they vary and are set."""
    values, others = usual.parameters() | usual.start.given(), odd.parameters() | odd.start.given()
    names = {name: name if "." in name else f"start.{name}" for name in values}
    same = {name for name in names if name in others and np.array_equal(values[name], others[name])}
    return {names[name]: others[name] for name in names if name in others and name not in same}


@pytest.mark.parametrize("name", LOOKS)
def test_a_number_that_is_set_or_varies_is_seen_as_the_one_in_a_scene(name):
    usual, odd, _ = LOOKS[name]
    # Of a held command the schedule follows.
    numbers = {
        key: value for key, value in changed(usual, odd).items() if name != "fin's command" or "schedule" not in key
    }
    assert said(usual.with_numbers(numbers)) == said(odd)
    if "euler" in "".join(numbers):  # Attitudes are drawn by laws of their own.
        return
    (message,) = said(lw.Ensemble(usual, 3, 1, {key: Choice([value.tolist()]) for key, value in numbers.items()}))
    assert message == f"{said(odd)[0]} (all 3 members)"


def test_a_command_of_a_shipped_vehicle_that_varies_in_radians_or_in_degrees():
    remus = lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0})
    (message,) = said(lw.Ensemble(remus, 50, 1, {"control_fins.command[1]": Uniform(low=4.0, high=20.0)}))
    assert message.startswith("control_fins.command: an angle of")
    assert "all 50 members" in message
    assert said(lw.Ensemble(remus, 50, 1, {"control_fins.command[1]": Uniform(low=-0.3, high=0.3)})) == ()


def test_without_a_stated_length_any_inertia_is_possible():
    assert said(scene({"inertia": [2e6, 3e6, 3e6]})) == ()


def test_a_vehicle_without_weight_has_none_to_compare():
    assert said(scene({"buoyancy": 0.0}, environment={"gravity": 0.0})) == ()


@pytest.mark.parametrize(
    "event", [{"type": "surface"}, {"type": "box", "lower": [-9.0, -9.0, 0.0], "upper": [9.0, 9.0, 9.0]}]
)
def test_an_event_at_the_surface_knows_what_is_above(event):
    above = {"start": {"position": [0.0, 0.0, -0.1]}}
    (text,) = said(scene(**above, events=[event]))
    says(text, event["type"], "0.1 m beyond this event")
    below = {"type": "box", "lower": [-9.0, -9.0, -9.0], "upper": [9.0, 9.0, 9.0]}
    assert len(said(scene(**above, events=[below]))) == 1


def test_members_are_counted_and_the_first_is_named(monkeypatch):
    buoyancy = np.full(1000, 290.0)
    buoyancy[5:817] = 3.0
    states = [np.zeros((1000, 3)), np.tile(np.eye(3), (1000, 1, 1)), np.zeros((1000, 3)), np.zeros((1000, 3))]
    states[0][-1, 2] = -4.0
    fleet = lw.Ensemble.from_states(scene(), *states, {"vehicle.buoyancy": buoyancy})
    expected = said(fleet)
    says(expected[0], "812 of 1,000 members; first: member 5)", "291.2 N")
    assert "(1 of 1,000 members; first: member 999)" in expected[1]
    for at_once in (7, 111, 1000):  # the last of them alone, too
        monkeypatch.setattr(slices, "AT_ONCE", at_once)
        assert said(fleet) == expected


def test_what_all_share_is_said_of_all():
    fleet = lw.Ensemble(scene(environment={"water_density": 1.025}), 1000, 1, {"vehicle.mass": Normal(relative=1e-3)})
    (message,) = said(fleet)
    assert message.endswith("(all 1,000 members)")


class Gale(lw.terms.Current):
    """A user's own law of the water."""

    type = "gale"


def test_the_water_of_a_law_of_the_user_is_looked_at():
    assert said(lw.Scene(lw.Vehicle(**BODY), terms=[Gale(velocity=[5.0, 0.0, 0.0])])) == ()
    (message,) = said(lw.Scene(lw.Vehicle(**BODY), terms=[Gale(velocity=[0.0, 6.0, 0.0])]))
    assert message.startswith("gale: a current of 6 m/s")


def samples(**fields):
    return {name: np.array(values, dtype=float) for name, values in fields.items()}


def test_what_becomes_odd_on_the_way_is_said():
    v = [[[29.0, 0, 0]] * 3, [[0, 31.0, 0], [np.nan, 0, 0], [0, 0, 30.0]], [[1.0, 0, 0]] * 3]
    (found,) = plausibility.on_the_way(samples(velocity=v)).messages(3)
    says(found, "31 m/s", "(1 of 3 members; first: member 0)")
    assert plausibility.on_the_way({}).messages(3) == ()


def test_heights_above_the_surface_count_from_a_limit_on():
    """A start above the surface has a message of its own; a depth that is no number counts for nothing."""
    limit = LIMITS["height"].value
    looked = Heights(scene(), np.array([1.0, 0.0, -2.0, 5.0, 5.0]), {})
    looked.look(
        np.array([[1.0, 0.0, -2.0, 5.0, 5.0], [-limit, -3.0, -3.0, np.nan, -0.5], [2.0, -1.0, 2.0, 5.0, -9.0]]),
        np.array([0, 7, 9]),
    )
    looked.look(np.array([[2.0, -4.0, -9.0, 5.0, 5.0]]), np.array([12]))
    none = np.zeros(5, np.uint16), np.zeros(5, np.int64), np.full(5, np.nan)
    bits, step, value = looked.added(*none)
    high = int(lw.Warnings.ABOVE_SURFACE)
    assert bits.tolist() == [0, high, 0, 0, high]
    assert step.tolist() == [0, 7, 0, 0, 7]
    assert value[[1, 4]].tolist() == [4.0, 9.0]
    (text,) = above_surface(bits, value)
    says(text, "2 of 5 members rise above the surface", "member 4, by 9 m", "lw.events.Surface()")
    known = Heights(scene(events=[{"type": "surface"}]), np.zeros(5), {})
    known.look(np.full((1, 5), -9.0), np.array([1]))
    assert known.added(*none) is not None
    assert not known.added(*none)[0].any()
    assert above_surface(none[0], none[2]) == ()


def in_waves(depth, **sections):
    sea = {"type": "waves", "amplitudes": [0.5], "periods": [8.0], "headings_deg": [0.0]}
    return scene(start={"position": [0.0, 0.0, depth]}, terms=[sea, *sections.pop("terms", [])], **sections)


def test_a_start_within_a_hull_length_of_the_surface_in_waves_is_said():
    """The length is that of the shape, of the strips, or of a spheroid of this mass and inertia: 1.41 m."""
    length = math.sqrt(20.0 * 3.0 / 30.0)
    assert said(in_waves(1.001 * length)) == ()
    (text,) = said(in_waves(0.999 * length))
    says(text, "start.position", "one hull length, 1.41 m")
    assert said(in_waves(1.61, terms=[HULL])) == ()
    assert len(said(in_waves(1.59, terms=[HULL]))) == 1
    (text,) = said(lw.Ensemble(in_waves(9.0), 50, 1, {"start.position[2]": Uniform(low=0.0, high=2.0 * length)}))
    assert " of 50 members; first: member " in text
    assert said(in_waves(0.5, events=[{"type": "surface"}])) == ()
    (text,) = said(in_waves(-0.5))
    assert "above the surface" in text


@pytest.mark.parametrize(
    ("event", "by"),
    [
        ({"type": "floor", "depth": 20.0}, 5.0),
        ({"type": "floor", "depth": [[20.0, 40.0], [20.0, 40.0]], "spacing": [10.0, 10.0], "clearance": 1.0}, 6.0),
        ({"type": "surface", "depth": 26.0}, 1.0),
        ({"type": "box", "lower": [-9.0, -9.0, 0.0], "upper": [9.0, 9.0, 22.0]}, 3.0),
    ],
)
def test_a_start_beyond_an_event_is_said(event, by):
    (text,) = said(scene(start={"position": [0.0, 0.0, 25.0]}, events=[event]))
    says(text, event["type"], f"{by:g} m beyond")
    assert said(scene(start={"position": [0.0, 0.0, 25.0]}, events=[{"type": "floor", "depth": 25.1}])) == ()


def test_a_fast_member_is_found_beside_one_that_is_no_number():
    v = [[[1.0, 0, 0]] * 2, [[np.nan, 0, 0], [-18.0, 18.0, -18.0]]]
    assert "31.18 m/s" in plausibility.on_the_way(samples(velocity=v)).messages(2)[0]
    v[1][1] = [-17.0, 17.0, -17.0]
    assert plausibility.on_the_way(samples(velocity=v)).messages(2) == ()


def test_of_very_many_samples_the_last_are_looked_at(monkeypatch):
    monkeypatch.setattr(plausibility, "MOST_SAMPLES", 5)
    v = [[[0.0, 0.0, 0.0]], [[50.0, 0.0, 0.0]], [[1.0, 0.0, 0.0]]]
    assert plausibility.on_the_way(samples(velocity=v)).messages(1) == ()
    assert len(plausibility.on_the_way(samples(velocity=v[:2])).messages(1)) == 1


@pytest.mark.kernel
def test_a_result_says_what_is_odd():
    fleet = lw.Ensemble(
        lw.Scene(lw.Vehicle(10.0, inertia=[1.0, 2.0, 2.5], buoyancy=200.0), start=lw.Start([0.0, 0.0, 1.0])),
        20,
        vary={"start.velocity": Uniform(low=[0.0, 0.0, 0.0], high=[60.0, 0.1, 0.1])},
    )
    texts = lw.solve(fleet, h=0.01, t1=1.0).messages
    assert [text.split(":")[0] for text in texts] == ["vehicle.buoyancy", "start.velocity", "position"]
    assert "(all 20 members)" in texts[0]
    assert " of 20 members; first: member " in texts[1]


NAMED = {name: lw.Scene.named(name) for name in lw.vehicles.names()}


@pytest.mark.parametrize("name", NAMED)
def test_no_named_vehicle_is_odd(name):
    assert said(NAMED[name]) == ()


NO_SCENES = {"sweeps", "extension_template"}
# Scenes with terms of gliders, or with their named vehicles.
OF_GLIDERS = {"remus_zigzag.toml", "seawing_spiral.toml", "slocum_comet.toml"}
SCENES = [
    pytest.param(path, marks=pytest.mark.needs("gliders")) if path.name in OF_GLIDERS else path
    for path in sorted((ROOT / "examples").rglob("*.toml"))
    if path.parent.name not in NO_SCENES
]


# A body of a test suite that rises with half of its weight.
ODD = {"gazebo_bodies_rising.toml": 1}


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.name)
def test_no_example_is_odd(path):
    assert len(said(lw.Scene.load(path))) == ODD.get(path.name, 0)


@pytest.mark.needs("gliders")
def test_no_scene_of_the_benchmarks_is_odd():
    for name, one in {**problems.each_term(), **problems.coupled(), "all": problems.all_terms()}.items():
        # Of all terms at once some are a sea beside a current.
        assert [text for text in said(one) if name != "all" or not text.startswith("waves.periods")] == [], name


def test_every_limit_has_its_reason_and_is_on_the_page():
    page = (ROOT / "docs" / "guide" / "plausibility.md").read_text()
    for name, limit in LIMITS.items():
        assert f"| {name} |" in page, name
        assert limit.reason in page, name


# The verb check.


def written(tmp_path: Path, text: str) -> str:
    (tmp_path / "scene.toml").write_text(text)
    return str(tmp_path / "scene.toml")


PLAIN = "[vehicle]\nmass = 30.0\ninertia = [0.2, 3.0, 3.0]\nbuoyancy = 290.0\n[run]\nstep = 0.01\nduration = 1.0\n"


def test_check_says_that_a_scene_can_run(tmp_path, capsys):
    assert main(["check", written(tmp_path, PLAIN)]) == 0
    out = capsys.readouterr().out
    assert out.splitlines()[-1] == "result      can run"
    assert "psi_s, step 0.01 s, 100 steps" in out
    assert main(["check", written(tmp_path, PLAIN), "--quiet"]) == 0
    assert capsys.readouterr().out == ""


def test_check_says_what_is_odd_and_refuses_nothing_for_it(tmp_path, capsys):
    options = ["--set", "environment.water_density=1.025", "--members", "5", "--step", "0.003"]
    assert main(["check", written(tmp_path, PLAIN), *options]) == 0
    notes = [line for line in capsys.readouterr().out.splitlines() if line.startswith("note")]
    assert len(notes) == 2
    assert "shortened" in notes[0]
    assert "(all 5 members)" in notes[1]


def test_check_refuses_what_run_refuses(tmp_path, capsys):
    assert main(["check", written(tmp_path, PLAIN), "--set", "vehicle.mass=-3"]) == 2
    assert "vehicle.mass = -3 is not positive" in capsys.readouterr().err
    assert main(["check", written(tmp_path, PLAIN), "--method", "psi_s", "--set", "run.duration=1e9"]) == 2
    assert "step" in capsys.readouterr().err


def test_check_of_a_scene_without_a_step_looks_at_the_rest(tmp_path, capsys):
    assert main(["check", written(tmp_path, PLAIN.split("[run]")[0])]) == 0
    assert "run.step and run.duration: not given" in capsys.readouterr().out


WAYPOINTS = {"points": [[0.0, 0.0, 5.0], [100.0, 0.0, 5.0]], "speed": 1.5, "look_ahead": 10.0, "radius": 5.0}
DEPTH, HEADING, SPEED = (
    lw.control.DepthPID(kp=0.1, kp_pitch=5.0),
    lw.control.HeadingPID(kp=1.0),
    lw.control.SpeedPID(kp=10.0),
)
TO_FINS, TO_PROPELLER = (
    lw.control.PseudoInverse(to="control_fins"),
    lw.control.PseudoInverse(to="thrusters", name="ahead"),
)
NO_LAW, NOT_DRIVEN, NOT_ASKED = "no law of the controller reads the wanted {}", "no allocation, schedule", "no law asks"


def looped(guidance, laws, allocation, **sections):
    """Messages on a LAUV under a controller, or of another vehicle."""
    controller = lw.Controller(period=0.1, guidance=guidance, laws=laws, allocation=allocation)
    name = sections.pop("name", "lauv")
    start = {"velocity": [1.0, 0.0, 0.0], "position": [0.0, 0.0, 5.0]}
    return said(lw.Scene.named(name, start=start, controller=controller, **sections))


class Yaw(lw.laws.ControlLaw):
    """A law of a user's own, which reads the attitude."""

    type = "yaw_of_mine"
    needs, demands, device = ("attitude",), ("N",), None


class Course(lw.laws.Guidance):
    """Guidance of a user's own."""

    type = "course_of_mine"
    device = None

    @property
    def gives(self):
        return ("heading", "attitude", "speed")


PATH = lw.control.Waypoints(**WAYPOINTS)
BOTH = [TO_FINS, TO_PROPELLER]
SET = lw.control.SetPoint
LOOPS = {
    "all read": ([PATH], [DEPTH, HEADING, SPEED], BOTH, []),
    "no law of speed": ([PATH], [DEPTH, HEADING], [TO_FINS], [("waypoints.speed", NO_LAW), ("thrusters", NOT_DRIVEN)]),
    "allocated": ([PATH], [DEPTH, HEADING], BOTH, [("waypoints.speed", NO_LAW), ("thrusters", NOT_ASKED)]),
    "no law of depth": ([PATH], [HEADING, SPEED], BOTH, [("waypoints.depth", NO_LAW)]),
    "a set point": ([SET(depth=5.0, heading=0.1, speed=1.0)], [DEPTH, SPEED], BOTH, [("set_point.heading", NO_LAW)]),
    "a place": ([SET(position=[1.0, 2.0, 3.0])], [DEPTH], [TO_FINS],
                [("set_point.position", NO_LAW), ("thrusters", NOT_DRIVEN)]),
    "of my own": ([Course()], [Yaw()], BOTH, [("course_of_mine.speed", NO_LAW), ("thrusters", NOT_ASKED)]),
    "a function": ([PATH], [lw.control.Callback(lambda t, y, r, members: None)], BOTH, []),
}  # fmt: skip


@pytest.mark.parametrize("name", LOOPS)
def test_what_no_law_reads_and_nothing_drives_is_said(name):
    guidance, laws, allocation, expected = LOOPS[name]
    found = [text for text in looped(guidance, laws, allocation) if not text.startswith("controller.")]
    assert len(found) == len(expected), found
    for (key, text), message in zip(expected, found, strict=True):
        assert message.startswith(f"{key}: {text.format(key.rpartition('.')[2])}")


def test_a_vehicle_that_something_else_drives_ahead_is_told_no_speed():
    # A REMUS has a constant thrust, and fins alone that take commands.
    assert not [text for text in looped([PATH], [DEPTH, HEADING], [TO_FINS], name="remus_100") if "wanted" in text]


@pytest.mark.parametrize(("speed", "count"), [({"speed": 5.0}, 1), ({}, 0)])
def test_a_speed_that_a_vehicle_without_a_propeller_is_asked_for_is_told(speed, count):
    texts = looped([SET(heading=0.3, **speed)], [HEADING], [TO_FINS], name="remus_100")
    assert [text.startswith(f"set_point.speed: {NO_LAW.format('speed')}") for text in texts] == [True] * count


@pytest.mark.parametrize("push", [{"command": [100.0]}, {"times": [0.0, 9.0], "command_schedule": [[0.0], [100.0]]}])
def test_a_propeller_with_a_command_or_a_schedule_of_its_own_is_driven(push):
    table = lw.Scene.named("lauv").to_dict()
    for term in table["terms"]:
        if term["type"] == "thrusters":
            del term["command"]
            term |= push
    controller = lw.Controller(period=0.1, guidance=[PATH], laws=[DEPTH, HEADING], allocation=[TO_FINS])
    driven = lw.Scene.from_dict(table | {"controller": controller.to_dict(), "start": {"position": [0.0, 0.0, 5.0]}})
    assert not [text for text in said(driven) if not text.startswith("controller.")]


def loops_of(folder):
    return [pytest.param(path, id=path.stem) for path in sorted((ROOT / "examples" / folder).glob("*.toml"))]


@pytest.mark.parametrize("path", loops_of("scenes"))
def test_of_shipped_scenes_no_loop_leaves_anything_unread(path):
    controller, terms = (scene := lw.Scene.load(path)).controller, scene.terms
    assert (controller.unread(terms), controller.idle, controller.undriven(terms)) == ((), (), ())


WAVES_TOGETHER = [
    ([0.0] * 10, [30.0] * 10, 1.342), ([0.0] * 10, [30.0, 390.0] * 5, 1.342), ([0.0, np.pi] * 5, [30.0] * 10, 0.0),
    ([0.0] * 10, [36.0 * i for i in range(10)], 0.424),
]  # fmt: skip


@pytest.mark.parametrize(("phases", "headings", "steep"), WAVES_TOGETHER)
def test_components_of_one_period_and_heading_are_one_wave(phases, headings, steep):
    """Ten waves of 0.3 m are one of 3 m where they go together, and none where they cancel."""
    sea = lw.terms.Waves(amplitudes=[0.3] * 10, periods=[3.0] * 10, phases=phases, headings_deg=headings)
    scene = lw.Scene.named("torpedo", terms=[sea], start={"position": [0.0, 0.0, 20.0]})
    found = [text for text in said(scene) if "steepness" in text]
    assert bool(found) == (steep > 0.44)
    assert all(f"k a of {steep:.3g} " in text for text in found)


HELD = [{"command": [0.5]}, {"limit": [1.0]}, {"times": [0.0, 9.0], "command_schedule": [[0.0], [-0.5]]}]


@pytest.mark.parametrize("numbers", HELD)
def test_a_thrust_far_beyond_the_weight_is_said(numbers):
    def messages_for(coefficient):
        term = lw.terms.Thrusters(
            position=[[0.0] * 3], direction=[[1.0, 0.0, 0.0]], coefficient=[coefficient], **numbers
        )
        scene = lw.Scene.named("torpedo", terms=[term], start={"position": [0.0, 0.0, 20.0]})
        return [text for text in said(scene) if text.startswith("thrusters.coefficient")]

    (text,) = messages_for(1e7)
    assert "a hundred times the weight" in text
    assert messages_for(10.0) == []
