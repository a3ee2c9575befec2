# SPDX-License-Identifier: Apache-2.0
"""Files that come with the package: their names, and where a name of one is taken for a path."""

import pytest

import lgvi_warp as lw
from lgvi_warp.robustness.sweeps.file import arguments_of_file
from lgvi_warp.scene.examples import example_files, example_title, located
from tests.conftest import ROOT
from tests.support.verbs import main

FILES = {
    path.stem: path
    for part in (".", "scenes", "sweeps", "validation")
    for path in (ROOT / "examples" / part).glob("*.toml")
}
SWEEPS = {path.stem for path in (ROOT / "examples" / "sweeps").glob("*.toml")}


def test_all_files_are_known_by_names_that_differ():
    assert example_files() == FILES
    assert len(FILES) == sum(
        len([*(ROOT / "examples" / part).glob("*.toml")]) for part in (".", "scenes", "sweeps", "validation")
    )
    titles = [example_title(path) for path in FILES.values()]
    assert all(10 < len(title) < 150 and "docs/" not in title for title in titles)
    assert len(set(titles)) == len(titles)


@pytest.mark.parametrize("name", FILES)
def test_each_is_read_in_any_folder(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if name in SWEEPS:
        assert arguments_of_file(f"example:{name}")["scene"].source["file"] in {path.name for path in FILES.values()}
    else:
        assert lw.Scene.load(f"example:{name}").to_dict() == lw.Scene.load(FILES[name]).to_dict()


@pytest.mark.parametrize(
    "name", ["../../x", "../paper", "scenes/remus_100_autopilot", "paper.toml", "/etc/passwd", "", "a\0b"]
)
def test_what_is_no_name_is_refused(name, capsys):
    for read in (located, lw.Scene.load, arguments_of_file):
        with pytest.raises(lw.SceneError, match="is not a known example"):
            read(f"example:{name}")
    for verb in (["run"], ["check"], ["sweep"]):
        with pytest.raises(SystemExit) as end:
            main([*verb, f"example:{name}"])
        assert end.value.code == 2
        assert "is not a known example" in capsys.readouterr().err


def test_a_near_name_is_suggested():
    with pytest.raises(lw.SceneError, match=r"^example:papr is not a known example. Did you mean 'paper'"):
        lw.Scene.load("example:papr")


def test_other_paths_stay_as_they_are(tmp_path):
    assert [located(path) for path in ("paper.toml", tmp_path, 3, None, b"a")] == [
        "paper.toml",
        tmp_path,
        3,
        None,
        b"a",
    ]
    assert located("a.toml", tmp_path) == tmp_path / "a.toml"
    assert located("example:paper", tmp_path) == FILES["paper"]


def test_the_verb_lists_and_prints(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["example"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == [*example_files()]
    for name in ("paper", "example:paper"):
        assert main(["example", name]) == 0
        assert capsys.readouterr().out == FILES["paper"].read_text()
    assert main(["example", "../paper"]) == 2
    assert capsys.readouterr().out == ""
    assert main(["check", "example:paper"]) == 0
    assert not list(tmp_path.iterdir())


def test_a_file_that_was_written_is_found_by_its_sweep(tmp_path, capsys):
    assert main(["example", "dead_thruster"]) == 0
    (tmp_path / "copy.toml").write_text(capsys.readouterr().out)
    assert (
        arguments_of_file(tmp_path / "copy.toml")["scene"].to_dict()
        == lw.Scene.load(FILES["bluerov2_dead_thruster"]).to_dict()
    )
