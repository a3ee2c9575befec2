# SPDX-License-Identifier: Apache-2.0
"""One way of reading members, for every argument that names them."""

import re

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.arguments import members_of
from lgvi_warp.views.drawn import places_of
from tests.support.odd_calls import BODY

N = 4
MASK = [True, False, True, False]


class Column:
    """A column of a data frame, as far as a reader may rely on it."""

    def __init__(self, values):
        self._values = np.asarray(values)

    def __array__(self, dtype=None, copy=None):
        return self._values if dtype is None else self._values.astype(dtype)

    def __iter__(self):
        return iter(self._values)


# (what a user gives, the members that are meant)
GOOD = [
    (MASK, [0, 2]), (np.array(MASK), [0, 2]), (Column(MASK), [0, 2]), (iter(MASK), [0, 2]), ([2, 1], [2, 1]), ((3,), [3]),
    (np.array([1, 0], np.uint8), [1, 0]), ([np.int32(1), 2], [1, 2]), (range(1, 4), [1, 2, 3]), (range(3, 0, -2), [3, 1]),
    (Column([2, 0]), [2, 0]), ((i for i in (0, 3)), [0, 3]), ([1, 1], [1, 1]), (np.array([1, 3], object), [1, 3]),
    (slice(1, 3), [1, 2]), (slice(None), [0, 1, 2, 3]), (slice(None, None, -1), [3, 2, 1, 0]), (slice(-1, 0, -2), [3, 1]),
]  # fmt: skip
ODD = [
    [0.7, 2.9], np.array([1.0]), "2", ["2"], [-1], np.array([0, -1]), slice(4, 9), [], np.zeros(0), [4], [True], [True, 2],
    np.array([[0, 1]]), [[0], [1, 2]], 1, True, None, {0: 1}, [None], [10**400], range(3, 6), range(10**15), range(-2, 2),
    np.ma.masked_array([0, 1], [False, True]), slice("a", 2), b"01", object(), np.array([*MASK, True]), [np.nan], [2**63],
]  # fmt: skip


def label(value):
    """Text of a value, the same in each process."""
    return re.sub(r" at 0x\w+", "", str(value))


@pytest.mark.parametrize(("inputs", "meant"), GOOD, ids=label)
def test_members_are_read(inputs, meant):
    found = members_of("members", inputs, N)
    assert (found.dtype, found.tolist()) == (np.int64, meant)


@pytest.mark.parametrize("odd", ODD, ids=label)
def test_what_names_no_members_is_refused_as_a_fault_and_as_an_index(odd):
    for error in (lw.SceneError, IndexError):
        with pytest.raises(error, match=r"^members = .*\. [A-Z].*\.$"):
            members_of("members", odd, N)


@pytest.fixture(scope="module")
def takers(tmp_path_factory):
    """Every function that takes members, as a function from what is given to the members that it takes."""
    folder = tmp_path_factory.mktemp("members")
    normal = lw.distributions.Normal(relative=0.01)
    scene = lw.Scene(lw.Vehicle(**BODY), terms=[lw.terms.Drag(linear=[1.0] * 6)])
    fleet = lw.Ensemble(scene, N, 1, {"vehicle.buoyancy": normal})
    arguments = {"method": "psi_s", "h": 0.1, "t1": 0.2}
    result = lw.solve(fleet, **arguments)
    stored = lw.solve(fleet, **arguments, store=folder / "run.zarr")
    of = result.parameters["vehicle.buoyancy"]

    def index(values):
        return [int(np.flatnonzero(of == value)[0]) for value in values]

    def exported(members):
        out = lw.export(result, to=folder / "out.csv", members=members, overwrite=True)
        rows = out.read_text().splitlines()
        place = [name.strip('"') for name in rows[0].split(",")].index("realization")
        return list(dict.fromkeys(int(row.split(",")[place]) for row in rows[1:]))

    settings = lw.Scene(lw.Vehicle(**BODY)).to_dict()

    def listed(indices):
        section = {"members": N, "indices": indices, "vary": {"vehicle.buoyancy": normal.to_dict()}}
        chosen = lw.Ensemble.from_scene(lw.Scene.from_dict({**settings, "ensemble": section}))
        return chosen.indices.tolist()

    return {
        "ensemble": lambda members: fleet.subset(members).indices.tolist(),
        "section": listed,
        "result": lambda members: index(result.part(members).parameters["vehicle.buoyancy"]),
        "final": lambda members: result.final.part(members).indices.tolist(),
        "of a store": lambda members: index(stored.part(members).parameters["vehicle.buoyancy"]),
        "open_run": lambda members: index(
            lw.open_run(folder / "run.zarr", members=members).parameters["vehicle.buoyancy"]
        ),
        "keep": lambda members: lw.solve(fleet, **arguments, keep=members).kept_members.tolist(),
        "export": exported,
        "recording": lambda members: places_of(members, N, np.arange(N)).tolist(),
    }


# Those that show or keep a set of members: each once, most in rising order.
SETS = {"keep", "export", "recording"}


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize("name", ["ensemble", "section", "result", "final", "of a store", "open_run", *sorted(SETS)])
def test_every_taker_takes_the_same_members(name, takers):
    for given, meant in GOOD:
        if hasattr(given, "__next__"):
            given = list(meant)
        if name == "section" and isinstance(given, slice):  # a file has no slices
            continue
        found = takers[name](given)
        assert sorted(found) == sorted(set(meant)) if name in SETS else found == meant, given


@pytest.mark.kernel
@pytest.mark.parametrize("name", ["ensemble", "section", "result", "final", "of a store", "open_run", *sorted(SETS)])
def test_every_taker_refuses_the_same(name, takers):
    for odd in ODD:
        if odd is None or (name == "keep" and isinstance(odd, str)):  # None is the default: all; a text names a choice
            continue
        if name == "section" and isinstance(odd, slice):
            continue
        with pytest.raises(lw.SceneError, match=r"(members|places|indices|keep) = .*\. [A-Z].*\."):
            takers[name](odd)


@pytest.mark.ci
@pytest.mark.kernel
def test_a_run_in_a_store_reads_backward_slices_and_masks_as_memory_does(takers, tmp_path):
    fleet = lw.Ensemble(lw.Scene(lw.Vehicle(**BODY)), N, 1, {"start.position": lw.distributions.Normal(std=1.0)})
    result = lw.solve(fleet, "psi_s", h=0.1, t1=0.2)
    lw.solve(fleet, "psi_s", h=0.1, t1=0.2, store=tmp_path / "run.zarr")
    for members in (slice(None, None, -1), slice(3, 0, -2), MASK, [1, 1, 0]):
        np.testing.assert_array_equal(
            lw.open_run(tmp_path / "run.zarr", members=members).position, result.part(members).position
        )
