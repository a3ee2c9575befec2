# SPDX-License-Identifier: Apache-2.0
"""Killed at any moment (SIGKILL), a run goes on and leaves the bytes of one that was never stopped."""

import random
import shutil
import time

import pytest

import lgvi_warp as lw
from tests.support.stores import differing, finished, fleet, forked, killed_after


# Blocks on one thread, chunks of about 50 samples: long enough to be hit in the middle of all that happens.
def run(path, threads, members):
    settings = {"h": 0.01, "t1": 60.0, "save": lw.SaveAt(every=0.5), "threads": threads}
    lw.solve(fleet(members), "psi_s", **settings, store=lw.Store(path, existing="resume", chunk_bytes=500_000))


def start(path, threads=1, members=2048):
    """The run in a process of its own, begun or gone on with; 256 members a block."""
    return forked(run, path, threads, members)


def wait_for(path, process):
    """Until the store is there."""
    while not path.exists() and process.is_alive():
        time.sleep(0.002)


def undisturbed(path, members):
    """(a run that was not stopped, seconds before its store was there, seconds after)."""
    lw.solve(fleet(64), "psi_s", h=0.01, t1=1.0)  # compiles the kernel, if nothing has
    begun = time.perf_counter()
    process = start(path, members=members)
    wait_for(path, process)
    there = time.perf_counter()
    process.join()
    assert process.exitcode == 0
    return path, there - begun, time.perf_counter() - there


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """Store of 8 blocks."""
    return undisturbed(tmp_path_factory.mktemp("short") / "run.zarr", 2048)


@pytest.fixture(scope="module")
def complete(tmp_path_factory):
    """Store of 16 blocks."""
    return undisturbed(tmp_path_factory.mktemp("whole") / "run.zarr", 4096)


def killed(path, seconds):
    """Start the run and kill it so many seconds after its start. Whether it was hit."""
    process = start(path, members=4096)
    process.join(seconds)
    process.kill()
    process.join()
    return process.exitcode != 0


def goes_on(path, complete, members=4096):
    """Finish a run by lw.resume, or start it again where it had not begun; compare all files."""
    if path.exists():
        lw.resume(path)
    else:
        process = start(path, members=members)
        process.join()
        assert process.exitcode == 0
    assert differing(complete, path) == []
    assert sorted(one.name for one in path.parent.iterdir()) == ["run.zarr"]
    shutil.rmtree(path)


@pytest.mark.ci
def test_three_kills(short, tmp_path):
    path, dice = tmp_path / "run.zarr", random.Random(3)
    for blocks in (1, 2, 4):
        # Blocks are marked in groups: on a busy machine the last of them may be marked before the kill arrives.
        for _ in range(5):
            hit = killed_after(path, blocks, dice.uniform(0.0, 0.02), run, 1, 2048)
            if in_middle := hit and 0 < finished(path) < 8:
                break
            shutil.rmtree(path)
        assert in_middle
        goes_on(path, short[0])


@pytest.mark.slow
def test_twenty_kills_at_random_moments(complete, tmp_path):
    """Ten from the start of the process to a little beyond its end, ten a moment after some block was marked.

    The moments of the second ten do not depend on how busy the machine is: most of them hit the run in its middle.
    """
    path, before, after = complete
    dice = random.Random(20)
    found = []
    for i in range(20):
        if i < 10:
            hit = killed(tmp_path / "run.zarr", dice.uniform(0.0, 1.05 * (before + after)))
        else:
            hit = killed_after(tmp_path / "run.zarr", dice.randrange(15), dice.uniform(0.0, 0.1), run, 1, 4096)
        found.append((hit, finished(tmp_path / "run.zarr")))
        goes_on(tmp_path / "run.zarr", path)
    assert sum(hit and 0 < count < 16 for hit, count in found) >= 5


@pytest.mark.slow
def test_killed_again_and_again(complete, tmp_path):
    """Each attempt is killed after two more blocks or a few more; the run still ends, with the same bytes."""
    here, kills = tmp_path / "run.zarr", 0
    while killed_after(here, finished(here) + 2, 0.0, run, 1, 4096):
        kills += 1
        assert kills < 10
    assert kills >= 3
    assert differing(complete[0], here) == []
