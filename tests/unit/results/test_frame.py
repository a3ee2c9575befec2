# SPDX-License-Identifier: Apache-2.0
"""A run as a table of pandas, beside the arrays that it is of; parameters as a table of text."""

import dataclasses
import sys

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.results.drawn import GivenParameters

pytestmark = pytest.mark.kernel
STATES = {"position": "m", "euler": "rad", "velocity": "m/s", "angular_velocity": "rad/s"}


def fleet(members=8, **start):
    scene = lw.Scene.named(
        "sphere", start={"position": [0, 0, 5], "velocity": [0, 0, 1.0]} | start, events=[lw.events.Floor(depth=5.5)]
    )
    # A spread that lets some reach the floor.
    vary = {
        "start.velocity": lw.distributions.Normal(std=[0.0, 0.0, 1.0]),
        "vehicle.mass": lw.distributions.Normal(std=0.1),
    }
    return lw.Ensemble(scene, members, seed=3, vary=vary if members > 1 else None)


def solved(members=8, **settings):
    return lw.solve(fleet(members), h=0.1, t1=1.0, **settings)


@pytest.fixture(scope="module")
def result():
    return solved()


def assert_is_of(frame, result):
    """Each column is that of the arrays, which are read here in another way: as samples of single members."""
    for name, unit in STATES.items():
        for i in range(3):
            column = f"{name}[{i}]"
            assert frame.attrs["units"][column] == unit
            np.testing.assert_array_equal(frame[column], getattr(result, name)[-1, :, i])
    assert frame["outcome"].tolist() == [lw.Status(int(code)).name.lower() for code in result.status]
    np.testing.assert_array_equal(frame["end_time"], [min(1.0, 1.0 if np.isnan(t) else t) for t in result.failure_time])


@pytest.mark.ci
def test_a_row_for_each_member(result):
    frame = result.frame()
    assert {"ok", "floor"} == set(frame["outcome"])
    assert_is_of(frame, result)
    assert list(frame.columns[:3]) == ["vehicle.mass", "start.velocity[2]", "outcome"]
    np.testing.assert_array_equal(frame["vehicle.mass"], fleet().numbers(0, 8)["vehicle.mass"])
    np.testing.assert_array_equal(frame["start.velocity[2]"], fleet().numbers(0, 8)["start.velocity"][:, 2])
    assert frame.index.name == "member"
    assert frame.index.tolist() == list(range(8))


@pytest.mark.ci
def test_of_a_store_a_file_a_part_and_single_precision(result, tmp_path):
    solved(store=tmp_path / "run.zarr")
    stored, whole = lw.open_run(tmp_path / "run.zarr"), result.frame()
    assert stored.frame().equals(whole)
    assert lw.Result.load(result.save(tmp_path / "run.npz")).frame().equals(whole)
    columns = [f"{name}[{i}]" for name in STATES for i in range(3)]
    for run in (result.part([5, 2]), lw.open_run(tmp_path / "run.zarr", members=[5, 2])):
        np.testing.assert_array_equal(run.frame()[columns], whole.loc[[5, 2], columns])
    assert_is_of(solved(dtype="float32").frame(), solved(dtype="float32"))


@pytest.mark.ci
def test_without_the_end_the_last_samples_are_read(result, tmp_path):
    fewer = dataclasses.replace(result, end=None)
    assert fewer.frame().equals(result.frame())
    solved(store=tmp_path / "run.zarr", save=lw.SaveAt(every=0.1, final=False))
    stored = lw.open_run(tmp_path / "run.zarr")
    assert stored.end is None
    assert stored.frame().equals(result.frame())


@pytest.mark.ci
def test_one_member_and_what_was_not_kept():
    one = solved(1).frame()
    assert list(one.columns[:2]) == ["outcome", "end_time"]
    assert len(one) == 1
    kept = solved(keep="none").frame()
    assert list(kept.columns) == ["vehicle.mass", "start.velocity[2]", "outcome", "end_time"]
    few = solved(save=lw.SaveAt(every=0.1, fields=["position"])).frame()
    assert [name for name in few if "[" in name and not name.startswith("start")] == [
        f"position[{i}]" for i in range(3)
    ]


def test_without_pandas_the_extra_is_named(result, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match=r"pandas: .*pip install '.*\[store\]'"):
        result.frame()


@pytest.mark.ci
def test_parameters_are_shown_as_a_table(result, tmp_path):
    solved(store=tmp_path / "run.zarr")
    runs = (
        result,
        result.part([1, 3]),
        lw.Result.load(result.save(tmp_path / "run.npz")),
        lw.open_run(tmp_path / "run.zarr"),
    )
    for run in runs:
        assert {"parameters", "frame"} <= set(dir(run))
        title, *lines = repr(run.parameters).splitlines()
        assert "members" in title or "arrays" in title
        assert "vehicle.mass " in lines[0] + lines[1]
        assert max(map(len, lines)) <= 96
    assert "varies; the first: " in repr(result.parameters)
    one = GivenParameters({"a": np.array([2.0]), "b": np.array([1.0, 3.0])})
    assert repr(one).splitlines() == ["Numbers of 2 members", "  b  varies: 2 numbers, 1 to 3", "  a  2"]
    assert repr(GivenParameters()) == "Numbers of 0 members"
