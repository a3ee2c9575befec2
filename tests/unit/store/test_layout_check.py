# SPDX-License-Identifier: Apache-2.0
"""The layout of a store's arrays: each must fit the others and the run, and be what this package writes."""

import dataclasses
import json

import pytest

from lgvi_warp.results import member_fields
from lgvi_warp.store.layout import KEPT_MEMBER, MEMBER
from lgvi_warp.store.layout_check import Layout, NotOursError, StoredArray, layout_of

MEMBERS, BLOCK, TIMES = 1003, 256, 31
SHAPES = {"position": (3,), "attitude": (3, 3), "velocity": (3,), "angular_velocity": (3,)}


def arrays():
    """Arrays of a run of all fields, with one number that varies and one that was given; several chunks along the times."""
    found = {"time": StoredArray((TIMES,), (TIMES,), "<f8", ("time",), {"units": "s"})}
    found["step"] = StoredArray((TIMES,), (TIMES,), "<i8", ("time",), {})
    for name, dtype in [(MEMBER, "<i8"), *((field.name, field.dtype) for field in member_fields.FIELDS)]:
        found[name] = StoredArray((MEMBERS,), (BLOCK,), dtype, (MEMBER,), {})
    for name, tail in SHAPES.items():
        dims = ("time", MEMBER, *(f"axis_{i}" for i in range(len(tail))))
        found[name] = StoredArray((TIMES, MEMBERS, *tail), (10, BLOCK, *tail), "<f4", dims, {"units": "m"})
    found["vehicle.inertia"] = StoredArray((MEMBERS, 3), (BLOCK, 3), "<f8", (MEMBER, "axis"), {})
    found["explicit/vehicle.mass"] = StoredArray((50,), (50,), "<f8", ("row",), {})
    found["chosen"] = StoredArray((MEMBERS,), (MEMBERS,), "|u1", (KEPT_MEMBER,), {})
    return found


def read(answer, groups=("explicit",), members=MEMBERS):
    """The layout of these arrays as their metadata tell it."""
    content = json.loads(Layout(answer, groups, (), TIMES).root({}))
    return layout_of(content, members)


def test_what_is_written_is_read():
    found = arrays()
    layout = read(found)
    assert (layout.arrays, layout.times, layout.groups) == (found, TIMES, ("explicit",))
    columns = {column.name: column for column in layout.columns}
    assert set(columns) == set(found) - {"time", "step", "chosen", "explicit/vehicle.mass"}
    for name, column in columns.items():
        timed = name in SHAPES
        assert (column.tail, column.dtype) == (found[name].shape[1 + timed :], found[name].dtype)
        assert layout.chunk_bytes(f"{name}/c" + (".0" * len(found[name].shape))) == found[name].bytes


NAMES = sorted(arrays())


@pytest.mark.parametrize("name", NAMES)
def test_an_array_of_another_type_is_not_ours(name):
    found = arrays()
    others = {"<f8", "<f4", "<i8", "<u2", "|u1"} - {found[name].dtype}
    if name.startswith("explicit/"):
        return  # what was given may have any type
    for dtype in others - ({"<f8"} if name in SHAPES else set()):
        with pytest.raises(NotOursError, match=name):
            read(found | {name: dataclasses.replace(found[name], dtype=dtype)})


@pytest.mark.parametrize("name", NAMES)
def test_an_array_of_another_shape_or_other_chunks_is_not_ours(name):
    found, array = arrays(), arrays()[name]
    for axis in range(len(array.shape)):
        member_axis = array.dims[axis] in (MEMBER, KEPT_MEMBER)
        for change in (-1, 1):
            shape, chunk = list(array.shape), list(array.chunk)
            shape[axis] += change
            chunk[axis] += change
            # Times are cut as it suits; a whole array may have another length where nothing else is as long.
            if name == "explicit/vehicle.mass":
                wrong = [(array.shape, tuple(chunk))]
            elif name == "vehicle.inertia" and not member_axis:
                wrong = [(array.shape, tuple(chunk)), (tuple(shape), array.chunk)]
            elif axis == 0 and name in SHAPES:
                wrong = [(tuple(shape), array.chunk)]
            elif name == "time":
                wrong = [(tuple(shape), tuple(chunk)), (array.shape, tuple(chunk))]
            else:
                wrong = [(tuple(shape), tuple(chunk)), (tuple(shape), array.chunk), (array.shape, tuple(chunk))]
            for other, cut in wrong:
                with pytest.raises(NotOursError):
                    read(found | {name: dataclasses.replace(array, shape=other, chunk=cut)})


@pytest.mark.parametrize("name", ["time", "step", MEMBER, "status", "failure_time"])
def test_an_array_that_all_runs_have_is_missing(name):
    found = arrays()
    del found[name]
    with pytest.raises(NotOursError, match=f"has no {name}"):
        read(found)


def test_other_members_and_groups_are_not_ours():
    for members in (MEMBERS - 1, MEMBERS + 1):
        with pytest.raises(NotOursError):
            read(arrays(), members=members)
    for groups in ((), ("explicit", "more"), ("more",)):
        with pytest.raises(NotOursError, match="groups that no run has"):
            read(arrays(), groups)
    for name in ("../x", "a/b/c", "explicit/..", "C:", "nul\n", "x" * 300):
        with pytest.raises(NotOursError, match="not a name of an array"):
            read(arrays() | {name: arrays()["step"]})
    with pytest.raises(NotOursError):
        read(arrays() | {"speeds": arrays()["status"]})
    # A group of kept members has metadata of its own.
    assert "kept/position" not in read(arrays() | {"kept/position": arrays()["step"]}).arrays


def test_only_files_of_the_layout_have_a_size():
    layout = read(arrays())
    assert layout.chunk_bytes("position/c.3.3.0") == 10 * BLOCK * 3 * 4 + 4
    for key in (
        "position/c.4.0.0",
        "position/c.0.4.0",
        "position/c.0.0.1",
        "position/c.0.0",
        "position/d.0.0.0",
        "place/c.0",
    ):
        assert layout.chunk_bytes(key) is None
    frame = layout.frame()
    assert frame["time/c.0"] == TIMES * 8 + 4
    assert frame["explicit/zarr.json"] is None
    assert "position/c.0.0.0" not in frame
    assert frame["chosen/c.0"] == MEMBERS + 4
    assert frame["explicit/vehicle.mass/c.0"] == 50 * 8 + 4
