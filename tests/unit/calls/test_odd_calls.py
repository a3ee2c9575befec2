# SPDX-License-Identifier: Apache-2.0
"""Public names called with one odd argument each: what they cannot take they refuse by name, with the remedy."""

import traceback
import warnings
from pathlib import Path

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.errors import MissingExtra, NothingToDraw
from tests.support import odd_calls
from tests.unit.cli.test_terminal import region, sobol
from tests.unit.measuring.test_cost import found as tradeoff_of

# What a call may end with: the refusal, a picture of nothing, a library that is not installed, a file that is not there.
DELIBERATE = (lw.SceneError, NothingToDraw, MissingExtra, OSError)
# Studies and trials of the disk: seconds each where an odd argument is taken, as None is.
LONG = {"stability_map", "suggest", "term_cost", "linearize", "trim", "tradeoff", "margins", "sweep", "tune_gains",
        "worst_case", "rare_event", "estimate", "derivatives", "assimilate", "predict", "record", "report", "statistics",
        "summary"}  # fmt: skip
PACKAGE = str(Path(lw.__file__).parent)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    scene = lw.Scene(lw.Vehicle(**odd_calls.BODY), terms=[lw.terms.Drag(linear=[1.0] * 6)])
    fleet = lw.Ensemble(scene, 4, 1, {"vehicle.buoyancy": lw.distributions.Normal(relative=0.01)})
    return scene, fleet, lw.solve(fleet, h=0.1, t1=0.4), tmp_path_factory.mktemp("odd")


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    """A text is a path too: what is written there is not left in the folder of the tests."""
    monkeypatch.chdir(tmp_path)


def raw(function, arguments):
    """The error that a call ends with, unless it is deliberate, or Python's own of a call that does not fit the signature."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            function(**arguments)
    except DELIBERATE:
        return None
    except Exception as error:
        # A class hands its arguments on after a look at its keywords.
        frames = [frame.filename for frame in traceback.extract_tb(error.__traceback__)]
        inside = any(name.startswith(PACKAGE) and not name.endswith("common/near.py") for name in frames)
        return None if isinstance(error, TypeError) and not inside else error
    return None


def raw_of(calls):
    """The calls that end in raw errors, as texts."""
    found = []
    for label, function, arguments in calls:
        error = raw(function, arguments)
        if error is not None:
            found.append(f"{label}: {type(error).__name__}: {error}")
    return found


@pytest.mark.ci
@pytest.mark.kernel
def test_no_odd_call_ends_in_a_raw_error(inputs):
    calls = [call for call in odd_calls.odd_calls(*inputs) if call[0].split("(")[0] not in LONG]
    some = np.random.default_rng(5).choice(len(calls), 600, replace=False)
    assert raw_of(calls[i] for i in some) == []


@pytest.mark.kernel
@pytest.mark.parametrize("name", ["Altitude", "CurrentField", "Trajectory", "Waypoints"])
def test_no_odd_word_or_array_of_a_part_ends_in_a_raw_error(name, inputs):
    calls = [call for call in odd_calls.odd_calls(*inputs) if call[0].startswith(f"{name}(")]
    assert len(calls) > 100
    assert raw_of(calls) == []


@pytest.mark.slow
@pytest.mark.kernel
def test_no_odd_call_of_a_picture_or_a_method_ends_in_a_raw_error(inputs):
    scene, _, result, folder = inputs
    assert raw_of(odd_calls.odd_calls_within(scene, result, folder, (tradeoff_of(4.0), sobol(), region()))) == []


@pytest.mark.parametrize(
    "draw", ["attitude", "drift", "fan", "histogram", "outcomes", "pairs", "paths", "phase", "plan_view"]
)
@pytest.mark.parametrize("odd", [None, 3, "x", np.zeros(3), lw.Result])
def test_pictures_are_of_results(draw, odd):
    with pytest.raises(lw.SceneError, match=r"^result = .*is not a Result. Give what lw.solve"):
        getattr(lw.plots, draw)(odd)


@pytest.mark.parametrize("odd", [None, 3, "", "a\0b", b"x", object()])
def test_what_is_no_path_is_told_before_anything_is_read_or_written(odd):
    for call in (tradeoff_of(4.0).save, tradeoff_of(4.0).to_csv, sobol().save, type(region()).load, lw.Result.load):
        with pytest.raises(lw.SceneError, match=r"(path|folder) = .*(is not a path|is empty|null character)"):
            call(odd)


@pytest.mark.parametrize("odd", [None, "x", 2.5, True, [[1.0], [1.0, 2.0]], np.zeros(3), 10**400, -1])
def test_members_that_are_none_are_told_by_index(odd):
    fleet = lw.Ensemble(lw.Scene(lw.Vehicle(**odd_calls.BODY)), 4)
    for call in (
        fleet.member,
        fleet.subset,
        lambda index: fleet.select(index, 2),
        lambda index: fleet.select(0, index),
    ):
        with pytest.raises(IndexError, match=r"^members "):
            call(odd)


@pytest.mark.slow
@pytest.mark.kernel
def test_every_odd_call(inputs):
    # Of the long ones those that no study takes.
    calls = [
        call
        for call in odd_calls.odd_calls(*inputs)
        if call[0].split("(")[0] not in LONG or any(type(value) is object for value in call[2].values())
    ]
    assert raw_of(calls) == []


@pytest.mark.parametrize(
    "name", ["method", "dtype", "checks", "on_failure", "device", "executor", "save", "statistics", "on_block"]
)
def test_arrays_are_refused_where_a_word_is_meant(name):
    fleet = lw.Ensemble(lw.Scene(lw.Vehicle(**odd_calls.BODY)), 4)
    with pytest.raises(lw.SceneError, match=name):
        lw.solve(fleet, h=0.1, t1=0.2, **{name: np.zeros(3)})


@pytest.mark.parametrize("call", [lw.solve, lw.prepare, lw.predict])
def test_a_device_other_than_the_cpu_is_refused(call):
    scene = lw.Scene(lw.Vehicle(**odd_calls.BODY))
    with pytest.raises(
        lw.SceneError, match=r"^device = 'cuda:0' .* runs are on CPU cores. Leave it out, or give \"cpu\"$"
    ):
        call(scene, h=0.1, t1=0.2, device="cuda:0")


def test_inertia_and_added_mass_are_given_by_name():
    with pytest.raises(TypeError, match="positional"):
        lw.Vehicle(20.0, (1.5, 4.0, 4.5), (5.0, 22.0, 25.0))


@pytest.mark.ci
@pytest.mark.kernel
def test_a_store_that_is_being_written_is_told_so(tmp_path):
    fleet = lw.Ensemble(lw.Scene(lw.Vehicle(**odd_calls.BODY)), 600)
    told = []

    def look(block):
        try:
            lw.open_run(tmp_path / "run.zarr")
        except lw.SceneError as error:
            told.append(str(error))

    lw.solve(fleet, "psi_s", h=0.1, t1=0.2, store=tmp_path / "run.zarr", on_block=look)
    assert told
    assert all("is being written (process" in text and "resume" not in text for text in told)
    assert lw.open_run(tmp_path / "run.zarr").members == 600
