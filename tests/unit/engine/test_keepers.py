# SPDX-License-Identifier: Apache-2.0
"""A keeper that another process gets brings nothing of what it has gathered."""

import pickle

import numpy as np

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


def test_members_beyond_those_that_ran_are_not_run_again():
    status = np.zeros(5, np.uint8)
    assert Observation(keep=(2, 5, 7)).again(status).tolist() == [2]
    assert Observation(keep="failed").again(np.array([0, 3, 0])).tolist() == [1]
    assert Observation(keep="none").again(status).tolist() == []
