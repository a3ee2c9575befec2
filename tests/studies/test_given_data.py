# SPDX-License-Identifier: Apache-2.0
"""Indices from given data of whole runs: a sphere without forces, whose depth is its start plus its velocity times time."""

import numpy as np
import pytest
from scipy.stats import norm

import lgvi_warp as lw
from tests.runs.test_weights import SETTINGS, T1, fleet_of

pytestmark = pytest.mark.kernel

START, SPEED = 0.3, 0.2
VARY = {
    "start.position[2]": lw.distributions.Normal(std=START),
    "start.velocity[2]": lw.distributions.Normal(std=SPEED),
    "start.position[0]": lw.distributions.Normal(std=1.0),
}
SHARES = {"start.position[2]": START**2, "start.velocity[2]": (SPEED * T1) ** 2, "start.position[0]": 0.0}
TOTAL = sum(SHARES.values())


@pytest.fixture(scope="module")
def fleet():
    return lw.Ensemble(fleet_of(2).scene, 4000, 3, VARY)


@pytest.fixture(scope="module")
def result(fleet):
    return lw.solve(fleet, **SETTINGS)


@pytest.mark.ci
def test_shares_are_those_of_the_closed_form(result):
    """A bin of 31 leaves a 31st squared of an input's variance within it, and so does chance: 0.02 is five of its errors."""
    found = lw.uq.given_data(result, ["depth", "outcome floor", "depth at 0.5"])
    assert set(found.factors) == set(SHARES)
    for name, share in SHARES.items():
        at = found.factors.index(name)
        assert found.first[0, at] == pytest.approx(share / TOTAL, abs=0.02)
        assert found.lower[0, at] - 0.02 <= share / TOTAL <= found.upper[0, at] + 0.02
        assert np.sign(found.slope[0, at]) == (1.0 if share else np.sign(found.slope[0, at]))
    assert found.quantities == ("depth", "outcome floor", "depth at 0.5")
    assert found.mean[1] == pytest.approx(norm.sf(15.0 - 10.0 - 2.0 * T1, scale=np.sqrt(TOTAL)), abs=0.02)
    # Earlier the start explains more.
    at = found.factors.index("start.position[2]")
    assert found.first[2, at] == pytest.approx(START**2 / (START**2 + (0.5 * SPEED) ** 2), abs=0.02)


@pytest.mark.ci
def test_a_store_and_a_file_give_the_same(fleet, result, tmp_path):
    lw.solve(fleet, **SETTINGS, store=tmp_path / "run.zarr")
    asked = ["depth", "max(position)", "end_time floor"]
    wanted = lw.uq.given_data(result, asked)
    for other in (tmp_path / "run.zarr", lw.Result.load(result.save(tmp_path / "run.npz"))):
        found = lw.uq.given_data(other, asked)
        assert found.factors == wanted.factors
        np.testing.assert_array_equal(found.first, wanted.first)
    assert "start.velocity[2]" in str(wanted)
    again = lw.uq.Indices.from_dict(wanted.to_dict())
    np.testing.assert_array_equal(again.slope, wanted.slope)


@pytest.mark.ci
def test_what_has_no_indices_is_said(result):
    still = lw.solve(lw.Ensemble(fleet_of(2).scene, 8), **SETTINGS)
    with pytest.raises(lw.SceneError, match="no number that differs between members"):
        lw.uq.given_data(still, "depth")
    with pytest.raises(lw.SceneError, match="members with weights"):
        lw.uq.given_data(lw.solve(fleet_of(300), **SETTINGS), "depth")
    alike = result.part(np.flatnonzero(result.status == lw.Status.OK))
    assert "outcome floor does not vary" in lw.uq.given_data(alike, "outcome floor").messages[-1]
    bare = lw.solve(lw.Ensemble(fleet_of(2).scene, 300, 3, VARY), **SETTINGS, keep="none")
    with pytest.raises(lw.SceneError, match=r'no samples of all were kept. Run with keep="all"'):
        lw.uq.given_data(bare, "depth")
    assert lw.uq.given_data(bare, "outcome floor").first.shape == (1, 3)


@pytest.mark.ci
def test_correlated_inputs_are_named():
    both = lw.distributions.CorrelatedNormal(std=[0.3, 0.2], correlation=[[1.0, 0.8], [0.8, 1.0]])
    fleet = lw.Ensemble(fleet_of(2).scene, 500, 3, {"start.position[2], start.velocity[2]": both})
    found = lw.uq.given_data(lw.solve(fleet, **SETTINGS), "depth")
    assert "are correlated (0." in found.messages[0]


def test_the_picture_has_a_bar_with_its_interval_for_each_input(result, tmp_path):
    pytest.importorskip("matplotlib")
    axes = lw.plots.sensitivity(lw.uq.given_data(result, "depth"), path=tmp_path / "bars.png")
    assert len(axes[0].patches) == 3
    assert axes[0].get_xlabel() == "share of variance"
