# SPDX-License-Identifier: Apache-2.0
"""Tools of the tests of stores: a small run, and whether two folders hold the same bytes."""

import contextlib
import multiprocessing
import time
from pathlib import Path

import lgvi_warp as lw
from lgvi_warp.measuring import speed

# 4 blocks of 256 members, the last one ragged; 31 samples.
MEMBERS, SETTINGS = 1003, {"method": "psi_s", "h": 0.01, "t1": 3.0, "save": lw.SaveAt(every=0.1)}
STATISTICS = [lw.statistics.Mean("position"), lw.statistics.Quantiles("depth"), lw.statistics.PathMaximum("speed"),
              lw.statistics.Covariance("angular_velocity"),
              lw.statistics.Quantiles("max(norm(velocity))"), lw.statistics.MeanAttitude()]  # fmt: skip
# Reached with 512 members.
UNTIL = lw.Until("mean angular_velocity[0]", 3.7e-3, members=256)


def bits(result):
    """All arrays of a result's statistics, as bytes, and what else they say."""
    arrays, text = result.statistics.to_arrays()
    return {name: values.tobytes() for name, values in arrays.items()}, text


def fleet(members=MEMBERS):
    """Members of the paper's vehicle with other rates and masses."""
    vary = {
        "start.angular_velocity": lw.distributions.Normal(relative=0.1),
        "vehicle.mass": lw.distributions.Normal(relative=0.001),
    }
    return lw.Ensemble(speed.example(), members, 1, vary)


def tree(path):
    """{name: bytes} of every file below a folder."""
    return {one.relative_to(path).as_posix(): one.read_bytes() for one in Path(path).rglob("*") if one.is_file()}


def differing(path, second):
    """Names of files that are not in both folders with the same bytes."""
    left, right = tree(path), tree(second)
    return sorted(name for name in left.keys() | right.keys() if left.get(name) != right.get(name))


def markers(path):
    """{marker of a finished block: when it was written}: another time is another file, of a block that ran again."""
    found = {}
    for one in (Path(path) / "blocks").glob("*.json"):
        with contextlib.suppress(FileNotFoundError):
            found[one.name] = one.stat().st_mtime_ns
    return found


def forked(work, *arguments):
    """A process at this work: a fork, which has all imports and kernels of the tests."""
    process = multiprocessing.get_context("fork").Process(target=work, args=arguments)
    process.start()
    return process


def finished(path):
    """Count of marked blocks."""
    return len(markers(path))


def killed_after(path, blocks, delay, work, *arguments):
    """Start a run by this work, or go on with it, and kill it a moment after so many blocks are marked. Whether it was hit."""
    process = forked(work, path, *arguments)
    while finished(path) < blocks and process.is_alive():
        time.sleep(0.002)
    time.sleep(delay)
    process.kill()
    process.join()
    return process.exitcode != 0
