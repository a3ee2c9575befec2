# SPDX-License-Identifier: Apache-2.0
"""A program that runs in every way in which Python starts children, and prints what each of them came to.

`python -m tests.support.forking FOLDER WAY ...`: the parent runs first, so that a forked child inherits all that a run leaves.
"""

import concurrent.futures
import contextlib
import functools
import hashlib
import importlib.util
import json
import multiprocessing
import os
import signal
import sys
import tempfile
import threading
import traceback
from pathlib import Path

import lgvi_warp as lw
from tests.support.stores import fleet, tree

# Enough files that the parent's threads which wait for the disk are as many as there may be.
SETTINGS = {
    "method": "psi_s", "h": 0.01, "t1": 0.1, "save": lw.SaveAt(every=0.05),
    "statistics": [lw.statistics.Mean("position")],
}  # fmt: skip
CHILDREN, MEMBERS = 2, 4096


def digest(contents):
    return hashlib.sha256(b"".join(contents)).hexdigest()


def work(folder, threads=2):
    """A run in memory and one into a store: the checksums of their bytes."""
    result = lw.solve(fleet(MEMBERS), **SETTINGS, threads=threads)
    path = Path(tempfile.mkdtemp(dir=folder)) / "run.zarr"
    lw.solve(fleet(MEMBERS), **SETTINGS, threads=threads, store=path)
    inside = {name: data for name, data in tree(path).items() if name != "zarr.json"}
    values = result.statistics["mean position"].value.tobytes()
    return digest([result.position.tobytes(), values]), digest(
        [x for name in sorted(inside) for x in (name.encode(), inside[name])]
    )


def answer(folder):
    """Answer of the work, or its failure."""
    try:
        return work(folder)
    except BaseException:
        return traceback.format_exc()


def fork(folder):
    """os.fork, and children that leave as programs do."""
    pipes = []
    for _ in range(CHILDREN):
        ours, theirs = os.pipe()
        if os.fork() == 0:
            os.write(theirs, json.dumps(answer(folder)).encode())
            sys.exit()  # what is registered to run at exit runs
        os.close(theirs)
        pipes.append(ours)
    answers = [json.loads(read_all(pipe)) for pipe in pipes]
    for _ in pipes:
        os.wait()
    return answers


def read_all(pipe):
    with open(pipe, "rb") as file:
        return file.read()


def fork_within(folder):
    """Forked in the middle of a run, by its progress."""
    answers = []

    def progress(fraction):
        if not answers:
            answers.append(None)
            ours, theirs = os.pipe()
            if os.fork() == 0:
                os.write(theirs, json.dumps(answer(folder)).encode())
                os._exit(0)
            os.close(theirs)
            answers[0] = json.loads(read_all(ours))
            os.wait()

    lw.solve(fleet(MEMBERS), **SETTINGS, threads=1, progress=progress, store=Path(folder) / "within.zarr")
    return answers


def fork_beside(folder):
    """Forked while another thread sets kernels up and launches them."""
    stop = threading.Event()

    def busy():
        while not stop.is_set():
            lw.solve(fleet(300), "psi_s", h=0.01, t1=0.05)

    thread = threading.Thread(target=busy)
    thread.start()
    try:
        return fork(folder)
    finally:
        stop.set()
        thread.join()


def pool(folder, kind):
    """multiprocessing.Pool: its workers are daemons."""
    with multiprocessing.get_context(kind).Pool(CHILDREN) as workers:
        return workers.map(work, [folder] * CHILDREN, chunksize=1)


def futures(folder, kind):
    """concurrent.futures."""
    with concurrent.futures.ProcessPoolExecutor(CHILDREN, mp_context=multiprocessing.get_context(kind)) as workers:
        return list(workers.map(work, [folder] * CHILDREN))


def loky(folder):
    """joblib; where it is not installed, what it does: fresh processes that get the function as cloudpickle's bytes."""
    if importlib.util.find_spec("joblib"):
        import joblib

        return joblib.Parallel(CHILDREN)(joblib.delayed(work)(folder) for _ in range(CHILDREN))
    import cloudpickle

    sent = cloudpickle.dumps(functools.partial(lambda where: work(where), folder))
    with concurrent.futures.ProcessPoolExecutor(CHILDREN, mp_context=multiprocessing.get_context("spawn")) as workers:
        return list(workers.map(unpickled, [sent] * CHILDREN))


def unpickled(sent):
    import cloudpickle

    return cloudpickle.loads(sent)()


def celery(folder):
    """Workers like Celery's prefork: daemons that live for several tasks each, deaf to the keyboard, ended by SIGTERM."""
    context = multiprocessing.get_context("fork")
    tasks, answers = context.SimpleQueue(), context.SimpleQueue()

    def serve():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        while True:
            answers.put(answer(tasks.get()))

    workers = [context.Process(target=serve, daemon=True) for _ in range(2)]
    for worker in workers:
        worker.start()
    for _ in range(CHILDREN + 1):
        tasks.put(folder)
    got = [answers.get() for _ in range(CHILDREN + 1)]
    for worker in workers:
        worker.terminate()
        worker.join()
    assert [worker.exitcode for worker in workers] == [-signal.SIGTERM] * 2
    return got


def refused(folder):
    """A daemon may start no processes of its own: what it is told."""
    with multiprocessing.get_context("fork").Pool(1) as workers:
        return workers.apply(refusals)


def refusals():
    told = []
    for executor in ("processes", "dask"):
        with contextlib.suppress(SystemExit):
            try:
                lw.solve(fleet(300), "psi_s", h=0.01, t1=0.05, executor=executor, threads=2)
            except lw.SceneError as error:
                told.append(str(error))
    return told


WAYS = {
    "fork": fork, "fork_within": fork_within, "fork_beside": fork_beside,
    "pool_fork": functools.partial(pool, kind="fork"), "pool_spawn": functools.partial(pool, kind="spawn"),
    "pool_forkserver": functools.partial(pool, kind="forkserver"),
    "futures_fork": functools.partial(futures, kind="fork"),
    "futures_spawn": functools.partial(futures, kind="spawn"), "loky": loky, "celery": celery, "refused": refused,
}  # fmt: skip


def main(folder, *ways):
    print(json.dumps({"parent": work(folder)}), flush=True)
    for way in ways:
        print(json.dumps({way: WAYS[way](folder)}), flush=True)
    print(json.dumps({"parent again": work(folder)}), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
