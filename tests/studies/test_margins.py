# SPDX-License-Identifier: Apache-2.0
"""Margins of loops: beside those of the sampled system written by hand, and by runs in lanes; one kernel."""

import dataclasses
import re

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.scene.settings import RunSettings
from lgvi_warp.studies.linear import loops as study
from lgvi_warp.studies.linear.edges import edges
from lgvi_warp.studies.linear.sampled_loop import SampledLoop
from tests.conftest import ROOT

J, PERIOD, H, EVERY = 11.0, 0.1, 0.02, 5
MEMBERS = 6


def scene(delay=0.0, laws=(), **gains):
    """A neutral body that turns its head."""
    law = lw.HeadingPID(**{"kp": 6.0, "ki": 0.8, "kd": 9.0} | gains)
    controller = lw.Controller(
        period=PERIOD, delay=delay, guidance=[lw.SetPoint(heading=0.0)], laws=[law, *laws],
        allocation=[lw.AllocationMatrix(to="control_wrench", matrix=np.eye(6))])  # fmt: skip
    vehicle = lw.Vehicle(20.0, (5.0, 8.0, J), (0.0, 0.0, 0.0), 200.0, (0.0, 0.0, 0.0))
    return lw.Scene(vehicle, lw.Environment(10.0), [lw.ControlWrench()], controller=controller)


@pytest.fixture(scope="module")
def fleet():
    vary = {
        "heading_pid.kp": lw.Uniform(4.0, 8.0), "heading_pid.kd": lw.Uniform(7.0, 12.0),
        "heading_pid.ki": lw.Uniform(0.4, 1.2), "controller.delay": lw.Choice([0.0, 0.06, 0.12])}  # fmt: skip
    return lw.Ensemble(scene(delay=0.06), MEMBERS, 5, vary)


@pytest.fixture(scope="module")
def found(fleet):
    return lw.margins(fleet, "heading_pid", by=("eigenvalues", "runs"), about=80.0, method="psi_s", h=H)


def radius(kp, ki, kd, g, steps):
    """Largest eigenvalue of the sampled loop: angle, rate, integral, and the torques that are on their way."""
    q, s = divmod(steps, EVERY)
    T, late = PERIOD, s * H

    def push(t):
        """Angle and rate after a torque that acts for the last t seconds of a period."""
        return np.array([0.5 * t**2, t]) / J

    A = np.zeros((3 + q + 2, 3 + q + 2))
    A[:2, :2] = [[1.0, T], [0.0, 1.0]]
    A[:2, 3 + q] = push(T - late)
    A[:2, 4 + q] = push(T) - push(T - late)
    A[2, :3] = -T, 0.0, 1.0
    A[3] = g * (-kp * A[0] - kd * A[1] + ki * A[2])
    A[4:, 3:-1] = np.eye(q + 1)
    return np.abs(np.linalg.eigvals(A)).max()


def edge(holds, inside, outside):
    for _ in range(60):
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if holds(middle) else (inside, middle)
    return inside


def by_hand(fleet, least):
    """Margins of the members, where the largest eigenvalue reaches `least`."""
    p = {name: np.broadcast_to(v, (MEMBERS, *v.shape[1:])) for name, v in fleet.parameters(0, MEMBERS).items()}
    rows = []
    for i in range(MEMBERS):
        gains, own = [p[f"heading_pid.{k}"][i] for k in ("kp", "ki", "kd")], round(p["controller.delay"][i] / H)
        lower, upper = (edge(lambda g: radius(*gains, g, own) < least, 1.0, end) for end in (0.01, 100.0))
        more = 0
        while radius(*gains, 1.0, own + more + 1) < least:
            more += 1
        rows.append((lower, upper, more * H))
    return dict(zip(("gain_lower", "gain_upper", "delay"), np.array(rows).T, strict=True))


def test_margins_by_eigenvalues_are_those_of_the_system_by_hand(fleet, found):
    expected = by_hand(fleet, 1.0)
    assert found.steady.all() and len(set(np.round(expected["delay"] / H))) > 2
    for name in ("gain_lower", "gain_upper"):
        # The differences err by 1e-10, the brackets end at 1e-6; a slow edge moves more than the eigenvalue does.
        np.testing.assert_allclose(found.values[name], expected[name], rtol=1e-5)
    np.testing.assert_array_equal(np.round(found.values["delay"] / H), np.round(expected["delay"] / H))


def test_margins_by_runs_are_those_at_which_the_envelope_shrinks(fleet, found):
    # From the second third of 240 s to the last are 80 s.
    expected = by_hand(fleet, study.SHRINKS ** (PERIOD / 80.0))
    for name in ("gain_lower", "gain_upper"):
        # Half of a bracket, and what other modes have left in the second third.
        np.testing.assert_allclose(found.by_runs[name], expected[name], rtol=3e-3)
    assert np.abs(found.by_runs["delay"] - found.values["delay"]).max() <= H * (1.0 + 1e-9)


@pytest.mark.slow
def test_the_poles_of_a_closed_loop_with_a_delay_are_those_of_the_system_by_hand():
    for steps in (0, 3, 11):
        closed = lw.linearize(scene(delay=steps * H), 80.0, closed=True, method="psi_s", h=H)
        turning = [name for name in closed.states if not name.startswith(("position", "velocity"))]
        # Beside roll and pitch, which nothing turns: two integrators each, at 1.
        others = [f"{word}[{i}]" for word in ("rotation", "angular_velocity") for i in (0, 1)]
        yaw = closed.part([name for name in turning if name not in others])
        assert abs(np.abs(yaw.poles[0]) - radius(6.0, 0.8, 9.0, 1.0, steps)) < 1e-8
        assert closed.inputs == tuple(f"control_wrench[{i}]" for i in range(6))
        torque, rate = closed.inputs.index("control_wrench[5]"), closed.states.index("angular_velocity[2]")
        assert abs(closed.B[rate, torque] - PERIOD / J) < 1e-9


def test_a_distribution(found):
    table = found.percentiles((0.0, 100.0))
    assert table["gain_upper"].tolist() == [found.values["gain_upper"].min(), found.values["gain_upper"].max()]
    values, part = found.curve("delay")
    assert np.all(np.diff(values) >= 0.0) and part[-1] == 1.0 and found.members == MEMBERS
    assert found.worst(1)[0] == np.argmin(found.values["gain_upper"])
    assert found.worst(1, "gain_lower")[0] == np.argmax(found.values["gain_lower"])
    assert "gain_upper" in str(found) and "delay s" in str(found)


def test_a_loop_that_does_not_settle_has_no_margins():
    loops = lw.Ensemble.from_states(
        scene(delay=0.06), np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3)), np.zeros((2, 3)),
        {"heading_pid.kd": np.array([9.0, 2.1 * J / PERIOD])})  # fmt: skip
    found = lw.margins(loops, None, "gain", about=1.0, method="psi_s", h=H)
    assert found.steady.tolist() == [True, False] and found.loop == "all laws"
    assert np.isnan(found.values["gain_upper"][1]) and np.isfinite(found.values["gain_upper"][0])
    assert found.why.tolist() == ["", "does not settle"] and "1 of them have none" in str(found)
    assert set(found.values) == {"gain_lower", "gain_upper"}
    assert found.worst(1).tolist() == [1]


def test_edges_beside_known_ones():
    rng = np.random.default_rng(2)
    true = np.exp(rng.uniform(-4.0, 4.0, 200))
    start, last = np.ones(200), np.where(true > 1.0, 1e3, 1e-3)
    true[:3], last[2] = (1e4, 1e-5, 1e4), 1e3
    last[:2] = 1e3, 1e-3
    start[3] = np.nan
    guess = true * np.exp(rng.normal(0.0, 0.1, 200))
    guess[10:30] = np.nan
    asked = []

    def holds(values, members):
        asked.append(len(members))
        inside = np.where(true[members] > 1.0, values < true[members], values > true[members])
        return inside

    found = edges(holds, start, last, guess, 1e-3)
    middle = np.sqrt(found[4:, 0] * found[4:, 1])
    np.testing.assert_allclose(middle, true[4:], rtol=1e-3)
    assert found[0, 1] == np.inf and found[1, 1] == 0.0 and found[2, 1] == np.inf and np.isnan(found[3]).all()
    counts = rng.integers(0, 100, 50).astype(float)
    inside = edges(lambda v, i: v <= counts[i], np.zeros(50), np.full(50, 60.0), np.full(50, np.nan), 1.0, whole=True)
    np.testing.assert_array_equal(inside[:, 0], np.minimum(counts, 60.0))
    assert np.array_equal(np.isinf(inside[:, 1]), counts >= 60.0)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"loop": "heding_pid"}, "did you mean 'heading_pid'"),
        ({"of": "phase"}, "of = 'phase'"),
        ({"by": "guess"}, "by = 'guess'"),
        ({"seconds": 0.0}, "seconds"),
        ({"seconds": 1.0}, "is less than 30 looks"),
    ],
)
def test_bad_arguments(words, message):
    with pytest.raises(lw.SceneError, match=message):
        lw.margins(scene(), **words, h=H)


def test_what_is_no_scene():
    for ask, words in (
        (lw.trim, {}), (lw.linearize, {}), (lw.margins, {}), (lw.worst_case, {"within": {}, "of": "depth"}),
        (lw.tune, {"over": {}, "minimise": "depth"}),
    ):  # fmt: skip
        with pytest.raises(lw.SceneError, match="is neither"):
            ask("scene.toml", **words)


def test_a_copy_that_fails_does_not_settle(fleet):
    """Beside a motion at the edge of what a step can solve, one of two copies is beyond it."""
    members = study.Study(fleet, None, 80.0, 80.0, 10.0, 1e-3, "psi_s", H)
    (loops,), why = members.loops(np.arange(2))
    motion, bus = loops.motion, members.bench.bus
    motion.angular_velocity[1] = (0.0, 0.0, 2.0 / H)
    assert why.tolist() == ["", ""]
    assert bus.rows == bus.answer + 6  # in which the demand of other laws is kept while those of the loop act
    sampled = SampledLoop(members.bench, np.arange(2), motion, loops.begin)
    assert sampled.stable(np.ones(2), loops.delay, np.arange(2)).tolist() == [True, False]


def test_scenes_without_margins():
    with pytest.raises(lw.SceneError, match="has no controller"):
        lw.margins(dataclasses.replace(scene(), controller=None), h=H)
    whole = scene()
    noisy = dataclasses.replace(whole.controller, sensors=[lw.Sensor(of="heading", noise=0.1)])
    with pytest.raises(lw.SceneError, match=r"sensor\.noise.*has no linear model"):
        lw.margins(dataclasses.replace(whole, controller=noisy), h=H)


def autopilot():
    """REMUS 100, ballasted, on a straight way."""
    start = lw.Start(velocity=(1.54, 0.0, 0.0))
    controller = lw.Controller(
        period=0.1, guidance=[lw.SetPoint(heading=0.0, depth=0.0)],
        laws=[lw.HeadingPID(kp=1.0, kd=2.0, ki=0.02),
              lw.DepthPID(kp=0.1, ki=0.001, kp_pitch=5.0, ki_pitch=0.3, kd_pitch=2.0, pitch_limit=0.5)],
        allocation=[lw.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])])  # fmt: skip
    run = RunSettings(method="psi_x", step=0.01, duration=20.0, save_every=1.0)
    return lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0}, start=start, controller=controller, run=run)


@pytest.mark.slow
@pytest.mark.parametrize("loop", ["depth_pid", None])
def test_a_factor_of_1_changes_nothing(loop):
    """Laws with integrals of their own, whose demands are added: the factor is that of one, or of both."""
    scene = dataclasses.replace(autopilot(), start=lw.Start(velocity=(1.54, 0.0, 0.0), position=(0.0, 0.0, 1.0)))
    fleet = lw.Ensemble(scene, 3, 1, {"heading_pid.ki": lw.Uniform(0.1, 0.3), "depth_pid.ki": lw.Uniform(0.01, 0.03)})
    (loops,), why = study.Study(fleet, loop, 599.9, 599.9, 10.0, 1e-3, None, 0.01).loops(np.arange(3))
    motion, expected = loops.motion, lw.solve(fleet, t1=600.0)
    assert why.tolist() == [""] * 3
    # Without the merged lead the steps are the same but for round-off, 2000 times eps, which an unstable vehicle multiplies.
    np.testing.assert_allclose(motion.position, expected.position[-1], atol=1e-10)
    np.testing.assert_allclose(motion.attitude, expected.attitude[-1], atol=1e-10)


@pytest.mark.slow
def test_the_heading_loop_of_remus():
    vary = {"heading_pid.kp": lw.Uniform(0.7, 1.3), "heading_pid.kd": lw.Uniform(1.5, 3.0)}
    found = lw.margins(lw.Ensemble(autopilot(), 64, 1, vary), "heading_pid", by=("eigenvalues", "runs"))
    assert found.steady.all()
    for name in ("gain_lower", "gain_upper"):
        np.testing.assert_allclose(found.by_runs[name], found.values[name], rtol=1e-2)
    assert np.abs(found.by_runs["delay"] - found.values["delay"]).max() < 0.01 * 1.001


@pytest.mark.slow
@pytest.mark.parametrize("page", ["controllers/margins.md", "guide/worst_case.md"])
def test_the_snippets_of_a_page(page, tmp_path, monkeypatch):
    pytest.importorskip("control")
    monkeypatch.chdir(tmp_path)
    names = {"lw": lw, "autopilot": autopilot(), "scene": autopilot()}
    # In a page's ensembles are more members, and budgets are larger, than a test needs.
    short = {"256": "8", "200": "4", "20_000": "200", "save=lw": "budget=300, save=lw"}
    for text in re.findall(r"```python\n(.*?)```", (ROOT / "docs" / page).read_text(), re.DOTALL):
        for long, brief in short.items():
            text = text.replace(long, brief)
        exec(text, names)
    assert isinstance(names["found"], lw.Margins if "margins" in page else lw.Tuned)
