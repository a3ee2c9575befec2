# SPDX-License-Identifier: Apache-2.0
"""Answers in files: what JSON cannot hold, files that are damaged, and whose members a study is about."""

import json
import math

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.criteria import files, members
from lgvi_warp.runs.request import ensemble_of


def test_numbers_that_json_cannot_hold_are_none():
    content = {"a": math.inf, "b": [1.0, math.nan, (2, np.float32(3.0))], "c": np.array([[1.0, -math.inf]]), "d": "x",
               "e": None}  # fmt: skip
    plain = files.finite_or_none(content)
    assert plain == {"a": None, "b": [1.0, None, [2, 3.0]], "c": [[1.0, None]], "d": "x", "e": None}
    assert type(plain["b"][2][1]) is float
    assert files.with_missing_as(plain, 7.0) == {
        "a": 7.0,
        "b": [1.0, 7.0, [2, 3.0]],
        "c": [[1.0, 7.0]],
        "d": "x",
        "e": 7.0,
    }


class Study(files.Saved):
    study = "example"

    def to_dict(self):
        return {"x": 1.5}

    def rows(self):
        return [{"x": 1.5, "y": "a"}]

    @classmethod
    def from_dict(cls, content):
        assert content == {"x": 1.5}
        return cls()


def test_a_study_writes_two_files(tmp_path):
    paths = Study().save(tmp_path / "new" / "folder")
    assert [path.relative_to(tmp_path).as_posix() for path in paths] == [
        "new/folder/example.json",
        "new/folder/example.csv",
    ]
    assert (paths[0].read_text(), paths[1].read_text().split()) == ('{\n "x": 1.5\n}', ["x,y", "1.5,a"])
    named = Study().save(tmp_path, "other")
    assert [path.name for path in named] == ["other.json", "other.csv"]
    assert json.loads(named[0].read_text()) == {"x": 1.5}


def test_a_damaged_file_is_said_to_be_damaged(tmp_path):
    for error in (ValueError("a"), KeyError("b"), TypeError("c"), AttributeError("d")):
        with pytest.raises(lw.SceneError) as caught, files.of_study(tmp_path / "x.json"):
            raise error
        head = f"{tmp_path / 'x.json'}: is damaged, or of another version"
        assert str(caught.value) == f"{head}: {error}; run the study again"
        assert caught.value.__cause__ is error
    with pytest.raises(lw.SceneError, match="itself"), files.of_study(tmp_path):
        raise lw.SceneError(["itself"])
    with pytest.raises(OSError, match="gone"), files.of_study(tmp_path):
        raise OSError("gone")


def test_whose_members_a_study_is_about(scene):
    fleet = lw.Ensemble(scene, 3)
    assert ensemble_of(fleet) is fleet
    assert members.scene_of(fleet) is fleet.scene
    assert members.scene_of(scene) is scene
    assert ensemble_of(scene).members == scene.ensemble_settings.members
    with pytest.raises(lw.SceneError) as caught:
        ensemble_of(3)
    assert str(caught.value) == "fleet = 3: is neither an Ensemble nor a Scene; give lw.Scene(...) or lw.Ensemble(...)"
    with pytest.raises(lw.SceneError) as caught:
        members.scene_of(3)
    assert str(caught.value) == "scene = 3: is neither a Scene nor an Ensemble; give lw.Scene(...)"
