# SPDX-License-Identifier: Apache-2.0
"""Same inputs, same bits: any number of threads, any order of members, alone or among others. Failures beside: extremes."""

import gc
import weakref

import numpy as np
import pytest

import lgvi_warp as lw
from benchmarks import problems
from lgvi_kernels.advance import kernel
from lgvi_kernels.lanes.arithmetic import WIDTHS
from lgvi_kernels.lanes.flags import CPU_FLAGS
from lgvi_warp.engine import kernel as kernels
from lgvi_warp.engine.block import blocks
from lgvi_warp.runs.settle import make_plan
from tests.conftest import ROOT
from tests.support.tools import random_states, scene_of

FIELDS = ("position", "attitude", "velocity", "angular_velocity")


@pytest.fixture(scope="module")
def fleet():
    """1,003 different members in several blocks, the last packet ragged; mass and inertia vary as well."""
    scene = scene_of((10.0, 12.0, 15.0), (1.0, 2.0, 2.5), net=-0.3, moment=(0.0, 0.1, -0.5))
    n = 1003
    rng = np.random.default_rng(5)
    parameters = {"vehicle.mass": 5.0 + rng.random(n),
                  "vehicle.inertia": np.array([1.0, 2.0, 2.5]) + rng.random((n, 3))}  # fmt: skip
    return lw.Ensemble.from_states(scene, *random_states(3, n), parameters)


@pytest.fixture(scope="module", params=["float64", "float32"])
def run(request):
    def solve(ensemble, **named):
        return lw.solve(ensemble, "psi_s", h=0.01, t1=0.75, save=lw.SaveAt(every=0.25), dtype=request.param, **named)

    return solve


def same(x, y, members=slice(None)):
    """Whether two results hold the same bytes, x's members chosen by an index."""
    return all(getattr(x, f)[:, members].tobytes() == getattr(y, f).tobytes() for f in FIELDS)


@pytest.mark.ci
def test_threads(fleet, run):
    assert len(blocks(fleet.members)) > 3
    reference = run(fleet, threads=1)
    assert all(same(reference, run(fleet, threads=threads)) for threads in (2, 3, 4))


@pytest.mark.ci
def test_order_of_members(fleet, run):
    order = np.random.default_rng(1).permutation(fleet.members)
    assert same(run(fleet), run(fleet.subset(order)), order)


@pytest.mark.ci
def test_alone_or_among_others(fleet, run):
    reference = run(fleet)
    for member in (0, 513, 1002):
        assert same(reference, run(fleet.subset([member])), [member])


@pytest.mark.ci
def test_samples_do_not_change_the_path(fleet):
    dense = lw.solve(fleet, h=0.01, t1=0.75, save=lw.SaveAt(every=0.01))
    sparse = lw.solve(fleet, h=0.01, t1=0.75)
    assert dense.position[-1].tobytes() == sparse.position[-1].tobytes()


def scene_called(name):
    """The paper's scene, or REMUS 100 under way."""
    if name == "paper":
        return lw.Scene.load(ROOT / "examples" / "paper.toml")
    return lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0}, start={"velocity": [1.5, 0.1, 0.0]})


@pytest.mark.slow
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize(("name", "method"), [("paper", "psi_s"), ("paper", "psi_x"), ("remus", "psi_x")])
def test_any_width(name, method, dtype, monkeypatch):
    # Left free to fuse, the compiler joins another product of a sum with the addition at another width. Nothing else differs.
    flags = CPU_FLAGS.replace("-ffp-contract=fast", "-ffp-contract=off")
    assert flags != CPU_FLAGS
    monkeypatch.setattr(kernel, "CPU_FLAGS", flags)
    monkeypatch.setattr(kernels, "make_advance", kernel.make_advance.__wrapped__)
    fleet = lw.Ensemble(scene_called(name), 37, 1, {"start.angular_velocity": lw.distributions.Normal(std=0.1)})

    def solve(width):
        return lw.solve(fleet, method, h=0.01, t1=3.0, dtype=dtype, width=width)

    reference = solve(8)
    assert all(same(reference, solve(width)) for width in WIDTHS)


# Two laws with enough rows to share: kernels of all laws, in both precisions, take long to compile.
TABLED = (problems.waves, problems.fins)
EACH_OF_THEM = [pytest.param(problems.ALL, dtype, marks=pytest.mark.slow) for dtype in ("float64", "float32")]


@pytest.mark.slow
@pytest.mark.parametrize(("laws", "dtype"), [(TABLED, "float64"), *EACH_OF_THEM])
def test_laws_with_rows_that_members_share(laws, dtype):
    """A number that all members share, given for each of them, has the same bits in another kernel."""
    scene, states = problems.scene(*(make() for make in laws)), random_states(3, 40)
    shared = lw.Ensemble.from_states(scene, *states)
    varied = lw.Ensemble.from_states(scene, *states, {"waves.amplitudes[0]": np.full(40, 0.3)})
    # Packets of 4 lanes, which some processors have by default, copy so few rows to each lane.
    settings = {"method": "psi_s", "h": 0.05, "t1": 1.0, "dtype": dtype, "width": 16}
    assert [make_plan(fleet, **settings).spec.shared_rows for fleet in (shared, varied)] == [True, False]
    assert same(*(lw.solve(fleet, **settings) for fleet in (shared, varied)))


@pytest.mark.ci
def test_what_is_known_of_a_scene_changes_no_bit():
    """A scene that has run, by other methods, steps and members, gives the bits of one that never did."""

    def made():
        drag = lw.terms.Drag(quadratic=(10.0, 20.0, 20.0, 1.0, 2.0, 2.0))
        start = lw.Start(velocity=[1.0, 0.2, 0.1], angular_velocity=[0.1, 0.2, 0.3])
        return lw.Scene.named("nordkvist_sanyal", terms=[drag], start=start)

    def solved(scene, column, values, method, h):
        fleet = lw.Ensemble(scene, None, 0, None, lw.designs.Table(values={column: np.asarray(values)}))
        result = lw.solve(fleet, method, h=h, t1=0.1, width=4)
        return [value.tobytes() for value in result.samples.values()], result.provenance["kernel"]

    runs = [
        (column, values, method, h)
        for method, h in (("psi_x", 0.01), ("rk4", 0.02), ("psi_x", 0.02))
        # Without drag another kernel runs; mass and inertia take part in other results.
        for column, values in (
            ("drag.quadratic[0]", [0.0, 0.0]),
            ("drag.quadratic[0]", [5.0, 7.0]),
            ("vehicle.mass", [120.0]),
        )
    ]
    known = made()
    for _ in range(2):
        for run in runs:
            assert solved(known, *run) == solved(made(), *run), run


@pytest.mark.ci
def test_what_is_known_of_a_scene_goes_with_it():
    scene = lw.Scene.named("remus_100", start=lw.Start(velocity=[1.5, 0.0, 0.0]))
    fleet = lw.Ensemble(scene, 3, 1, {"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
    lw.solve(fleet, "psi_x", h=0.01, t1=0.02)
    left = weakref.ref(scene)
    del scene, fleet
    gc.collect()
    assert left() is None
