# SPDX-License-Identifier: Apache-2.0
"""Phase margins and open loops of fleets: beside python-control's and eigenvalues of the same loops written by hand."""

import dataclasses

import numpy as np
import pytest
from scipy.linalg import expm

import lgvi_warp as lw
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.control import HeadingPID, Sensor, SetPoint, StateFeedback
from lgvi_warp.distributions import Uniform
from lgvi_warp.terms import Drag
from tests.support.refusals import refused, says
from tests.support.turning_loops import (
    GAINS,
    INERTIAS,
    LATE,
    PERIOD,
    H,
    J,
    heading_loops,
    loop_of,
    opened,
    scene,
    turning,
)

RUN = {"about": 80.0, "method": "psi_s", "h": H}


def radius(A, B, C, angle):
    """Largest eigenvalue of a loop that is closed with a phase on its demand."""
    return np.abs(np.linalg.eigvals(A + np.exp(-1j * angle) * B @ C)).max()


def turned_until_it_grows(A, B, C):
    """The least phase, lag or lead, at which a loop of one frequency after the other stops to settle: by bisection."""
    ends = []
    for sign in (1.0, -1.0):
        steps = np.linspace(0.0, np.pi, 400)
        grows = [radius(A, B, C, sign * step) >= 1.0 for step in steps]
        if not any(grows):
            continue
        high = int(np.argmax(grows))
        inside, outside = steps[high - 1], steps[high]
        for _ in range(50):
            middle = 0.5 * (inside + outside)
            inside, outside = (inside, middle) if radius(A, B, C, sign * middle) >= 1.0 else (middle, outside)
        ends.append(inside)
    return min(ends, default=np.inf)


@pytest.fixture(scope="module")
def answer():
    fleet = heading_loops(10)
    return fleet, lw.linear.margins(fleet, "heading_pid", of=("gain", "delay", "phase"), **RUN)


@pytest.mark.ci
def test_ten_loops_beside_python_control_and_eigenvalues(answer):
    control = pytest.importorskip("control")
    fleet, found = answer
    assert found.steady.all()
    frequencies = np.geomspace(1e-2, np.pi / PERIOD, 4000)
    for i in range(10):
        A, B, C = loop_of(fleet, i)
        phase, at = found.values["phase"][i], found.values["phase_frequency"][i]
        # python-control's margins of a discrete state space are those of polynomials, which it loses: those of data are well.
        L = np.array([-C @ np.linalg.solve(z * np.eye(len(A)) - A, B) for z in np.exp(1j * PERIOD * frequencies)])
        data = control.FRD(L[:, 0, 0], frequencies, smooth=True)
        gain, margin, _, crossover = control.margin(data)
        assert np.rad2deg(phase) == pytest.approx(margin, rel=1e-6)
        assert at == pytest.approx(crossover, rel=1e-6)
        # Theirs is the nearer one of two factors.
        nearer = min((found.values[name][i] for name in ("gain_lower", "gain_upper")), key=lambda g: abs(np.log(g)))
        assert nearer == pytest.approx(gain, rel=1e-5)
        assert phase == pytest.approx(turned_until_it_grows(A, B, C), rel=1e-7)
        # A delay turns the phase by the frequency times it: of slow crossovers, to a period.
        assert found.values["delay"][i] == pytest.approx(phase / at, abs=PERIOD)


@pytest.mark.ci
@pytest.mark.parametrize(("inertia", "delay"), [
    (INERTIAS[0], 0.0), *(pytest.param(*each, marks=pytest.mark.slow) for each in zip(INERTIAS[1:], LATE[1:], strict=True)),
])  # fmt: skip
def test_coupled_axes_beside_eigenvalues(inertia, delay):
    found = lw.linear.margins(turning(inertia, delay), of=("phase",), **RUN)
    A, B, C = opened(*GAINS, inertia, round(delay / H))
    assert found.values["phase"][0] == pytest.approx(turned_until_it_grows(A, B, C), rel=1e-7)


def spinning(gain, stiffness=0.0, drag=4.0):
    """A law that damps rolling, of a body with drag whose weight hangs below its buoyancy or not."""
    K = np.zeros((6, 12))
    K[3, 9] = gain
    wanted = [SetPoint(position=np.zeros(3), heading=0.0)]
    one = scene(StateFeedback(K=K), (5.0, 8.0, J), delay=0.0, guidance=wanted)
    vehicle = dataclasses.replace(one.vehicle, center_of_buoyancy=(0.0, 0.0, -stiffness / 200.0))
    return dataclasses.replace(one, vehicle=vehicle, terms=[*one.terms, Drag(linear=[50.0] * 3 + [drag, 40.0, 40.0])])


def held(stiffness, drag, gain, inertia=5.0):
    """The loop by hand: angle and rate; the rate alone where nothing turns the body back."""
    F, G = np.array([[0.0, 1.0], [-stiffness / inertia, -drag / inertia]]), np.array([[0.0], [1.0 / inertia]])
    both, first = expm(PERIOD * np.block([[F, G], [np.zeros((1, 3))]])), 0 if stiffness else 1
    return both[first:2, first:2], both[first:2, 2:], np.array([[0.0, -gain]])[:, first:]


@pytest.mark.ci
def test_loops_without_a_crossover_bear_any_phase_and_several_crossovers_have_a_worst():
    rows = [(2.0, 0.0, 4.0), (8.0, 0.0, 4.0), (8.0, 40.0, 4.0), (20.0, 40.0, 1.0)]
    margins = []
    for gain, stiffness, drag in rows:
        found = lw.linear.margins(spinning(gain, stiffness, drag), of=("phase",), about=80.0, method="rk4", h=H)
        assert found.steady.all(), found.why
        A, B, C = held(stiffness, drag, gain)
        expected = turned_until_it_grows(A, B, C)
        # rk4 errs by (h w)^4 / 120 a step of a vibration of 3 rad/s.
        assert found.values["phase"][0] == pytest.approx(expected, rel=1e-6)
        margins.append((found, expected))
    none, one, two, worse = margins
    # Of 2 N m s against a drag of 4 no gain is above 1/2.
    assert none[1] == np.inf
    assert np.isnan(none[0].values["phase_frequency"][0])
    says(none[0].answer, "tolerates any phase (its gain crosses 1 nowhere) in 1 member.")
    assert none[0].to_dict()["eigenvalues"]["phase"] == ["inf"]
    assert lw.linear.Margins.from_dict(none[0].to_dict()).values["phase"].tolist() == [np.inf]
    assert np.isnan(none[0].percentiles()["phase_frequency"]).all()
    # A vibration comes with a lead and leaves with a lag, in which the hold is worse.
    assert two[0].values["phase_frequency"][0] > np.sqrt(40.0 / 5.0)
    assert worse[1] < two[1] < np.inf
    assert one[1] < np.pi


@pytest.mark.ci
def test_a_loop_that_grows_has_an_open_loop_and_no_margins():
    """At its set-point exactly nothing moves: the motion is steady, and one tilt shows that it does not settle."""
    law = HeadingPID(kp=6.0, kd=2.1 * J / PERIOD)
    one = scene(law, (5.0, 8.0, J), delay=0.0)
    found = lw.linear.margins(one, of=("phase",), **RUN)
    assert found.why.tolist() == ["does not settle"]
    says(found.answer, "The loop of all laws has no margins in any of 1 member (1: does not settle).")
    A, B, C = opened([6.0], [0.0], [2.1 * J / PERIOD], J, 0)
    grows = lw.linear.loop(one, **RUN)
    w = np.array([0.5, 3.0, 30.0])
    L = [-C @ np.linalg.solve(z * np.eye(len(A)) - A, B) for z in np.exp(1j * PERIOD * w)]
    np.testing.assert_allclose(grows.response(w)[0], L, rtol=1e-6)
    a, b, c = grows.models[0]
    assert np.abs(np.linalg.eigvals(a - b @ c)).max() == pytest.approx(radius(A, B, C, 0.0), rel=1e-8)


@pytest.fixture(scope="module")
def loops():
    fleet = heading_loops(6)
    return fleet, {
        at: lw.linear.loop(fleet, at, **RUN) for at in (None, "heading_pid", "N", "control_wrench[5]", "control_wrench")
    }


def by_hand(A, B, C, w):
    return np.array([-C @ np.linalg.solve(z * np.eye(len(A)) - A, B) for z in np.exp(1j * PERIOD * w)])


@pytest.mark.ci
def test_open_loops_beside_those_by_hand(loops):
    fleet, each = loops
    w = np.geomspace(0.05, np.pi / PERIOD, 30)
    for at, found in each.items():
        assert found.members == 6
        assert (found.why == "").all()
        for i in range(6):
            L = by_hand(*loop_of(fleet, i), w)[:, 0, 0]
            np.testing.assert_allclose(found.response(w)[i, :, -1, -1], L, rtol=1e-6, err_msg=str(at))
            np.testing.assert_allclose(found.loci(w)[i, :, 0], L, rtol=1e-6)
    assert each["control_wrench"].names == tuple(f"control_wrench[{i}]" for i in range(6))
    assert np.abs(each["control_wrench"].response(w)[0, :, :5]).max() == 0.0
    assert (each[None].at, each[None].names) == ("all laws", ("N",))
    assert repr(each["N"]) == "The loop is opened at N in 6 members."
    assert repr(each["heading_pid"]) == "The loop is opened at heading_pid (N) in 6 members."


def test_open_loops_for_python_control(loops):
    control = pytest.importorskip("control")
    fleet, each = loops
    found = each["heading_pid"]
    w = np.geomspace(0.05, 30.0, 20)
    for i in (0, 5):
        A, B, C = loop_of(fleet, i)
        space, data = found.state_space(i), found.frd(i, w)
        assert (space.dt, data.dt) == (PERIOD, PERIOD)
        L = by_hand(A, B, C, w)[:, 0, 0]
        np.testing.assert_allclose(control.frequency_response(space, w).frdata[0, 0], L, rtol=1e-6)
        np.testing.assert_allclose(data.frdata[0, 0], L, rtol=1e-6)
        closed = control.feedback(space, 1.0)
        assert np.abs(control.poles(closed)).max() == pytest.approx(radius(A, B, C, 0.0), rel=1e-8)
    grid = found.frequencies()
    assert grid[-1] == pytest.approx(np.pi / PERIOD)
    assert (np.diff(grid) > 0.0).all()
    assert (found.frd(0).omega[-1], space.input_labels, space.output_labels) == (np.pi / PERIOD, ["u_N"], ["y_N"])


@pytest.mark.ci
def test_an_axis_by_itself_and_with_the_others_closed():
    one = turning(INERTIAS[1], 0.06)
    A, B, C = opened(*GAINS, INERTIAS[1], 3)
    w = np.geomspace(0.1, np.pi / PERIOD, 20)
    whole = lw.linear.loop(one, **RUN)
    assert whole.names == ("X", "Y", "Z", "K", "M", "N")
    np.testing.assert_allclose(whole.response(w)[0, :, 3:, 3:], by_hand(A, B, C, w), rtol=1e-6, atol=1e-9)
    middle = lw.linear.loop(one, "M", **RUN)
    others = np.array([0, 2])
    L = by_hand(A + B[:, others] @ C[others], B[:, 1:2], C[1:2], w)
    np.testing.assert_allclose(middle.response(w)[0], L, rtol=1e-6)
    # A component is a command here, whose torque acts as the law demands it.
    np.testing.assert_allclose(lw.linear.loop(one, "control_wrench[4]", **RUN).response(w)[0], L, rtol=1e-6)


@pytest.mark.ci
def test_members_without_a_loop_and_what_is_refused():
    states = [
        np.zeros((2, 3)),
        np.tile(np.eye(3), (2, 1, 1)),
        np.zeros((2, 3)),
        np.array([[0.0] * 3, [0.0, 0.0, 5.0 / H]]),
    ]
    law = HeadingPID(kp=6.0, kd=9.0)
    fleet = lw.Ensemble.from_states(scene(law, (5.0, 8.0, J)), *states)
    found = lw.linear.loop(fleet, **RUN, settle=80.0)
    assert found.why.tolist() == ["", "failed"]
    assert (found.models[0] is None, found.models[1] is None) == (False, True)
    assert np.isnan(found.response([1.0])[1]).all()
    assert np.isnan(found.loci([1.0])[1]).all()
    assert repr(found) == "The loop is opened at all laws (N) in 1 of 2 members (1: failed)."
    says(refused(found.frd, 1), "member", "has no loop: failed")
    says(refused(found.state_space, 2), "member", "is none of 2")
    one = fleet.scene
    says(refused(lw.linear.loop, one, "heding_pid"), "at", "Did you mean 'heading_pid'")
    says(refused(lw.linear.loop, one, "M", **RUN), "at", "is a component that no law demands. Give one of N")
    says(refused(lw.linear.loop, one, about=-1.0), "about")
    says(refused(lw.linear.loop, dataclasses.replace(one, controller=None)), "controller", "a loop needs one")
    noisy = dataclasses.replace(
        one, controller=dataclasses.replace(one.controller, sensors=[Sensor(of="heading", noise=0.1)])
    )
    quiet = lw.linear.loop(noisy, **RUN)
    says(quiet.messages[0], "sensor.noise taken as 0")
    np.testing.assert_allclose(quiet.response([1.0]), found.response([1.0])[:1], rtol=1e-6)
    says(
        refused(lw.linear.loop, lw.Ensemble(noisy, 2, 1, {"sensor.noise": Uniform(0.0, 0.2)})), "sensor.noise", "varies"
    )


def test_pictures_of_open_loops(loops, tmp_path):
    pytest.importorskip("matplotlib")
    _, each = loops
    gain, phase = lw.plots.bode(each["heading_pid"], path=tmp_path / "bode.png")
    assert (gain.get_yscale(), phase.get_xlabel(), phase.get_ylabel()) == ("log", "frequency [rad/s]", "phase [rad]")
    assert [text.get_text() for text in gain.get_legend().get_texts()] == ["all", "90%", "50%", "median"]
    w, median = gain.lines[0].get_data()
    values = np.abs(each["heading_pid"].response(w)[:, :, 0, 0])
    np.testing.assert_allclose(median, np.quantile(values, 0.5, axis=0, method="inverted_cdf"), rtol=0.5)
    # An angle, its rate and an integral: three quarters of a turn behind.
    assert phase.lines[0].get_ydata()[0] == pytest.approx(-1.5 * np.pi, abs=0.1)
    several, _ = lw.plots.bode(each["control_wrench"])
    assert [text.get_text() for text in several.get_legend().get_texts()] == ["characteristic locus 1"]
    axes = lw.plots.nyquist(each["heading_pid"], path=tmp_path / "nyquist.png")
    distances = np.abs(1.0 + each["heading_pid"].loci(w)).min(axis=(1, 2))
    (text,) = (text.get_text() for text in axes.get_legend().get_texts())
    assert text == f"member {np.argmin(distances)}, nearest to -1 (distance {distances.min():.3g})"
    assert (tmp_path / "nyquist.png").stat().st_size > 1000
    lost = dataclasses.replace(each["heading_pid"], models=(None,), why=np.array(["failed"], dtype=object))
    for draw in (lw.plots.bode, lw.plots.nyquist):
        with pytest.raises(NothingToDraw, match=r"none of 1 member has a loop \(failed\)"):
            draw(lost)


@pytest.mark.ci
def test_the_shipped_autopilot_has_margins_and_says_what_they_leave_out():
    shipped = lw.Scene.load("example:remus_100_autopilot")
    fleet = lw.Ensemble.from_scene(shipped).subset([0, 1])
    found = lw.linear.margins(fleet, "heading_pid", of=("phase", "disk"))
    assert found.steady.all()
    # What a disk says of phases is at most the phase margin.
    assert (found.values["disk_phase"] <= found.values["phase"]).all()
    left_out = "depth_cell.noise, depth_cell.quantum, compass.noise, compass.drift taken as 0, its mean"
    says(found.answer, "rad of phase at", left_out, "stuck_rudder taken as off")
    assert str(found).endswith(found.answer)
    assert found.to_dict()["messages"] == list(found.messages)


@pytest.mark.slow
def test_a_thousand_members_beside_those_by_hand():
    fleet = heading_loops(1000)
    found = lw.linear.margins(fleet, "heading_pid", of=("phase",), **RUN)
    for i in range(0, 1000, 20):
        assert found.values["phase"][i] == pytest.approx(turned_until_it_grows(*loop_of(fleet, i)), rel=1e-6)
    worst = np.argmin(found.values["phase"])
    assert found.worst(1, "phase").tolist() == [worst]
    says(found.answer, f"in 1,000 members; member {worst} has the least margin")
    assert len(lw.linear.loop(fleet, "heading_pid", **RUN).models) == 1000
