# SPDX-License-Identifier: Apache-2.0
"""Work of the simplest kind for executors: it waits, tells how far it is, and leaves a trace of each time it is begun."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

STEPS = 10


class Nothing:
    """In place of a plan: nothing to compile; so many steps."""

    class grid:  # noqa: N801
        steps = STEPS

    def compile(self):
        return 0.0


@dataclass(frozen=True)
class Traced:
    """A block takes half a second, or as many as a step says, and gives the process it ran in."""

    folder: Path
    step: float = 0.05
    plan = Nothing()

    def __call__(self, block, halted, advanced):
        (self.folder / f"{block.first}-{os.getpid()}-{time.monotonic_ns()}").touch()
        for i in range(STEPS):
            time.sleep(self.step)
            advanced(block.count * (i + 1))
        return os.getpid()

    def begun(self):
        """[(first member of a block, process)], in the order in which blocks were begun."""
        names = [[int(word) for word in path.name.split("-")] for path in self.folder.iterdir()]
        return [(first, pid) for first, pid, _ in sorted(names, key=lambda name: name[2])]
