# SPDX-License-Identifier: Apache-2.0
"""A law that is a Python function: the same motion as the law in the kernel, and what it says where it fails."""

import threading

import numpy as np
import pytest

import lgvi_warp as lw

H, GAINS = 0.02, dict(kp=3.0, kd=2.0)


def scene(laws, members=20, **more):
    """A body with a heading law and an ideal actuator; members that differ."""
    controller = lw.Controller(period=5 * H, guidance=[lw.control.SetPoint(heading=0.8)], laws=laws, **more)
    vehicle = lw.Vehicle(10.0, inertia=(1.0, 2.0, 3.0))
    terms = [
        lw.terms.ControlWrench(limit=2.0),
        lw.terms.Drag(linear=(1.0, 2.0, 2.0, 0.1, 0.1, 0.1), quadratic=(0.0,) * 6),
    ]
    plain = lw.Scene(vehicle, terms=terms, controller=controller)
    vary = {
        "start.angular_velocity": lw.distributions.Normal(std=0.1),
        "start.velocity": lw.distributions.Normal(std=0.2),
    }
    return lw.Ensemble(plain, members, 3, vary)


def heading(t, y, r, members):
    """The heading law in NumPy."""
    s, c = r.attitude[:, :2, 0], y.attitude[:, :2, 0]
    e = np.arctan2(s[:, 1] * c[:, 0] - s[:, 0] * c[:, 1], np.sum(s * c, axis=1))
    demand = np.zeros((len(members), 6))
    demand[:, 5] = GAINS["kp"] * e + GAINS["kd"] * (r.angular_velocity[:, 2] - y.angular_velocity[:, 2])
    return demand


def run(laws, **named):
    return lw.solve(scene(laws), "psi_s", h=H, t1=5.0, save=lw.SaveAt(every=0.5), **named)


@pytest.mark.slow
def test_it_is_the_law_in_the_kernel():
    metrics = [lw.metrics.IAE("heading"), lw.metrics.Effort(), lw.metrics.MaxError("attitude")]
    asked, fused = (
        run([law], statistics=metrics) for law in (lw.control.Callback(heading), lw.control.HeadingPID(**GAINS))
    )
    # 250 steps of round-off: the two evaluate the same formula in another order.
    assert np.abs(asked.attitude - fused.attitude).max() < 1e-12
    assert np.abs(asked.position - fused.position).max() < 1e-12
    # Integrals over 5 s of what the two have alike: the command of each tick among it, which the host answers after it.
    for name, estimate in fused.statistics.items():
        assert estimate.value == pytest.approx(asked.statistics[name].value, rel=1e-10), name


@pytest.mark.ci
def test_commands():
    def commands(t, y, r, members):
        return np.clip(heading(t, y, r, members), -9.0, 9.0)

    asked = run([lw.control.Callback(commands, to="control_wrench")])
    fused = run([lw.control.Callback(heading)])
    assert np.abs(asked.attitude - fused.attitude).max() < 1e-12


@pytest.mark.slow
def test_commands_of_two_terms():
    """Two halves of a wrench are one, but for the sums' round-off."""

    def halves(t, y, r, members):
        wrench = np.clip(heading(t, y, r, members), -2.0, 2.0)
        return np.concatenate([0.25 * wrench, 0.75 * wrench], axis=1)

    fleet = scene([lw.control.Callback(heading)])
    terms = [*(lw.terms.ControlWrench(name=name, limit=2.0) for name in ("one", "two")), fleet.scene.terms[1]]
    law = lw.control.Callback(halves, to=["two", "one"])
    loop = lw.Controller(period=5 * H, guidance=[lw.control.SetPoint(heading=0.8)], laws=[law])
    split = lw.Ensemble(lw.Scene(fleet.scene.vehicle, terms=terms, controller=loop), 20, 3, fleet.vary)
    both = lw.solve(split, "psi_s", h=H, t1=5.0, save=lw.SaveAt(every=0.5))
    one = run([lw.control.Callback(heading)])
    assert np.abs(both.attitude - one.attitude).max() < 1e-12


def test_one_member_without_an_answer():
    def broken(t, y, r, members):
        demand = heading(t, y, r, members)
        demand[(members == 3) & (t > 1.0)] = np.nan
        return demand

    result, whole = run([lw.control.Callback(broken)]), run([lw.control.Callback(heading)])
    assert result.status.counts() == {"ok": 19, "control_non_finite": 1}
    assert result.status[3] == lw.Status.CONTROL_NON_FINITE
    assert 1.0 < result.failure_time[3] <= 1.1 + 1e-9
    others = np.arange(20) != 3
    assert np.array_equal(result.position[:, others], whole.position[:, others])


def test_wrong_shape():
    with pytest.raises(ValueError, match=r"returned shape \(20,\). Return \(20, 6\)"):
        run([lw.control.Callback(lambda t, y, r, members: np.zeros(len(members)))])


ODD = {
    "complex": (lambda values: values + 0j, "is not numeric"), "texts": (lambda values: values.astype(str), "is not numeric"),
    "truth": (lambda values: values > 0.0, "is not numeric"),
    "dates": (lambda values: values.astype("M8[s]"), "is not numeric"),
    "masked": (lambda values: np.ma.array(values, mask=np.arange(values.size).reshape(values.shape) == 1), "mask that hides"),
    "ragged": (lambda values: [[1.0], [1.0, 2.0]], "is not numeric"), "none": (lambda values: None, "is not numeric"),
}  # fmt: skip


@pytest.mark.parametrize("odd, words", ODD.values(), ids=ODD)
def test_what_is_no_real_number_is_refused(odd, words):
    """Imaginary parts and masks would be lost without a word."""
    with pytest.raises(ValueError, match=f"callback 'callback' at t = 0 s, members 0 to 19.*{words}"):
        run([lw.control.Callback(lambda t, y, r, members: odd(heading(t, y, r, members)))])


def test_an_exception_says_where():
    def fails(t, y, r, members):
        raise RuntimeError("no solution")

    with pytest.raises(RuntimeError, match="no solution") as info:
        run([lw.control.Callback(fails)])
    assert "t = 0 s, members 0 to 19" in info.value.__notes__[0]


def test_no_code_in_files():
    with pytest.raises(lw.SceneError, match="runs no code"):
        lw.Controller(period=0.1, laws=[{"type": "callback"}])


def mended(t, y, r, members):
    """The heading law, which knows no answer for later blocks until it is mended."""
    if members[0] > 0 and t > 0.5 and not mended.now:
        raise RuntimeError("no solution")
    return heading(t, y, r, members)


def test_a_stopped_run_goes_on_with_the_mended_function(tmp_path):
    """A function other than the run's first one is refused, or taken and reported."""
    settings, mended.now = dict(method="psi_s", h=H, t1=1.0, threads=1), False
    with pytest.raises(RuntimeError, match="no solution"):
        lw.solve(scene([lw.control.Callback(mended)], 300), **settings, store=tmp_path / "run.zarr")
    with pytest.raises(lw.SceneError, match=r"lw\.resume\(path, fleet\)"):
        lw.resume(tmp_path / "run.zarr")
    mended.now = True
    fleet = scene([lw.control.Callback(mended)], 300)
    with pytest.raises(lw.SceneError, match=r"functions\.laws\.callback is .*force=True"):
        lw.resume(tmp_path / "run.zarr", fleet, threads=1)
    resumed = lw.resume(tmp_path / "run.zarr", fleet, threads=1, force=True)
    assert any("continued although functions.laws.callback is" in text for text in resumed.messages)
    whole = lw.solve(scene([lw.control.Callback(heading)], 300), **settings)
    assert np.array_equal(resumed.position, whole.position)


@pytest.mark.parametrize("version", [None, "1"])
def test_a_run_goes_on_with_its_function_alone(tmp_path, version):
    """A function of the same name, gain and all but one number in a closure is another one, unless its version is given."""
    path, settings = tmp_path / "run.zarr", dict(method="psi_s", h=H, t1=0.2, threads=1)
    first, same, other = (scene([lw.control.Callback(turning(k), version=version)], 300) for k in (1.0, 1.0, 2.0))
    lw.solve(first, **settings, store=lw.Store(path), blocks=range(1))
    if version is None:
        for existing in (
            lambda: lw.resume(path, other),
            lambda: lw.solve(other, **settings, store=lw.Store(path, existing="resume")),
        ):
            with pytest.raises(lw.SceneError, match=r"functions\.laws\.callback is .*Go on with the functions"):
                existing()
    resumed = lw.resume(path, same if version is None else other, threads=1)
    assert not any("functions" in text or "version" in text for text in resumed.messages)
    assert (version is None) == np.array_equal(resumed.position, lw.solve(first, **settings).position)


def test_a_function_that_cannot_be_compared_is_noted(tmp_path):
    path, settings, lock = tmp_path / "run.zarr", dict(method="psi_s", h=H, t1=0.2, threads=1), threading.Lock()

    def locked(t, y, r, members):
        with lock:
            return heading(t, y, r, members)

    fleet = scene([lw.control.Callback(locked)], 300)
    lw.solve(fleet, **settings, store=lw.Store(path), blocks=range(1))
    assert any("laws.callback" in text and "version" in text for text in lw.resume(path, fleet).messages)


def turning(k):
    """A law whose gain is in a closure."""

    def law(t, y, r, members):
        return k * heading(t, y, r, members)

    return law


def shares(cases, folder=None, metrics=("iae heading",), **more):
    """Metrics by case of a sweep of the scene; and how often each case asked its function."""
    settings = dict(metrics=list(metrics), h=H, t1=0.5, method="psi_s", out=folder, **more)
    found = lw.sweep(scene([lw.control.Callback(heading)], 4), cases, **settings)
    return {case.name: found.values(case.name, next(iter(found.metrics))) for case in found.setup.cases}


def truth(function):
    """The metric of a run with this function, outside any sweep."""
    metric = lw.metrics.IAE("heading", then=[lw.statistics.MemberValues()])
    return lw.solve(scene([lw.control.Callback(function)], 4), "psi_s", h=H, t1=0.5, keep="none",
                    statistics=[metric]).statistics[
        "each iae heading"].value[0, 0]  # fmt: skip


def replacing(**functions):
    """Cases of other functions."""
    return [
        lw.studies.Case(name, replace={"laws": [lw.control.Callback(function)]}) for name, function in functions.items()
    ]


@pytest.mark.ci
@pytest.mark.parametrize("on_disk", [False, True])
def test_a_sweep_runs_each_function(tmp_path, on_disk):
    """Functions of one name: closures of a factory, and lambdas."""
    folder = tmp_path if on_disk else None
    weak, strong, lazy = turning(0.1), turning(0.3), lambda t, y, r, members: 0.0 * heading(t, y, r, members)
    busy = lambda t, y, r, members: 0.2 * heading(t, y, r, members)  # noqa: E731
    functions = dict(weak=weak, strong=strong, lazy=lazy, busy=busy)
    for _ in range(2):  # once more what is in the folder
        found = shares(replacing(**functions), folder)
        for name, function in functions.items():
            np.testing.assert_array_equal(found[name], truth(function), err_msg=name)
    assert len({values.tobytes() for values in found.values()}) == 4


@pytest.mark.ci
def test_a_sweep_goes_on_with_what_is_the_same(tmp_path):
    """A second call runs no cell of the same functions, and every cell of another one."""
    known = {}
    for gains, new in (((0.1, 0.2), 2), ((0.1, 0.2), 0), ((0.1, 0.3), 1), ((0.3, 0.1), 0)):
        shares(replacing(one=turning(gains[0]), other=turning(gains[1])), tmp_path)
        files = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "cells").iterdir()}
        assert len(files) == len(known) + new
        assert files.items() >= known.items()
        known = files


@pytest.mark.ci
def test_a_sweep_shares_nothing_in_doubt(tmp_path):
    lock = threading.Lock()

    def locked(k):
        def law(t, y, r, members):
            with lock:
                return k * heading(t, y, r, members)

        return law

    functions = dict(one=locked(1.0), other=locked(2.0))
    for folder in (None, tmp_path, tmp_path):
        found = shares(replacing(**functions), folder)
        for name, function in functions.items():
            np.testing.assert_array_equal(found[name], truth(function), err_msg=name)
    assert not list(tmp_path.rglob("*.npz"))


def test_a_changed_metric_is_run_anew(tmp_path):
    """Changes in names, closures and end of a function of `CustomMetric`."""

    def of(k, method):
        return lambda state, tick: getattr(np, method)(tick["position"][:, 0] if state is None else state, k)

    metrics = [lw.metrics.CustomMetric(of(k, method), name="own", last=last) for k, method, last in (
        (1.0, "maximum", None), (1.0, "minimum", None), (2.0, "maximum", None), (1.0, "maximum", np.negative))]  # fmt: skip
    # The states begin at 0: max(0, 1), min(0, 1), max(0, 2), -max(0, 1).
    for metric, value in zip(metrics, (1.0, 0.0, 2.0, -1.0), strict=True):
        assert shares([{"name": "one"}], tmp_path, [metric])["one"] == pytest.approx(np.full(4, value), abs=1e-3)


SMC = dict(lambda_=0.4, boundary=0.1, k_sigma=0.05, k_d=0.5, nomoto_time=1.5, anti_windup="none")


class Sliding:
    """The sliding mode of `heading_smc` in NumPy."""

    def __init__(self, members, gain):
        self.total, self.gain = np.zeros(members), gain

    def __call__(self, t, y, r, members):
        rate = SMC["lambda_"]
        error = np.remainder(y.heading - r.heading + np.pi, 2.0 * np.pi) - np.pi
        turn = y.angular_velocity[:, 2] - r.angular_velocity[:, 2]
        sigma = turn + 2.0 * rate * error + rate**2 * self.total[members]
        self.total[members] += 5 * H * error
        change = r.angular_acceleration[:, 2] - 2.0 * rate * turn - rate**2 * error
        switched = SMC["k_sigma"] * np.clip(sigma / SMC["boundary"], -1.0, 1.0)
        demand = np.zeros((len(members), 6))
        wanted = SMC["nomoto_time"] * change + y.angular_velocity[:, 2] - sigma - SMC["k_d"] * sigma - switched
        demand[:, 5] = wanted / self.gain
        return demand


@pytest.mark.slow
def test_the_wanted_acceleration_reaches_the_function_and_the_laws_beside_it():
    """Half of the sliding mode in the kernel and half in Python are the whole; a reference model wants the acceleration."""

    def turned(laws):
        fleet = scene(laws)
        loop = fleet.scene.controller
        led = (*loop.guidance, lw.control.ReferenceModel(natural_frequency=(1.0, 1.0)))
        loop = lw.Controller(period=loop.period, guidance=led, laws=laws)
        terms = [lw.terms.ControlWrench(), *fleet.scene.terms[1:]]
        whole = lw.Scene(fleet.scene.vehicle, terms=terms, controller=loop)
        fields = ("attitude", "reference_angular_acceleration")
        fleet = lw.Ensemble(whole, fleet.members, 3, fleet.vary)
        return lw.solve(fleet, "psi_s", h=H, t1=5.0, save=lw.SaveAt(every=0.5, fields=fields))

    fused = turned([lw.control.HeadingSMC(nomoto_gain=0.4, **SMC)])
    halves = turned([lw.control.HeadingSMC(nomoto_gain=0.8, **SMC), lw.control.Callback(Sliding(20, 0.8))])
    assert np.abs(halves.attitude - fused.attitude).max() < 1e-12
    # It is felt: some 0.1 rad/s^2 times the time of Nomoto's model.
    assert np.abs(fused.reference_angular_acceleration[:, :, 2]).max() > 0.05


@pytest.mark.slow
def test_other_processes_call_it():
    fleet, settings = scene([lw.control.Callback(heading)], 300), dict(method="psi_s", h=H, t1=1.0)
    apart = lw.solve(fleet, **settings, executor="processes", threads=2)
    assert np.array_equal(apart.position, lw.solve(fleet, **settings).position)
