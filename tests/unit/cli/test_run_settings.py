# SPDX-License-Identifier: Apache-2.0
"""Changes of a scene by arguments, and the folder, store and blocks that they name."""

import pytest

import lgvi_warp as lw
from lgvi_warp.cli import settings
from lgvi_warp.cli.arguments import parsed
from tests.conftest import ROOT

PAPER = str(ROOT / "examples" / "paper.toml")


def chosen(*words):
    """The arguments of the verb run."""
    return parsed(["run", PAPER, *words])


def test_every_option_of_a_run_replaces_its_key():
    words = {"method": "rk4", "step": "0.5", "duration": "7", "dtype": "float32", "solver": "newton", "iterations": "3",
             "tolerance": "1e-9", "rtol": "1e-5", "atol": "1e-6", "checks": "all", "on_failure": "raise",
             "device": "cpu", "keep": "none"}  # fmt: skip
    options = [word for name, text in words.items() for word in (f"--{name.replace('_', '-')}", text)]
    expected = {f"run.{name}": text for name, text in words.items()}
    assert settings.overrides(chosen(*options)) == expected
    plainly = ("--members", "1e6", "--seed", "-3", "--keep", "3,17", "--set", " vehicle.mass = a=b ")
    assert settings.overrides(chosen(*plainly)) == {
        "run.keep": "[3,17]", "ensemble.members": "1000000", "ensemble.seed": "-3", "vehicle.mass": "a=b"}  # fmt: skip
    with pytest.raises(
        lw.SceneError, match=r"^--set = 'vehicle\.mass' is not a NAME=VALUE. Write --set vehicle\.buoyancy=300\.$"
    ):
        settings.overrides(chosen("--set", "vehicle.mass"))


def test_a_scene_is_loaded_with_them():
    scene = settings.load_scene(chosen("--members", "7", "--step", "0.25"))
    assert (scene.ensemble_settings.members, scene.run.step) == (7, 0.25)


@pytest.mark.parametrize(
    ("text", "digits"),
    [("12", "12"), ("-7", "-7"), ("+7", "+7"), ("1e6", "1000000"), ("2.0", "2"), ("-3e2", "-300"), ("2.5", "2.5"),
     ("ten", "ten"), ("1e400", "1e400"), ("", "")],
)  # fmt: skip
def test_a_whole_number_is_written_in_digits(text, digits):
    assert settings.whole_number_text(text) == digits


@pytest.mark.parametrize(
    ("text", "value"),
    [("3,17", "[3,17]"), ("3, 17", "[3, 17]"), ("5", "[5]"), ("all", "all"), ("3,-1", "3,-1"), ("[3]", "[3]")],
)
def test_indices_are_written_as_a_list(text, value):
    assert settings.listed(text) == value


def test_the_folder_is_named_after_the_scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for scene, suffix, name in (("a/dive.toml", "", "dive"), ("dive.toml", "_sweep", "dive_sweep"), ("...toml", "", "scene"),
                                ("...toml", "_x", "scene_x"), (".a.toml", "", ".a")):  # fmt: skip
        words = parsed(["run", scene])
        assert str(settings.out_of(words, suffix)) == f"runs/{name}"
    assert not list(tmp_path.iterdir())
    assert settings.folder(parsed(["run", "dive.toml"]), "_y").is_dir()
    assert (tmp_path / "runs" / "dive_y").is_dir()
    given = parsed(["run", "dive.toml", "--out", str(tmp_path / "a" / "b")])
    assert settings.folder(given, "_y") == tmp_path / "a" / "b"
    assert (tmp_path / "a" / "b").is_dir()
    assert settings.folder(given) == tmp_path / "a" / "b"  # a second time


def test_the_store_and_its_options(tmp_path):
    out = ["--out", str(tmp_path)]
    assert settings.store_settings(chosen(*out)) is None
    kept = {(): "refuse", ("--overwrite",): "overwrite", ("--resume",): "resume"}
    for words, existing in kept.items():
        store = settings.store_settings(chosen(*out, "--store", "zarr", "--store-dtype", "float32", *words))
        assert (store.path, store.dtype, store.existing) == (tmp_path / "run.zarr", "float32", existing)
    assert settings.store_settings(chosen(*out, "--store", "zarr")).dtype is None
    every = ["--store-dtype", "float32", "--blocks", "0:1", "--overwrite"]
    text = "--store-dtype and --blocks and --overwrite is for runs in a store. Add --store zarr, or leave it out."
    with pytest.raises(lw.SceneError) as caught:
        settings.store_settings(chosen(*out, *every))
    assert str(caught.value) == text


def test_blocks_are_a_range():
    assert settings.block_range(chosen()) is None
    assert settings.block_range(chosen("--blocks", "2:10")) == range(2, 10)
    for text in ("3", "3:", ":3", "a:3", "3:a", "1:2:3"):
        with pytest.raises(lw.SceneError) as caught:
            settings.block_range(chosen("--blocks", text))
        words = f"--blocks {text} is not a range of blocks. Write --blocks 0:100 for the first hundred."
        assert str(caught.value) == words
