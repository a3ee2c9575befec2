# SPDX-License-Identifier: Apache-2.0
"""docs/theory/: each equation leads to the functions that hold it, and these name it in return."""

import importlib
import re
import sys

import pytest

from tests.conftest import ROOT

sys.path.append(str(ROOT / "docs"))

pytest.importorskip("docutils")
from site_parts import equations

NUMBERED = [each for each in equations.equations() if each.label]
HOLDERS = sorted({holder for each in NUMBERED for holder in each.holders})
CODE = [file for folder in ("lgvi_warp", "kernels") for file in sorted((ROOT / folder).rglob("*.py"))]


def name(holder):
    return f"{holder.file.stem}.{holder.name}"


def missing(holder):
    """Why a link leads to no function; "" where it does."""
    if not holder.file.is_relative_to(ROOT) or not holder.file.exists():
        return f"{holder.file} is not there"
    known = equations.definitions(holder.file.read_text())
    return "" if holder.name in known else f"{holder.file.name} has no {holder.name}"


def source(holder):
    """The text of a function, or of a name with the comment above it."""
    text = holder.file.read_text()
    first, last = equations.definitions(text)[holder.name]
    return "\n".join(text.splitlines()[first - 1 : last])


def without_link(text):
    """Numbers of a page's equations that no link to code follows."""
    return [each.label for each in equations.equations_of("page", text) if each.label and not each.holders]


def fault_of(page, text):
    """Parts of a page that the site could not show."""
    lines = equations.FENCE.sub("", text)
    whole = [(each.tex, True) for each in equations.equations_of(page, text)]
    for tex, block in [*whole, *((tex, False) for tex in re.findall(r"\$([^$]+)\$", lines))]:
        try:
            equations.mathml(tex, block)
        except Exception as fault:
            return f"{tex}: {fault}"
    return ""


FENCED = "```math\na = b \\tag{7}\n```\n\n"


def test_the_checks_see_faults():
    assert without_link(FENCED + "No link.\n") == ["7"]
    assert without_link("```math\na = b\n```\n") == []
    (found,) = equations.equations_of("page", FENCED + "Code: [`paper.psi`](../../lgvi_warp/reference/paper.py)\n")
    assert (found.label, found.tex) == ("7", "a = b")
    assert not missing(found.holders[0])
    for file, link in (("gone", "gone.psi"), ("paper", "paper.gone"), ("paper", "psi")):
        assert missing(equations.holder(f"../../lgvi_warp/reference/{file}.py", link)), link
    assert fault_of("page", FENCED.replace("a = b", "\\nothing"))
    assert fault_of("page", "$\\frac{a}$")
    assert list(equations.named_back("docs/theory/x.md, (13), (I4); docs/theory/y.md, (2)")) == [
        ("x", "13"), ("x", "I4"), ("y", "2"),
    ]  # fmt: skip


def test_definitions_are_found_with_their_comments():
    text = "# why\n# more\nA = 1\n\nclass B:\n    x: int = 2\n\n    @property\n    def c(self):\n        return 1\n"
    assert equations.definitions(text) == {"A": (1, 3), "B": (5, 10), "B.x": (6, 6), "B.c": (8, 10)}


def test_all_equations_of_the_paper_are_there():
    numbers = [int(each.label) for each in NUMBERED if each.label.isdigit()]
    assert sorted(numbers) == list(range(1, 25))


def test_each_number_stands_once_and_in_order():
    labels = [each.label for each in NUMBERED]
    assert len(set(labels)) == len(labels) > 100
    for page in equations.pages():
        own = [each.label for each in NUMBERED if each.page == page.stem and not each.label.isdigit()]
        assert [int(label[1:]) for label in own] == list(range(1, len(own) + 1)), page.name
        assert len({label[0] for label in own}) == 1, page.name


@pytest.mark.parametrize("page", equations.pages(), ids=lambda page: page.stem)
def test_each_numbered_equation_has_a_link(page):
    assert without_link(page.read_text()) == []
    # And no line of links stands without an equation.
    assert page.read_text().count("\nCode: ") == len([each for each in NUMBERED if each.page == page.stem])


@pytest.mark.parametrize("page", equations.pages(), ids=lambda page: page.stem)
def test_each_link_to_code_leads_there(page):
    # Those within the text too.
    links = [
        equations.holder(target, name) for name, target in equations.LINK.findall(page.read_text()) if ".py" in target
    ]
    assert [fault for fault in map(missing, links) if fault] == []


@pytest.mark.parametrize("page", equations.pages(), ids=lambda page: page.stem)
def test_the_site_can_show_each_formula(page):
    assert fault_of(page.stem, page.read_text()) == ""


@pytest.mark.parametrize("holder", HOLDERS, ids=name)
def test_each_link_leads_to_a_function_that_names_its_equations(holder):
    assert not missing(holder)
    wanted = {(each.page, each.label) for each in NUMBERED if holder in each.holders}
    assert wanted <= set(equations.named_back(source(holder)))


def test_each_equation_that_the_code_names_leads_back():
    held = {(each.page, each.label, holder) for each in NUMBERED for holder in each.holders}
    for file in CODE:
        text = file.read_text()
        named = set(equations.named_back(text))
        told = {(page, label) for page, label, holder in held if holder.file == file}
        assert named <= told, f"{file.name}: {named - told}"
        # A page that is named, in whatever way, is there.
        for page in re.findall(r"docs/theory/(\w+)\.md", text):
            assert page in {each.stem for each in equations.pages()}, file.name


def test_functions_of_the_package_are_found_by_import():
    # The reader of the source and Python agree on what there is.
    for holder in HOLDERS:
        if holder.file.is_relative_to(ROOT / "lgvi_warp"):
            path = holder.file.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".").removesuffix(".__init__")
            found = importlib.import_module(path)
            for part in holder.name.split("."):
                found = getattr(found, part)


def test_numbers_in_the_text_are_those_of_equations():
    labels = {each.label for each in NUMBERED}
    for page in equations.pages():
        text = equations.FENCE.sub("", page.read_text())
        assert set(equations.NUMBER.findall(re.sub(r"\$[^$]+\$", "", text))) <= labels, page.name


def test_the_pages_stand_alone():
    # No construct that GitHub does not draw: directives, roles, labels, and macros that it forbids.
    for page in equations.pages():
        text = page.read_text()
        assert not re.findall(
            r"\{\w+\}`|^```\{|^\(\w+\)=|\\label|\\newcommand|\\operatorname|\$\$", text, re.MULTILINE
        ), page
