# SPDX-License-Identifier: Apache-2.0
"""Numbers of gliders' terms that are too large to be meant."""

import pytest

from tests.support.refusals import says
from tests.unit.scene.test_plausibility import in_waves
from tests.unit.scene.test_term_limits import WATER, beyond_is_said, said, scene

ODD = {
    "stratification": (lambda g: scene(type="stratification", gradient=g), 0.049, 10.0, "stratification.gradient", "10 1/m"),
    "compressibility": (lambda c: scene(type="stratification", gradient=0.0, compressibility=c, reference_depth=45.0),
                        4.9e-3, 0.1,
                        "stratification.compressibility", "0.1 1/m"),
    "ballast": (lambda V: scene(type="ballast", position=[[0.0, 0.0, 0.0]], command=[V]), 0.99 * WATER, 1.0,
                "ballast.command", "1 m3", "displaces"),
    "limit of ballast": (lambda V: scene(type="ballast", position=[[0.0, 0.0, 0.0]], limit=[V]), 0.99 * WATER, 1.0,
                         "ballast.limit", "displaces"),
}  # fmt: skip


@pytest.mark.parametrize("name", ODD)
def test_beyond_a_rule_is_said_and_at_it_is_not(name):
    beyond_is_said(*ODD[name])


def test_a_limit_that_is_none_is_not_odd():
    assert said(scene(type="ballast", position=[[0.0, 0.0, 0.0]])) == ()


def test_a_hull_without_volume_at_its_start_is_said():
    soft = scene(type="stratification", gradient=1e-5, compressibility=4e-3)
    (text,) = said(soft.with_numbers({"start.position[2]": 251.0}))
    says(text, "stratification.compressibility", "no volume left", "251 m")
    assert said(soft.with_numbers({"start.position[2]": 249.0})) == ()


def test_a_path_that_begins_at_once_is_said():
    def path(*times, mass=10.0):
        return scene(type="moving_mass", mass=mass, times=list(times), places=[[0.0, 0.0, 0.05], [0.03, 0.0, 0.05]])

    (text,) = said(path(0.0, 3.0))
    says(text, "moving_mass", "0.01 m/s", "kick")
    assert said(path(1.0, 3.0)) == ()
    assert said(path(0.0, 3.0, mass=1.0)) == ()


def test_what_floats_may_start_at_the_surface_in_waves():
    assert len(said(in_waves(0.5))) == 1
    assert said(in_waves(0.5, terms=[{"type": "surface_buoyancy", "heights": 0.2}])) == ()
