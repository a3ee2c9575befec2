# SPDX-License-Identifier: Apache-2.0
"""Standard normals that calls give: the bits of those that counters would, and runs that follow from them by closed forms."""

import pickle
import re
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
import warp as wp
from scipy import stats

import lgvi_warp as lw
from lgvi_kernels.law import add, div, mul, normals_over, ones, root  # noqa: F401

pytestmark = pytest.mark.kernel

MASS, DRAG, STRENGTH, H = 10.0, 2.0, np.array([0.3, 0.0, 1.0]), 0.1
BODY = lw.Vehicle(mass=MASS, inertia=(1.0, 1.0, 1.0), buoyancy=MASS * 9.80665)
NAMES = ["start.velocity[2]"]
X = np.linspace(0.0, 1.0, 300)[:, None]
# Members in any order, one of them twice, and the last that there can be.
INDICES = np.concatenate([np.arange(298)[::-1], [17, 2**31 - 1]])


def everything(noise_step=None, current="zero"):
    """White force and torque, a random current, and two sensors with noise, a walk and lost readings."""
    compass, gyro = (
        lw.control.Sensor(of=of, noise=0.1, drift=0.05, dropout=0.2, name=name)
        for of, name in (("heading", "compass"), ("angular_velocity", "gyro"))
    )
    controller = lw.Controller(period=2 * H, sensors=[compass, gyro], guidance=[lw.control.SetPoint(heading=0.5)],
                               laws=[lw.control.HeadingPID(kp=1.0, kd=1.0)])  # fmt: skip
    drifting = [lw.terms.GaussMarkovCurrent(standard_deviation=(0.1,) * 3, time_constant=5.0, noise_step=noise_step,
                                            start=current)] if current else []  # fmt: skip
    white = lw.terms.WrenchNoise(force=(0.0, 0.2, 1.0), torque=(0.1, 0.1, 0.1), noise_step=noise_step)
    terms = [lw.terms.Drag(linear=(DRAG,) * 6), white, *drifting, lw.terms.ControlWrench(limit=2.0)]
    return lw.Scene(BODY, terms=terms, controller=controller)


def pair(scene, **settings):
    """The same run, given its draws and drawing them."""
    known = dict(method="psi_x", h=H, t1=1.0, threads=1) | settings
    return lw.prepare(scene, NAMES, draws="given", **known), lw.prepare(scene, NAMES, **known)


STATE = ["position", "euler", "velocity", "angular_velocity"]


def assert_same_bits(scene, **settings):
    given, drawn = pair(scene, of=STATE, **settings)
    for seed in (None, 2**40 + 7):
        xi = lw.uq.draws_of(given, INDICES, seed=seed)
        found = given(X, xi)
        np.testing.assert_array_equal(found, drawn(X, seed=seed, indices=INDICES))
        assert (found != given(X, np.zeros_like(xi))).any(axis=1).all()
    return given, xi


@pytest.fixture(scope="module")
def both():
    return pair(everything(), of=STATE)


@pytest.mark.slow
def test_a_call_has_the_bits_of_the_counters():
    given, xi = assert_same_bits(everything())
    assert xi.dtype == np.float64
    assert xi.shape == (300, sum(entry.numbers for entry in given.draws))
    # Of 300 times 150 independent normals; a chance of 1e-3 for the test, whose seed is fixed.
    assert stats.kstest(xi.ravel(), "norm").pvalue > 1e-3
    assert np.abs(np.corrcoef(xi.T) - np.eye(xi.shape[1])).max() < 6.0 / np.sqrt(300)


SETTINGS = [
    ("psi_x", "float32", None, "stationary"), ("psi_x", "float32_compensated", H / 2, "zero"),
    ("psi_s", "float64", H / 2, "zero"), ("psi_s", "float64", None, "stationary"),
    ("psi_w", "float64", H / 4, "zero"), ("rk4", "float64", None, None),
    ("rk8", "float64", H / 2, None),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("method", "dtype", "noise_step", "current"), SETTINGS)
def test_every_kind_of_run_has_the_bits_of_the_counters(method, dtype, noise_step, current):
    _, xi = assert_same_bits(everything(noise_step, current), method=method, dtype=dtype)
    # What the host draws for the start has 53 bits, whatever the kernel computes with.
    assert xi.dtype == (
        np.float64 if "float64" in (dtype, "float64" if current == "stationary" else "") else np.float32
    )


@pytest.mark.slow
def test_a_kernel_that_is_compiled_otherwise_sees_the_same_draws():
    """Given draws make another kernel: here its compiler joins a sum of positions otherwise, below 1 m by 6e-8 at most."""
    given, drawn = pair(everything(None, None), of=STATE, method="rkmk4", dtype="float32")
    found, expected = given(X, lw.uq.draws_of(given, INDICES)), drawn(X, indices=INDICES)
    np.testing.assert_array_equal(found[:, 3:], expected[:, 3:])
    np.testing.assert_allclose(found[:, :3], expected[:, :3], rtol=0.0, atol=1.2e-7)


@pytest.mark.slow
@pytest.mark.parametrize("width", [2, 4, 16])
def test_every_width_has_the_bits_of_the_counters(width):
    assert_same_bits(everything(H / 2), width=width)


@pytest.mark.slow
def test_packets_of_one_lane_differ_in_the_last_digit():
    # Of plain numbers the compiler joins other products with other sums where a kernel draws and where it does not.
    given, drawn = pair(everything(H / 2), of=STATE, width=1)
    found, expected = given(X, lw.uq.draws_of(given, INDICES)), drawn(X, indices=INDICES)
    # Ten steps of a few hundred operations.
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-15)


@pytest.mark.ci
def test_what_is_drawn_is_listed(both):
    given, drawn = both
    assert given.draws == drawn.draws
    assert [(entry.of, entry.stream, entry.first, entry.spacing, entry.count, entry.size) for entry in given.draws] == [
        ("wrench_noise", "force", 0.0, H, 10, 3), ("wrench_noise", "torque", 0.0, H, 10, 3),
        ("gauss_markov_current", "current", 0.0, H, 10, 3),
        ("compass", "noise", 0.0, 2 * H, 6, 1), ("compass", "drift", 0.0, 2 * H, 6, 1),
        ("compass", "dropout", 0.0, 2 * H, 6, 1), ("gyro", "noise", 0.0, 2 * H, 6, 3),
        ("gyro", "drift", 0.0, 2 * H, 6, 3), ("gyro", "dropout", 0.0, 2 * H, 6, 1),
    ]  # fmt: skip
    columns = np.concatenate([np.arange(150)[entry.columns] for entry in given.draws])
    np.testing.assert_array_equal(columns, np.arange(150))
    assert given.draws[3].times[-1] == pytest.approx(1.0)


@pytest.mark.ci
def test_what_cannot_act_is_not_listed_and_what_varies_is():
    still = lw.prepare(lw.Scene(BODY), NAMES, of="depth", method="psi_x", h=H, t1=1.0, draws="given")
    assert still.draws == ()
    assert lw.uq.draws_of(still, [0, 1]).shape == (2, 0)
    np.testing.assert_array_equal(still(X), still(X, np.empty((300, 0))))
    white = lw.Scene(BODY, terms=[lw.terms.WrenchNoise(force=(0.0, 0.0, 1.0))])
    for vary, streams in ((NAMES, ["force"]), (["wrench_noise.torque[0]"], ["force", "torque"])):
        run = lw.prepare(white, vary, of="depth", method="psi_x", h=H, t1=1.0)
        assert [entry.stream for entry in run.draws] == streams


# Truth --------------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def white():
    """A neutral body that does not turn, with linear drag, under a white force."""
    force = lw.terms.WrenchNoise(force=STRENGTH)
    scene = lw.Scene(BODY, terms=[lw.terms.Drag(linear=(DRAG,) * 6), force])
    return pair(scene, of=["position", "velocity"], method="rk4")


@pytest.mark.slow
def test_a_white_force_on_linear_drag_is_the_recursion_of_its_normals(white):
    """rk4 on y' = A y + (0, f / m), f = S xi / sqrt(h) held over a step: y <- P y + h Q (0, f / m), two polynomials of h A."""
    given, _ = white
    (entry,) = given.draws
    assert (entry.stream, entry.count, entry.size) == ("force", 10, 3)
    A = np.array([[0.0, 1.0], [0.0, -DRAG / MASS]]) * H
    powers = [np.linalg.matrix_power(A, k) for k in range(5)]
    P = sum(power / factor for power, factor in zip(powers, (1.0, 1.0, 2.0, 6.0, 24.0), strict=True))
    Q = sum(power / factor for power, factor in zip(powers[:4], (1.0, 2.0, 6.0, 24.0), strict=True))
    rng = np.random.default_rng(0)
    for xi in (rng.normal(size=(300, 30)), 5.0 * rng.normal(size=(300, 30)).astype(np.float32), np.zeros((300, 30))):
        y = np.zeros((300, 3, 2))
        y[:, 2, 1] = X[:, 0]
        for normals in np.moveaxis(xi.reshape(300, 10, 3), 1, 0):
            y = y @ P.T + (STRENGTH * normals)[..., None] / np.sqrt(H) / MASS * (H * Q[:, 1])
        found = given(X, xi)
        np.testing.assert_allclose(found[:, :3], y[..., 0], rtol=0.0, atol=1e-13)
        np.testing.assert_allclose(found[:, 3:], y[..., 1], rtol=0.0, atol=1e-13)


@pytest.mark.slow
def test_a_sensor_measures_the_truth_with_what_is_given():
    """Truth + walk + sigma xi, and the last reading where a normal says that this one is lost."""
    sigma, walking, loss = np.array([0.5, 0.4, 0.3]), 0.2, 0.3
    sensor = lw.control.Sensor(of="position", noise=sigma, drift=walking, dropout=loss)
    controller = lw.Controller(period=H, sensors=[sensor], guidance=[lw.control.SetPoint(heading=0.5)],
                               laws=[lw.control.HeadingPID(kp=1.0, kd=1.0)])  # fmt: skip
    scene = lw.Scene(
        BODY, terms=[lw.terms.Drag(linear=(DRAG,) * 6), lw.terms.ControlWrench(limit=2.0)], controller=controller
    )
    save = lw.SaveAt(every=H, fields=("position", "measured_position"))
    run = lw.prepare(scene, NAMES, method="psi_x", h=H, t1=1.0, save=save, draws="given", threads=1)
    xi = np.random.default_rng(1).normal(size=(300, 77))
    result = run(X, xi)
    noise, steps, lost = (xi[:, entry.columns].reshape(300, 11, entry.size) for entry in run.draws)
    walk = np.cumsum(walking * np.sqrt(H) * steps, axis=1) - walking * np.sqrt(H) * steps
    fresh = np.moveaxis(result.samples["position"], 0, 1) + walk + sigma * noise
    missing = lost[..., 0] < stats.norm.ppf(loss)
    assert 0.2 < missing.mean() < 0.4
    held = fresh.copy()
    for tick in range(1, 11):
        held[:, tick] = np.where(missing[:, tick, None], held[:, tick - 1], fresh[:, tick])
    np.testing.assert_allclose(np.moveaxis(result.samples["measured_position"], 0, 1), held, rtol=0.0, atol=1e-14)


@pytest.mark.ci
def test_a_current_starts_where_it_is_told():
    current = lw.terms.GaussMarkovCurrent(standard_deviation=(0.1, 0.2, 0.3), time_constant=1e9, start="stationary")
    scene = lw.Scene(BODY, terms=[lw.terms.Drag(linear=(DRAG,) * 6), current])
    run = lw.prepare(scene, NAMES, of="velocity", method="psi_x", h=0.5, t1=200.0, draws="given", threads=1)
    assert [(entry.stream, entry.count) for entry in run.draws] == [("current", 400), ("start", 1)]
    xi = np.zeros((300, 1203))
    xi[:, -3:] = np.random.default_rng(2).normal(size=(300, 3))
    # After forty times the time constant of the drag the body moves with the water, which keeps its velocity.
    np.testing.assert_allclose(run(X, xi), xi[:, -3:] * [0.1, 0.2, 0.3], rtol=0.0, atol=1e-6)


@wp.func
def gust_law(w: Any, view: Any, p: Any):
    unity = ones(view.b.x)
    w.force = w.force + (unity / root(view.h * unity)) * (p.strength * normals_over(view, p.key, 1))
    return w


class Device:
    NOISE = True
    law = gust_law


@dataclass(frozen=True, eq=False, kw_only=True)
class Gust(lw.laws.NoisyTerm):
    type: ClassVar[str] = "gust_of_given_draws"
    device: ClassVar[Any] = Device
    strength: Any = lw.laws.number((3,), "N s^1/2", axes="vector")


@pytest.mark.slow
def test_a_law_of_a_user_takes_them_too():
    """Between rows of others, held to its own: the sum of its second stream, as a force that is held over a step."""
    scene = lw.Scene(
        BODY, terms=[lw.terms.WrenchNoise(force=(1e-30, 0.0, 0.0)), Gust(strength=STRENGTH, noise_step=H / 2)]
    )
    given, drawn = pair(scene, of="velocity", method="rk4")
    assert [(entry.of, entry.stream, entry.count) for entry in given.draws] == [
        ("wrench_noise", "force", 10), ("gust_of_given_draws", "0", 20), ("gust_of_given_draws", "1", 20)]  # fmt: skip
    xi = lw.uq.draws_of(given, INDICES)
    found = given(X, xi)
    np.testing.assert_array_equal(found, drawn(X, indices=INDICES))
    impulse = np.sqrt(H / 2) * STRENGTH * xi[:, -60:].reshape(300, 20, 3).sum(axis=1)
    np.testing.assert_allclose(found, X * [0.0, 0.0, 1.0] + impulse / MASS, rtol=0.0, atol=1e-13)


# Calls of other kinds -----------------------------------------------------------------------------------------------------


@pytest.mark.ci
def test_normals_stay_with_their_members(white):
    """Many members at a time for quantities over paths, one member, a block that is not full, states, levels, a pickle."""
    given, _ = white
    rng = np.random.default_rng(3)
    xi = rng.normal(size=(300, 30))
    whole = given(X, xi)
    order = rng.permutation(300)
    np.testing.assert_array_equal(given(X[order], xi[order]), whole[order])
    np.testing.assert_array_equal(given(X[7:8], xi[7:8]), whole[7:8])
    np.testing.assert_array_equal(given(X[:5], np.asfortranarray(xi)[:5]), whole[:5])
    np.testing.assert_array_equal(given(X[:5], xi[:5].tolist()), whole[:5])
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(given))(X, xi), whole)
    np.testing.assert_array_equal(given(X, xi), whole)
    velocity = np.zeros((300, 3))
    velocity[:, 2] = X[:, 0]
    state = np.zeros((300, 3)), np.tile(np.eye(3), (300, 1, 1)), velocity, np.zeros((300, 3))
    np.testing.assert_array_equal(given.states(*state, xi=xi), whole)
    many = rng.uniform(size=(16_500, 1))
    scene = lw.Scene(BODY, terms=[lw.terms.Drag(linear=(DRAG,) * 6), lw.terms.WrenchNoise(force=STRENGTH)])
    over, counted = pair(scene, of="max(depth)", method="rk4", save=lw.SaveAt(every=0.5))
    index = np.arange(16_500) + 7
    np.testing.assert_array_equal(over(many, lw.uq.draws_of(over, index)), counted(many, indices=index))
    by_level = lw.prepare(
        scene, {NAMES[0]: lw.distributions.Uniform(0.0, 1.0)}, of=["position", "velocity"], levels=True, draws="given",
        method="rk4", h=H, t1=1.0, threads=1)  # fmt: skip
    inside = slice(1, 299)
    np.testing.assert_array_equal(by_level(X[inside], xi[inside]), whole[inside])


@pytest.mark.slow
def test_processes_get_the_normals_of_their_members(white):
    given, _ = white
    scene = lw.Scene(BODY, terms=[lw.terms.Drag(linear=(DRAG,) * 6), lw.terms.WrenchNoise(force=STRENGTH)])
    elsewhere, _ = pair(scene, of=["position", "velocity"], method="rk4", executor="processes", threads=2)
    xi = np.random.default_rng(4).normal(size=(300, 30))
    np.testing.assert_array_equal(elsewhere(X, xi), given(X, xi))


@pytest.mark.ci
def test_default_members_and_seed_are_those_of_the_ensemble():
    scene = lw.Scene(BODY, terms=[lw.terms.WrenchNoise(force=STRENGTH)])
    fleet = lw.Ensemble(scene, 5, 3, {NAMES[0]: lw.distributions.Normal(std=1.0)})
    run = lw.prepare(fleet, of="depth", method="psi_x", h=H, t1=1.0, draws="given", threads=1)
    xi = lw.uq.draws_of(run)
    np.testing.assert_array_equal(xi, lw.uq.draws_of(run, np.arange(5), seed=3))
    np.testing.assert_array_equal(xi[:2], lw.uq.draws_of(run, members=2))
    drawn = lw.prepare(fleet, of="depth", method="psi_x", h=H, t1=1.0, threads=1)
    np.testing.assert_array_equal(run(xi=xi), drawn())
    np.testing.assert_array_equal(lw.uq.draws_of(drawn), xi)


@pytest.mark.ci
def test_a_failed_member_fails_alone(white):
    given, _ = white
    mild = lw.prepare(
        lw.Scene(BODY, terms=[lw.terms.Drag(linear=(DRAG,) * 6), lw.terms.WrenchNoise(force=STRENGTH)]), NAMES,
        of=["position", "velocity"], method="rk4", h=H, t1=1.0, threads=1, draws="given", failed="nan")  # fmt: skip
    xi = np.random.default_rng(5).normal(size=(300, 30))
    whole = given(X, xi)
    xi[4, 3] = 1e308
    found = mild(X, xi)
    assert np.isnan(found[4]).all()
    np.testing.assert_array_equal(np.delete(found, 4, axis=0), np.delete(whole, 4, axis=0))


# What is refused ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("words", "more"), [
    (r"xi = None is missing.*shape \(300, 30\), such as lw.uq.draws_of", {"xi": None}),
    (r"xi = .* has shape \(300, 29\). Give standard normals of shape \(300, 30\)", {"xi": np.zeros((300, 29))}),
    (r"xi = .* has shape \(30,\)", {"xi": np.zeros(30)}), (r"xi = .* has shape \(1, 30\)", {"xi": np.zeros((1, 30))}),
    (r"xi = nan is not finite in row 2, column 17 \(wrench_noise, force\)", {"xi": "nan"}),
    (r"xi = -?inf is not finite in row 2, column 17", {"xi": "inf"}), ("xi = ", {"xi": np.full((300, 30), 1j)}),
    (r"xi = ", {"xi": [["a"] * 30] * 300}), (r"seed = 3 says whose noise.*draws_of\(run, indices, seed=", {"seed": 3}),
    (r"indices = .* says whose noise", {"indices": np.arange(300)}),
])  # fmt: skip
def test_normals_that_are_wrong_are_refused(white, words, more):
    given, _ = white
    odd = {"nan": np.nan, "inf": np.inf}
    xi = more.pop("xi", np.zeros((300, 30)))
    if isinstance(xi, str):
        value, xi = odd[xi], np.zeros((300, 30))
        xi[2, 17] = value
    with pytest.raises(lw.SceneError, match=words):
        given(X, xi, **more)


def test_other_arguments_that_do_not_go_together_are_refused(white):
    given, drawn = white
    with pytest.raises(
        lw.SceneError, match=r'xi = .* is given to a run that draws its noise. Prepare the run with draws="given"'
    ):
        drawn(X, np.zeros((300, 30)))
    scene = everything()
    with pytest.raises(lw.SceneError, match=r'common_noise = True says whose noise.*draws="given"'):
        lw.prepare(scene, NAMES, draws="given", common_noise=True, h=H, t1=1.0)
    with pytest.raises(lw.SceneError, match=r"draws = 'givn' .*given"):
        lw.prepare(scene, NAMES, draws="givn", h=H, t1=1.0)
    with pytest.raises(lw.SceneError, match=r"members = 3 is given beside indices"):
        lw.uq.draws_of(given, [0, 1], members=3)
    with pytest.raises(lw.SceneError, match=r"indices = .*from 0"):
        lw.uq.draws_of(given, [-1])
    with pytest.raises(lw.SceneError, match=r"indices = .*from 0"):
        lw.uq.draws_of(given, [[1], [1, 2]])
    with pytest.raises(lw.SceneError, match=r"run = .* is not a prepared run"):
        lw.uq.draws_of(lambda X: X)


def test_more_than_a_gigabyte_is_refused_with_the_sum(white):
    given, _ = white
    # A view of one number: nothing of it is in memory.
    large = np.broadcast_to(0.0, (5_000_000, 30))
    words = re.escape(
        "5,000,000 members times 30 normals of 8 bytes, 1.2 GB. Call with fewer members at once, at most 4,166,666"
    )
    with pytest.raises(lw.SceneError, match=words):
        given(np.broadcast_to(0.0, (5_000_000, 1)), large)
    with pytest.raises(lw.SceneError, match=words):
        lw.uq.draws_of(given, members=5_000_000)


def test_what_varies_without_being_named_may_not_draw(white):
    """A parameter that makes a stream act which `draws` does not list."""
    given, _ = white
    state = np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3)), np.zeros((2, 3))
    torque = {"wrench_noise.torque": np.ones((2, 3))}
    with pytest.raises(
        lw.SceneError, match=r"parameters = 'wrench_noise.torque' make something draw .*Name what varies"
    ):
        given.states(*state, torque, xi=np.zeros((2, 30)))
