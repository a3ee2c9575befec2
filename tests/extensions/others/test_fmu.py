# SPDX-License-Identifier: Apache-2.0
"""A scene as an FMU: what FMPy runs moves as `lw.solve` does, and what a unit cannot carry is said."""

import json
import sys
import zipfile
from dataclasses import replace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli

fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed: pip install '.[fmu]'")
pytest.importorskip("pythonfmu", reason="PythonFMU is not installed: pip install '.[fmu]'")
pytestmark = pytest.mark.needs("others")

H, PERIOD, STEPS = 0.02, 0.04, 50
COMPONENTS = ("X", "Y", "Z", "K", "M", "N")
MOTION = [f"{name}[{i}]" for name in ("position", "velocity", "angular_velocity") for i in range(3)]
MOTION += [f"quaternion_wxyz[{i}]" for i in range(4)]
SENSORS = [
    lw.control.Sensor(name="depth_cell", of="depth", noise=0.05),
    lw.control.Sensor(name="compass", of="heading", noise=0.02),
]
SET_POINT = lw.control.SetPoint(heading=0.5, depth=2.0)
LAWS = [lw.control.HeadingPID(kp=3.0, kd=2.0), lw.control.HeavePID(kp=4.0, kd=6.0)]
FIELDS = ("position", "attitude", "velocity", "angular_velocity")


def scene(**changes):
    """A body with an ideal actuator, two sensors and two laws."""
    controller = lw.Controller(period=PERIOD, sensors=SENSORS, guidance=[SET_POINT], laws=LAWS)
    drag = lw.terms.Drag(linear=(1.0, 2.0, 2.0, 0.1, 0.1, 0.1), quadratic=(0.0,) * 6)
    vehicle = lw.Vehicle(10.0, inertia=(1.0, 2.0, 3.0))
    plain = lw.Scene(vehicle, terms=[lw.terms.ControlWrench(limit=20.0), drag], controller=controller)
    return plain.with_numbers({"run.step": H, "start.velocity": [1.0, 0.0, 0.0], **changes})


@pytest.fixture(scope="module")
def unit(tmp_path_factory):
    folder = tmp_path_factory.mktemp("unit")
    return lw.export(scene(), folder / "vehicle.fmu")


def commands(t):
    """Commands (6,) [N, N m] that vary with time."""
    return np.array([3.0 * np.sin(t), 0.5, -0.3, 0.02, 0.1 * np.cos(2.0 * t), 0.2])


def inputs():
    """The commands as signals of FMPy, as ticks see them."""
    names, every = [f"control_wrench.command[{i}]" for i in range(6)], round(PERIOD / H)
    kind = np.dtype([("time", float)] + [(name, float) for name in names])
    return np.array([(k * H, *commands(k // every * every * H)) for k in range(STEPS + 1)], kind)


def simulated(file, **settings):
    """Outputs by name at each step, of FMPy."""
    chosen = {"stop_time": STEPS * H, "output_interval": H, "input": inputs(), **settings}
    names = [*MOTION, "measured_depth", "measured_heading", "status"]
    return fmpy.simulate_fmu(str(file), output=names, validate=True, **chosen)


def solved(seed=0, **changes):
    """The same by `lw.solve`: its result, and what sensors read at the ticks."""
    read = []

    def law(t, y, r, members):
        read.append((y.depth[0], y.heading[0]))
        return commands(t)[None]

    plain = scene(**changes)
    asked = lw.control.Callback(law, to="control_wrench")
    controller = replace(plain.controller, guidance=(), laws=[asked], allocation=())
    fleet = lw.Ensemble(replace(plain, controller=controller), 1, seed)
    return lw.solve(fleet, h=H, t1=STEPS * H, save=lw.SaveAt(every=H)), np.array(read)


def motion(result):
    """Samples (k, 13) in the order of MOTION."""
    parts = (result.position, result.velocity, result.angular_velocity, result.quaternion_wxyz)
    return np.concatenate([part[:, 0] for part in parts], axis=1)


def columns(rows, names):
    return np.stack([rows[name] for name in names], axis=1)


@pytest.mark.ci
def test_the_unit_moves_as_a_run(unit):
    """The same kernel and launches: round-off of what the host computes of them alone."""
    rows = simulated(unit)
    result, read = solved()
    expected = motion(result)
    assert np.abs(columns(rows, MOTION) - expected).max() < 1e-15 * np.abs(expected).max()
    assert np.abs(expected[-1, :3]).min() > 1e-3
    ticks = slice(0, STEPS, round(PERIOD / H))
    assert np.array_equal(columns(rows, ["measured_depth", "measured_heading"])[ticks], read)
    assert not rows["status"].any()


@pytest.mark.ci
def test_parameters_and_the_seed_are_those_of_the_scene(unit):
    changes = {"vehicle.mass": 12.0, "drag.linear[0]": 2.0, "start.position[2]": 3.0, "depth_cell.bias": 0.5}
    rows = simulated(unit, start_values=changes | {"seed": 7})
    result, read = solved(7, **changes)
    expected = motion(result)
    assert np.abs(columns(rows, MOTION) - expected).max() < 1e-15 * np.abs(expected).max()
    assert np.array_equal(rows["measured_depth"][:STEPS:2], read[:, 0])
    assert abs(read[0, 0] - 3.5) < 0.5
    assert not np.array_equal(rows["measured_heading"], simulated(unit)["measured_heading"])


def opened(file):
    """An instance in step mode, and the value references of its variables."""
    described, said = fmpy.read_model_description(str(file), validate=True), []
    listen = lambda *message: said.append(message[-1].decode())  # noqa: E731
    folder = fmpy.extract(str(file))
    instance = fmpy.instantiate_fmu(folder, described, "CoSimulation", debug_logging=True, logger=listen)
    instance.said = said
    return instance, {variable.name: variable.valueReference for variable in described.modelVariables}


def begun(instance):
    instance.setupExperiment(startTime=0.0)
    instance.enterInitializationMode()
    instance.exitInitializationMode()


@pytest.mark.ci
def test_long_communication_steps_reset_and_states(unit):
    """Steps of several periods make the same motion; a state comes back, serialized too, and so does the start."""
    instance, places = opened(unit)
    wanted = [places[name] for name in MOTION]
    command = [places[f"control_wrench.command[{i}]"] for i in range(6)]
    begun(instance)
    first = instance.getReal(wanted)
    instance.setReal(command, commands(0.3).tolist())
    instance.doStep(0.0, 10 * H)
    state = instance.getFMUstate()
    data = instance.serializeFMUstate(state)
    instance.doStep(10 * H, 5 * H)
    after = instance.getReal(wanted)
    for again in (state, instance.deSerializeFMUstate(data)):
        instance.setFMUstate(again)
        for k in range(10, 15):
            instance.doStep(k * H, H)
        assert instance.getReal(wanted) == after
    with pytest.raises(Exception, match=r"fmi2DoStep failed with status 2 \(discard\)"):
        instance.doStep(15 * H, 0.5 * H)
    assert any("communication step 0.01 s is not a whole number of steps of 0.02 s" in text for text in instance.said)
    instance.doStep(15 * H, H)
    instance.reset()
    begun(instance)
    assert instance.getReal(wanted) == first
    instance.terminate()
    instance.freeInstance()


@pytest.mark.slow
def test_set_points_steer_the_controller_inside(tmp_path):
    file = lw.export(scene(), tmp_path / "loop.fmu", inputs="set_points")
    rows = simulated(file, input=None, start_values={"set_point.heading": 0.8})
    fields = (*FIELDS, *(f"measured_{name}" for name in ("position", "attitude", "velocity", "water_velocity",
              "angular_velocity", "depth", "heading")))  # fmt: skip
    changed = scene(**{"set_point.heading": 0.8})
    result = lw.solve(lw.Ensemble(changed, 1), h=H, t1=STEPS * H, save=lw.SaveAt(every=H, fields=fields))
    expected = motion(result)
    assert np.abs(columns(rows, MOTION) - expected).max() < 1e-15 * np.abs(expected).max()
    assert np.array_equal(rows["measured_depth"], result.samples["measured_depth"][:, 0])
    instance, places = opened(file)
    begun(instance)
    instance.doStep(0.0, 2 * H)
    instance.setReal([places["set_point.heading"]], [-0.8])
    for k in range(2, 200):
        instance.doStep(k * H, H)
    assert instance.getReal([places["euler[2]"]])[0] < -0.3
    instance.terminate()
    instance.freeInstance()


@pytest.mark.slow
def test_an_event_of_the_scene_ends_the_vehicle(tmp_path):
    ended = replace(scene(), events=[lw.events.Box(lower=(-9.0, -9.0, -9.0), upper=(0.5, 9.0, 9.0))])
    rows = simulated(lw.export(ended, tmp_path / "box.fmu"), input=None)
    assert rows["status"][0] == 0
    assert rows["status"][-1] == lw.Status.BOX
    assert rows["position[0]"][-1] == pytest.approx(0.5, abs=1e-6)
    stopped = np.flatnonzero(rows["status"])
    assert np.all(rows["position[0]"][stopped] == rows["position[0]"][-1])


def test_the_same_scene_gives_the_same_bytes(unit, tmp_path):
    again = lw.export(scene(), tmp_path / "vehicle.fmu")
    assert again.read_bytes() == unit.read_bytes()
    with pytest.raises(lw.SceneError, match="is there already"):
        lw.export(scene(), again)


def test_what_the_file_says(unit):
    """FMPy checks the description; numbers have their units, and read as they are."""
    described = fmpy.read_model_description(str(unit), validate=True)
    known = {variable.name: variable for variable in described.modelVariables}
    assert known["vehicle.mass"].causality == "parameter"
    assert known["control_wrench.command[5]"].causality == "input"
    assert known["position[2]"].unit == "m"
    assert "Python that has lgvi_warp" in described.description
    assert described.coSimulation.canSerializeFMUstate
    numbers = scene().parameters()
    assert all(float(known[f"drag.linear[{i}]"].start) == numbers["drag.linear"][i] for i in range(6))
    with zipfile.ZipFile(unit) as archive:
        assert {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries")} >= {
            "linux64",
            "win64",
        }
        assert json.loads(archive.read("resources/vehicle.json"))["inputs"] == "commands"


@pytest.mark.parametrize(
    ("changes", "settings", "said"),
    [
        ({}, {"inputs": "wishes"}, "inputs = 'wishes'"),
        ({}, {"members": [0]}, r"members = \[0\] is given for a .fmu file"),
        ({"controller": None}, {"inputs": "set_points"}, "need a set-point, which the scene has not"),
        ({"run": lw.Scene(lw.Vehicle(1.0, inertia=(1.0, 1.0, 1.0))).run}, {}, r"run.step = None is missing"),
    ],
)
def test_what_a_unit_cannot_be_made_of(changes, settings, said, tmp_path):
    with pytest.raises(lw.SceneError, match=said):
        lw.export(replace(scene(), **changes), tmp_path / "none.fmu", **settings)
    assert not list(tmp_path.iterdir())


def test_files_functions_and_ensembles_are_refused(tmp_path):
    target = tmp_path / "none.fmu"
    with pytest.raises(lw.SceneError, match=r"is no scene, of which a .fmu file is made: one vehicle"):
        lw.export(lw.Ensemble(scene(), 3), target)
    with pytest.raises(lw.SceneError, match=r"is a scene, of which no .csv file can be made. Run it first"):
        lw.export(scene(), tmp_path / "none.csv")
    with pytest.raises(lw.SceneError, match=r"is given for a run. Leave it out"):
        lw.export(tmp_path, tmp_path / "none.csv", inputs="commands")
    law = lw.control.Callback(lambda t, y, r, members: np.zeros((len(members), 6)))
    with pytest.raises(lw.SceneError, match="is a function of Python, which a unit does not carry"):
        lw.export(replace(scene(), controller=lw.Controller(period=PERIOD, laws=[law])), target)
    names = ("weights_0", "biases_0")
    np.savez(tmp_path / "policy.npz", **dict(zip(names, (np.ones((1, 1)), np.zeros(1)), strict=True)))
    policy = lw.control.Policy(file=str(tmp_path / "policy.npz"), inputs=["depth_error"], outputs=["Z"])
    loop = lw.Controller(period=PERIOD, guidance=[SET_POINT], laws=[policy])
    with pytest.raises(lw.SceneError, match=r"controller.laws\[0\].file .* is a file, which a unit does not carry"):
        lw.export(replace(scene(), controller=loop), target)
    assert not target.exists()


def test_a_missing_library_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pythonfmu", None)
    with pytest.raises(lw.SceneError, match=r"units of FMI need pythonfmu: .*fmu"):
        lw.export(scene(), tmp_path / "none.fmu")


def test_the_command_takes_a_scene_file(tmp_path):
    """Its [ensemble] gives the seed, and what it varies is a parameter."""
    target = tmp_path / "remus.fmu"
    assert cli.main(["export", "example:remus_100_autopilot", "--to", str(target), "--quiet"]) == 0
    described = fmpy.read_model_description(str(target), validate=True)
    known = {variable.name: variable for variable in described.modelVariables}
    assert known["seed"].start == "1"
    assert float(known["vehicle.buoyancy"].start) == 299.0
    assert {"control_fins.command[0]", "control_fins.command[1]", "measured_depth"} <= set(known)
    assert cli.main(["export", "example:remus_100_autopilot", "--to", str(target)]) == 2


@pytest.mark.ci
def test_inputs_that_are_no_numbers_end_no_vehicle(unit):
    """The step is refused with the reason; with a number the vehicle goes on as if it had not been asked."""
    instance, places = opened(unit)
    wanted, command = [places[name] for name in MOTION], places["control_wrench.command[2]"]
    begun(instance)
    for bad in (np.nan, np.inf):
        instance.setReal([command], [bad])
        with pytest.raises(Exception, match=r"fmi2DoStep failed with status 2 \(discard\)"):
            instance.doStep(0.0, H)
        assert f"control_wrench.command[2] = {bad} is not finite. Give a number" in instance.said[-1]
    instance.setReal([command], [3.0])
    instance.doStep(0.0, H)
    other, _ = opened(unit)
    begun(other)
    other.setReal([command], [3.0])
    other.doStep(0.0, H)
    assert instance.getReal(wanted) == other.getReal(wanted)


@pytest.mark.ci
def test_a_parameter_of_a_vehicle_that_has_moved_lets_the_next_step_fail(unit):
    instance, places = opened(unit)
    begun(instance)
    instance.doStep(0.0, H)
    state = instance.getFMUState()
    instance.setReal([places["vehicle.buoyancy"]], [250.0])
    with pytest.raises(Exception, match=r"fmi2DoStep failed with status 2 \(discard\)"):
        instance.doStep(H, H)
    assert "vehicle.buoyancy = 250.0 is a parameter, and the vehicle has moved. Reset the unit" in instance.said[-1]
    # A state from before knows nothing of it.
    instance.setFMUState(state)
    instance.doStep(H, H)
