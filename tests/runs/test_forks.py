# SPDX-License-Identifier: Apache-2.0
"""Children of every kind run as their parent does, in memory and into stores: the same bits, and none waits for ever."""

import json
import os
import signal
import subprocess
import sys

import pytest

from tests.conftest import ROOT
from tests.support.forking import CHILDREN

QUICK = ("fork_within", "celery", "refused")
LONG = ("fork", "pool_fork", "fork_beside", "pool_spawn", "pool_forkserver", "futures_fork", "futures_spawn", "loky")
# A child that waits for ever ends with the group of its parent.
SECONDS = 120.0


def answers_of(folder, ways):
    """Answer of each way by name; none for a way that hangs or does not end."""
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen([sys.executable, "-m", "tests.support.forking", str(folder), *ways], env=env, cwd=ROOT,
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)  # fmt: skip
    try:
        said, faults = process.communicate(timeout=SECONDS)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        said, faults = process.communicate()
    answers = {}
    for line in said.splitlines():
        answers |= json.loads(line)
    return answers | {"faults": faults}


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    return answers_of(tmp_path_factory.mktemp("forks"), QUICK)


@pytest.fixture(scope="module")
def long(tmp_path_factory):
    return answers_of(tmp_path_factory.mktemp("forks"), LONG)


def check(answers, way):
    assert way in answers, f"{way} did not come to its end: {answers}"
    assert answers["faults"] == ""
    assert len(answers[way]) >= (1 if way == "fork_within" else CHILDREN)
    assert all(answer == answers["parent"] for answer in answers[way])


@pytest.mark.ci
@pytest.mark.parametrize("way", [way for way in QUICK if way != "refused"])
def test_forked_children_run_as_their_parent(quick, way):
    check(quick, way)


@pytest.mark.slow
@pytest.mark.parametrize("way", LONG)
def test_children_run_as_their_parent(long, way):
    check(long, way)


@pytest.mark.ci
def test_the_parent_goes_on_as_before(quick):
    assert quick["parent again"] == quick["parent"]


def test_a_daemon_is_told_that_it_may_start_no_processes(quick):
    processes, dask = quick["refused"]
    assert "executor = 'processes'" in processes
    assert "executor = 'dask'" in dask
    assert all('executor="threads"' in text for text in (processes, dask))
