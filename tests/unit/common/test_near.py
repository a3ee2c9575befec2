# SPDX-License-Identifier: Apache-2.0
"""Unknown names are refused with the nearest known one: methods, vehicles, keywords of functions, public names."""

import enum
import inspect
import pickle

import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.common.nearest import nearest
from lgvi_warp.results.drawn import DrawnParameters, DrawnStarts
from tests.conftest import ROOT
from tests.support.public import PATHS
from tests.support.refusals import says

SCENE = lw.Scene.named("sphere")


@pytest.mark.parametrize(
    ("word", "names", "answer"),
    [
        ("RK4", ("psi_s", "rk4", "rk8"), "rk4"),
        ("current", ("Current", "CurrentField", "Drag"), "Current"),
        ("PID", ("HeadingPID", "PosePID", "LQR"), "PosePID"),
        ("track", ("summary", "Some_tracks_of_all"), "Some_tracks_of_all"),
        ("kp", ("heading_pid.kp", "depth_pid.ki"), "heading_pid.kp"),
        ("xyz", ("mass", "inertia"), None),
        ("", ("mass",), None),
    ],
)
def test_the_nearest_name_whatever_its_case(word, names, answer):
    assert nearest(word, names) == answer


def test_names_in_another_case():
    for call, name in (
        (lambda: lw.Method("RK4"), "rk4"),
        (lambda: lw.solve(SCENE, "Psi_S", h=0.1, t1=0.1), "psi_s"),
        (lambda: lw.Scene.named("REMUS_100"), "remus_100"),
        (lambda: lw.Scene.from_dict({"vehicle": {"Mass": 3.0}}), "mass"),
    ):
        with pytest.raises(lw.SceneError, match=f"Did you mean '{name}'"):
            call()


@pytest.mark.parametrize(
    ("door", "word", "name"),
    [("terms", "current", "Current"),
     ("control", "PID", "DepthPID' or 'HeadingPID' or 'HeavePID' or 'PosePID' or 'SpeedPID"),
     ("events", "floor", "Floor"),
     ("distributions", "normal", "Normal"), ("statistics", "mean", "Mean"), ("designs", "sobol", "Sobol"),
     ("metrics", "overshoot", "Overshoot"), ("", "sovle", "solve"), ("", "ensemble", "Ensemble")],
)  # fmt: skip
def test_public_names_that_are_nearly_right(door, word, name):
    module = getattr(lw, door) if door else lw
    assert set(name.split("' or '")) <= set(dir(module))
    with pytest.raises(AttributeError, match=f"has no attribute '{word}'. Did you mean '{name}'"):
        getattr(module, word)
    assert not hasattr(module, "__path_of_nothing__")


@pytest.mark.parametrize(
    ("place", "word", "name"),
    [("", "Drag", "lw.terms.Drag"), ("", "HeadingPID", "lw.control.HeadingPID"),
     ("control", "Thrusters", "lw.terms.Thrusters"), ("", "footprint", "lw.plots.footprint' or 'lw.studies.footprint"),
     ("terms", "Controller", "lw.Controller")],
)  # fmt: skip
def test_public_names_behind_another_door(place, word, name):
    with pytest.raises(AttributeError, match=f"has no attribute '{word}'. Did you mean '{name}'"):
        getattr(getattr(lw, place) if place else lw, word)


def test_a_word_that_several_names_end_with_names_all_of_them():
    scene = lw.Scene.load(ROOT / "examples" / "scenes" / "remus_100_autopilot.toml", {"ensemble.members": 2})
    with pytest.raises(lw.SceneError, match=r"Did you mean 'depth_pid\.kp' or 'heading_pid\.kp'"):
        scene.with_numbers({"kp": 1.0})


def test_options_by_the_names_of_arguments(capsys):
    for word, option in (("--dt", "--step"), ("--t1=3", "--duration"), ("--n", "--members"), ("--stpe", "--step")):
        with pytest.raises(SystemExit):
            cli.main(["run", "scene.toml", word, "3"])
        assert f"is not known. Did you mean '{option}'?" in capsys.readouterr().err


def keywords(kind):
    """Keywords of a constructor, the longest first; none where it takes any."""
    parameters = inspect.signature(kind).parameters.values()
    if any(each.kind is each.VAR_KEYWORD for each in parameters):
        return []
    named = [each.name for each in parameters if each.kind in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY)]
    return sorted(named, key=len, reverse=True)


CLASSES = {path: thing for path, thing in PATHS.items() if isinstance(thing, type) and not inspect.isabstract(thing)}
# Of these, those whose constructor is Python's own, and those that take any keyword.
OTHERS = {path for path, kind in CLASSES.items() if issubclass(kind, enum.Enum | tuple) or not keywords(kind)}


@pytest.mark.parametrize("path", sorted(set(CLASSES) - OTHERS))
def test_an_unknown_keyword_of_a_class_gets_the_nearest(path):
    kind = CLASSES[path]
    known = keywords(kind)
    word = f"{known[0][:-1]}zz"
    meant = nearest(word, tuple(inspect.signature(kind).parameters))
    with pytest.raises(lw.SceneError) as caught:
        kind(**{word: None})
    remedy = f"Did you mean {meant!r}?" if meant else f"Known: {', '.join(inspect.signature(kind).parameters)}"
    text = f"{kind.__qualname__}() got an unexpected keyword argument {word!r}. {remedy}"
    assert str(caught.value).removesuffix(".") == text
    assert isinstance(caught.value, TypeError)
    assert type(pickle.loads(pickle.dumps(caught.value))) is type(caught.value)


def test_classes_whose_keywords_are_not_checked_are_few():
    assert len(CLASSES) > 120
    assert len(OTHERS) <= 12, OTHERS


def test_a_subclass_hands_its_own_keywords_on():
    class Mine(lw.SaveAt):
        def __init__(self, mine, **more):
            super().__init__(**more)
            object.__setattr__(self, "mine", mine)

    assert (Mine(mine=3, every=0.5).mine, Mine(mine=3, every=0.5).every) == (3, 0.5)
    with pytest.raises(TypeError, match="unexpected keyword argument 'evry'"):
        Mine(mine=3, evry=0.5)


# Functions that take settings of a run, and keywords of other packages with what they are here.
FUNCTIONS = {
    "solve": lw.solve, "prepare": lw.prepare, "predict": lw.predict, "sweep": lw.sweep, "rare_event": lw.rare_event,
    "estimate": lw.estimate, "stability_map": lw.stability_map, "worst_case": lw.worst_case, "tune_gains": lw.tune_gains,
    "derivatives": lw.derivatives, "margins": lw.linear.margins, "trim": lw.linear.trim, "linearize": lw.linear.linearize,
    "loop": lw.linear.loop,
}  # fmt: skip
ELSEWHERE = {"dt": "h", "timestep": "h", "Metod": "method", "H": "h"}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_unknown_keywords_name_the_nearest(name):
    for word, known in ELSEWHERE.items():
        told = rf"^{name}\(\) got an unexpected keyword argument '{word}'. Did you mean '{known}s?'"
        with pytest.raises(TypeError, match=told):
            FUNCTIONS[name](SCENE, **{word: 0.1})
    with pytest.raises(TypeError, match=r"Known: .*\bh\b"):
        FUNCTIONS[name](SCENE, **{"zzz": 0.1})


def test_a_float_that_is_whole_is_refused_with_the_number_to_write():
    for call, key in (
        (lambda: lw.Ensemble(SCENE, members=1e4), "ensemble.members"),
        (lambda: lw.solve(SCENE, h=0.1, t1=0.1, threads=1e4), "threads"),
        (lambda: lw.designs.LatinHypercube(group=1e4), "group"),
        (lambda: lw.statistics.Histogram("depth", bins=1e4, limits=(0.0, 1.0)), "bins"),
    ):
        with pytest.raises(lw.SceneError) as refused:
            call()
        says(str(refused.value), key, "whole number", "Write 10000")
    with pytest.raises(lw.SceneError, match="Give 1 or more"):
        lw.Ensemble(SCENE, members=1.5)


def test_drawn_numbers_are_shown_by_their_names():
    fleet = lw.Ensemble(SCENE, 5, 1, {"vehicle.buoyancy": lw.distributions.Normal(std=0.1)})
    drawn = DrawnParameters(fleet, 5)
    title, first, *others = repr(drawn).splitlines()
    assert title == "Numbers of 5 members"
    assert first.split() == ["vehicle.buoyancy", "varies;", "the", "first:", f"{drawn['vehicle.buoyancy'][0]:.6g}"]
    assert [line.split()[0] for line in others] == [name for name in drawn if name != "vehicle.buoyancy"]
    assert repr(DrawnStarts(fleet, 5)) == "Numbers of 5 members"
