# SPDX-License-Identifier: Apache-2.0
"""Gains that keep constraints: beside a grid of all gains, whose margins are those of loops written by hand."""

import dataclasses

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.control import HeadingPID
from lgvi_warp.distributions import Choice
from tests.support.refusals import refused, says
from tests.support.turning_loops import LATE, PERIOD, H, J, opened, scene

OVER = {"heading_pid.kp": (2.0, 60.0, "log"), "heading_pid.kd": (4.0, 60.0, "log")}
RUN = {"method": "psi_s", "h": H, "t1": 20.0}
LEAST = 0.8


def turned(members=3):
    """Bodies that turn back 0.2 rad, whose computers answer at once or late."""
    one = scene(HeadingPID(kp=6.0, kd=9.0), (5.0, 8.0, J), delay=0.06)
    one = dataclasses.replace(one, start=lw.Start(euler_deg=[0.0, 0.0, np.rad2deg(0.2)]))
    return lw.Ensemble(one, members, 4, {"controller.delay": Choice(LATE)})


def disk(kp, kd, delay):
    """The disk margin of a loop by hand, on a grid of ten thousandths."""
    A, B, C = opened([kp], [0.0], [kd], J, round(delay / H))
    if np.abs(np.linalg.eigvals(A + B @ C)[:, None]).max() >= 1.0 + 1e-9:
        return np.nan
    # Nothing uses the integral.
    A, B, C = (np.delete(each, 2, axis) for each, axis in ((np.delete(A, 2, 0), 1), (B, 0), (C, 1)))
    z = np.exp(1j * PERIOD * np.geomspace(0.05, np.pi / PERIOD, 2000))[:, None, None]
    L = -C @ np.linalg.solve(z * np.eye(len(A)) - A, B[None])
    return 1.0 / np.abs(1.0 / (1.0 + L) - 0.5).max()


def by_brute_force(fleet, count):
    """Gains (k, 2) of a grid, the mean cost of the members, and the least disk margin of them."""
    axes = [np.geomspace(*ends[:2], count) for ends in OVER.values()]
    gains = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    delays = np.broadcast_to(fleet.parameters(0, fleet.members)["controller.delay"], (fleet.members,))
    run = lw.prepare(fleet.scene, [*OVER, "controller.delay"], "iae heading", failed="nan", **RUN)
    rows = np.concatenate([np.column_stack([gains, np.full(len(gains), delay)]) for delay in delays])
    costs = run(rows).reshape(len(delays), -1).mean(axis=0)
    margins = np.array([[disk(*each, delay) for delay in np.unique(delays)] for each in gains])
    return gains, costs, np.where(np.isnan(margins).any(axis=1), -1.0, margins.min(axis=1))


@pytest.mark.ci
def test_the_best_gains_of_a_disk_margin_beside_brute_force():
    fleet = turned()
    assert len(np.unique(fleet.parameters(0, 3)["controller.delay"])) > 1
    free = lw.tune_gains(fleet, OVER, "iae heading", budget=3 * 100, fresh=0, **RUN)
    found = lw.tune_gains(fleet, OVER, "iae heading", budget=3 * 100, fresh=6, constraints=f"disk above {LEAST}", **RUN)
    delays = np.unique(fleet.parameters(0, 3)["controller.delay"])
    best = min(disk(*found.parameters.values(), delay) for delay in delays)
    told = found.constraints[f"disk above {LEAST}"]
    # The grid errs by its square next to a peak.
    assert told["worst"] == pytest.approx(best, rel=1e-4)
    assert best > LEAST * (1.0 - 1e-4)
    # Without it they would be other ones.
    assert min(disk(*free.parameters.values(), delay) for delay in delays) < 0.75 * LEAST
    gains, costs, margins = by_brute_force(fleet, 21)
    allowed = margins >= LEAST
    assert 10 < allowed.sum() < 0.8 * len(gains)
    assert found.cost <= costs[allowed].min() * (1.0 + 1e-9)
    # It is no lower than what is beside the allowed ones of the grid.
    near = margins >= 0.85 * LEAST
    assert found.cost > costs[near].min() * 0.9
    assert found.feasible
    assert found.cost > free.cost
    assert (found.fresh, told["fresh_broken"]) == (6, 0.0)
    says(found.answer, "; disk above 0.8: at worst", "in fresh members.")
    assert lw.studies.Tuned.from_dict(found.to_dict()).constraints == found.constraints
    assert found.runs <= 3 * 100 + 12 + 3


@pytest.mark.ci
def test_metrics_margins_and_quantities_at_once_and_none_that_fit():
    fleet, save = turned(), lw.SaveAt(every=0.5)
    bounds = ["overshoot heading below 0.02", "gain_upper heading_pid above 4", "max(norm(angular_velocity)) below 0.2"]
    found = lw.tune_gains(fleet, OVER, "iae heading", budget=3 * 60, fresh=0, constraints=bounds, save=save, **RUN)
    assert found.feasible
    kept = found.constraints
    assert list(kept) == bounds
    delays = fleet.parameters(0, 3)["controller.delay"]
    run = lw.prepare(
        fleet.scene, [*OVER, "controller.delay"], ["overshoot heading", "max(norm(angular_velocity))"], save=save, **RUN
    )
    values = run([[*found.parameters.values(), delay] for delay in delays])
    assert [kept[name]["worst"] for name in (bounds[0], bounds[2])] == pytest.approx(
        values.max(axis=0).tolist(), rel=1e-12
    )
    numbers = {"controller.delay": delays} | {name: np.full(3, value) for name, value in found.parameters.items()}
    one = lw.Ensemble.from_states(
        fleet.scene, np.zeros((3, 3)), np.tile(np.eye(3), (3, 1, 1)), *np.zeros((2, 3, 3)), numbers
    )
    margins = lw.linear.margins(one, "heading_pid", ("gain",), method="psi_s", h=H)
    assert kept[bounds[1]]["worst"] == pytest.approx(margins.values["gain_upper"].min(), rel=1e-5)
    assert np.isnan(kept[bounds[0]]["fresh_worst"])
    none = lw.tune_gains(fleet, OVER, "iae heading", budget=3 * 32, fresh=0, constraints=["disk above 1.9"], **RUN)
    assert not none.feasible
    says(none.answer, "No numbers were found for which all members keep the constraints; the nearest has")
    assert none.constraints["disk above 1.9"]["worst"] < 1.9
    assert np.isfinite(none.cost)


def test_constraints_that_are_none():
    fleet = turned()
    for text, words in (
        ("disk", "is no number with a bound"), ("disk >= 0.5", 'Write "disk above 0.5"'),
        ("disk depth_pid above 0.5", "names depth_pid, which is no law of the controller"),
        (5.0, "is not a list"), ([5.0], "is no number with a bound"),
    ):  # fmt: skip
        says(refused(lw.tune_gains, fleet, OVER, "iae heading", constraints=text, **RUN), "constraints", words)
    open_ = dataclasses.replace(fleet.scene, controller=None)
    says(refused(lw.tune_gains, open_, {"vehicle.mass": (20.0, 21.0)}, "depth", constraints="disk above 0.5", **RUN),
         "the scene has no controller")  # fmt: skip
