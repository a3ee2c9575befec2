# SPDX-License-Identifier: Apache-2.0
"""The reference pages say what the code says: statuses, warnings, methods, public names.

`python -m tests.house.test_reference_pages` writes the list of public names anew.
"""

import inspect
import operator
import re

import lgvi_warp as lw
from lgvi_warp.common.status import Status, Warnings
from lgvi_warp.methods import method
from tests.conftest import ROOT

FOLDER = ROOT / "docs" / "reference"
INTRODUCTION = """# Public names

`import lgvi_warp as lw`. `help(lw.solve)` prints arguments with shapes, units and defaults. What is not listed here may
change. The root, `lw`, has what most scripts use. All else is behind doors such as `lw.terms`; `dir(lw.terms)` lists what
one holds. A test writes this page.
"""
# What the root is for, and its names.
ROOT_NAMES = {
    "Describe": "Scene Vehicle Environment Start Ensemble Controller Method SaveAt Store Until",
    "Run": "solve prepare predict resume open_run gather merge export",
    "Ask": "suggest tradeoff estimate stability_map sweep worst_case tune_gains rare_event assimilate derivatives",
    "See": "show record report select_members",
    "Get back": "Result Prepared Sweep Status Warnings SceneError MembersFailed Interrupted",
}
# {door: its title, its page}.
DOORS = {
    "terms": ("Terms: what acts", "[pages](../guide/terms/README.md)"),
    "events": ("Events: what stops a member", "[page](../guide/events.md)"),
    "control": ("Parts of a controller", "[pages](../controllers/README.md)"),
    "distributions": ("Distributions: how a number varies", "[page](../guide/distributions.md)"),
    "designs": ("Designs: how members are chosen", "[page](../guide/sampling.md)"),
    "statistics": ("Statistics over members", "[page](../guide/statistics.md)"),
    "metrics": ("Metrics of a control loop", "[page](../controllers/metrics.md)"),
    "linear": ("Steady motions, linear models and margins", "[page](../controllers/margins.md)"),
    "studies": ("What studies take and give", "[page](../guide/is_my_controller_robust.md)"),
    "uq": ("Sensitivity", "[page](../guide/sensitivity.md)"),
    "bench": ("Costs on this machine", "[page](../guide/accuracy_and_speed.md)"),
    "plots": ("Pictures", "[page](../guide/pictures.md)"),
    "vehicles": ("Vehicles", "[page](../guide/vehicles.md)"),
    "gym": ("Environments for learners", "[page](../controllers/gym.md)"),
    "notation": ("Conversions", "[page](paper_to_code.md)"),
    "laws": (
        "For authors of device code",
        "[force](../develop/add_a_force.md), [part](../develop/add_a_controller.md)",
    ),
}


def rows(page, heading):
    """The cells of the first table below a heading; a bar within a cell is written as \\|."""
    text = (FOLDER / page).read_text().partition(f"# {heading}\n")[2]
    lines = re.search(r"^\|.*?(?=\n\n|\Z)", text, re.DOTALL | re.MULTILINE)[0].splitlines()[2:]
    return [[cell.replace("\\|", "|").strip() for cell in re.split(r"(?<!\\)\|", line.strip())[1:-1]] for line in lines]


def test_statuses():
    expected = [[str(int(code)), f"`{code.name}`", code.text] for code in sorted(Status)]
    assert rows("status.md", "Statuses") == expected


def test_warnings():
    expected = [[str(int(bit)), f"`{bit.name}`", bit.value_name, bit.text] for bit in Warnings]
    assert rows("status.md", "Warnings") == expected


def test_methods_and_their_orders():
    orders = {name.strip("`"): int(order) for name, _, order, *_ in rows("methods.md", "Methods")}
    assert {name: lw.Method(name).order for name in orders} == orders
    compositions = {name.partition("(")[0] for name in orders if "(" in name}
    assert compositions == set(method.COMPOSITIONS | method.HALVES)
    simple = {name for name in orders if "(" not in name}
    assert simple == set(method.PROGRAMS | method.RUNGE_KUTTA | method.TWO_PART | method.GAUSS)


def line(path):
    """A row of the list of public names: the name, and the first line of its docstring."""
    return (
        f"| `lw.{path}` | {inspect.getdoc(operator.attrgetter(path)(lw)).splitlines()[0].replace('|', chr(92) + '|')} |"
    )


def list_of_public_names():
    """docs/reference/api.md as it should be: a table for each part of the root, and for each door."""
    table = "| name | what it is |\n|---|---|\n"
    parts = [(title, names.split()) for title, names in ROOT_NAMES.items()]
    parts += [
        (f"{title} (`lw.{door}`, {link})", [f"{door}.{name}" for name in getattr(lw, door).__all__])
        for door, (title, link) in DOORS.items()
    ]
    tables = (f"\n## {title}\n\n{table}" + "".join(f"{line(path)}\n" for path in paths) for title, paths in parts)
    return INTRODUCTION + "".join(tables)


def test_the_list_of_public_names():
    assert (FOLDER / "api.md").read_text() == list_of_public_names(), "run: python -m tests.house.test_reference_pages"


def test_the_list_has_every_name_of_the_root_and_every_door():
    names = " ".join(ROOT_NAMES.values()).split()
    assert sorted([*names, *DOORS]) == sorted(lw.__all__)


if __name__ == "__main__":
    (FOLDER / "api.md").write_text(list_of_public_names())
