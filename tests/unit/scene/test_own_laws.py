# SPDX-License-Identifier: Apache-2.0
"""Distributions that are objects of the user's: one whose text is the same is told from another by what it does."""

import numpy as np
import pytest
from scipy import stats

import lgvi_warp as lw
from lgvi_warp.scene.functions import functions_of, identities

NAME = "start.position[0]"
SETTINGS = dict(method="psi_s", h=0.1, t1=0.2)


class Scaled:
    """A law from 0 to a number, which its text does not say."""

    def __init__(self, width):
        self.width = width

    def ppf(self, u):
        return self.width * np.asarray(u)

    def __repr__(self):
        return "Scaled()"


class Generic(stats.rv_continuous):
    """One of the user's, by scipy's rules."""

    def _cdf(self, x, width):
        return np.clip(x / width, 0.0, 1.0)

    def _ppf(self, u, width):
        return width * u


class Twice(Generic):
    """Another one, of the same name in scipy."""

    def _ppf(self, u, width):
        return 2.0 * width * u


def north(state, tick):
    return tick["position"][:, 0]


def told(law):
    return identities(functions_of(lw.Ensemble(lw.Scene.named("sphere"), 4, 1, {NAME: law})))


@pytest.mark.parametrize(("single", "again", "compared"), [
    (Scaled(1.0), Scaled(1.0), Scaled(2.0)),
    (Generic(name="own")(1.0), Generic(name="own")(1.0), Twice(name="own")(1.0)),
], ids=["object", "of scipy"])  # fmt: skip
def test_laws_of_one_text_differ(single, again, compared):
    first, same, second = told(single), told(again), told(compared)
    assert first.keys() == {f"vary.{NAME}"}
    assert first == same != second


def test_laws_of_libraries_say_what_they_are():
    """Their text has all their numbers. (A new one of scipy's remembers what it was asked, and is the same nevertheless.)"""
    for law in (
        stats.gamma(2.0),
        stats.Normal(mu=1.0, sigma=2.0),
        lw.distributions.Normal(std=1.0),
        stats.rv_histogram(([1, 2], [0, 1, 2]))(),
    ):
        assert told(law) == {}


@pytest.mark.ci
@pytest.mark.kernel
def test_a_store_and_a_sweep_take_no_law_for_another(tmp_path):
    scene = lw.Scene.named("sphere")
    one, other = (lw.Ensemble(scene, 300, 1, {NAME: Scaled(width)}) for width in (1.0, 2.0))
    lw.solve(one, **SETTINGS, store=tmp_path / "run.zarr", blocks=range(1))
    with pytest.raises(lw.SceneError, match=r"functions\.vary\.start\.position\[0\] is "):
        lw.resume(tmp_path / "run.zarr", other)
    assert lw.resume(tmp_path / "run.zarr", one).members == 300
    for fleet in (one, other, one):
        found = lw.sweep(
            fleet,
            [{"name": "all"}],
            metrics=[lw.metrics.CustomMetric(north, name="north")],
            out=tmp_path / "sweep",
            **SETTINGS,
        )
        np.testing.assert_array_equal(found.values("all", "north"), fleet.select(0, 300).position[:, 0])
    assert len(list((tmp_path / "sweep" / "cells").iterdir())) == 2
