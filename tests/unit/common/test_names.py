# SPDX-License-Identifier: Apache-2.0
"""Names of terms and events become folders of a store: what any file system refuses, drops or takes for another is refused."""

import pytest

import lgvi_warp as lw
from lgvi_warp.common import names
from lgvi_warp.common.errors import one_line
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.scene.scene import from_dict
from lgvi_warp.store.layout import columns
from tests.support.refusals import says

BODY = {"mass": 10.0, "inertia": [1.0, 2.0, 2.5], "buoyancy": 98.0}
DRAG = {"type": "drag", "linear": [1.0] * 6}

# Names, and words of the refusal.
BAD = [("a/b", "has '/'"), ("/abs", "has '/'"), ("/", "has '/'"), ("..", "begins with a point"),
       (".", "begins with a point"), ("../../escaped", "has '/'"), (".hidden", "begins with a point"),
       ("a\\b", "has '\\\\'"), ("C:", "has ':'"), ("a\0b", "'\\x00'"), ("a\nb", "'\\n'"), ("\u202egnp", "'\\u202e'"),
       ("a" * 300, "has 300 bytes"), ("ü" * 60, "has 120 bytes"), ("con", "device on Windows"),
       ("NUL", "device on Windows"), ("com1", "device on Windows"), ("COM\u00b9", "device on Windows"),
       ("lpt9.x", "device on Windows"), ("aux .x", "device on Windows"), ("drag.", "ends with a point"),
       ("drag ", "ends with a space"), (" drag", "begins with a space"), ("-drag", "begins with '-'"),
       ("drag*", "has '*'"), ("drag?", "has '?'"), ('"drag"', "has '\"'"), ("a,b", "has ','"), ("drag[0]", "has '['"),
       ("$(touch x)", "has '$'"), ("a|b", "has '|'"), ("e\u0301", "has '\u0301'"), ("\ud800", "'\\ud800'")]  # fmt: skip


@pytest.mark.parametrize(("name", "words"), BAD, ids=[ascii(name)[:20] for name, _ in BAD])
@pytest.mark.parametrize("section", ["terms", "events"])
def test_a_name_that_is_no_folder_everywhere_is_refused(name, words, section):
    table = DRAG if section == "terms" else {"type": "floor", "depth": 9.0}
    with pytest.raises(lw.SceneError) as caught:
        from_dict({"vehicle": BODY, section: [table | {"name": name}]})
    (fault,) = caught.value.faults
    assert fault.isprintable()
    says(fault, ".name = ", ". ")
    assert one_line(words) in fault


GOOD = ["drag_2", "half of 1.0", "_", "2nd", "bow-thruster", "Strömung", "流れ", "a" * 100, "console"]


@pytest.mark.parametrize("name", GOOD)
def test_a_name_that_is_a_folder_everywhere_is_taken(name):
    scene = from_dict({"vehicle": BODY, "terms": [DRAG | {"name": name}]})
    assert f"{name}.linear" in scene.parameters()


def test_a_type_of_the_user_is_a_name_too():
    kind = type("Odd", (lw.terms.Current,), {"type": "../odd"})
    with pytest.raises(lw.SceneError, match="has '/'"):
        kind(velocity=[0.1, 0.0, 0.0])
    assert kind(velocity=[0.1, 0.0, 0.0], name="even").key == "even"


@pytest.mark.parametrize(("first", "second"), [("Drag", "drag"), ("STRASSE", "straße"), ("\u212b", "å"), ("ﬁn", "fin")])
def test_names_that_are_one_folder_on_some_systems_are_refused(first, second):
    tables = {"terms": [DRAG | {"name": first}], "events": [{"type": "floor", "depth": 9.0, "name": second}]}
    with pytest.raises(lw.SceneError, match="is the same folder as"):
        from_dict({"vehicle": BODY, **tables})
    assert names.folded(first) == names.folded(second)


@pytest.mark.parametrize("name", ["vehicle", "environment", "start", "Vehicle"])
@pytest.mark.parametrize("section", ["terms", "events"])
def test_a_section_of_the_scene_is_no_name(name, section):
    table = DRAG if section == "terms" else {"type": "floor", "depth": 9.0}
    with pytest.raises(lw.SceneError, match="name of a section"):
        from_dict({"vehicle": BODY, section: [table | {"name": name}]})


def test_the_longest_name_leaves_room_for_every_field_within_255_bytes():
    scene = from_dict({"vehicle": BODY, "terms": [DRAG | {"name": "a" * names.MOST_NAME_BYTES}]})
    vary = {f"{'a' * names.MOST_NAME_BYTES}.linear": lw.distributions.Uniform(relative=0.1)}
    plan = make_plan(lw.Ensemble(scene, 4, vary=vary), "psi_s", 0.01, 0.1)
    found = [one.name for one in columns(plan, lw.Store("anywhere.zarr"))]
    assert max(len(name.encode()) for name in found) < 150


def test_what_is_alike_is_found_once_for_each_pair():
    assert names.alike(["a", "A", "b", "A", "B"]) == [("a", "A"), ("b", "B")]
    assert names.alike(["a", "a", "b"]) == []
