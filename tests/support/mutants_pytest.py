# SPDX-License-Identifier: Apache-2.0
"""A pytest plugin for mutants.py: it records what each test runs, or runs chosen tests in a given order.

MUTANTS_RECORD   folder: write there the lines that each test executes (coverage.py), its kernels and its duration
MUTANTS_SELECT   JSON file: tests to run, in order, with each one's time limit; outcomes are written next to it
"""

import atexit
import faulthandler
import json
import os
import sys
import time
import uuid
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RECORD, SELECT = os.environ.get("MUTANTS_RECORD"), os.environ.get("MUTANTS_SELECT")
# Python runs this file at the start of every process that a test starts.
SITE = '''"""Record the lines that a test's subprocess executes."""
import os
if os.environ.get("MUTANTS_TEST"):
    from tests.support.mutants_pytest import start_coverage
    start_coverage(os.environ["MUTANTS_TEST"])
'''


def start_coverage(context=None):
    """Measure this process from now on.

    Args:
        context: name of a test, in a process that it starts; None: the test's name follows.

    Returns:
        The measurement.
    """
    from multiprocessing import util

    import coverage

    files = [f"{ROOT}/lgvi_warp/*", f"{ROOT}/kernels/*"]
    data_file = str(Path(os.environ["MUTANTS_RECORD"]) / "coverage")
    measured = coverage.Coverage(data_file, data_suffix=True, include=files, context=context, config_file=False)
    measured.start()

    def save():
        measured.stop()
        measured.save()

    if context is None:
        return measured
    if any("spawn_main" in argument for argument in sys.orig_argv):  # workers of multiprocessing end without atexit
        util.Finalize(None, save, exitpriority=100)
    else:
        atexit.register(save)
    return measured


# Before conftest.py imports the product.
measured = start_coverage() if RECORD else None


def key_of(test):
    """A test's name without its folder, so that a record outlives a move."""
    path, _, name = test.nodeid.partition("::")
    return f"{Path(path).name}::{name}"


class Recorder:
    """Writes what each test runs."""

    def __init__(self, folder):
        self.path = Path(folder) / f"tests-{uuid.uuid4().hex}.jsonl"
        self.kernels, self.identifiers, self.load_time = set(), {}, 0.0

    def watch_kernels(self):
        """Note each kernel that is loaded or launched, and the time that loading takes."""
        import warp._src.context as context

        load, recorder = context.Module.load, self

        def watched(module, device, block_dim=None, *arguments, **named):
            start = time.perf_counter()
            try:
                return load(module, device, block_dim, *arguments, **named)
            finally:
                recorder.load_time += time.perf_counter() - start
                if module not in recorder.identifiers:
                    recorder.identifiers[module] = module.get_module_identifier(block_dim)
                recorder.kernels.add(recorder.identifiers[module])

        context.Module.load = watched

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item):
        """Measure one test with its fixtures."""
        if not self.identifiers:
            self.identifiers[None] = None
            self.watch_kernels()
        self.kernels.clear()
        self.load_time, self.failed, start = 0.0, False, time.perf_counter()
        measured.switch_context(key_of(item))
        os.environ["MUTANTS_TEST"] = key_of(item)
        try:
            return (yield)
        finally:
            del os.environ["MUTANTS_TEST"]
            measured.switch_context("")
            line = {
                "test": key_of(item), "path": item.nodeid.split("::")[0],
                "time": time.perf_counter() - start - self.load_time, "load": self.load_time, "failed": self.failed,
                "kernels": sorted(self.kernels),
            }  # fmt: skip
            with self.path.open("a") as file:
                file.write(json.dumps(line) + "\n")

    def pytest_runtest_logreport(self, report):
        """Note a failure."""
        self.failed |= report.failed

    def pytest_sessionfinish(self):
        """Write the lines."""
        measured.stop()
        measured.save()


class Selector:
    """Runs chosen tests in a given order and ends the process where one takes too long."""

    def __init__(self, path):
        self.limits = json.loads(Path(path).read_text())
        self.outcome = Path(path).with_suffix(".outcome")

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items):
        """Keep the chosen tests, in their order."""
        place = {name: i for i, name in enumerate(self.limits)}
        items[:] = sorted((item for item in items if key_of(item) in place), key=lambda item: place[key_of(item)])

    def write(self, name, outcome):
        """Write what a test is at, for the process that waits."""
        self.outcome.write_text(json.dumps({"test": name, "outcome": outcome}))

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item):
        """Run one test within its time."""
        self.write(key_of(item), "running")
        faulthandler.dump_traceback_later(self.limits[key_of(item)], exit=True)
        try:
            return (yield)
        finally:
            faulthandler.cancel_dump_traceback_later()

    def pytest_runtest_logreport(self, report):
        """Write a failure at once: what follows may end the process."""
        if report.failed:
            self.write(key_of(report), "failed")

    def pytest_sessionfinish(self, exitstatus):
        """Write that all passed."""
        if exitstatus in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
            self.write("", "passed")


def pytest_configure(config):
    """Record or select, as the environment says."""
    if RECORD and (hasattr(config, "workerinput") or not config.getoption("numprocesses", None)):
        config.pluginmanager.register(Recorder(RECORD))
    if SELECT:
        config.pluginmanager.register(Selector(SELECT))
