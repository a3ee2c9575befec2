# SPDX-License-Identifier: Apache-2.0
"""Margins and linear models of loops with gain tables: at a node those of the node's constant gains."""

import dataclasses

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.control import HeadingPID, SetPoint, SpeedPID

SPEEDS = np.array([0.5, 1.0, 2.0])
GAINS = {"kp": (24.0, 14.0, 9.0), "kd": (18.0, 9.0, 4.0)}
PUSH = 10.0


def scene(kp, kd, yaw=6.0, heading=0.3):
    """A body that moves ahead at a wanted speed, which its feedforward holds exactly, and turns its head."""
    laws = [HeadingPID(kp=kp, kd=kd), SpeedPID(kp=20.0, drag=PUSH)]
    controller = lw.Controller(period=0.1, guidance=[SetPoint(heading=heading, speed=1.0)], laws=laws)
    # The moment of the added mass turns its head, and lets its pitch be.
    body = dict(inertia=[4.0, 5.0, yaw], added_mass=(5.0, 8.0, 5.0), center_of_buoyancy=(0.0, 0.0, -0.02))
    vehicle = lw.Vehicle(50.0, buoyancy=500.0, **body)
    drag = lw.terms.Drag(linear=(0.0, 30.0, 30.0, 4.0, 5.0, 6.0), quadratic=(PUSH, 40.0, 40.0, 1.0, 2.0, 3.0))
    return lw.Scene(vehicle, lw.Environment(10.0), [lw.terms.ControlWrench(), drag], controller=controller)


def over(name, at=SPEEDS):
    return {"over": "speed", "at": list(at), "values": list(GAINS[name])}


def fleet(here, **parameters):
    """Members that move at each of the speeds, in the wanted heading."""
    n, zeros = len(SPEEDS), np.zeros((len(SPEEDS), 3))
    attitude = lw.notation.matrix_from_rotation_vector(np.tile([0.0, 0.0, 0.3], (n, 1)))
    ahead = np.column_stack([SPEEDS, zeros[:, :2]])
    return lw.Ensemble.from_states(here, zeros, attitude, ahead, zeros, {"set_point.speed": SPEEDS, **parameters})


@pytest.mark.slow
def test_margins_at_each_node_are_those_of_its_constant_gains():
    def found(ensemble):
        of = ("gain", "delay", "phase", "disk")
        return lw.linear.margins(ensemble, "heading_pid", of, about=1.0, seconds=60.0, method="rk4", h=0.05)

    tables = found(fleet(scene(over("kp"), over("kd"))))
    constant = found(fleet(scene(1.0, 1.0), **{f"heading_pid.{name}": np.array(GAINS[name]) for name in GAINS}))
    assert tables.steady.all()
    for name, values in constant.values.items():
        np.testing.assert_allclose(tables.values[name], values, rtol=1e-9, err_msg=name)
    # The nodes differ, so that this can fail.
    assert np.ptp(constant.values["disk"]) > 0.01


@pytest.mark.slow
def test_a_linear_model_has_the_slope_of_the_table_where_there_is_an_error():
    # So heavy that it does not turn: the error of the heading stays 0.2, and N gains kp'(u) 0.2 with the speed.
    kp, start = {"over": "speed", "at": [0.0, 2.0], "values": [10.0, 4.0]}, {"velocity": [1.0, 0.0, 0.0]}
    models = [
        lw.linear.linearize(
            dataclasses.replace(scene(gain, 1.0, 1e9, 0.2), start=lw.Start(**start)), closed=True, method="rk4", h=0.05
        )
        for gain in (kp, 7.0)
    ]
    ours, constant = (model.A for model in models)
    states = models[0].states
    assert states == models[1].states
    N, u = states.index("control_wrench.command[5]"), states.index("velocity[0]")
    np.testing.assert_allclose(ours[N] - constant[N], -3.0 * 0.2 * constant[u], atol=1e-8)
    others = np.arange(len(states)) != N
    np.testing.assert_allclose(ours[others], constant[others], atol=1e-9)
    assert abs(ours[N, u] - constant[N, u]) > 0.1
