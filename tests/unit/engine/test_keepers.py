# SPDX-License-Identifier: Apache-2.0
"""A keeper that another process gets brings nothing of what it has gathered."""

import pickle

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.engine.block import blocks
from lgvi_warp.engine.keepers.observation import Observation
from lgvi_warp.engine.keepers.statistics import Gathered


def test_statistics_are_sent_without_what_they_gathered():
    statistics = [lw.statistics.Mean("depth"), lw.statistics.Quantiles("speed")]
    gathered = Gathered(np.arange(3.0), 1000, statistics)
    empty = pickle.dumps(gathered)
    part = {"samples": np.random.default_rng(1).normal(size=100_000)}
    gathered.merge(blocks(1000)[0], [part, part])
    sent = pickle.dumps(gathered)
    assert len(sent) == len(empty) < part["samples"].nbytes / 100
    received = pickle.loads(sent)
    assert received.statistics[0].key == statistics[0].key
    assert received.time.tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize("count", [1, 3, 4])
def test_parts_of_a_block_are_as_many_as_the_statistics(count):
    # As a damaged store has them: parts too many are none of a later block.
    gathered = Gathered(np.arange(3.0), 1000, [lw.statistics.Mean("position"), lw.statistics.Covariance("position")])
    with pytest.raises(ValueError, match="zip"):
        gathered.merge(blocks(1000)[0], [{}] * count)


def test_members_beyond_those_that_ran_are_not_run_again():
    status = np.zeros(5, np.uint8)
    assert Observation(keep=(2, 5, 7)).again(status).tolist() == [2]
    assert Observation(keep="failed").again(np.array([0, 3, 0])).tolist() == [1]
    assert Observation(keep="none").again(status).tolist() == []


@pytest.mark.ci
@pytest.mark.kernel
def test_statistics_are_the_same_whether_blocks_run_as_one_or_apart(tmp_path):
    """Also of members that ended, and of a function that sees members; a store runs each block apart."""
    scene = lw.Scene.named("nordkvist_sanyal", start={"velocity": [0.2, 0.0, 0.1]}, events=[lw.events.Floor(depth=0.1)])
    vary = {
        "start.velocity": lw.distributions.Normal(std=0.1),
        "vehicle.buoyancy": lw.distributions.Normal(relative=0.01),
    }
    fleet = lw.Ensemble(scene, 700, 1, vary)
    own = lw.statistics.Quantity("own", lambda samples, members: samples["position"][..., 2] * members.indices)
    kinds = lw.statistics.Mean, lw.statistics.Covariance, lw.statistics.Extremes
    asked = [kind(of) for kind in kinds for of in ("position", own)]
    asked += [
        lw.statistics.Quantiles("speed", size=64),
        lw.statistics.Mean("depth", at="floor"),
        lw.statistics.Outcome("floor"),
    ]
    seen = []
    settings = dict(method="psi_s", h=0.05, t1=1.0, keep="none", statistics=asked, threads=1)
    as_one = lw.solve(fleet, **settings, on_block=lambda result: seen.append(result.members))
    apart = lw.solve(fleet, **settings, store=tmp_path / "apart.zarr")
    assert seen == [700]
    assert set(as_one.status.counts()) == {"ok", "floor"}
    for name, estimate in as_one.statistics.items():
        for array, values in estimate.arrays.items():
            np.testing.assert_array_equal(values, apart.statistics[name][array], err_msg=f"{name} {array}")
