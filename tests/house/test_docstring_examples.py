# SPDX-License-Identifier: Apache-2.0
"""The examples in the docstrings of public names run, and print what they say."""

import doctest
import inspect

import pytest

import lgvi_warp as lw
from tests.support.public import NAMED

PUBLIC = NAMED | {
    f"{door}.{name}": getattr(getattr(lw, door), name) for door in ("plots", "uq") for name in getattr(lw, door).__all__
}
# Those whose kernels no other quick test needs, or that search.
LONG = {"IAE", "Overshoot", "Until", "linearize", "lqr", "stability_map", "sweep", "loop", "margins", "term_cost", "tradeoff",
        "trim", "tune_gains", "worst_case"}  # fmt: skip


def examples() -> dict[str, doctest.DocTest]:
    """Name -> the example of each public name that has one."""
    parser = doctest.DocTestParser()
    texts = {name: inspect.getdoc(PUBLIC[name]) or "" for name in PUBLIC if "Examples:" in documented(name)}
    return {name: parser.get_doctest(text, {}, name, None, None) for name, text in texts.items()}


def documented(name: str) -> str:
    """The docstring of the name itself, not that of a base."""
    return vars(PUBLIC[name]).get("__doc__") or getattr(PUBLIC[name], "__doc__", "") or ""


EXAMPLES = examples()


def test_the_main_names_have_examples():
    assert len(EXAMPLES) >= 30
    main = {"Scene", "solve", "prepare", "Result", "Ensemble", "Controller", "open_run", "suggest", "plots.fan"}
    assert set(EXAMPLES) >= LONG | main


@pytest.mark.ci
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name in LONG else []) for name in EXAMPLES]
)
def test_an_example_prints_what_it_says(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said: list[str] = []
    result = doctest.DocTestRunner(verbose=False).run(EXAMPLES[name], out=said.append)
    assert result.attempted >= 2
    assert result.failed == 0, "".join(said)
