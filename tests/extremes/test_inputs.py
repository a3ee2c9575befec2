# SPDX-License-Identifier: Apache-2.0
"""Numbers at the edge of what floating point holds: infinite, not a number, subnormal; one sick member, all members."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.status import Status
from tests.extremes.cases import DTYPES, Case, Group, ensemble, measured, oblique
from tests.support.tools import random_states, scene_of

FIELDS = ("position", "attitude", "velocity", "angular_velocity")
GENERAL = scene_of((10.0, 12.0, 15.0), (1.0, 2.0, 2.5), net=-0.3, moment=(0.0, 0.1, -0.5))
BAD = (Status.NON_FINITE, Status.STEP_TOO_LARGE)


def finite(result, members):
    """Whether every sample of these members is finite."""
    return all(np.isfinite(getattr(result, name)[:, members]).all() for name in FIELDS)


@pytest.mark.ci
@pytest.mark.parametrize("dtype", DTYPES)
def test_one_sick_member_among_many(dtype):
    n = 100_000
    states = random_states(5, n, 0.5, 0.5)
    states[2][70_001, 1] = np.nan
    result = lw.solve(lw.Ensemble.from_states(GENERAL, *states), h=0.01, t1=0.1, dtype=dtype)
    well = np.arange(n) != 70_001
    assert result.status.counts() == {"ok": n - 1, "non_finite": 1}
    assert finite(result, well)
    assert result.failure_time[70_001] == 0.0
    assert np.isnan(result.velocity[-1, 70_001, 1])  # as it was given: nothing is reset


@pytest.mark.ci
@pytest.mark.slow_for("1--inf*")
@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("field", range(4))
def test_every_member_fails_at_once(dtype, bad, field):
    states = random_states(5, 300, 0.5, 0.5)
    states[field].reshape(300, -1)[:, 1] = bad
    result = lw.solve(lw.Ensemble.from_states(GENERAL, *states), h=0.01, t1=100.0, dtype=dtype)
    assert set(np.unique(result.status)) <= set(BAD)
    # Ten thousand steps of frozen members: the status is of the first, and the samples are the start.
    assert (result.failure_time == 0.0).all()
    for name in FIELDS:
        start, end = getattr(result, name)[0], getattr(result, name)[-1]
        np.testing.assert_allclose(end[np.isfinite(end)], start[np.isfinite(end)], rtol=1e-6, atol=1e-6)


@pytest.mark.ci
@pytest.mark.parametrize("dtype", DTYPES)
def test_subnormal_states_are_no_fault(dtype):
    tiny = 5e-324 if dtype == "float64" else 1e-45
    alone = Case("subnormal velocities", nu=oblique(1.0) * tiny, Om=(tiny, -tiny, tiny))
    beside = Case("subnormal beside normal", nu=(tiny, 1.0, tiny), Om=(tiny, 1.0, 0.0), b=(tiny, 0.0, 0.0))
    group = Group("", 0.1, 60, (alone, beside))
    result = lw.solve(ensemble(group), h=group.h, t1=group.h * group.steps, dtype=dtype)
    assert result.status.counts() == {"ok": 2}
    assert finite(result, slice(None))
    found = measured(group, "psi_s", dtype)
    # Of a subnormal number nothing but its size is promised: the first member goes nowhere.
    assert np.abs(result.position[-1, 0]).max() <= 100 * tiny
    assert found.error[1] <= found.bound[1]


@pytest.mark.ci
@pytest.mark.parametrize("dtype", DTYPES)
def test_huge_states(dtype):
    far = 1e300 if dtype == "float64" else 1e35
    b, R, nu, Om = random_states(5, 6, 0.5, 0.5)
    b[0] = far  # far away is no fault: it stays there, to its round-off
    b[1] = 1.7e308  # the largest that float64 holds, and infinite in float32
    nu[2], nu[3], Om[4], Om[5] = 1e160, 1e300, 1e160, 1e300
    result = lw.solve(lw.Ensemble.from_states(GENERAL, b, R, nu, Om), h=0.01, t1=1.0, dtype=dtype)
    assert result.status[0] == Status.OK
    assert np.abs(result.position[-1, 0] / far - 1.0).max() < 1e-6
    assert (result.status[1] == Status.OK) == (dtype == "float64")
    assert finite(result, np.asarray(result.status) == 0)
    assert (np.asarray(result.status[2:]) != Status.OK).all()


@pytest.mark.parametrize(
    "name", ["vehicle.mass", "vehicle.inertia", "vehicle.added_mass", "vehicle.buoyancy", "environment.gravity"]
)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_parameters_that_are_not_finite_are_refused(name, bad):
    states = random_states(5, 3, 0.5, 0.5)
    values = np.broadcast_to(np.ones(3) if name in ("vehicle.inertia", "vehicle.added_mass") else 1.0,
                             (3, 3) if name in ("vehicle.inertia", "vehicle.added_mass") else (3,)).copy()  # fmt: skip
    values.flat[1] = bad
    with pytest.raises(lw.SceneError, match=name):
        lw.Ensemble.from_states(GENERAL, *states, {name: values})


@pytest.mark.ci
@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("name", ["vehicle.mass", "vehicle.inertia"])
def test_parameters_beyond_the_precision_are_flagged(dtype, name):
    # Subnormal or overflowing when divided: never a status OK beside numbers that are not finite.
    values = np.array([3e-308, 1e-300, 1e-40, 1e40, 1e300, 1e308])
    n = len(values)
    b, R, nu, Om = random_states(5, n, 0.5, 0.1)
    # Unequal along the axes, as GENERAL is: the kernel is the same.
    mass = values if name == "vehicle.mass" else np.full(n, 10.0)
    parameters = {name: values if name == "vehicle.mass" else np.repeat(values[:, None], 3, axis=1),
                  "vehicle.added_mass": np.multiply.outer(mass, (0.0, 0.2, 0.5))}  # fmt: skip
    with np.errstate(all="ignore"):
        result = lw.solve(lw.Ensemble.from_states(GENERAL, b, R, nu, Om, parameters), h=0.01, t1=1.0, dtype=dtype)
    well = np.asarray(result.status) == Status.OK
    assert finite(result, well)
    for tiny in (5e-324, 1e-310):
        with pytest.raises(lw.SceneError, match=name):
            lw.Ensemble.from_states(GENERAL, b, R, nu, Om, parameters | {name: np.full_like(parameters[name], tiny)})
