# SPDX-License-Identifier: Apache-2.0
"""Disk margins: beside python-control's of the same loops written by hand, and beside a sweep by SciPy of coupled ones."""

import numpy as np
import pytest
from scipy.optimize import minimize

import lgvi_warp as lw
from lgvi_warp.control import AllocationMatrix, HeadingPID, PosePID, SetPoint
from lgvi_warp.distributions import Choice, Uniform
from lgvi_warp.terms import ControlWrench
from tests.support.refusals import refused, says

J, PERIOD, H, EVERY = 11.0, 0.1, 0.02, 5
LATE = [0.0, 0.06, 0.12]


def scene(law, inertia, delay=0.06, guidance=()):
    controller = lw.Controller(
        period=PERIOD, delay=delay, guidance=guidance or [SetPoint(heading=0.0)], laws=[law],
        allocation=[AllocationMatrix(to="control_wrench", matrix=np.eye(6))])  # fmt: skip
    vehicle = lw.Vehicle(
        20.0, inertia=inertia, added_mass=(0.0, 0.0, 0.0), buoyancy=200.0, center_of_buoyancy=(0.0, 0.0, 0.0)
    )
    return lw.Scene(vehicle, lw.Environment(10.0), [ControlWrench()], controller=controller)


def opened(kp, ki, kd, inertia, steps):
    """x' = A x + B w, w = C x: angles, rates, integrals of the errors, and the torques that are on their way."""
    inverse, unity = np.linalg.inv(np.atleast_2d(inertia)), np.eye(len(np.atleast_2d(inertia)))
    r, (q, s) = len(unity), divmod(steps, EVERY)
    late = s * H

    def push(t):
        return np.concatenate([0.5 * t**2 * inverse, t * inverse])

    n = 3 * r + (q + 2) * r
    A = np.zeros((n, n))
    A[: 2 * r, : 2 * r] = np.block([[unity, PERIOD * unity], [0.0 * unity, unity]])
    acting = slice(3 * r + q * r, 4 * r + q * r)
    older = slice(acting.stop, acting.stop + r)
    A[: 2 * r, acting] = push(PERIOD - late)
    A[: 2 * r, older] = push(PERIOD) - push(PERIOD - late)
    A[2 * r : 3 * r, :r], A[2 * r : 3 * r, 2 * r : 3 * r] = -PERIOD * unity, unity
    A[4 * r :, 3 * r : -r] = np.eye((q + 1) * r)
    B = np.zeros((n, r))
    B[3 * r : 4 * r] = unity
    C = -np.diag(kp) @ A[:r] - np.diag(kd) @ A[r : 2 * r] + np.diag(ki) @ A[2 * r : 3 * r]
    return A, B, C


def numbers(fleet, n):
    return {name: np.broadcast_to(v, (n, *v.shape[1:])) for name, v in fleet.parameters(0, n).items()}


@pytest.mark.parametrize(
    "skew", [0.0, pytest.param(1.0, marks=pytest.mark.slow), pytest.param(-0.5, marks=pytest.mark.slow)]
)
def test_ten_loops_beside_python_control(skew):
    control = pytest.importorskip("control")
    vary = {"heading_pid.kp": Uniform(4.0, 8.0), "heading_pid.kd": Uniform(7.0, 12.0), "heading_pid.ki": Uniform(0.4, 1.2),
            "controller.delay": Choice(LATE)}  # fmt: skip
    law = HeadingPID(kp=6.0, ki=0.8, kd=9.0)
    fleet = lw.Ensemble(scene(law, (5.0, 8.0, J)), 10, 7, vary)
    found = lw.linear.margins(fleet, "heading_pid", of=("disk",), skew=skew, about=80.0, method="psi_s", h=H)
    assert found.steady.all()
    p = numbers(fleet, 10)
    frequencies = np.geomspace(1e-3, np.pi / PERIOD, 20_000)
    for i in range(10):
        gains = [p[f"heading_pid.{k}"][i : i + 1] for k in ("kp", "ki", "kd")]
        A, B, C = opened(*gains, J, round(p["controller.delay"][i] / H))
        margin, gain, phase = control.disk_margins(control.ss(A, B, -C, 0.0, PERIOD), frequencies, skew=skew)
        # python-control looks at a grid of ten thousandths: next to a peak that errs by their square.
        assert found.values["disk"][i] == pytest.approx(margin, rel=1e-5)
        either = np.minimum(found.values["disk_gain_upper"][i], 1.0 / found.values["disk_gain_lower"][i])
        assert 20.0 * np.log10(either) == pytest.approx(gain, rel=1e-4)
        assert np.rad2deg(found.values["disk_phase"][i]) == pytest.approx(phase, rel=1e-4)


def swept(A, B, C, frequencies):
    """1 / the largest structured norm of (S - T)/2 over frequencies, each by SciPy's simplex from two starts."""
    largest = 0.0
    for w in frequencies:
        L = -C @ np.linalg.solve(np.exp(1j * w * PERIOD) * np.eye(len(A)) - A, B)
        S = np.linalg.inv(np.eye(len(L)) + L)
        M = 0.5 * (S - L @ S)

        def norm(x, M=M):
            d = np.exp(np.append(x, 0.0))
            return np.linalg.norm(d[:, None] * M / d, 2)

        starts = np.zeros(len(L) - 1), np.full(len(L) - 1, 0.7)
        largest = max(
            largest, min(minimize(norm, x, method="Nelder-Mead", options={"xatol": 1e-6}).fun for x in starts)
        )
    return 1.0 / largest


INERTIAS = [
    [[5.0, 2.0, 0.0], [2.0, 8.0, 0.0], [0.0, 0.0, 11.0]],
    [[5.0, 2.5, 1.0], [2.5, 8.0, 3.0], [1.0, 3.0, 11.0]],
    [[5.0, -3.0, 2.0], [-3.0, 9.0, 1.0], [2.0, 1.0, 7.0]],
]


@pytest.mark.parametrize(("inertia", "delay"), [
    (INERTIAS[0], 0.0), *(pytest.param(*each, marks=pytest.mark.slow) for each in zip(INERTIAS[1:], LATE[1:], strict=True)),
])  # fmt: skip
def test_coupled_axes_beside_a_sweep(inertia, delay):
    kr, ki_r, kw = np.array([4.0, 7.0, 9.0]), np.array([0.3, 0.5, 0.4]), np.array([8.0, 11.0, 13.0])
    law = PosePID(kp=[0.0] * 3, kd=[0.0] * 3, kr=kr, ki_r=ki_r, kw=kw)
    place = SetPoint(position=[0.0, 0.0, 0.0], heading=0.0)
    found = lw.linear.margins(scene(law, inertia, delay, [place]), of=("disk",), about=80.0, method="psi_s", h=H)
    assert found.steady.all(), found.why
    A, B, C = opened(kr, ki_r, kw, inertia, round(delay / H))
    at = found.values["disk_frequency"][0]
    grid = np.concatenate([np.geomspace(0.01, np.pi / PERIOD, 60), at * np.linspace(0.98, 1.02, 21)])
    # The grid is a thousandth fine at the peak.
    assert found.values["disk"][0] == pytest.approx(swept(A, B, C, grid), rel=1e-4)


def test_a_factor_in_the_disk_is_borne_and_one_beyond_is_not():
    # What the worst disk says of gain alone is within what gain alone bears.
    law = HeadingPID(kp=6.0, ki=0.8, kd=9.0)
    found = lw.linear.margins(scene(law, (5.0, 8.0, J)), of=("gain", "disk"), about=80.0, method="psi_s", h=H)
    assert found.values["gain_lower"] < found.values["disk_gain_lower"] < 1.0
    assert 1.0 < found.values["disk_gain_upper"] < found.values["gain_upper"]
    assert "disk_phase rad" in str(found)
    labels = [axes.get_xlabel() for axes in lw.plots.margins(found)]
    assert labels[2:] == ["disk margin", "disk margin as a factor", "disk margin as a phase [rad]"]
    assert found.to_dict()["eigenvalues"]["disk"] == found.values["disk"].tolist()


def test_what_has_no_disk():
    law = HeadingPID(kp=-6.0, kd=9.0)
    found = lw.linear.margins(scene(law, (5.0, 8.0, J)), of=("disk",), about=10.0, settle=20.0, method="psi_s", h=H)
    assert np.isnan(found.values["disk"]).all()
    fleet = lw.Ensemble(scene(law, (5.0, 8.0, J)), 2)
    says(refused(lw.linear.margins, fleet, of=("disk",), by="runs"), "by", "eigenvalues")
    says(refused(lw.linear.margins, fleet, of=("disk",), skew=2.0), "skew", "-1 to 1")
