# SPDX-License-Identifier: Apache-2.0
"""Derivatives of whole runs by differences, beside closed forms; and every kind of number that has none, with its reason."""

import copy
import json
import pickle
import runpy

import numpy as np
import pytest

import lgvi_warp as lw
from tests.conftest import ROOT
from tests.support.pages import blocks
from tests.support.refusals import faults, says

MASS, ADDED, GRAVITY = 100.0, 20.0, 9.8
M = MASS + ADDED
HEAVY, QUADRATIC, LINEAR = 24.0, 30.0, 12.0
T1 = 8.0
RUN = {"method": "rk8", "h": 0.05, "t1": T1, "threads": 1}


def body(heavy=HEAVY, linear=0.0, quadratic=0.0, **sections):
    """A body with the same mass along all axes and nothing that turns it."""
    vehicle = lw.Vehicle(
        mass=MASS,
        added_mass=[ADDED] * 3,
        inertia=[5.0, 6.0, 7.0],
        buoyancy=MASS * GRAVITY - heavy,
        center_of_buoyancy=[0.0] * 3,
    )
    drag = lw.terms.Drag(linear=[linear] * 3 + [1.0] * 3, quadratic=[quadratic] * 3 + [0.0] * 3)
    sections = {"terms": [drag], **sections}
    return lw.Scene(vehicle=vehicle, environment=lw.Environment(gravity=GRAVITY), **sections)


def agrees(found, truth, most=1e-7):
    """Derivatives are within the error told of the truth, which is small beside them."""
    truth = np.asarray(truth, dtype=np.float64)
    assert not found.undefined
    # Where the truth is evaluated, and where the run ends, round-off moves it by some 1e-14 of itself.
    assert (np.abs(found.jacobian - truth) <= found.error + 1e-13 * np.abs(truth)).all(), (
        found.jacobian - truth,
        found.error,
    )
    assert (found.error <= most * np.maximum(np.abs(truth), 1e-3)).all(), found.error


@pytest.mark.ci
def test_a_fall_against_quadratic_drag():
    """m v' = F - k v^2 from rest: z = m / k ln cosh(t sqrt(F k) / m)."""
    by = ["vehicle.buoyancy", "drag.quadratic[2]", "start.position[2]"]
    found = lw.derivatives(body(quadratic=QUADRATIC), ["depth", "velocity[2]"], by, **RUN)
    F, k = HEAVY, QUADRATIC
    s = T1 * np.sqrt(F * k) / M
    ln, tanh, slope = np.log(np.cosh(s)), np.tanh(s), 1.0 / np.cosh(s) ** 2
    np.testing.assert_allclose(found.value, [M / k * ln, np.sqrt(F / k) * tanh], rtol=1e-12)
    agrees(found, [
        [-M / k * tanh * s / (2.0 * F), -M / k**2 * ln + M / k * tanh * s / (2.0 * k), 1.0],
        [-0.5 / np.sqrt(F * k) * (tanh + s * slope), 0.5 * np.sqrt(F / k) / k * (s * slope - tanh), 0.0],
    ])  # fmt: skip
    assert found.of == ("depth", "velocity[2]")
    assert found.units == ("m", "m/s")
    assert found.by == tuple(by)


@pytest.mark.ci
@pytest.mark.parametrize("method", ["psi_s", "psi_x"])
def test_derivatives_have_the_order_of_the_method(method):
    """Half the step is a fourth of the error, of value and derivative."""
    truth, apart = fallen(HEAVY), []
    for h in (0.2, 0.1, 0.05):
        run = RUN | {"method": method, "h": h}
        found = lw.derivatives(body(quadratic=QUADRATIC), "depth", "vehicle.buoyancy", **run)
        assert found.error[0, 0] < 1e-9
        apart.append([found.value[0] - truth[0], found.jacobian[0, 0] - truth[1]])
    ratios = np.divide(apart[:-1], apart[1:])
    np.testing.assert_allclose(ratios, 4.0, rtol=0.05)


def turned(result):
    R = result.attitude[-1]
    return np.unwrap([np.full(len(R), 0.7 * T1), np.arctan2(R[:, 1, 0], R[:, 0, 0])], axis=0)[1]


@pytest.mark.ci
def test_free_motion_and_steady_spin():
    """Without forces a body goes straight on, and turns evenly about a principal axis."""
    start = lw.Start(rotation_vector=[0.0, 0.0, 0.3], velocity=[1.2, 0.0, 0.0], angular_velocity=[0.0, 0.0, 0.7])
    by = [
        "start.velocity[0]",
        "start.velocity[1]",
        "start.rotation_vector[2]",
        "start.angular_velocity[2]",
        "vehicle.mass",
    ]
    found = lw.derivatives(body(0.0, start=start, terms=[]), ["position", turned], by[:-1], **RUN)
    c, s = np.cos(0.3), np.sin(0.3)
    agrees(found, [
        [T1 * c, -T1 * s, -1.2 * T1 * s, 0.0], [T1 * s, T1 * c, 1.2 * T1 * c, 0.0], [0.0] * 4, [0.0, 0.0, 1.0, T1],
    ])  # fmt: skip
    assert found.of == ("position[0]", "position[1]", "position[2]", "turned")


PERIOD = 0.1


def looped(depth=2.0, **controller):
    """A body without weight in linear drag under a feedback of depth and its rate, held from tick to tick."""
    K = np.zeros((6, 12))
    K[2, [2, 8]] = 20.0, 40.0
    parts = dict(
        period=PERIOD, guidance=[lw.control.SetPoint(position=[0.0] * 3, heading=0.0)],
        laws=[lw.control.StateFeedback(K=K)],
        allocation=[lw.control.AllocationMatrix(to="control_wrench", matrix=np.eye(6))])  # fmt: skip
    terms = [
        lw.terms.ControlWrench(limit=1e3, time_constant=(0.0,) * 6),
        lw.terms.Drag(linear=[LINEAR] * 3 + [1.0] * 3),
    ]
    return body(0.0, terms=terms, start=lw.Start(position=[0.0, 0.0, depth]),
                controller=lw.Controller(**parts | controller))  # fmt: skip


def closed_loop(gains, linear=LINEAR, depth=2.0):
    """Depth at the end and its derivatives by both gains and the depth at the start: a product of matrices."""
    decay = np.exp(-linear * PERIOD / M)
    way = M / linear * (1.0 - decay)
    A = np.array([[1.0, way], [0.0, decay]])
    B = np.array([(PERIOD - way) / linear, (1.0 - decay) / linear])
    x, slopes = np.array([depth, 0.0]), np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    gains = np.asarray(gains)
    for _ in range(round(T1 / PERIOD)):
        pushes = np.outer(B, np.append(x, 0.0))
        slopes = (A - np.outer(B, gains)) @ slopes - pushes
        x = (A - np.outer(B, gains)) @ x
    return x[0], slopes[0]


@pytest.mark.slow
def test_a_sampled_linear_loop():
    by = ["state_feedback.K[2,2]", "state_feedback.K[2,8]", "start.position[2]"]
    found = lw.derivatives(looped(), "position[2]", by, **RUN)
    value, slopes = closed_loop((20.0, 40.0))
    assert found.value[0] == pytest.approx(value, rel=1e-11)
    agrees(found, [slopes])


def sounding(start=None):
    """The loop with every kind of number that goes in steps."""
    cell = lw.control.Sensor(name="cell", of="depth", quantum=0.005, every=2, latency=1, dropout=0.05)
    fault = lw.control.Fault(of="control_wrench", channel=0, time=4.0, gain=0.5)
    law = lw.control.HeavePID(kp=20.0, kd=40.0)
    return looped(sensors=[cell], delay=0.05, faults=[fault], laws=[law], guidance=[lw.control.SetPoint(depth=0.0)])


IN_STEPS = {
    "cell.dropout": "which readings are lost",
    "cell.every": "whole number of ticks",
    "cell.latency": "whole number of ticks",
    "cell.quantum": "step by which readings jump",
    "controller.delay": "whole number of steps",
    "fault.time": "tick at or after it",
}


@pytest.mark.slow
def test_what_goes_in_steps_is_named():
    scene = sounding()
    metrics = [
        lw.metrics.SettlingTime("depth", within=0.5),
        lw.metrics.RiseTime("depth"),
        lw.metrics.PeakTime("depth"),
        lw.metrics.SaturationShare(),
    ]
    by = [*IN_STEPS, "heave_pid.kp"]
    found = lw.derivatives(scene, ["depth", *metrics, "outcome ok"], by, **RUN)
    assert np.isnan(found.jacobian).all()
    assert np.isnan(found.error).all()
    assert len(found.undefined) == found.jacobian.size
    for name, words in IN_STEPS.items():
        says(found.undefined[f"depth by {name}"], name, words)
    says(found.undefined["depth by heave_pid.kp"], "readings are rounded (cell to 0.005)", "smooth=True")
    for metric in metrics:
        says(found.undefined[f"{metric.key} by heave_pid.kp"], metric.key, "jumps by one")
    says(found.undefined["outcome ok by heave_pid.kp"], "is 1 or 0")
    assert found.members == 3  # nothing is moved in vain
    smooth = lw.derivatives(scene, "depth", by, smooth=True, **RUN)
    assert list(smooth.undefined) == [f"depth by {name}" for name in IN_STEPS]
    assert smooth.messages == ("readings are not rounded: cell.quantum left out",)
    # What readings are lost, and when, is the member's: the same for all copies.
    e = 1e-3
    ends = [lw.solve(scene.with_numbers({"cell.quantum": 0.0, "heave_pid.kp": 20.0 + d}), **RUN).depth[-1, 0]
            for d in (-e, e)]  # fmt: skip
    assert smooth.jacobian[0, -1] == pytest.approx((ends[1] - ends[0]) / (2.0 * e), rel=1e-6)
    assert smooth.error[0, -1] < 1e-6 * abs(smooth.jacobian[0, -1])


@pytest.mark.ci
def test_what_differences_disagree_about():
    def kinked(result):
        return np.abs(result.position[-1, :, 1])

    def rounded(result):
        return np.round(result.position[-1, :, 2], 2)

    def reached(result):
        return np.where(result.position[-1, :, 2] > 1e3, 1.0, np.inf)

    by = ["start.position[1]", "start.position[2]", "start.velocity[2]"]
    found = lw.derivatives(body(quadratic=QUADRATIC), [kinked, rounded, reached, "depth"], by, **RUN)
    says(found.undefined["kinked by start.position[1]"], "a kink", "1 from above and -1 from below")
    says(found.undefined["rounded by start.position[2]"], "jumps between increments of")
    says(found.undefined["reached by start.position[2]"], "it is inf")
    assert np.isnan(found.jacobian[[0, 1, 2, 2], [0, 1, 0, 2]]).all()
    assert found.jacobian[3, 0] == 0.0
    assert abs(found.jacobian[3, 1] - 1.0) <= found.error[3, 1]


@pytest.mark.ci
def test_a_start_that_grows_beyond_measure():
    """A turn about the middle axis grows by exp(0.169 w t)."""
    start = lw.Start(angular_velocity=[0.0, 20.0, 0.0])
    found = lw.derivatives(body(0.0, start=start, terms=[]), turned, "start.angular_velocity[1]", **RUN)
    says(
        found.undefined["turned by start.angular_velocity[1]"], "a small difference of the start grows", "earlier time"
    )
    slower = lw.derivatives(body(0.0, start=start, terms=[]), turned, "start.angular_velocity[0]", **RUN | {"t1": 1.0})
    assert not slower.undefined


@pytest.mark.slow
def test_a_member_that_failed():
    scene = body(linear=1e5, start=lw.Start(velocity=[1.0, 0.0, 0.0]))
    found = lw.derivatives(scene, "position[0]", "start.velocity[0]", **RUN)
    says(found.undefined["position[0] by start.velocity[0]"], "the member failed (")
    raising = lw.Scene.from_dict(scene.to_dict() | {"run": {"on_failure": "raise"}})
    again = lw.derivatives(raising, "position[0]", "start.velocity[0]", **RUN)
    assert again.undefined == found.undefined


FLOOR = 4.0


@pytest.mark.slow
def test_across_an_event():
    """The time at which the fall reaches a depth moves by less the derivative of the depth over the speed there."""
    scene = body(quadratic=QUADRATIC, events=[lw.events.Floor(depth=FLOOR), lw.events.StopTime(at=100.0)])
    by = ["vehicle.buoyancy", "drag.quadratic[2]", "start.position[2]", "floor.depth"]
    of = ["end_time floor", "depth", "depth at 2.0", lw.metrics.TimeToFailure(), "end_time time"]
    found = lw.derivatives(scene, of, by, **RUN)
    F, k = HEAVY, QUADRATIC
    s = np.arccosh(np.exp(k * FLOOR / M))
    end, tanh = s * M / np.sqrt(F * k), np.tanh(s)
    speed = np.sqrt(F / k) * tanh
    depth = np.array(
        [-M / k * tanh * s / (2.0 * F), -M / k**2 * np.log(np.cosh(s)) + M / k * tanh * s / (2.0 * k), 1.0, -1.0]
    )
    assert found.value[0] == pytest.approx(end, rel=1e-4)
    assert (np.abs(found.jacobian[0] + depth / speed) <= found.error[0]).all()
    # A cubic through four steps is as good as that, a step's fourth power.
    assert (found.error[0] < 1e-4 * np.abs(depth / speed)).all()
    assert np.isnan(found.jacobian[[1, 3, 4]]).all()
    says(found.undefined["depth by vehicle.buoyancy"], "an event stopped the member (floor)", '"end_time NAME"')
    says(found.undefined["time_to_failure by vehicle.buoyancy"], 'ask for "end_time NAME"')
    says(found.undefined["end_time time by vehicle.buoyancy"], "does not end so")
    s = 2.0 * np.sqrt(F * k) / M
    assert abs(found.jacobian[2, 0] + M / k * np.tanh(s) * s / (2.0 * F)) <= found.error[2, 0]
    assert found.jacobian[2, 3] == 0.0


@pytest.mark.slow
def test_a_member_that_stops_at_a_time():
    scene = body(quadratic=QUADRATIC, events=[lw.events.StopTime(at=4.0)])
    found = lw.derivatives(scene, ["depth", "end_time time"], ["start.position[2]", "time.at"], **RUN)
    assert abs(found.jacobian[0, 0] - 1.0) <= found.error[0, 0]
    assert abs(found.jacobian[1, 1] - 1.0) <= found.error[1, 1] + 1e-12
    assert list(found.undefined) == ["depth by time.at"]
    says(found.undefined["depth by time.at"], "whole steps")


def pushed(interpolation):
    """A body that is pushed ahead from 1 s on: at once, or ever more."""
    forces = [[0.0] * 3, [LINEAR, 0.0, 0.0]]
    times = [0.0, 1.0] if interpolation == "steps" else [1.0, 3.0]
    return body(0.0, terms=[lw.terms.WrenchSchedule(times=times, force=forces, interpolation=interpolation)])


@pytest.mark.ci
def test_times_at_which_a_schedule_jumps():
    """A push that begins at 1 s begins at the step after it; one that grows, at that time."""
    by, run = ["wrench_schedule.times[1]", "wrench_schedule.force[1,0]"], RUN | {"method": "psi_x", "h": 0.1, "t1": 3.0}
    steps = lw.derivatives(pushed("steps"), "position[0]", by, **run)
    assert list(steps.undefined) == ["position[0] by wrench_schedule.times[1]"]
    says(steps.undefined["position[0] by wrench_schedule.times[1]"], "jumps", "step")
    assert abs(steps.jacobian[0, 1] - 2.0**2 / (2.0 * M)) <= steps.error[0, 1] + 1e-12
    # x = F (t - t0)^3 / (6 M (t1 - t0)) between both times.
    grows = lw.derivatives(pushed("linear"), "position[0] at 2.0", by, **run)
    assert not grows.undefined
    assert grows.jacobian[0, 0] == pytest.approx(-LINEAR / (6.0 * M * 2.0**2), rel=0.02)  # the step's own error, h^2


@pytest.mark.slow
def test_legs_of_waypoints():
    points = [[0.0, 0.0, 0.0], [6.0, 0.0, 0.0], [6.0, 100.0, 0.0]]
    controller = lw.Controller(
        period=0.1, guidance=[lw.control.Waypoints(points=points, speed=1.5, look_ahead=10.0, radius=2.0)],
        laws=[lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0)],
        allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0] * 6])])  # fmt: skip
    scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]}, controller=controller)
    run = {"method": "psi_x", "h": 0.1, "threads": 1}
    by = ["heading_pid.kp", "waypoints.radius"]
    before = lw.derivatives(scene, "position[1]", by, t1=2.0, **run)
    assert list(before.undefined) == ["position[1] by waypoints.radius"]
    says(before.undefined["position[1] by waypoints.radius"], "at which tick a leg is done")
    after = lw.derivatives(scene, ["position[1]", "position[1] at 2.0"], by, t1=5.0, **run)
    says(after.undefined["position[1] by heading_pid.kp"], "tick at which a leg is done", "1 of them were")
    assert abs(after.jacobian[1, 0] - before.jacobian[0, 0]) <= after.error[1, 0] + before.error[0, 0]
    between = lw.derivatives(scene, "position[1] at 4.9", "heading_pid.kp", t1=5.0, **run)
    says(between.undefined["position[1] at 4.9 by heading_pid.kp"], "1 of them were")


@pytest.mark.ci
def test_a_number_that_may_not_be_less():
    """The first drag of a fall in vacuum: z = F t^2 / 2 m - k F^2 t^4 / 12 m^3."""
    found = lw.derivatives(body(), "depth", "drag.quadratic[2]", **RUN)
    assert abs(found.jacobian[0, 0] + HEAVY**2 * T1**4 / (12.0 * M**3)) <= found.error[0, 0]
    assert found.error[0, 0] < 1e-7 * abs(found.jacobian[0, 0])
    says(found.messages[0], "drag.quadratic[2]", "from above alone")


@pytest.mark.ci
def test_a_number_that_cannot_be_moved_leaves_the_others():
    scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.1, 0.05]})
    by = ["drag_matrix.linear[5,1]", "vehicle.buoyancy"]
    found = lw.derivatives(scene, "depth", by, method="rk4", h=0.1, t1=0.5, threads=1)
    says(found.undefined["depth by drag_matrix.linear[5,1]"], "cannot be moved to either side: ", "unphysical")
    assert np.isnan(found.jacobian[0, 0])
    assert found.jacobian[0, 1] < 0.0
    assert not found.messages


@pytest.mark.ci
def test_quantities_of_signals_alone():
    save = lw.SaveAt(at=[T1], fields=("command",))
    found = lw.derivatives(looped(), lambda result: result.command[-1, :, 2], "state_feedback.K[2,2]", save=save, **RUN)
    named = lw.derivatives(looped(), "command[2]", "state_feedback.K[2,2]", **RUN)
    assert not found.undefined
    assert not named.undefined
    assert found.error[0, 0] < 1e-7 * abs(found.jacobian[0, 0])
    np.testing.assert_allclose(named.jacobian, found.jacobian, atol=found.error[0, 0] + named.error[0, 0])


def fallen(F, k=QUADRATIC):
    s = T1 * np.sqrt(F * k) / M
    return M / k * np.log(np.cosh(s)), -M / k * np.tanh(s) * s / (2.0 * F)


@pytest.mark.ci
@pytest.mark.parametrize("members", [1, 11])
def test_a_fleet_has_an_axis_of_members(members):
    vary = {
        "vehicle.buoyancy": lw.distributions.Normal(std=3.0),
        "start.position": lw.distributions.Normal(std=1.0),
        "start.attitude": lw.distributions.UniformRotation(),
    }
    fleet = lw.Ensemble(body(quadratic=QUADRATIC), members, 3, vary)
    found = lw.derivatives(fleet, "depth", ["vehicle.buoyancy", "start.position[2]"], **RUN)
    heavy = MASS * GRAVITY - fleet.parameters(0, members)["vehicle.buoyancy"]
    assert found.jacobian.shape == found.error.shape == found.increments.shape == (members, 1, 2)
    start = fleet.select(0, members).position[:, 2]
    # Turned bodies fall along other axes: their drag is not that of one axis.
    upright = lw.Ensemble(fleet.scene, members, 3, {name: vary[name] for name in list(vary)[:2]})
    plain = lw.derivatives(upright, "depth", ["vehicle.buoyancy", "start.position[2]"], **RUN)
    np.testing.assert_allclose(
        plain.value[:, 0], upright.select(0, members).position[:, 2] + fallen(heavy)[0], rtol=1e-10
    )
    assert (np.abs(plain.jacobian[:, 0, 0] - fallen(heavy)[1]) <= plain.error[:, 0, 0]).all()
    assert (plain.error[:, 0, 0] < 1e-7 * np.abs(fallen(heavy)[1])).all()
    for each in (found, plain):
        assert (np.abs(each.jacobian[:, 0, 1] - 1.0) <= each.error[:, 0, 1]).all()
    assert np.abs(found.value[:, 0] - start).max() > 1.0
    assert "mean over members" in str(found)
    again = lw.derivatives(upright, "depth", ["vehicle.buoyancy", "start.position[2]"], seed=4, **RUN)
    assert not np.isin(again.value, plain.value).any()


@pytest.mark.ci
def test_members_that_need_other_increments_than_the_first_ones():
    """Almost neutral bodies: drag by the square of the speed is no power series in the weight across its sign."""
    heavy = np.array([HEAVY] * 9 + [1.9e-4, -5.7e-5, 3e-3])
    sampling = lw.designs.Table({"vehicle.buoyancy": MASS * GRAVITY - heavy})
    fleet = lw.Ensemble(body(quadratic=QUADRATIC), sampling=sampling)
    found = lw.derivatives(fleet, "depth", "vehicle.buoyancy", **RUN)
    assert not found.undefined
    truth = fallen(np.abs(heavy))[1]
    assert (np.abs(found.jacobian[:, 0, 0] - truth) <= found.error[:, 0, 0]).all()
    assert (found.error[:, 0, 0] < 1e-2 * np.abs(truth)).all()


@pytest.mark.slow
def test_members_of_a_fleet_with_different_ends():
    fleet = lw.Ensemble(
        body(quadratic=QUADRATIC, events=[lw.events.Floor(depth=7.0)]),
        sampling=lw.designs.Table({"start.position[2]": [0.0, 3.0, 6.0]}),
    )
    found = lw.derivatives(fleet, ["depth", "end_time floor"], "start.position[2]", **RUN)
    assert np.isnan(found.jacobian[:, 0, 0]).tolist() == [False, True, True]
    assert np.isnan(found.jacobian[:, 1, 0]).tolist() == [True, False, False]
    says(found.undefined["depth by start.position[2]"], "(2 of 3 members, the first 1)")
    says(str(found), "(2 members have none)", "(1 member has none)")
    assert (found.jacobian[1:, 1, 0] < 0.0).all()


@pytest.mark.ci
def test_noise_is_that_of_the_member():
    """In linear drag the way is linear in the start and in the strength of the noise."""
    gusts = lw.terms.WrenchNoise(force=(0.0, 0.0, 6.0))
    scene = body(0.0, terms=[lw.terms.Drag(linear=[LINEAR] * 3 + [1.0] * 3), gusts])
    run = {"method": "psi_x", "h": 0.1, "t1": T1, "threads": 1}
    by = ["start.velocity[2]", "wrench_noise.force[2]"]
    found = lw.derivatives(scene, "depth", by, seed=5, **run)
    fleet = lw.Ensemble(scene, 3, 5)
    each = lw.derivatives(fleet, "depth", by, **run)
    np.testing.assert_allclose(each.value[:, 0], lw.solve(fleet, **run).depth[-1], rtol=1e-13)
    assert each.value[0, 0] == found.value[0]
    # The noise of a member moves it by its strength: from nothing at 0.
    assert (np.abs(each.jacobian[:, 0, 1] - each.value[:, 0] / 6.0) <= each.error[:, 0, 1] + 1e-13).all()
    assert np.abs(np.diff(each.jacobian[:, 0, 0])).max() <= 2.0 * each.error[:, 0, 0].max()
    way = M / LINEAR * (1.0 - np.exp(-LINEAR * T1 / M))
    assert each.jacobian[0, 0, 0] == pytest.approx(way, rel=1e-4)  # the step's own error, h^2
    assert not found.undefined
    assert not each.undefined


@pytest.mark.slow
def test_single_precision():
    """Round-off of 1e-7 and an error of e^6 leave some four digits."""
    by = ["vehicle.buoyancy", "drag.quadratic[2]"]
    found = lw.derivatives(body(quadratic=QUADRATIC), "depth", by, **RUN | {"dtype": "float32"})
    F, k = HEAVY, QUADRATIC
    s = T1 * np.sqrt(F * k) / M
    truth = [fallen(F)[1], -M / k**2 * np.log(np.cosh(s)) + M / k * np.tanh(s) * s / (2.0 * k)]
    assert not found.undefined
    assert (np.abs(found.jacobian[0] - truth) <= found.error[0]).all()
    assert (found.error[0] < 0.02 * np.abs(truth)).all()


def test_bad_arguments_are_told_all_at_once():
    scene = body(quadratic=QUADRATIC)
    found = faults(lw.derivatives, scene, ["depth", "depth", "dept"], ["vehicle.mas", "start.position", "drag.linear[9]"],
                   smooth=3, seed=-1)  # fmt: skip
    text = "\n".join(found)
    says(text, "dept", "vehicle.mas", "Did you mean 'vehicle.mass'", "is not a single number", "start.position[0]",
         "drag.linear[9]", "smooth", "seed = -1")  # fmt: skip
    says("\n".join(faults(lw.derivatives, scene, ["depth", "depth"], "vehicle.mass")), "of = 'depth'", "is named twice")
    metrics = [lw.metrics.IAE("depth"), lw.metrics.IAE("depth")]
    says("\n".join(faults(lw.derivatives, looped(), metrics, "vehicle.mass")), "iae depth", "name of another")
    says(
        "\n".join(faults(lw.derivatives, scene, "depth", ["vehicle.mass", "vehicle.mass"])),
        "by = 'vehicle.mass'",
        "twice",
    )
    says("\n".join(faults(lw.derivatives, scene, "depth", [])), "by = []")
    says("\n".join(faults(lw.derivatives, 3, "depth", "vehicle.mass")), "fleet = 3")
    says("\n".join(faults(lw.derivatives, scene, "depth", "vehicle.mass, vehicle.buoyancy")), "names several numbers")


@pytest.fixture(scope="module")
def found():
    return lw.derivatives(body(quadratic=QUADRATIC), ["depth", "max(depth)"], ["vehicle.buoyancy", "start.position[1]"],
                          **RUN, save=lw.SaveAt(every=1.0))  # fmt: skip


@pytest.mark.ci
def test_the_answer_in_words_and_files(found, tmp_path):
    says(str(found), "depth = ", "by vehicle.buoyancy", " +- ", "max(depth) = ")
    for again in (pickle.loads(pickle.dumps(found)), copy.copy(found), copy.deepcopy(found)):
        assert str(again) == str(found)
    paths = found.save(tmp_path)
    assert [path.name for path in paths] == ["derivatives.json", "derivatives.csv"]
    again = lw.studies.Derivatives.load(paths[0])
    assert str(again) == str(found)
    np.testing.assert_array_equal(again.jacobian, found.jacobian)
    rows = list(found.rows())
    assert [(row["of"], row["by"]) for row in rows[:2]] == [
        ("depth", "vehicle.buoyancy"),
        ("depth", "start.position[1]"),
    ]
    assert rows[0]["jacobian"] == found.jacobian[0, 0]
    assert json.loads(paths[0].read_text())["provenance"]["method"]["name"] == "rk8"
    # A fall goes down: the deepest place is the last one.
    np.testing.assert_array_equal(found.jacobian[0], found.jacobian[1])


@pytest.mark.ci
def test_progress_and_executors(found):
    shares = []
    other = lw.derivatives(body(quadratic=QUADRATIC), ["depth", "max(depth)"], ["vehicle.buoyancy", "start.position[1]"],
                           **RUN | {"threads": 2}, save=lw.SaveAt(every=1.0), progress=shares.append)  # fmt: skip
    np.testing.assert_array_equal(other.jacobian, found.jacobian)
    assert shares[-1] == 1.0


@pytest.mark.slow
def test_the_code_of_the_page_on_derivatives(monkeypatch):
    monkeypatch.chdir(ROOT)
    names = {}
    autopilot, calibration = blocks("docs/guide/derivatives.md", "python")
    exec(autopilot, names)
    found = names["found"]
    assert np.isfinite(found.jacobian[:2, :3]).all()
    assert np.isnan(found.jacobian[2]).all()
    assert np.isnan(found.jacobian[:, 3]).all()
    exec(calibration, names)
    assert names["linear"] == pytest.approx(26.0, rel=1e-9)


@pytest.mark.slow
def test_the_calibration_of_the_example(capsys):
    """Estimates are normal about the truth with the covariance told: the square of their distance is chi-squared of three."""
    example = runpy.run_path(str(ROOT / "examples" / "estimates" / "calibrate_remus.py"))
    at, covariance = example["main"]()
    apart = at - list(example["TRUTH"].values())
    assert apart @ np.linalg.solve(covariance, apart) < 16.3  # 0.1 %
    assert np.abs(apart).min() > 0.0
    assert capsys.readouterr().out.count("truth") == 3
