# SPDX-License-Identifier: Apache-2.0
"""No bit of a motion depends on which signals of its controller are saved, nor does a signal on which others are."""

import dataclasses

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.control import signals
from lgvi_warp.physics.fields import FIELDS
from tests.control import test_altitude as floors
from tests.control import test_loop as loops
from tests.extensions.navigation import navigating
from tests.runs.test_going_on import SENSORS, autopilot, fleet_of, law

MODEL = {"type": "reference_model", "natural_frequency": [0.2, 0.3], "damping_ratio": [1.0, 1.0]}
SIGHT = {"type": "waypoints", "points": [[0, 0, 5], [0.5, 0, 5], [0.5, 5, 6]], "speed": 1.5, "look_ahead": 3.0,
         "radius": 0.3, "method": "ilos"}  # fmt: skip
POSE = {"kp": (40.0, 40.0, 60.0), "ki": (4.0, 4.0, 6.0), "kd": (60.0, 60.0, 80.0), "kr": (10.0,) * 3, "kw": (4.0,) * 3}
HOLD = lw.control.SetPoint(position=(0.3, -0.2, 9.0), heading=1.0)
DEAD = lw.control.Fault(name="dead", of="thrusters", channel=2, time=0.3, gain=0.0, known=True)
PATH = lw.control.Trajectory(
    times=[0.0, 1.0, 3.0], positions=[[0.0, 0.0, 10.0], [0.3, 0.1, 9.8], [1.0, 0.5, 9.5]], headings=[0.0, 0.3, 0.6]
)


def rov(laws, guidance=(HOLD,), allocation=(), faults=()):
    """BlueROV2 heavy with these parts of a controller."""
    return fleet_of(
        "bluerov2_heavy",
        controller=lw.Controller(period=0.1, guidance=guidance, laws=laws, allocation=allocation, faults=faults),
    )


def of(scene):
    """Twenty members of a scene."""
    spread = {f"start.{name}": lw.distributions.Normal(std=0.05) for name in ("velocity", "angular_velocity")}
    return lw.Ensemble(scene, 20, 1, spread)


def in_waves():
    """The autopilot in waves and a current, which sensors and laws do not look at."""
    fleet = autopilot()
    waves = lw.terms.Waves(amplitudes=[0.2], periods=[4.0], headings_deg=[20.0])
    water = [waves, lw.terms.Current(velocity=(0.2, 0.1, 0.0))]
    return lw.Ensemble(dataclasses.replace(fleet.scene, terms=[*fleet.scene.terms, *water]), 20, 1, fleet.vary)


def by_a_filter():
    """REMUS 100 by what a filter believes, which it tells."""
    return of(navigating.remus(navigating.parts(**navigating.ON_BOARD, aids=("depth", "heading"), report=True)))


# Each a fleet, a method and a precision.
SCENES = {
    "sensors": lambda: (autopilot(), "psi_x", "float64"),
    "line of sight, reference model, sensors": lambda: (autopilot(guidance=[SIGHT, MODEL]), "psi_x", "float64"),
    "float32": lambda: (autopilot(guidance=[SIGHT, MODEL]), "psi_x", "float32"),
    "rk4": lambda: (autopilot(sensors=SENSORS[:3]), "rk4", "float64"),
    "in waves": lambda: (in_waves(), "psi_x", "float64"),
    "pose": lambda: (rov([lw.control.PosePID(**POSE)]), "psi_s", "float64"),
    "pose, float32, within limits": lambda: (
        rov([lw.control.PosePID(**POSE)], allocation=[lw.control.BoundedLeastSquares(to="thrusters")]), "psi_s", "float32"
    ),
    "trajectory, a fault that is known": lambda: (rov([lw.control.PosePID(**POSE)], [PATH], faults=[DEAD]), "rk4", "float64"),
    "lag and delay": lambda: (of(loops.scene(0.3, 0.06)), "rk8", "float64"),
    "compensated": lambda: (of(loops.scene(0.3)), "psi_s", "float32_compensated"),
    "filter": lambda: (by_a_filter(), "psi_x", "float64"),
    "altitude": lambda: (of(floors.scene_of(floors.rough(1.0), lw.control.Altimeter(noise=0.02))), "psi_s", "float64"),
    "law in Python": lambda: (rov([lw.control.Callback(law)], [HOLD]), "psi_s", "float64"),
}  # fmt: skip


def test_there_are_twelve():
    assert len(SCENES) >= 12


@pytest.mark.ci
@pytest.mark.slow_but("float32")
@pytest.mark.parametrize("name", SCENES)
def test_a_motion_does_not_depend_on_what_is_saved(name):
    fleet, method, dtype = SCENES[name]()

    def saved(names):
        save = lw.SaveAt(every=0.1, fields=(*FIELDS, *names))
        return lw.solve(fleet, method, h=0.02, t1=2.0, dtype=dtype, save=save, checks="safe")

    every = [name for name in signals.saved_fields(fleet.scene.controller) if name in signals.SIGNALS]
    assert len(every) >= 19
    # All, none, and half of a random order.
    order = np.random.default_rng(len(name)).permutation(every).tolist()
    whole = saved(every)
    assert np.ptp(whole.position[-1], axis=0).max() > 0.0
    for names in ((), order[::2]):
        some = saved(names)
        assert set(some.samples) == {*FIELDS, *names}
        for field in some.samples:
            assert some.samples[field].tobytes() == whole.samples[field].tobytes(), (field, names)
