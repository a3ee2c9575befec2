# SPDX-License-Identifier: Apache-2.0
"""A process of mutants.py that runs pytest again and again, each time in a fork.

It has imported what tests need and is not ours: a process that imported it anew would take most of its time for that. It is
the first process of a namespace of its own, where there is one, and ends all others there after each run.
"""

import json
import os
import signal
import sys
import tempfile
import time


def run(task):
    """In a fork: run pytest in a tree, with an environment, and end."""
    import pytest

    os.setsid()
    log = os.open(task["log"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for number, descriptor in enumerate((os.open(os.devnull, os.O_RDONLY), log, log)):
        os.dup2(descriptor, number)
    os.chdir(task["tree"])
    os.environ.clear()
    os.environ.update(task["environment"])
    sys.path[:1] = [task["tree"], os.path.join(task["tree"], "kernels")]
    sys.argv, tempfile.tempdir = ["pytest"], None
    code = pytest.main(task["arguments"])
    sys.stdout.flush()
    os._exit(code)


def in_time(child, seconds):
    """Whether a process ends within so many seconds; afterwards nothing of it is left."""
    deadline = time.monotonic() + seconds
    while not (ended := os.waitpid(child, os.WNOHANG)[0]) and time.monotonic() < deadline:
        time.sleep(0.02)
    try:
        if os.getpid() == 1:
            os.kill(-1, signal.SIGKILL)
        else:
            os.killpg(child, signal.SIGKILL)
        while True:
            os.waitpid(-1, 0)
    except (ProcessLookupError, ChildProcessError):
        return bool(ended)


def main():
    """Say that it is ready; then run a task for each line of stdin, and answer with a line whether it ended in time."""
    import hypothesis  # noqa: F401
    import numpy  # noqa: F401
    import pytest  # noqa: F401
    import scipy.special
    import scipy.stats  # noqa: F401
    import warp  # noqa: F401

    print("ready", flush=True)
    for line in sys.stdin:
        task = json.loads(line)
        child = os.fork()
        if not child:
            run(task)
        print(json.dumps(in_time(child, task["seconds"])), flush=True)


if __name__ == "__main__":
    main()
