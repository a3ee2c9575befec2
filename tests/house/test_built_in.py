# SPDX-License-Identifier: Apache-2.0
"""Every built-in force, part of a controller and statistic has all that the pages on adding one list."""

from importlib import import_module
from pkgutil import iter_modules

import pytest

import lgvi_warp as lw
from lgvi_warp.control.base import SECTIONS
from lgvi_warp.physics import terms
from lgvi_warp.statistics.base import TYPES as STATISTICS
from tests.conftest import ROOT
from tests.control.test_laws import ACTING
from tests.laws.case import twin_of
from tests.laws.cases import CASES

# They take no numbers: every scene of the tests has them, or a controller's tests.
EVERYWHERE = {"weight", "restoring", "control_wrench"}
# They need a floor, or change what the other terms do: beside their twins in tests/extensions.
APART = {"bottom_contact", "density_profile", "tide"}
# A law whose twin is the user's function.
NO_TWIN = {"callback"}
GUIDE = ROOT / "docs" / "guide" / "terms"
PARTS = {word: kind for base in SECTIONS.values() for word, kind in base.kinds.items()}


def built_in(kinds):
    """Words of the package's own classes."""
    return sorted(word for word, kind in kinds.items() if kind.__module__.startswith("lgvi_warp."))


def has_twin(kind):
    """Whether a class has its twin: in lgvi_warp.reference or, of an extension, in its folder."""
    package = twin_of(kind.__module__).rpartition(".")[0]
    modules = (import_module(f"{package}.{module.name}") for module in iter_modules(import_module(package).__path__))
    return any(hasattr(module, kind.__name__) for module in modules)


@pytest.mark.parametrize("word", built_in(terms.TYPES))
def test_a_force_has_its_twin_case_page_and_public_name(word):
    kind = terms.TYPES[word]
    assert kind.__name__ in lw.terms.__all__, "name it in lgvi_warp/terms.pyi"
    assert has_twin(kind), f"Write its twin: class {kind.__name__} in lgvi_warp/reference/terms"
    tested = {type(term).type for case in CASES.values() for term in case.terms} | EVERYWHERE | APART
    assert word in tested, "Add a case to tests/laws/cases.py"
    assert (GUIDE / f"{word}.md").exists(), f"Write docs/guide/terms/{word}.md"
    assert f"| [{word}](" in (GUIDE / "README.md").read_text(), "Add its row to docs/guide/terms/README.md"


@pytest.mark.parametrize("word", built_in(PARTS))
def test_a_part_of_a_controller_has_its_twin_and_public_name(word):
    name = PARTS[word].__name__
    assert name in lw.control.__all__, "name it in lgvi_warp/control/__init__.pyi"
    twin = word in NO_TWIN or has_twin(PARTS[word])
    assert twin, f"Write its twin: class {name} in lgvi_warp/reference/control"


LAWS = {word: kind for word, kind in lw.laws.ControlLaw.kinds.items() if ".extensions." not in kind.__module__}


# Laws of extensions are tested in tests/extensions.
@pytest.mark.parametrize("word", built_in(LAWS))
def test_a_law_of_a_controller_is_tested(word):
    assert word in ACTING or word in NO_TWIN, "Add numbers with which it acts to ACTING of tests/control/test_laws.py"


@pytest.mark.parametrize("word", built_in(STATISTICS))
def test_a_statistic_has_its_public_name(word):
    kind = STATISTICS[word]
    door = "metrics" if kind.ticks else "statistics"
    stub = "metrics.pyi" if kind.ticks else "statistics/__init__.pyi"
    assert kind.__name__ in getattr(lw, door).__all__, f"name it in lgvi_warp/{stub}"
