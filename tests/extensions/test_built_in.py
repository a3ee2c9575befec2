# SPDX-License-Identifier: Apache-2.0
"""The extensions that come with the package are found by their words."""

from importlib import import_module

import pytest

import lgvi_warp as lw
from lgvi_kernels.maps.bounded import written_here
from lgvi_warp.common import extensions
from lgvi_warp.physics.terms import TYPES
from tests.conftest import ROOT
from tests.house.test_start import modules_after
from tests.unit.common.test_extensions import told_by


def test_a_word_of_one_extension_imports_what_it_needs_alone():
    modules = modules_after("import lgvi_warp as lw; lw.Scene.named('torpedo', terms=[{'type': 'polar'}])")
    loaded = {name for name in modules if name.startswith("lgvi_warp.extensions.gliders.")}
    assert loaded == {"lgvi_warp.extensions.gliders.terms", "lgvi_warp.extensions.gliders.terms.polar"}


def test_lists_have_the_words_of_extensions():
    assert "polar" in TYPES
    assert "polar" in list(TYPES)
    assert TYPES["polar"] is lw.terms.Polar
    assert {"seawing", "remus_100"} <= set(lw.vehicles.names())
    with pytest.raises(lw.SceneError, match="Did you mean 'polar'"):
        lw.Scene.named("torpedo", terms=[{"type": "polarr"}])


def test_every_place_of_a_built_in_extension_is_there():
    for module in extensions.built_in():
        for table, held in module.HOLDS.items():
            for word in held:
                if table == "vehicles":
                    assert extensions.file(table, word).exists(), word
                else:
                    assert extensions.load(table, word) is not None, word


def test_a_scene_with_its_own_class_does_not_take_the_word_of_an_extension():
    code = """
import json
import lgvi_warp as lw
class Mine(lw.laws.Term):
    type = "polar"
print(json.dumps([lw.laws.Term.kinds["polar"].__module__, Mine.__module__]))
"""
    assert told_by(code, ROOT)[0] == ["lgvi_warp.extensions.gliders.terms.polar", "__main__"]


@pytest.mark.parametrize(
    "path", sorted((ROOT / "lgvi_warp" / "extensions").glob("*/device/*.py")), ids=lambda path: path.stem
)
def test_device_code_of_the_package_is_trusted_with_the_whole_memory(path):
    # A pump writes to the account of the energy used, beyond its own rows.
    module = import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
    assert written_here(module)
