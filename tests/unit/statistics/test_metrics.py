# SPDX-License-Identifier: Apache-2.0
"""Metrics by themselves: analytic step responses, python-control's step_info, members that end, batches, the user's own."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.status import Status
from lgvi_warp.statistics.ends import Ends
from lgvi_warp.statistics.values.values import Values

# A member that an event stopped.
STOPPED = int(next(status for status in Status if status.stopped))
ZETA, OMEGA = np.array([0.2, 0.5, 0.7]), np.array([1.0, 2.0, 0.5])
T = np.linspace(0.0, 60.0, 6_001)


def step_response(t, zeta, omega):
    """The response of omega^2 / (s^2 + 2 zeta omega s + omega^2) to a step of 1."""
    damped = omega * np.sqrt(1.0 - zeta**2)
    return 1.0 - np.exp(-zeta * omega * t) * (np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t))


RESPONSES = step_response(T[:, None], ZETA, OMEGA)


def number(metric, x, t=T, good=None, ended=np.inf, lost=False, batches=(7, 1_000), replicates=1):
    """The numbers of members with samples x (k, d, n), taken in batches."""
    members = x.shape[2]
    gatherer = metric.open(t, members)
    edges = [0, *[b for b in batches if b < len(t)], len(t)]
    for first, stop in zip(edges[:-1], edges[1:], strict=True):
        part = None if good is None else good[first:stop]
        gatherer.take(Values(x[first:stop].copy(), part, 0, 0, members, replicates), slice(first, stop))
    time = np.broadcast_to(np.where(np.isinf(ended), t[-1], ended), members)
    status = np.broadcast_to(np.where(np.isinf(ended), 0, 1 if lost else STOPPED), members).astype(np.uint8)
    gatherer.end(Ends(status, np.zeros(members, int), time), replicates)
    estimates = metric.estimates([gatherer.close()], t)
    return estimates[-1].value[0, 0]


def course(y, goal=1.0):
    """Samples of a number and its goal."""
    return np.stack([y, np.broadcast_to(goal, y.shape)], axis=1)


def each(kind, *args, **settings):
    return kind(*args, then=[lw.statistics.MemberValues()], **settings)


def test_second_order_steps_have_their_analytic_numbers():
    damped = OMEGA * np.sqrt(1.0 - ZETA**2)
    over = np.exp(-np.pi * ZETA / np.sqrt(1.0 - ZETA**2))
    dt = T[1]
    # A tick is at most dt / 2 from the peak, where the curvature is at most omega^2: an error of omega^2 dt^2 / 8.
    bound = OMEGA**2 * dt**2 / 8.0
    assert np.all(np.abs(number(each(lw.metrics.Overshoot, "depth"), course(RESPONSES)) - over) <= bound)
    percent = number(each(lw.metrics.Overshoot, "depth", percent=True), course(RESPONSES))
    assert np.all(np.abs(percent - 100.0 * over) <= 100.0 * bound)
    assert np.all(np.abs(number(each(lw.metrics.Peak, "depth"), course(RESPONSES)) - 1.0 - over) <= bound)
    assert np.all(np.abs(number(each(lw.metrics.PeakTime, "depth"), course(RESPONSES)) - np.pi / damped) <= 0.5001 * dt)
    assert np.all(number(each(lw.metrics.Undershoot, "depth"), course(RESPONSES)) == 0.0)
    # The integral of e^2 of such a step is (1 + 4 zeta^2) / (4 zeta omega), of e itself 2 zeta / omega.
    ise = number(each(lw.metrics.ISE, "depth"), 1.0 - RESPONSES[:, None])
    np.testing.assert_allclose(ise, (1.0 + 4.0 * ZETA**2) / (4.0 * ZETA * OMEGA), rtol=1e-4)


def test_a_step_downward_or_from_elsewhere_is_the_same():
    up = [
        number(each(kind, "depth"), course(RESPONSES))
        for kind in (lw.metrics.Overshoot, lw.metrics.RiseTime, lw.metrics.SettlingTime)
    ]
    down = course(7.0 - 4.0 * RESPONSES, 3.0)
    np.testing.assert_allclose(number(each(lw.metrics.Overshoot, "depth"), down), 4.0 * up[0], rtol=1e-9)
    np.testing.assert_allclose(number(each(lw.metrics.Peak, "depth"), down), 3.0 - 4.0 * up[0], rtol=1e-9)
    # Round-off may move a tick across a limit.
    for kind, value in ((lw.metrics.RiseTime, up[1]), (lw.metrics.SettlingTime, up[2])):
        assert np.all(np.abs(number(each(kind, "depth"), down) - value) <= 1.001 * T[1])


def test_step_info_of_python_control_says_the_same():
    control = pytest.importorskip("control")
    y = np.concatenate([RESPONSES, -0.1 * np.sin(T[:, None]) * (T[:, None] < 3.0) + RESPONSES[:, 1:2]], axis=1)
    x = course(y)
    names = {
        "RiseTime": each(lw.metrics.RiseTime, "depth"), "SettlingTime": each(lw.metrics.SettlingTime, "depth"),
        "Overshoot": each(lw.metrics.Overshoot, "depth", percent=True),
        "Undershoot": each(lw.metrics.Undershoot, "depth", percent=True),
        "Peak": each(lw.metrics.Peak, "depth"), "PeakTime": each(lw.metrics.PeakTime, "depth"),
    }  # fmt: skip
    for i in range(y.shape[1]):
        info = control.step_info(y[:, i], T=T, yfinal=1.0)
        for name, metric in names.items():
            assert number(metric, x)[i] == pytest.approx(info[name], rel=1e-12, abs=1e-12), name


def test_batches_and_replicates_change_no_bit():
    x = course(RESPONSES[:, [0, 1, 2, 0, 1, 2, 1, 0]] + np.arange(8) * 0.01)
    e = x[:, :1]
    for metric, samples in (
        (each(lw.metrics.Overshoot, "depth"), x), (each(lw.metrics.SettlingTime, "depth"), x),
        (each(lw.metrics.RiseTime, "depth"), x),
        (each(lw.metrics.PeakTime, "depth"), x), (each(lw.metrics.ITAE, "depth"), e), (each(lw.metrics.RMSError, "depth"), e),
        (each(lw.metrics.SteadyStateError, "depth"), e), (each(lw.metrics.MaxError, "heading"), e),
        (each(lw.metrics.Travel), e),
    ):  # fmt: skip
        whole = number(metric, samples, batches=())
        for batches in ((1,), (1, 2, 3), (5, 500, 5_000)):
            assert number(metric, samples, batches=batches).tobytes() == whole.tobytes()
    from lgvi_warp.statistics.values.values import dealt

    metric = each(lw.metrics.IAE, "depth")
    gatherer = metric.open(T, 8)
    gatherer.take(dealt(e, None, 0, 0, 8, 4), slice(0, len(T)))
    gatherer.end(Ends(np.zeros(8, np.uint8), np.zeros(8, int), np.full(8, T[-1])), 4)
    (estimate,) = metric.estimates_of_replicates([gatherer.close()], T, 4)
    assert estimate.value[0, 0].tobytes() == number(metric, e).tobytes()


def test_members_that_end_have_the_numbers_of_their_time_under_way():
    t = np.arange(0.0, 10.5, 0.5)
    e = np.ones((len(t), 1, 2)) * (1.0 + t[:, None, None])
    good = np.ones((len(t), 2), bool)
    good[5:, 1] = False  # the last tick under way is at 2 s
    held = e.copy()
    held[5:, :, 1] = 1e9
    ended = np.array([np.inf, 2.2])
    iae = number(each(lw.metrics.IAE, "depth"), held, t, good, ended)
    assert iae.tolist() == [60.0, 4.0]
    assert number(each(lw.metrics.MaxError, "depth"), held, t, good, ended).tolist() == [11.0, 3.0]
    assert number(each(lw.metrics.RMSError, "depth"), held, t, good, ended)[1] == pytest.approx(
        np.sqrt(np.trapezoid(e[:5, 0, 1] ** 2, t[:5]) / 2.0)
    )
    assert number(each(lw.metrics.TimeToFailure), held, t, good, ended).tolist() == [np.inf, 2.2]
    last = number(each(lw.metrics.SteadyStateError, "depth"), held, t, good, ended)
    assert last[0] == pytest.approx(np.mean([10.0, 10.5, 11.0]))
    assert np.isnan(last[1])
    # Statistics count members that stopped, and leave out those that failed.
    assert number(lw.metrics.IAE("depth"), held, t, good, ended) == pytest.approx(32.0)
    assert number(lw.metrics.IAE("depth"), held, t, good, ended, lost=True) == pytest.approx(60.0)


def test_what_never_comes_is_infinite():
    y = 0.5 * RESPONSES
    assert np.all(np.isinf(number(each(lw.metrics.RiseTime, "depth"), course(y))))
    assert np.all(np.isinf(number(each(lw.metrics.SettlingTime, "depth"), course(y))))
    still = course(np.ones((len(T), 1)))
    assert (
        number(each(lw.metrics.RiseTime, "depth"), still)
        == number(each(lw.metrics.SettlingTime, "depth"), still)
        == 0.0
    )
    assert np.isnan(number(each(lw.metrics.Overshoot, "depth", percent=True), still))


def test_headings_are_wrapped():
    turn = np.linspace(3.0, 3.5, 101)
    y = np.arctan2(np.sin(turn), np.cos(turn))[:, None]
    x, t = course(y, -3.0), np.linspace(0.0, 10.0, 101)
    # From 3.0 rad up to 2 pi - 3.0 = 3.283 rad, and beyond it to 3.5 rad.
    assert number(each(lw.metrics.Overshoot, "heading"), x, t) == pytest.approx(3.5 - (2.0 * np.pi - 3.0))
    assert number(each(lw.metrics.Peak, "heading"), x, t) == pytest.approx(3.5 - 2.0 * np.pi)


def test_the_users_own_sees_each_tick():
    seen = []

    def worst(state, tick):
        seen.append((tick.t, tick.dt, tick["position"].shape, tick["command"].shape))
        size = np.stack([tick["position"][:, 2], tick["command"].sum(axis=1)])
        return size if state is None else np.maximum(state, size)

    t = np.array([0.0, 1.0, 3.0])
    x = np.random.default_rng(1).normal(size=(3, 5, 4))
    metric = lw.metrics.CustomMetric(
        worst, then=[lw.statistics.MemberValues()], fields=("position", "command"), last=lambda state: state.sum(axis=0)
    )
    expected = x[:, 2].max(axis=0) + (x[:, 3] + x[:, 4]).max(axis=0)
    np.testing.assert_array_equal(number(metric, x, t, batches=(1,)), expected)
    assert seen == [(0.0, 0.0, (4, 3), (4, 2)), (1.0, 1.0, (4, 3), (4, 2)), (3.0, 2.0, (4, 3), (4, 2))]
    assert metric.key == "worst"
    with pytest.raises(ValueError, match=r"gave shape \(2,\). It must be \(..., 4\)"):
        number(lw.metrics.CustomMetric(lambda state, tick: np.zeros(2), fields=("position",)), x[:, :3], t)


@pytest.mark.parametrize(("make", "text"), [
    (lambda: lw.metrics.Overshoot("dept"), "Did you mean 'depth'"),
    (lambda: lw.metrics.Overshoot("position"), "no goal beyond"),
    (lambda: lw.metrics.IAE(None), "is missing"), (lambda: lw.metrics.SettlingTime("depth", within=-1.0), "within"),
    (lambda: lw.metrics.RiseTime("depth", limits=(0.9, 0.1)), "two rising parts"),
    (lambda: lw.metrics.Effort("speed"), "signal of actuators"),
    (lambda: lw.metrics.SteadyStateError("depth", share=0.0), "part of the run"),
    (lambda: lw.metrics.CustomMetric("depth"), "not a function"),
    (lambda: lw.metrics.CustomMetric(len, fields=("dept",)), "fields"),
    (lambda: lw.metrics.IAE("depth", stopped="held"), "no meaning"),
    (lambda: lw.metrics.IAE("depth", at="floor"), "one moment"), (lambda: lw.metrics.ActuatorEnergy("depth"), "Leave it out"),
])  # fmt: skip
def test_what_is_asked_wrongly_gets_one_sentence(make, text):
    with pytest.raises(lw.SceneError, match=text):
        _ = make().quantity
