# SPDX-License-Identifier: Apache-2.0
"""Metrics of a loop as quantities of a prepared run, beside others: by closed forms of a loop that does nothing."""

import numpy as np
import pytest

import lgvi_warp as lw

pytestmark = pytest.mark.kernel

H, T, SPEED = 0.1, 2.0, 0.5
WANTED = np.array([0.2, -0.5, 0.0, 1.0])
SETTINGS = dict(method="psi_x", h=H, t1=T, threads=1)


@pytest.fixture(scope="module")
def idle():
    """A neutral body that heads north and moves straight on, whatever heading is wanted: its gains are 0."""
    controller = lw.Controller(period=2 * H, guidance=[lw.control.SetPoint(heading=0.5)],
                               laws=[lw.control.HeadingPID(kp=0.0, kd=0.0)])  # fmt: skip
    body = lw.Vehicle(mass=10.0, inertia=(1.0, 1.0, 1.0), buoyancy=10.0 * 9.80665)
    return lw.Scene(body, terms=[lw.terms.ControlWrench(limit=2.0)], controller=controller,
                    start=lw.Start(velocity=(SPEED, 0.0, 0.0)))  # fmt: skip


OF = [lw.metrics.IAE("heading"), "itae heading", {"type": "settling_time", "of": "heading", "within": 0.05}, "position[0]",
      "max(position[0])", "outcome ok"]  # fmt: skip


@pytest.mark.ci
def test_metrics_stand_beside_quantities(idle):
    """The error is w all the time: its integral w T, with the time w T^2 / 2; it never settles, or at once where w = 0."""
    run = lw.prepare(idle, ["set_point.heading"], of=OF, save=lw.SaveAt(every=2 * H), **SETTINGS)
    found = run(WANTED[:, None])
    size, none = np.abs(WANTED), np.zeros(4)
    expected = [
        size * T,
        size * T**2 / 2.0,
        np.where(size > 0.0, np.inf, 0.0),
        none + SPEED * T,
        none + SPEED * T,
        none + 1.0,
    ]
    np.testing.assert_allclose(found, np.stack(expected, axis=1), rtol=1e-12, atol=1e-12)
    # By itself, (n,), and of some members again: the same bits.
    alone = lw.prepare(idle, ["set_point.heading"], of="itae heading", **SETTINGS)
    np.testing.assert_array_equal(alone(WANTED[:, None]), found[:, 1])
    np.testing.assert_array_equal(alone(WANTED[2:, None]), found[2:, 1])
    outputs = lw.uq.evaluate(lw.Ensemble(idle, 3), ["iae heading", "settling_time heading"], **SETTINGS)
    assert (outputs.labels, outputs.failed.any()) == (("iae heading", "settling_time heading"), False)
    np.testing.assert_allclose(outputs.values[:, 0], 0.5 * T, rtol=1e-12)


@pytest.mark.ci
def test_a_metric_of_samples_has_those_of_every_tick(idle):
    run = lw.prepare(idle, ["set_point.heading"], of=lw.statistics.PathMean("position[0]"), **SETTINGS)
    np.testing.assert_allclose(run(WANTED[:, None]), SPEED * T / 2.0, rtol=1e-12)


@pytest.mark.ci
def test_a_member_that_fails_has_no_metric(idle):
    state = [np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3)), np.zeros((2, 3))]
    state[2][1, 0] = np.nan
    lenient = lw.prepare(idle, None, of=["iae heading", "position[0]"], failed="nan", **SETTINGS)
    np.testing.assert_allclose(lenient.states(*state), [[0.5 * T, 0.0], [np.nan, np.nan]], rtol=1e-12)
    with pytest.raises(lw.uq.FailedMembers, match="1 of 2 members failed"):
        lw.prepare(idle, None, of="iae heading", **SETTINGS).states(*state)


@pytest.mark.parametrize(("of", "words"), [
    ("mean depth", "of = 'mean' is not a metric: it is not one number of each member"), ("iae headng", "headng"),
    (lw.statistics.Mean("depth"), "is not a metric"), ({"type": "iea", "of": "heading"}, "of.*iea"),
    (["iae heading", lw.metrics.IAE("heading")], "of = 'iae heading' is the name of another metric"),
    ("iae depth", "no guidance of the scene wants a depth"),
])  # fmt: skip
def test_metrics_that_are_wrong_are_refused(idle, of, words):
    with pytest.raises(lw.SceneError, match=words):
        lw.prepare(idle, ["set_point.heading"], of=of, **SETTINGS)
