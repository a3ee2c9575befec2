# SPDX-License-Identifier: Apache-2.0
"""Runs side by side, with samples or with statistics alone: the curves say the same."""

import dataclasses

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.statistics.estimates.estimate import Estimate, Estimates
from lgvi_warp.views.plots.canvas import band
from tests.support.made import made

N, LEVELS = 41, np.array([0.05, 0.5, 0.95])
RUN = made(np.linspace(10.0, 20.0, N)[:, None] * np.array([0.0, 0.0, 1.0]) + np.arange(6.0)[:, None, None])
DEPTH = RUN.position[..., 2]


def estimate(kind, **arrays):
    """A statistic of the depths of RUN."""
    coordinates = {"time": RUN.time, "component": np.array(["depth"]), "level": LEVELS}
    return Estimate(f"{kind} depth", {"type": kind}, "m", 0.95, "", {"value": ("time",)}, arrays, coordinates)


def bare(*estimates):
    """RUN as keep="none" leaves it."""
    return dataclasses.replace(RUN, samples={}, statistics=Estimates(estimates))


QUANTILES = estimate("quantiles", value=np.quantile(DEPTH, LEVELS, axis=1).T[..., None])
MEAN = estimate(
    "mean", **{name: DEPTH.mean(axis=1)[:, None] + d for name, d in {"lower": -1, "value": 0, "upper": 1}.items()}
)


def edges(area):
    """Lowest and highest depth of a filled band at its first time."""
    points = area.get_paths()[0].vertices
    return np.array([depths(points[points[:, 0] == RUN.time[0], 1]) for depths in (np.min, np.max)])


def test_quantiles_stand_for_samples():
    axes = lw.plots.compare({"samples": RUN, "statistics": bare(MEAN, QUANTILES)})
    of_samples, of_statistics = (line for line in axes.lines if line.get_label()[:2] in ("sa", "st"))
    np.testing.assert_allclose(of_statistics.get_ydata(), of_samples.get_ydata())
    np.testing.assert_allclose(edges(axes.collections[1]), edges(axes.collections[0]))
    assert of_samples.get_label() == f"samples: {N} members"
    assert of_statistics.get_label() == f"statistics: {N} members, 50% quantile, and band of 90%"
    assert of_samples.get_linestyle() != of_statistics.get_linestyle()


def test_a_mean_has_its_interval():
    axes = lw.plots.compare({"a": bare(MEAN)})
    np.testing.assert_allclose(axes.lines[0].get_ydata(), DEPTH.mean(axis=1))
    np.testing.assert_allclose(edges(axes.collections[0]), DEPTH[0].mean() + np.array([-1.0, 1.0]))
    legend = axes.get_legend()
    assert axes.lines[0].get_label() == f"a: {N} members, mean and 95% confidence interval"
    assert legend.get_title().get_text() == ""


def test_nothing_kept_and_nothing_gathered_is_refused():
    with pytest.raises(NothingToDraw, match=r'keep="all"'):
        lw.plots.compare({"a": RUN, "b": bare()})


def test_a_band_says_what_it_holds_and_never_more():
    assert [band(*levels) for levels in ((0.05, 0.95), (0.25, 0.75), (0.001, 0.999), (0.0, 0.5))] == [
        "90%",
        "50%",
        "99.8%",
        "50%",
    ]
