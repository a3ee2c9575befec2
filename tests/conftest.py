# SPDX-License-Identifier: Apache-2.0
"""Fixtures: the paper's example, as numbers, as a scene and as the reference's body."""

import contextlib
import fnmatch
import gc
import json
import os
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
import warp._src.context as context

import lgvi_warp as lw
from lgvi_warp.engine import widths
from lgvi_warp.reference.submaps import Body, State
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.weight import Weight

ROOT = Path(__file__).parent.parent


def matches(case, mark):
    """Whether the id of a test's case is like one of a mark's patterns, such as "psi_x-*"."""
    return any(fnmatch.fnmatchcase(case, pattern) for pattern in mark.args)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Mark as slow the cases that `slow_for` names, and all but those that `slow_but` names."""
    unlike = {}
    for item in items:
        case = item.callspec.id if hasattr(item, "callspec") else ""
        slow_for, slow_but = item.get_closest_marker("slow_for"), item.get_closest_marker("slow_but")
        if (slow_for and matches(case, slow_for)) or (slow_but and not matches(case, slow_but)):
            item.add_marker(pytest.mark.slow)
        for mark in filter(None, (slow_for, slow_but)):
            left = unlike.setdefault((item.nodeid.partition("[")[0], mark.name), set(mark.args))
            left -= {pattern for pattern in left if fnmatch.fnmatchcase(case, pattern)}
    wrong = [f"{test}: {name} names no case by {sorted(left)}" for (test, name), left in unlike.items() if left]
    # A case that is asked for by its name comes alone.
    if wrong and not any("[" in argument for argument in config.args):
        raise pytest.UsageError(*wrong)


SKIPPED_GUARDS = pytest.StashKey[dict]()


def pytest_configure(config):
    """Begin the list of skipped guards."""
    config.stash[SKIPPED_GUARDS] = {}


def pytest_runtest_setup(item):
    """Skip what needs an extension in a copy of the tree that has none (tests/support/core_alone.py)."""
    needed = [name for mark in item.iter_markers("needs") for name in mark.args]
    if absent := [name for name in needed if not (ROOT / "lgvi_warp" / "extensions" / name).is_dir()]:
        pytest.skip(f"without {', '.join(absent)}")


def pytest_itemcollected(item):
    """Let reports say which tests are guards: `guard` is counted if skipped, `guard(in_ci=True)` fails there."""
    if mark := item.get_closest_marker("guard"):
        item.user_properties.append(("guard", "must run in CI" if mark.kwargs.get("in_ci") else "may be skipped"))


@pytest.hookimpl(tryfirst=True)
def pytest_terminal_summary(terminalreporter, config):
    """Collect the guards that were skipped."""
    for report in terminalreporter.stats.get("skipped", []):
        # What was skipped while collecting has no properties.
        if (kind := dict(getattr(report, "user_properties", ())).get("guard")) is not None:
            config.stash[SKIPPED_GUARDS][report.nodeid] = kind


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_sessionfinish(session):
    """In CI a guard that must run and was skipped is a failure."""
    result = yield
    if os.environ.get("CI") and "must run in CI" in session.config.stash[SKIPPED_GUARDS].values():
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
    return result


def pytest_unconfigure(config):
    """Say in the last line how many guards were skipped."""
    if skipped := config.stash.get(SKIPPED_GUARDS, {}):
        must = sum(kind == "must run in CI" for kind in skipped.values())
        print(f"guards that were skipped: {len(skipped)}, of which must run in CI: {must} (reasons above)")


def pytest_collection_finish():
    """Leave what collecting makes, and imports, out of every collection of garbage from now on: it stays to the end."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item):
    """Let a unit test, its fixtures included, load a kernel only where it is marked: `make quick` leaves such tests out."""
    marked = item.get_closest_marker("kernel") or not item.path.is_relative_to(ROOT / "tests" / "unit")
    with contextlib.nullcontext() if marked else mock.patch.object(context.Module, "load", refuse):
        return (yield)


def refuse(module, *_, **__):
    """In place of Warp's Module.load."""
    pytest.fail(f"this test loads the kernel {module.name}: mark it with @pytest.mark.kernel")


@pytest.fixture(scope="session", autouse=True)
def widths_of_the_table(tmp_path_factory):
    """Packets as on a machine where no width was measured."""
    with mock.patch.object(widths, "path", lambda: tmp_path_factory.getbasetemp() / widths.FILE):
        yield


@pytest.fixture
def measured_widths(widths_of_the_table):
    """The file of measured widths, in which a test may keep some."""
    yield widths.path()
    widths.path().unlink(missing_ok=True)
    widths.read_hashes.cache_clear()


@pytest.fixture(scope="session")
def example():
    """The states of the paper's example: `truth` in quadruple precision, and each method's at h = 0.01."""
    return json.loads((Path(__file__).parent / "data" / "paper_example.json").read_text())


@pytest.fixture(scope="session")
def scene():
    """The paper's vehicle and start; the example starts deeper, below a surface."""
    return lw.Scene.load(ROOT / "examples" / "paper.toml", {"start.position": [0.0, 0.0, 10.0]})


@pytest.fixture(scope="session")
def body(example):
    """The paper's vehicle for the reference."""
    p = example["params"]
    terms = (Weight(net=p["m"] * p["g"] - p["rhoVg"]), Restoring(moment=p["rhoVg"] * np.array(p["r"])))
    return Body(np.diag(p["M"]), np.diag(p["J"]), terms)


@pytest.fixture(scope="session")
def start(example, body):
    """The paper's initial state for the reference."""
    x = {key: np.array(value) for key, value in example["params"]["x0"].items()}
    return State(x["b"], x["R"], body.M @ x["nu"], body.J @ x["Omega"])
