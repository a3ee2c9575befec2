# SPDX-License-Identifier: Apache-2.0
"""Margins of loops: beside those of the sampled system written by hand, and by runs in lanes; one kernel."""

import dataclasses

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.control import AllocationMatrix, DepthPID, HeadingPID, Sensor, SetPoint, SpeedPID
from lgvi_warp.control.loop_gain import FACTOR
from lgvi_warp.distributions import Choice, Uniform
from lgvi_warp.robustness.linear import loops as study
from lgvi_warp.robustness.linear.edges import edges
from lgvi_warp.robustness.linear.sampled_loop import DELAY, SampledLoop
from lgvi_warp.scene.settings import RunSettings
from lgvi_warp.terms import ControlWrench, Drag, Thrusters
from tests.support.pages import blocks
from tests.support.refusals import says
from tests.support.unsettled_loops import LOOPS, STEP, fleet_of

J, PERIOD, H, EVERY = 11.0, 0.1, 0.02, 5
MEMBERS = 6


def scene(delay=0.0, laws=(), **gains):
    """A neutral body that turns its head."""
    law = HeadingPID(**{"kp": 6.0, "ki": 0.8, "kd": 9.0} | gains)
    controller = lw.Controller(
        period=PERIOD, delay=delay, guidance=[SetPoint(heading=0.0)], laws=[law, *laws],
        allocation=[AllocationMatrix(to="control_wrench", matrix=np.eye(6))])  # fmt: skip
    vehicle = lw.Vehicle(
        20.0, inertia=(5.0, 8.0, J), added_mass=(0.0, 0.0, 0.0), buoyancy=200.0, center_of_buoyancy=(0.0, 0.0, 0.0)
    )
    return lw.Scene(vehicle, lw.Environment(10.0), [ControlWrench()], controller=controller)


@pytest.fixture(scope="module")
def fleet():
    vary = {
        "heading_pid.kp": Uniform(4.0, 8.0), "heading_pid.kd": Uniform(7.0, 12.0),
        "heading_pid.ki": Uniform(0.4, 1.2),
        "controller.delay": Choice([0.0, 0.06, 0.12])}  # fmt: skip
    return lw.Ensemble(scene(delay=0.06), MEMBERS, 5, vary)


@pytest.fixture(scope="module")
def found(fleet):
    return lw.linear.margins(fleet, "heading_pid", by=("eigenvalues", "runs"), about=80.0, method="psi_s", h=H)


def radius(kp, ki, kd, g, steps, T=PERIOD, drag=0.0):
    """Largest eigenvalue of the sampled loop: angle, rate, integral, and the torques that are on their way."""
    h = T / EVERY
    q, s = divmod(steps, EVERY)
    late = s * h

    def left(t):
        """The time for which a rate of 1 turns in t seconds: (1 - exp(-drag t / J)) J / drag."""
        return -np.expm1(-drag * t / J) * J / drag if drag else t

    def push(t):
        """Angle and rate after a torque that acts for the last t seconds of a period."""
        return np.array([(t - left(t)) / drag if drag else 0.5 * t**2 / J, left(t) / J])

    A = np.zeros((3 + q + 2, 3 + q + 2))
    A[:2, :2] = [[1.0, left(T)], [0.0, 1.0 - drag * left(T) / J]]
    A[:2, 3 + q] = push(T - late)
    A[:2, 4 + q] = push(T) - push(T - late)
    A[2, :3] = -T, 0.0, 1.0
    A[3] = g * (-kp * A[0] - kd * A[1] + ki * A[2])
    A[4:, 3:-1] = np.eye(q + 1)
    if not ki:
        # An integral that nothing uses.
        A = np.delete(np.delete(A, 2, 0), 2, 1)
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


@pytest.mark.ci
def test_margins_by_eigenvalues_are_those_of_the_system_by_hand(fleet, found):
    expected = by_hand(fleet, 1.0)
    assert found.steady.all()
    assert len(set(np.round(expected["delay"] / H))) > 2
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


@pytest.mark.ci
@pytest.mark.parametrize(
    "steps", [3, pytest.param(0, marks=pytest.mark.slow), pytest.param(11, marks=pytest.mark.slow)]
)
def test_the_poles_of_a_closed_loop_with_a_delay_are_those_of_the_system_by_hand(steps):
    closed = lw.linear.linearize(scene(delay=steps * H), 80.0, closed=True, method="psi_s", h=H)
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
    assert np.all(np.diff(values) >= 0.0)
    assert part[-1] == 1.0
    assert found.members == MEMBERS
    assert found.worst(1)[0] == np.argmin(found.values["gain_upper"])
    assert found.worst(1, "gain_lower")[0] == np.argmax(found.values["gain_lower"])
    says(str(found), "gain_upper", "delay s")


@pytest.mark.ci
def test_a_loop_that_does_not_settle_has_no_margins():
    loops = lw.Ensemble.from_states(
        scene(delay=0.06), np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3)), np.zeros((2, 3)),
        {"heading_pid.kd": np.array([9.0, 2.1 * J / PERIOD])})  # fmt: skip
    found = lw.linear.margins(loops, None, "gain", about=1.0, method="psi_s", h=H)
    assert (found.steady.tolist(), found.loop) == ([True, False], "all laws")
    assert np.isnan(found.values["gain_upper"][1])
    assert np.isfinite(found.values["gain_upper"][0])
    assert found.why.tolist() == ["", "does not settle"]
    assert "1 of them have none" in str(found)
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
    assert (found[0, 1], found[1, 1], found[2, 1]) == (np.inf, 0.0, np.inf)
    assert np.isnan(found[3]).all()
    counts = rng.integers(0, 100, 50).astype(float)
    inside = edges(
        lambda v, i: v <= counts[i], np.zeros(50), np.full(50, 60.0), np.full(50, np.nan), 1.0, whole_numbers=True
    )
    np.testing.assert_array_equal(inside[:, 0], np.minimum(counts, 60.0))
    assert np.array_equal(np.isinf(inside[:, 1]), counts >= 60.0)


@pytest.mark.parametrize(("words", "message"), [
    ({"loop": "heding_pid"}, "Did you mean 'heading_pid'"), ({"of": "frequency"}, "of = 'frequency'"),
    ({"of": [["gain"]]}, r"of = \['gain'\] is not a name"),
    ({"by": "guess"}, "by = 'guess'"), ({"seconds": 0.0}, "seconds"), ({"seconds": 1.0}, "is less than 30 ticks"),
])  # fmt: skip
def test_bad_arguments(words, message):
    with pytest.raises(lw.SceneError, match=message):
        lw.linear.margins(scene(), **words, h=H)


def test_what_is_no_scene():
    for ask, words in (
        (lw.linear.trim, {}), (lw.linear.linearize, {}), (lw.linear.margins, {}),
        (lw.worst_case, {"within": {}, "of": "depth"}),
        (lw.tune_gains, {"over": {}, "minimise": "depth"}),
    ):  # fmt: skip
        with pytest.raises(lw.SceneError, match="is neither"):
            ask("scene.toml", **words)


@pytest.mark.ci
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
    with pytest.raises(lw.SceneError, match="controller = None is not in the scene"):
        lw.linear.margins(dataclasses.replace(scene(), controller=None), h=H)
    whole = scene()
    late = dataclasses.replace(whole.controller, sensors=[Sensor(of="heading", latency=2.0)])
    with pytest.raises(lw.SceneError, match=r"sensor\.latency.*has no linear model"):
        lw.linear.margins(dataclasses.replace(whole, controller=late), h=H)


def autopilot():
    """REMUS 100, ballasted, on a straight way."""
    start = lw.Start(velocity=(1.54, 0.0, 0.0))
    controller = lw.Controller(
        period=0.1, guidance=[SetPoint(heading=0.0, depth=0.0)],
        laws=[HeadingPID(kp=1.0, kd=2.0, ki=0.02),
              DepthPID(kp=0.1, ki=0.001, kp_pitch=5.0, ki_pitch=0.3, kd_pitch=2.0, pitch_limit=0.5)],
        allocation=[AllocationMatrix(to="control_fins",
                                                matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])])  # fmt: skip
    run = RunSettings(method="psi_x", step=0.01, duration=20.0, save_every=1.0)
    return lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0}, start=start, controller=controller, run=run)


@pytest.mark.slow
@pytest.mark.parametrize("loop", ["depth_pid", None])
def test_a_factor_of_1_changes_nothing(loop):
    """Laws with integrals of their own, whose demands are added: the factor is that of one, or of both."""
    scene = dataclasses.replace(autopilot(), start=lw.Start(velocity=(1.54, 0.0, 0.0), position=(0.0, 0.0, 1.0)))
    fleet = lw.Ensemble(scene, 3, 1, {"heading_pid.ki": Uniform(0.1, 0.3), "depth_pid.ki": Uniform(0.01, 0.03)})
    members = study.Study(fleet, loop, 20.0, 20.0, 10.0, 1e-3, None, 0.01)
    numbers = {FACTOR: np.ones((3, 6)), DELAY: np.zeros(3)}
    motion = members.bench.run(np.arange(3), None, 0, members.begin, numbers)
    expected = lw.solve(fleet, t1=20.0)
    # Without the merged lead the steps are the same but for round-off, 2000 times eps, which an unstable vehicle multiplies.
    np.testing.assert_allclose(motion.position, expected.position[-1], atol=1e-10)
    np.testing.assert_allclose(motion.attitude, expected.attitude[-1], atol=1e-10)


@pytest.mark.slow
def test_the_heading_loop_of_remus():
    vary = {"heading_pid.kp": Uniform(0.7, 1.3), "heading_pid.kd": Uniform(1.5, 3.0)}
    found = lw.linear.margins(lw.Ensemble(autopilot(), 64, 1, vary), "heading_pid", by=("eigenvalues", "runs"))
    assert found.steady.all()
    for name in ("gain_lower", "gain_upper"):
        np.testing.assert_allclose(found.by_runs[name], found.values[name], rtol=1e-2)
    assert np.abs(found.by_runs["delay"] - found.values["delay"]).max() < 0.01 * 1.001


@pytest.mark.slow
@pytest.mark.parametrize("page", ["docs/controllers/margins.md", "docs/guide/worst_case.md"])
def test_the_snippets_of_a_page(page, tmp_path, monkeypatch):
    pytest.importorskip("control")
    monkeypatch.chdir(tmp_path)
    names = {"lw": lw, "autopilot": autopilot(), "scene": autopilot()}
    # In a page's ensembles are more members, and budgets are larger, than a test needs.
    short = {"256": "8", "200": "4", "2_000": "200", "10_000": "300"}
    for text in blocks(page, "python"):
        for long, brief in short.items():
            text = text.replace(long, brief)
        exec(text, names)
    assert isinstance(names["found"], lw.linear.Margins if "margins" in page else lw.studies.Tuned)


def unsettled(name, vehicle, vary, members, by):
    """Margins of a loop that settles for nobody, as runs of the fleet show."""
    fleet = fleet_of(vehicle, vary, members)
    late = lw.SaveAt(at=np.arange(400.0, 600.5, 0.5).tolist(), fields=("angular_velocity", "position"))
    found = lw.solve(fleet, method="psi_x", h=STEP, t1=600.0, save=late)
    # After 400 s, rates swing ten times as far as what counts as settled at most; or the depth runs away; or the run fails.
    rates, depths = (np.ptp(each[1:], axis=0) for each in (found.angular_velocity, found.position[..., 2]))
    assert ((rates.max(axis=1) > 0.1) | (depths > 10.0) | ~np.isfinite(depths)).all(), name
    found = lw.linear.margins(fleet, None, "gain", by=by, method="psi_x", h=STEP)
    return found


def nobody(found):
    columns = [*found.values.values(), *found.by_runs.values()]
    return not found.steady.any() and all(np.isnan(column).all() for column in columns) and "" not in found.why


@pytest.mark.slow
def test_of_loops_that_do_not_settle_none_is_steady():
    for name, vehicle, vary in LOOPS:
        assert nobody(unsettled(name, vehicle, vary, 128, ("eigenvalues", "runs"))), name


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", ["remus", "rov"])
def test_loops_that_settle_have_margins(vehicle):
    found = lw.linear.margins(
        fleet_of(vehicle, {}, 16), None, "gain", by=("eigenvalues", "runs"), method="psi_x", h=STEP
    )
    assert found.steady.all()
    assert set(found.why) == {""}
    assert (found.values["gain_upper"] > 1.2).all()


def sampled(limit=49.85, heading=0.0, most=1e6, **gains):
    """A heading loop of 0.05 s whose gain limit is known: of a double integrator with kp, kd it is 2 J / (T kd)."""
    one = scene(kp=6.0, ki=0.0, kd=2.0 * J / (0.05 * limit), **gains)
    controller = dataclasses.replace(one.controller, period=0.05, guidance=[SetPoint(heading=heading)])
    return dataclasses.replace(one, controller=controller, terms=[ControlWrench(limit=[most] * 6)])


@pytest.mark.ci
@pytest.mark.slow_for("240.0-1e-05-*", "900.0-*")
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("seconds", "tilt", "heading", "most"), [
    (60.0, 1e-3, 0.0, 1e6), (240.0, 1e-3, 0.8, 5.0), (240.0, 1e-5, 0.0, 1e6), (900.0, 1e-3, 0.8, 1e6),
])  # fmt: skip
def test_a_gain_limit_that_is_known_for_any_length_of_runs_heading_and_limit(seconds, tilt, heading, most):
    """At 0.8 rad, round-off couples neutral velocities to the others; beyond the limit swings saturate, and headings wrap."""
    one = sampled(heading=heading, most=most)
    for by, asked in (("eigenvalues", ("eigenvalues",)), ("runs", ("runs",)), ("runs", ("eigenvalues", "runs"))):
        found = lw.linear.margins(
            one, "heading_pid", "gain", by=asked, seconds=seconds, tilt=tilt, method="psi_s", h=0.01
        )
        values = found.to_dict()[by]
        assert found.steady.all()
        assert values["gain_lower"][0] < 0.02
        # Of the eigenvalues by differences, 1e-10, and brackets; of runs 3 % in a third of them, 1e-4, and half of a bracket.
        assert values["gain_upper"][0] == pytest.approx(49.85, rel=1e-5 if by == "eigenvalues" else 3e-3)


@pytest.mark.ci
def test_runs_judge_swings_by_angles_and_not_by_parts_of_limits():
    """A demand of 60 N m/rad at factors up to 5 is 60 tilts of a limit of 5 N m: small all the same, since it shrinks."""
    one = dataclasses.replace(scene(delay=0.06, kp=60.0, ki=0.0, kd=20.0), terms=[ControlWrench(limit=[5.0] * 6)])
    expected = edge(lambda g: radius(60.0, 0.0, 20.0, g, 3) < study.SHRINKS ** (PERIOD / 80.0), 1.0, 100.0)
    for seconds in (240.0, 900.0):
        found = lw.linear.margins(one, None, "gain", by="runs", seconds=seconds, method="psi_s", h=H)
        # Half of a bracket, and that a run of 900 s comes nearer to the edge.
        assert found.by_runs["gain_upper"][0] == pytest.approx(expected, rel=3e-3 if seconds == 240.0 else 1e-2)


@pytest.mark.ci
@pytest.mark.slow_for("0.3076565-*")
@pytest.mark.parametrize(("kp", "ki", "kd", "drag", "steps", "most", "tilt"), [
    # Beyond the limit a swing that starts from 1e-5 rad wraps around, where its last third is by chance below its second.
    (5.1206017, 0.0, 1.5507809, 1.4798703, 13, 7920.0, 1e-5),
    # Swings of commands far above ten thousandths of their limits; a slow integral behind a fast mode.
    (1.7977004, 0.0545263, 0.0997715, 6.5997012, 10, 1.37, 1e-3),
    (0.3076565, 0.0036990, 2.4844341, 3.8696209, 12, 279.0, 1e-3),
])  # fmt: skip
def test_swings_that_wrap_and_slow_integrals(kp, ki, kd, drag, steps, most, tilt):
    assert radius(kp, ki, kd, 49.84, steps, 0.05, drag) < 1.0 < radius(kp, ki, kd, 49.86, steps, 0.05, drag)
    one = scene(delay=0.01 * steps, kp=kp, ki=ki, kd=kd)
    acting = [ControlWrench(limit=[most] * 6), Drag(linear=[drag] * 6)]
    one = dataclasses.replace(one, controller=dataclasses.replace(one.controller, period=0.05), terms=acting)
    found = lw.linear.margins(one, "heading_pid", "gain", by=("eigenvalues",), tilt=tilt, method="rk4", h=0.01)
    by_runs = lw.linear.margins(one, "heading_pid", "gain", by="runs", tilt=tilt, method="rk4", h=0.01).by_runs
    assert found.values["gain_upper"][0] == pytest.approx(49.85, rel=1e-3)
    assert by_runs["gain_upper"][0] == pytest.approx(49.85, rel=1e-2)


@pytest.mark.slow
def test_saturated_members_whose_sampled_loop_grows_are_never_steady():
    """Random gains: the loop by hand grows or not, whatever a torque at its limit shows at the time that is looked at."""
    rng = np.random.default_rng(4)
    n = 64
    gains = {name: rng.uniform(low, high, n) for name, low, high in (("kp", -6.0, 8.0), ("kd", -4.0, 400.0),
                                                                     ("ki", 0.0, 3.0))}  # fmt: skip
    radii = np.array([radius(*each, 1.0, 0) for each in zip(gains["kp"], gains["ki"], gains["kd"], strict=True)])
    spins, eye, zero = rng.normal(0.0, 0.1, (n, 3)), np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3))
    numbers = {f"heading_pid.{name}": values for name, values in gains.items()}
    one = dataclasses.replace(scene(), terms=[ControlWrench(limit=[2.0] * 6)])
    fleet = lw.Ensemble.from_states(one, zero, eye, zero, spins * [0.0, 0.0, 1.0], numbers)
    assert (radii > 1.0).sum() > n / 4
    assert (radii < 0.99).any()
    for by in ("eigenvalues", "runs"):
        found = lw.linear.margins(fleet, None, "gain", by=by, about=5.0, method="psi_s", h=H)
        assert not found.steady[radii > 1.0].any(), by
        assert set(found.why[radii > 1.0]) <= {"does not settle", "at its limit: control_wrench[5]"}
        assert found.steady.any()
        assert (radii[found.steady] < 1.0).all()


def turning(terms, allocation, laws=(), **wanted):
    guidance = [SetPoint(heading=0.3, **wanted)]
    law = HeadingPID(kp=6.0, kd=9.0)
    controller = lw.Controller(period=PERIOD, guidance=guidance, laws=[law, *laws], allocation=[allocation])
    return dataclasses.replace(scene(), terms=terms, controller=controller)


@pytest.mark.slow
def test_members_at_a_limit_and_members_that_fail_are_named():
    """A speed that drag does not allow: 1 N against 10 N s/m makes 0.1 m/s."""
    acting = [ControlWrench(limit=[1.0] * 5 + [50.0]), Drag(linear=[10.0] * 3 + [1.0] * 3)]
    one = turning(acting, AllocationMatrix(to="control_wrench", matrix=np.eye(6)), [SpeedPID(kp=20.0)], speed=0.5)
    zero, eye = np.zeros((3, 3)), np.tile(np.eye(3), (3, 1, 1))
    spins = zero.copy()
    spins[2] = 5.0 / H
    limits = {"control_wrench.limit": np.array([[1.0] * 6, [20.0] * 6, [20.0] * 6])}
    fleet = lw.Ensemble.from_states(one, zero, eye, zero, spins, limits)
    for by in ("eigenvalues", "runs"):
        found = lw.linear.margins(fleet, "heading_pid", "delay", by=by, method="psi_s", h=H)
        assert found.why.tolist() == ["at its limit: control_wrench[0]", "", "failed"]
        assert "1: at its limit: control_wrench[0]; 1: failed" in str(found)
        assert [value is None for value in found.to_dict()[by]["delay"]] == [True, False, True]


@pytest.mark.slow
def test_a_loop_within_a_dead_band_moves_nothing():
    pushes = Thrusters(position=[[0.0, 0.3, 0.0], [0.0, -0.3, 0.0]], direction=[[1.0, 0.0, 0.0]] * 2,
                          coefficient=[40.0] * 2, dead_band=[0.1] * 2, limit=[1.0] * 2)  # fmt: skip
    matrix = [[0, 0, 0, 0, 0, -0.1], [0, 0, 0, 0, 0, 0.1]]
    one = turning([pushes, Drag(linear=[10.0] * 3 + [1.0] * 3)], AllocationMatrix(to="thrusters", matrix=matrix))
    one = dataclasses.replace(one, start=lw.Start(euler_deg=[0.0, 0.0, np.rad2deg(0.3)]))
    found = lw.linear.margins(one, None, "gain", method="psi_s", h=0.03)
    assert "step shortened from 0.03 s to 0.025 s" in str(found)
    assert found.to_dict()["messages"] == list(found.messages)
    assert found.why.tolist() == ["moves nothing"]
    assert np.isnan(found.values["gain_upper"][0])


@pytest.mark.ci
@pytest.mark.parametrize("by", ["eigenvalues", "runs"])
def test_noise_is_taken_as_its_mean_and_faults_as_off(by):
    """A fault whose time varies, too: margins are those of the loop without them, to the bit, and say what they leave out."""
    whole = scene()
    words = {"noise": 0.1, "drift": 0.01} | ({"quantum": 0.02} if by == "eigenvalues" else {})
    sensor, clean = (Sensor(of="heading", bias=0.05, **more) for more in (words, {}))
    fault = lw.control.Fault(name="dead", of="sensor", time=3.0, gain=0.0)
    noisy = dataclasses.replace(
        whole, controller=dataclasses.replace(whole.controller, sensors=[sensor], faults=[fault])
    )
    quiet = dataclasses.replace(whole, controller=dataclasses.replace(whole.controller, sensors=[clean]))
    vary = {"dead.time": Uniform(1.0, 9.0)}
    found = lw.linear.margins(lw.Ensemble(noisy, 2, 1, vary), by=by, h=H, about=20.0)
    expected = lw.linear.margins(lw.Ensemble(quiet, 2, 1), by=by, h=H, about=20.0)
    for name, values in expected.values.items():
        np.testing.assert_array_equal(found.values[name], values)
    (text,) = found.messages
    assert text.startswith("of the loop as a linear one: sensor.noise, sensor.drift")
    assert "dead taken as off" in text
    assert expected.messages == ()
    with pytest.raises(lw.SceneError, match=r"sensor\.noise.*varies, where margins take it as 0"):
        lw.linear.margins(lw.Ensemble(noisy, 2, 1, {"sensor.noise": Uniform(0.0, 0.2)}), by=by, h=H)


@pytest.mark.ci
def test_a_closed_model_leaves_out_what_has_the_mean_0():
    whole = scene()
    sensor, clean = (Sensor(of="heading", **more) for more in ({"noise": 0.1, "quantum": 0.1}, {}))
    noisy, quiet = (
        dataclasses.replace(whole, controller=dataclasses.replace(whole.controller, sensors=[each]))
        for each in (sensor, clean)
    )
    found, expected = (lw.linear.linearize(each, 1.0, closed=True, h=H) for each in (noisy, quiet))
    np.testing.assert_array_equal(found.A, expected.A)
    assert "sensor.noise, sensor.quantum taken as 0" in found.messages[0]
    assert expected.messages == ()
