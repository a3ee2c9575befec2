# SPDX-License-Identifier: Apache-2.0
"""The benchmarks stand without the tests, each can be started by its name, and a table goes between its marks only."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks import own_process, pages, timing

FOLDER = Path(pages.__file__).parent
CASES = sorted(path.parent.name for path in FOLDER.glob("cases/*/case.py"))
TABLES = sorted(path.stem for path in FOLDER.glob("tables/*.py") if path.stem != "__init__")
TEXT = "# Methods\n\nBefore.\n\n<!-- method: begin -->\n\nold\n\n<!-- method: end -->\n\nAfter.\n"


def imported(path):
    """Packages that a file imports, anywhere in it."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{path}: relative import"
            yield node.module.split(".")[0]


def test_benchmarks_import_nothing_from_tests():
    found = {path.relative_to(FOLDER).as_posix(): set(imported(path)) for path in FOLDER.rglob("*.py")}
    assert "benchmarks" in found["tables/coupled.py"]  # the imports are read
    assert not [path for path, names in found.items() if "tests" in names]


def test_the_help_names_every_case_and_table():
    run = [sys.executable, "-m", "benchmarks", "--help"]
    text = subprocess.run(run, cwd=pages.ROOT, capture_output=True, text=True, check=True).stdout
    listed = [line.split()[0] for line in text.splitlines() if line.startswith("  ") and len(line.split()) > 1]
    assert set(CASES + TABLES) <= set(listed)
    assert len(CASES) >= 16
    assert len(TABLES) >= 12


@pytest.mark.parametrize("name", CASES)
def test_every_case_can_be_run(name):
    assert callable(importlib.import_module(f"benchmarks.cases.{name}.case").run)


@pytest.mark.parametrize("name", TABLES)
def test_every_table_can_be_made(name):
    assert callable(importlib.import_module(f"benchmarks.tables.{name}").main)


def test_only_tables_have_pages():
    assert set(pages.PAGES) == set(TABLES) - {"coverage", "warning_limits"}  # these two are printed only


@pytest.mark.parametrize(("name", "page"), pages.PAGES.items())
def test_every_page_has_the_marks_of_its_table(name, page):
    before, after = pages.parts(name, pages.ROOT / page)
    assert before.endswith(f"<!-- {name}: begin -->")
    assert after.startswith(f"<!-- {name}: end -->")


def test_a_text_goes_between_its_marks(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(TEXT)
    pages.write("method", page, "new\n")
    assert page.read_text() == TEXT.replace("old", "new")


@pytest.mark.parametrize(("text", "message"), [
    (None, "is missing"), (TEXT.replace("method", "drift"), "needs the lines"), (TEXT + TEXT, "needs the lines"),
    (TEXT.replace("begin", "x").replace("end", "begin").replace("x", "end"), "needs the lines"),
])  # fmt: skip
def test_a_page_without_its_marks_is_refused(tmp_path, text, message):
    page = tmp_path / "page.md"
    if text is not None:
        page.write_text(text)
    with pytest.raises(SystemExit, match=f"table method: its page {page} {message}"):
        pages.write("method", page, "new")
    assert text is None or page.read_text() == text


def test_a_call_in_a_process_of_its_own():
    assert own_process.call(divmod_of_pair, 17, "5") == [3, 2]
    with pytest.raises(RuntimeError, match="ZeroDivisionError"):
        own_process.call(divmod_of_pair, 1, "0")


def test_the_least_time_of_calls_in_turn():
    clock, order = iter([0.0, 3.0, 10.0, 11.0, 20.0, 22.0, 30.0, 35.0]), []
    calls, begins = [lambda: order.append("a"), lambda: order.append("b")], [lambda: order.append("A"), lambda: None]
    assert timing.least(calls, 2, begins, clock=lambda: next(clock)) == [2.0, 1.0]
    assert order == ["A", "a", "b", "A", "a", "b"]


def divmod_of_pair(x, text):
    return divmod(x, int(text))
