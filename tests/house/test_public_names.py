# SPDX-License-Identifier: Apache-2.0
"""Public names that were replaced: the old ones still work, warn, and name the new ones."""

import inspect
import pickle
from pathlib import Path

import pytest

import lgvi_warp as lw
from lgvi_warp.cli.arguments import parser
from lgvi_warp.cli.command import VERBS

RENAMED = {
    "Frozen": "ScipyDistribution",
    "Levels": "UnitCubePoints",
    "Setting": "PackingContext",
    "from_fossen": "vehicle_tables_from_fossen",
    "from_sdf": "vehicle_tables_from_sdf",
    "from_yaml": "vehicle_tables_from_yaml",
    "quantity": "number",
    "register": "register_term",
}


@pytest.mark.parametrize(("old", "new"), RENAMED.items())
def test_an_old_name_is_the_new_thing_and_warns_each_time(old, new):
    for _ in range(2):
        with pytest.warns(DeprecationWarning, match=rf"lw\.{old} is now lw\.{new};") as warned:
            assert getattr(lw, old) is getattr(lw, new)
        assert warned[0].filename == __file__
    assert new in lw.__all__
    assert old not in lw.__all__


def test_the_old_name_of_uq():
    with pytest.warns(DeprecationWarning, match=r"lw\.uq\.Model is now lw\.uq\.ScalarModel;"):
        assert lw.uq.Model is lw.uq.ScalarModel
    with pytest.raises(AttributeError, match="no attribute 'Models'"):
        lw.uq.Models


def test_an_old_name_pickles_as_the_new_class():
    with pytest.warns(DeprecationWarning, match="UnitCubePoints"):
        design = lw.Levels([[0.25, 0.5]])
    loaded = pickle.loads(pickle.dumps(design))
    assert type(loaded) is lw.UnitCubePoints
    assert loaded.points.tolist() == [[0.25, 0.5]]


def test_the_verb_plan_is_the_verb_predict():
    chosen = [vars(parser().parse_args([verb, "scene.toml", "--members", "3"])) for verb in ("plan", "predict")]
    assert chosen[0].pop("verb") == "plan"
    assert chosen[1].pop("verb") == "predict"
    assert chosen[0] == chosen[1]
    assert VERBS["plan"] is VERBS["predict"]
    assert "predict (plan)" in parser().format_help()


def test_no_room_bears_the_name_of_a_function():
    # Once a room is imported, it is an attribute of the package.
    rooms = {path.stem for path in Path(lw.__path__[0]).iterdir()}
    assert {name for name in rooms & set(lw.__all__) if not inspect.ismodule(getattr(lw, name))} == set()
