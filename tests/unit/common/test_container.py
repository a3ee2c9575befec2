# SPDX-License-Identifier: Apache-2.0
"""Limits of control groups, from trees of files as kernels of both versions show them."""

import os

import pytest

from lgvi_warp.calls.predict import Prediction
from lgvi_warp.common import container, machine
from tests.support.refusals import says

NONE_V1 = 9223372036854771712

# Name -> (/proc/self/cgroup, files below /sys/fs/cgroup, quota [CPUs], limit [bytes]).
TREES = {
    "no control groups": ("", {}, None, None),
    "v2, no limits": ("0::/", {"cpu.max": "max 100000", "memory.max": "max"}, None, None),
    "v2, a container of its own namespace": ("0::/", {"cpu.max": "150000 100000", "memory.max": "1073741824"}, 1.5, 2**30),
    "v2, another period": ("0::/", {"cpu.max": "20000 10000"}, 2.0, None),
    "v2, no period": ("0::/", {"cpu.max": "50000"}, 0.5, None),
    "v2, a group within groups": (
        "0::/user.slice/run.scope",
        {"user.slice/cpu.max": "300000 100000", "user.slice/memory.max": "4096", "user.slice/run.scope/cpu.max": "max 100000",
         "user.slice/run.scope/memory.max": "8192"},
        3.0, 4096,
    ),
    "v2, the least of all above": (
        "0::/a/b", {"a/cpu.max": "400000 100000", "a/b/cpu.max": "200000 100000"}, 2.0, None,
    ),
    "v2, a group of the host that is not there": ("0::/kubepods/pod1", {"cpu.max": "100000 100000"}, 1.0, None),
    "v2, a group outside of the namespace": ("0::/../other", {"cpu.max": "100000 100000", "memory.max": "5"}, 1.0, 5),
    "v1, a batch job": (
        "4:memory:/slurm/job_7/step_0\n1:cpu,cpuacct:/slurm/job_7/step_0",
        {"cpu/slurm/job_7/cpu.cfs_quota_us": "800000", "cpu/slurm/job_7/cpu.cfs_period_us": "100000",
         "cpu/slurm/job_7/step_0/cpu.cfs_quota_us": "-1", "cpu/slurm/job_7/step_0/cpu.cfs_period_us": "100000",
         "memory/slurm/job_7/memory.limit_in_bytes": "6000", "memory/slurm/job_7/step_0/memory.limit_in_bytes": str(NONE_V1)},
        8.0, 6000,
    ),
    "v1, docker without a namespace": (
        "3:memory:/docker/abc\n2:cpu,cpuacct:/docker/abc",
        {"cpu,cpuacct/cpu.cfs_quota_us": "250000", "cpu,cpuacct/cpu.cfs_period_us": "100000",
         "memory/memory.limit_in_bytes": "7000"},
        2.5, 7000,
    ),
    "v1, told by the hierarchy alone": (
        "3:memory:/", {"memory/memory.limit_in_bytes": str(NONE_V1), "memory/memory.stat": "hierarchical_memory_limit 9000"},
        None, 9000,
    ),
    "v1 beside v2": (
        "2:memory:/\n1:cpu:/\n0::/x",
        {"cpu/cpu.cfs_quota_us": "100000", "cpu/cpu.cfs_period_us": "100000", "memory/memory.limit_in_bytes": "3000",
         "unified/x/cpu.max": "50000 100000"},
        0.5, 3000,
    ),
    "nonsense": ("x\n0::/\n:::::", {"cpu.max": "many of them", "memory.max": ""}, None, None),
    "zeros": ("0::/", {"cpu.max": "0 0", "memory.max": "0"}, None, None),
}  # fmt: skip


@pytest.mark.parametrize("name", TREES)
def test_limits(name, tmp_path):
    own, files, quota, limit = TREES[name]
    root = tmp_path / "cgroup"
    for key, text in files.items():
        (root / key).parent.mkdir(parents=True, exist_ok=True)
        (root / key).write_text(text + "\n")
    (tmp_path / "own").write_text(own + "\n")
    assert container.cpu_quota(root, tmp_path / "own") == quota
    assert container.memory_limit(root, tmp_path / "own") == limit


def test_files_that_cannot_be_read_say_nothing(tmp_path):
    assert container.cpu_quota(tmp_path / "none", tmp_path / "none") is None
    (tmp_path / "own").write_bytes(b"0::/\xff\n")
    assert container.memory_limit(tmp_path, tmp_path / "own") is None


@pytest.mark.parametrize(
    ("quota", "cores", "threads"), [(None, 8, 8), (1.5, 8, 2), (0.2, 8, 1), (16.0, 8, 8), (3.0, 8, 3)]
)
def test_threads_by_default(quota, cores, threads):
    assert machine.threads_of(cores, quota) == threads


def test_what_this_process_may_use():
    assert 1 <= machine.affinity() <= (os.cpu_count() or 1)
    assert machine.thread_count() == machine.threads_of(machine.affinity(), container.cpu_quota())
    assert machine.describe()["threads"] == machine.thread_count()
    assert machine.memory_bytes() == machine.least_known(machine.physical_memory(), container.memory_limit())


def test_cores_are_those_that_the_system_names(monkeypatch):
    monkeypatch.setattr(os, "process_cpu_count", lambda: 5, raising=False)
    assert machine.affinity() == 5


@pytest.mark.parametrize(
    ("physical", "limit", "memory"),
    [(100, None, 100), (100, 40, 40), (100, NONE_V1, 100), (None, 40, 40), (None, None, None)],
)
def test_memory(physical, limit, memory):
    assert machine.least_known(physical, limit) == memory


def test_a_prediction_tells_what_a_container_does_not_hold():
    told = str(
        Prediction(20, 200, 1, 1, 0.0, 0.0, 0.0, 0.0, memory=9 * 10**6, disk=0, free_memory=10**7, free_disk=None)
    )
    says(told, "1 threads", "more than the memory holds")
