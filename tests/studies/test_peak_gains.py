# SPDX-License-Identifier: Apache-2.0
"""Peak gains of closed loops: beside python-control's norms of the same loops written by hand, and beside a sweep in NumPy."""

import numpy as np
import pytest

import lgvi_warp as lw
from tests.support.refusals import refused, says
from tests.support.turning_loops import GAINS, INERTIAS, LATE, PERIOD, H, heading_loops, loop_of, opened, turning

SETTINGS = dict(of=("peak",), about=80.0, method="psi_s", h=H)


@pytest.fixture(scope="module")
def answer():
    fleet = heading_loops(10)
    return fleet, lw.linear.margins(fleet, "heading_pid", to=("rotation[2]", "angular_velocity[2]"), **SETTINGS)


@pytest.mark.ci
def test_ten_loops_beside_python_control(answer):
    control = pytest.importorskip("control")
    fleet, peaks = answer
    assert peaks.steady.all()
    names = ("sensitivity", "complementary", "rotation[2]", "angular_velocity[2]")
    coarse = np.geomspace(1e-3, np.pi / PERIOD, 1000)
    for i in range(10):
        A, B, C = loop_of(fleet, i)
        seen, direct = np.concatenate([C, -C, np.eye(len(A))[:2]]), np.array([[1.0], [0.0], [0.0], [0.0]])
        system = control.ss(A + B @ C, B, seen, direct, PERIOD)
        at = [peaks.values[f"{name}_frequency"][i] for name in names]
        near = np.concatenate([np.linspace(0.98, 1.02, 401) * w for w in at])
        grid = np.unique(np.concatenate([coarse, near[near < np.pi / PERIOD]]))
        gains = control.frequency_response(system, grid).magnitude[:, 0].max(axis=1)
        # A grid of ten thousandths errs next to a peak by their square; slopes of the loop are good to 1e-7.
        assert [peaks.values[f"{name}_peak"][i] for name in names] == pytest.approx(gains, rel=1e-5)


def test_the_worst_case_of_the_ensemble_is_the_largest_peak(answer):
    _, peaks = answer
    values = peaks.values["sensitivity_peak"]
    assert peaks.worst(3).tolist() == np.argsort(-values)[:3].tolist()
    assert peaks.percentiles((100.0,))["sensitivity_peak"][0] == values.max()
    assert "angular_velocity[2]_frequency rad/s" in str(peaks)
    labels = [axes.get_xlabel() for axes in lw.plots.margins(peaks)]
    assert labels == [
        "peak of sensitivity S",
        "peak of complementary sensitivity T",
        "peak gain to rotation[2]",
        "peak gain to angular_velocity[2]",
    ]


@pytest.mark.ci
def test_of_one_component_the_peak_of_s_is_one_over_the_disk_of_skew_one(answer):
    fleet, peaks = answer
    disk = lw.linear.margins(fleet, "heading_pid", skew=1.0, **SETTINGS | {"of": ("disk",)}).values["disk"]
    assert peaks.values["sensitivity_peak"] == pytest.approx(1.0 / disk, rel=1e-9)


@pytest.mark.ci
@pytest.mark.parametrize(("inertia", "delay"), [
    (INERTIAS[0], 0.0), *(pytest.param(*each, marks=pytest.mark.slow) for each in zip(INERTIAS[1:], LATE[1:], strict=True)),
])  # fmt: skip
def test_coupled_axes_beside_a_sweep(inertia, delay):
    peaks = lw.linear.margins(turning(inertia, delay), to=("rotation", "position[0]"), **SETTINGS)
    A, B, C = opened(*GAINS, inertia, round(delay / H))
    z = np.exp(1j * PERIOD * np.geomspace(1e-3, np.pi / PERIOD, 20_000))[:, None, None]
    states = np.linalg.solve(z * np.eye(len(A)) - A - B @ C, B)
    wanted = {"sensitivity": np.eye(3) + C @ states, "complementary": C @ states}
    wanted |= {f"rotation[{i}]": states[:, i : i + 1] for i in range(3)}
    for name, of in wanted.items():
        # Next to a peak a grid of ten thousandths errs by their square.
        assert peaks.values[f"{name}_peak"][0] == pytest.approx(np.linalg.norm(of, 2, axis=(1, 2)).max(), rel=1e-5)
    # Nothing holds the place: a steady force moves it for ever.
    assert peaks.values["position[0]_peak"][0] == np.inf
    assert peaks.values["position[0]_frequency"][0] == 0.0


def test_what_does_not_fit_is_said():
    fleet = heading_loops(2)
    says(refused(lw.linear.margins, fleet, of=("gain",), to=("rotation[2]",)), "to", 'Add "peak"')
    says(refused(lw.linear.margins, fleet, of=("peak",), to=("depth",)), "to", "position[0]")
    says(refused(lw.linear.margins, fleet, of=("peak",), by="runs"), "by", "eigenvalues")
