# SPDX-License-Identifier: Apache-2.0
"""`store` of `lw.rare_event` and `lw.estimate`: an interrupted call goes on where it ended, with the same answer."""

import shutil

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.npy_files import write_npz
from lgvi_warp.criteria.memory import Remembered
from lgvi_warp.uncertainty.estimating.levels import Runs
from lgvi_warp.uncertainty.rare.limit import VehicleLimit
from lgvi_warp.uncertainty.rare.walk import VehicleWalk
from tests.support.refusals import refused, says

SECONDS = ("seconds", "plain_seconds", "pilot_seconds")


def fleet(std=0.1):
    return lw.Ensemble(lw.Scene.named("sphere"), vary={"start.velocity[2]": lw.distributions.Normal(std=std)})


def rare(limit="depth - 0.35", std=0.1, **more):
    more = {"method": "psi_x", "h": 0.1, "t1": 1.0, "threads": 1, "relative_error": 0.3} | more
    return lw.rare_event(fleet(std), limit, **more)


def of_conditions(**more):
    """Two conditions, whose limits are kept by condition, and a cheaper setting, which has calls of its own."""
    conditions = {"max(depth)": {"above": 0.35}, "min(position[2])": {"below": -0.35}}
    return rare(conditions, save=lw.SaveAt(every=0.5), cheaper=[{"h": 0.2}], **more)


def likely(**more):
    """Event so likely that it is sampled plainly."""
    return rare("depth - 0.1", **more)


def estimate(of="mean position[2]", error=0.002, **more):
    return lw.estimate(fleet(), of, error, **{"t1": 1.0, "method": "psi_x", "threads": 1, "seed": 3} | more)


CALLS = {"rare": (rare, VehicleLimit), "conditions": (of_conditions, VehicleLimit), "plain": (likely, VehicleLimit),
         "estimate": (estimate, Runs)}  # fmt: skip


def answer(finding):
    """All that an answer holds but times, as text and to the bit."""
    content = {name: value for name, value in finding.to_dict().items() if name not in SECONDS}
    return repr(content)


@pytest.fixture
def ran(monkeypatch):
    """The members of each batch that was run; with `most` set, one more batch is interrupted."""

    class Batches(list):
        most = np.inf

    batches = Batches()
    for kind in (VehicleLimit, Runs):

        def run(self, *arguments, _own=kind._ran):
            if len(batches) >= batches.most:
                raise KeyboardInterrupt
            batches.append(len(arguments[-1]))
            return _own(self, *arguments)

        monkeypatch.setattr(kind, "_ran", run)
    return batches


@pytest.mark.ci
@pytest.mark.parametrize("name", CALLS)
def test_an_interrupted_call_goes_on_with_the_same_answer(name, tmp_path, ran):
    call, _ = CALLS[name]
    whole = answer(call())
    batches = list(ran)
    assert len(batches) > 3
    cuts, done = (1, len(batches) - 1), 0
    for cut in cuts:
        ran.clear()
        ran.most = cut - done
        with pytest.raises(KeyboardInterrupt):
            call(store=tmp_path / "kept")
        assert ran == batches[done:cut]
        done = cut
    ran.clear()
    ran.most = np.inf
    assert answer(call(store=tmp_path / "kept")) == whole
    assert ran == batches[done:]
    # All is kept then: nothing is run, and no file is touched.
    ran.clear()
    files = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in (tmp_path / "kept").iterdir()}
    assert len(files) == len(batches)
    assert answer(call(store=str(tmp_path / "kept"))) == whole
    assert ran == []
    assert {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in (tmp_path / "kept").iterdir()} == files


def split(**more):
    """An event of noise and of a number that varies, along a few pieces."""
    noise = lw.terms.WrenchNoise(force=(30.0, 0.0, 0.0))
    scene = lw.Scene.named("sphere", terms=[lw.terms.Drag(linear=[20.0] * 3 + [1.0] * 3), noise])
    members = lw.Ensemble(scene, vary={"start.position[0]": lw.distributions.Normal(std=0.5)})
    more = {"by": "splitting", "intervals": 5, "relative_error": 0.5, "most": 10_000, "seed": 2} | more
    return lw.rare_event(members, "position[0] - 6.0", method="psi_x", h=0.1, t1=3.0, threads=1, **more)


@pytest.mark.ci
def test_splitting_goes_on_after_the_last_level(tmp_path, monkeypatch):
    """Its pilot's plain members alone are run again."""
    went, most, own = [], [np.inf], VehicleWalk.advance

    def advance(self, flock, keys):
        if len(went) >= most[0]:
            raise KeyboardInterrupt
        went.append(len(keys))
        return own(self, flock, keys)

    monkeypatch.setattr(VehicleWalk, "advance", advance)
    whole = answer(split())
    calls = len(went)
    went.clear()
    most[0] = 2 * calls // 3
    with pytest.raises(KeyboardInterrupt):
        split(store=tmp_path / "kept")
    assert len(list((tmp_path / "kept").iterdir())) > 3
    went.clear()
    most[0] = np.inf
    assert answer(split(store=tmp_path / "kept")) == whole
    assert len(went) < 0.6 * calls
    went.clear()
    assert answer(split(store=tmp_path / "kept")) == whole
    assert len(went) < 0.3 * calls
    says(refused(split, store=tmp_path / "kept", intervals=6), "store", "keeps the calls of other arguments")
    torn = sorted((tmp_path / "kept").iterdir())[-1]
    torn.write_bytes(torn.read_bytes()[:100])
    assert answer(split(store=tmp_path / "kept")) == whole


@pytest.mark.ci
def test_a_progress_callback_may_interrupt(tmp_path, ran):
    def stop(fraction):
        if fraction > 0.3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        rare(store=tmp_path, progress=stop)
    first = len(ran)
    assert first > 0
    ran.clear()
    found = rare(store=tmp_path)
    rest = len(ran)
    ran.clear()
    assert answer(found) == answer(rare())
    assert len(ran) == first + rest


@pytest.mark.ci
def test_a_torn_file_is_made_anew(tmp_path, ran):
    whole = answer(rare(store=tmp_path))
    files = sorted(tmp_path.iterdir())
    content = [path.read_bytes() for path in files]
    damages = (b"", content[0][: len(content[0]) // 2], b"no archive")
    for torn, damaged in zip((files[-1], files[1], files[0]), damages, strict=True):
        torn.write_bytes(damaged)
    ran.clear()
    assert answer(rare(store=tmp_path)) == whole
    assert len(ran) == 3
    # A bit that has changed is seen by the checksum.
    spoilt = bytearray(files[0].read_bytes())
    spoilt[len(spoilt) // 2] ^= 1
    files[0].write_bytes(spoilt)
    ran.clear()
    assert answer(rare(store=tmp_path)) == whole
    assert len(ran) == 1


@pytest.mark.ci
def test_a_store_of_other_arguments_is_refused_before_anything_runs(tmp_path, ran):
    rare(store=tmp_path / "rare")
    estimate(store=tmp_path / "estimate")
    ran.clear()
    text = "store", "keeps the calls of other arguments", "another folder"
    others = [{"seed": 1}, {"limit": "depth - 0.36"}, {"std": 0.11}, {"h": 0.05}, {"relative_error": 0.2}, {"t1": 1.1},
              {"failed": "refuse"}, {"cheaper": [{"h": 0.2}]}]  # fmt: skip
    for other in others:
        says(refused(rare, store=tmp_path / "rare", **other), *text)
    for other in [{"seed": 1}, {"error": 0.003}, {"of": "position[2] above 0.1"}, {"t1": 1.1}, {"risk": 0.9},
                  {"cheaper": [{"vehicle.mass": 900.0}]}]:  # fmt: skip
        says(refused(estimate, store=tmp_path / "estimate", **other), *text)
    says(refused(rare, store=tmp_path / "estimate"), *text)
    assert ran == []
    # Threads change no number, and a copy is as good.
    shutil.copytree(tmp_path / "estimate", tmp_path / "copy")
    assert answer(estimate(store=tmp_path / "copy", threads=2)) == answer(estimate(store=tmp_path / "estimate"))
    assert ran == []
    write_npz(tmp_path / "000000.npz", {"someone": np.ones(3)})
    says(refused(rare, store=tmp_path), *text)


@pytest.mark.ci
def test_functions_are_told_apart(tmp_path, ran):
    save = lw.SaveAt(at=[1.0])
    bound = 0.35
    found = rare(lambda result: result.samples["position"][-1, :, 2] - bound, save=save, store=tmp_path)
    ran.clear()
    again = rare(lambda result: result.samples["position"][-1, :, 2] - bound, save=save, store=tmp_path)
    assert answer(again) == answer(found)
    assert ran == []
    bound = 0.36
    limit = lambda result: result.samples["position"][-1, :, 2] - bound  # noqa: E731
    says(refused(rare, limit, save=save, store=tmp_path), "keeps the calls of other arguments")


def test_what_cannot_be_kept_is_refused(tmp_path):
    says(refused(rare, store=3), "store", "is not a path")
    (tmp_path / "file").write_text("a file")
    with pytest.raises(OSError, match="file"):
        rare(store=tmp_path / "file")


def test_a_call_that_fails_has_a_number_and_no_file(tmp_path):
    """The calls that follow it are found by their own numbers."""

    def double(x):
        if x[0] < 0.0:
            raise ValueError("below 0")
        return (2.0 * x,)

    def all_of(remembered):
        (first,) = remembered("double", double, np.array([1.0]))
        with pytest.raises(ValueError, match="below 0"):
            remembered("double", double, np.array([-1.0]))
        (second,) = remembered("double", double, np.array([2.0, 3.0]))
        return [*first, *second]

    for _ in range(2):
        assert all_of(Remembered(tmp_path)) == [2.0, 4.0, 6.0]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["000000.npz", "000002.npz"]
    says(refused(Remembered(tmp_path), "double", double, np.array([1.5])), "store", "another call as 000000.npz")
