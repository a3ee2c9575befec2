# SPDX-License-Identifier: Apache-2.0
"""Calls in a process of their own, whose memory and start are those of nothing else."""

import json
import subprocess
import sys
from collections.abc import Callable
from typing import Any

from benchmarks.pages import ROOT


def call(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a function of a module in a new process.

    Args:
        function: It returns what JSON can hold.
        arguments: What `repr` writes and Python reads back.

    Returns:
        What it returned.

    Raises:
        RuntimeError: The process failed; the message is what it wrote to stderr.
    """
    called = f"{function.__name__}{arguments!r}" if len(arguments) != 1 else f"{function.__name__}({arguments[0]!r})"
    code = f"import json; from {function.__module__} import {function.__name__}; print('\\n' + json.dumps({called}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


def peak_memory() -> int:
    """The largest resident memory of this process so far [bytes].

    ru_maxrss would begin with what the process that started it had.
    """
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) * 1024 for line in file if line.startswith("VmHWM"))
