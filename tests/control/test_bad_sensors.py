# SPDX-License-Identifier: Apache-2.0
"""Sensors, estimators and faults that are wrong get a sentence with key, value and remedy."""

import tomllib

import numpy as np
import pytest

import lgvi_warp as lw
from tests.control.bench import scene
from tests.support.pages import blocks
from tests.support.refusals import refused, says

CONTROLLER = {
    "period": 0.1,
    "laws": [{"type": "heading_pid", "kp": 1.0}],
    "guidance": [{"type": "set_point", "heading": 0.0}],
}


def of_table(**tables):
    """A scene from tables as in a file."""
    return lw.Scene.from_dict(scene([]).to_dict() | {"controller": CONTROLLER | tables})


CELL = {"type": "sensor", "name": "cell", "of": "depth"}
# A table of a sensor or an estimator (with its type), or of a fault -> words of the message.
WRONG = [
    ("sensors", {"type": "sensor", "of": "dept"}, "sensor.of = 'dept' is not known", "'depth'"),
    ("sensors", {"type": "sensor"}, "sensor.of = '' is not known"),
    ("sensors", {"type": "sensor", "of": ["depth"]}, "sensor.of", "is not known"),
    ("sensors", {"type": "sensor", "of": "depth", "noise": -0.1}, "sensor.noise = -0.1 is out of bounds", "from 0"),
    ("sensors", {"type": "sensor", "of": "depth", "noise": float("nan")}, "sensor.noise", "is not finite"),
    ("sensors", {"type": "sensor", "of": "depth", "noise": [0.1, 0.1, 0.1]}, "sensor.noise", "has shape (3,)"),
    ("sensors", {"type": "sensor", "of": "velocity", "bias": [0.1, 0.1]}, "sensor.bias", "has shape (2,)"),
    ("sensors", {"type": "sensor", "of": "velocity", "bias": "much"}, "sensor.bias"),
    ("sensors", {"type": "sensor", "of": "velocity", "bias": None}, "sensor.bias"),
    ("sensors", {"type": "sensor", "of": "depth", "every": 1.5},
     "sensor.every = 1.5 is not a whole number of ticks. Give 1 or 2"),
    ("sensors", {"type": "sensor", "of": "depth", "every": 0}, "sensor.every = 0", "from 1 to 1000"),
    ("sensors", {"type": "sensor", "of": "depth", "latency": -1}, "sensor.latency = -1", "from 0 to 1000"),
    ("sensors", {"type": "sensor", "of": "depth", "dropout": 1.1}, "sensor.dropout = 1.1", "from 0 to 1"),
    ("sensors", {"type": "sensor", "of": "depth", "nois": 0.1}, "sensors[0].nois", "noise"),
    ("sensors", {"type": "low_pas"}, "sensors[0].type = 'low_pas' is not known", "'low_pass'"),
    ("sensors", {"type": "low_pass", "of": "depth"}, "sensors[0].time_constant", "is missing. Give it [s]"),
    ("sensors", {"type": "low_pass", "of": "speed", "time_constant": 1.0}, "low_pass.of = 'speed' is not known"),
    ("sensors", {"type": "complementary_filter", "time_constant": -1.0}, "complementary_filter.time_constant = -1.0"),
    ("sensors", {"type": "dead_reckoning", "rule": "simpson"}, "dead_reckoning.rule = 'simpson' is not known"),
    ("sensors", {"type": "dead_reckoning", "velocity": "wind"}, "dead_reckoning.velocity = 'wind'"),
    ("sensors", {"type": "dead_reckoning", "depth": 3.0}, "dead_reckoning.depth = 3.0"),
    ("faults", {"of": "cel", "time": 1.0},
     "fault.of = 'cel' is not an actuator and no sensor of this controller", "'cell'"),
    ("faults", {"of": "cell", "time": 1.0, "channel": 1}, "fault.channel = 1 is beyond the 1 of cell. Give 0"),
    ("faults", {"of": "control_wrench", "time": 1.0, "channel": 6},
     "fault.channel = 6", "is beyond the 6", "Give 0 to 5"),
    ("faults", {"of": "control_wrench", "time": 1.0, "channel": -1}, "fault.channel = -1", "Give 0 to 5"),
    ("faults", {"of": "control_wrench", "time": 1.0, "channel": 1.5}, "fault.channel = 1.5 is not a whole number"),
    ("faults", {"of": "control_wrench", "time": 1.0, "channel": True}, "fault.channel = True is not a whole number"),
    ("faults", {"of": ["cell"], "time": 1.0}, "fault.of", "is not a text"),
    ("faults", {"of": "cell", "time": -1.0}, "fault.time = -1.0"),
    ("faults", {"of": "cell", "time": float("nan")}, "fault.time"),
    ("faults", {"of": "cell", "time": 1.0, "gain": float("inf")}, "fault.gain"),
]  # fmt: skip


@pytest.mark.parametrize(("section", "table", "words"), [(row[0], row[1], row[2:]) for row in WRONG])
def test_a_wrong_part(section, table, words):
    message = refused(of_table, **({"sensors": [CELL]} | {section: [table]}))
    assert all(word in message for word in words), message


def test_the_examples_of_the_pages():
    pages = ("docs/controllers/sensors.md", "docs/controllers/faults.md")
    text = "\n".join(block for page in pages for block in blocks(page, "toml"))
    tables = tomllib.loads(text)["controller"]
    matrix = [[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]]
    controller = CONTROLLER | {"allocation": [{"type": "matrix", "to": "control_fins", "matrix": matrix}]} | tables
    floor = {"type": "floor", "depth": 40.0}
    scene = lw.Scene.from_dict({"vehicle": {"name": "remus_100"}, "controller": controller, "events": [floor]})
    assert [part.key for part in scene.controller.faults] == ["stuck_rudder", "blind"]
    assert scene.parameters()["log.noise"].tolist() == [0.01, 0.01, 0.02]


def test_two_faults_without_names_are_told_to_have_some():
    faults = [{"of": "cell", "time": 1.0}, {"of": "control_wrench", "time": 2.0}]
    text = refused(of_table, sensors=[CELL], faults=faults)
    says(text, "'fault' is the name of two parts", 'name = "fault_2"')


def test_a_part_and_a_term_of_one_name_are_told_apart():
    text = refused(of_table, sensors=[CELL | {"name": "control_wrench"}])
    assert "'control_wrench' is the name of two parts or of a term too" in text


def test_all_faults_at_once():
    sensors = [CELL | {"noise": -1.0}, {"type": "sensor", "of": "x"}]
    text = refused(of_table, sensors=sensors, faults=[{"of": 3}])
    assert all(word in text for word in ("cell.noise", "sensor.of", "fault.of"))


def test_a_scene_with_sensors_is_its_own_file():
    sensors = [
        lw.control.Sensor(name="cell", of="depth", noise=0.1),
        lw.control.Sensor(name="log", of="velocity", bias=0.2, latency=2),
    ]
    sensors += [lw.control.DeadReckoning(rule="euler"), lw.control.LowPass(of="heading", time_constant=1.0)]
    sensors += [lw.control.ComplementaryFilter(time_constant=2.0)]
    first = scene(sensors, [lw.control.Fault(of="log", channel=2, time=np.inf)])
    again = lw.Scene.from_dict(first.to_dict())
    assert again.to_dict() == first.to_dict()
    assert first.parameters()["cell.noise"].shape == ()
    assert first.parameters()["log.bias"].tolist() == [0.2] * 3
