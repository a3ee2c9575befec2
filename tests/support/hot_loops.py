# SPDX-License-Identifier: Apache-2.0
"""Compiled form of a kernel's loop over steps: its floating-point vector instructions, and seconds to compile it.

A figure that no load of the machine changes: every scene is compiled for one processor, x86-64-v4, whichever this one is,
and not run. `python -m tests.support.hot_loops --write` records them anew, after a change that is meant.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import re
import shutil
import subprocess
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import warp as wp

from benchmarks import own_process, problems
from benchmarks.peers.problem import driven_scene
from lgvi_warp.common import warp_setup
from lgvi_warp.engine.plan import Plan
from lgvi_warp.measuring import speed
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene

TABLE = Path(__file__).parent.parent / "data" / "hot_loops.json"
# How much more than recorded a loop may hold, and how much longer than recorded its kernel may compile beside PLAIN.
MARGIN, COMPILE_MARGIN = 1.3, 2.0
TARGET, LANES = "-target-cpu x86-64-v4", 8
SCENES = {
    "paper": speed.example,
    "remus_100": lambda: driven_scene("remus_100"),
    "bluerov2_heavy": lambda: driven_scene("bluerov2_heavy"),
    "all terms": lambda: problems.all_terms(noise=False),
}
# An explicit method, which scenes with damping have by default, and a splitting.
METHODS = ("rk4", "psi_x")
# The kernel whose compilation others are measured against.
PLAIN = ("paper", "psi_1")
# A loop over steps within others has at least this part of their arithmetic.
MOST = 0.6
# Instructions that a call of another function counts as, and what the names of functions hold: the kernel, and derivatives
# that nothing calls.
OUTSIDE, KERNEL, GRADIENTS = 10, "_cpu_block_thunk_forward", "_Z14adj_"
# A loop within the loop over steps is taken as this many rounds: of channels, strips or components.
ROUNDS = 4
# Arithmetic on floating-point numbers, packed or, where it was not vectorised, one by one.
ARITHMETIC = re.compile(r"v(f?n?m(add|sub)|add|sub|mul|div|sqrt|max|min|rcp14|rsqrt14)[0-9]*[ps][sd]$")
LINE = re.compile(r"^\s*([0-9a-f]+):\s+(\S+)\s*(.*)$")
JUMP_TARGET = re.compile(r"^(?:0x)?([0-9a-f]+)\b")


def plan_of(scene: Scene, method: str) -> Plan:
    """The plan of a scene."""
    return make_plan(Ensemble(scene, 16, 1, {}), method, h=0.01, t1=0.1, width=LANES)


def compiled(plan: Plan, folder: Path) -> tuple[Path, float]:
    """The object file of a plan's kernel for TARGET, and the processor time that it took to make [s]."""
    warp_setup.start()
    module = plan.kernel.advance.kernel.module
    module.options["cpu_compiler_flags"] = module.options["cpu_compiler_flags"].replace("-march=native", TARGET)
    begun = time.process_time()
    wp.compile_aot_module(module, device="cpu", module_dir=str(folder), strip_hash=True)
    seconds = time.process_time() - begun
    return next(folder.glob("*.o")), seconds


@dataclasses.dataclass
class Block:
    """Instructions that follow each other without a jump between them."""

    arithmetic: int = 0
    calls: int = 0
    after: list[int] = dataclasses.field(default_factory=list)


def disassembler() -> str | None:
    """A program that reads object files, of binutils or of LLVM."""
    return shutil.which("objdump") or shutil.which("llvm-objdump")


def functions(path: Path) -> dict[str, list[tuple[int, str, str]]]:
    """The instructions of each function of an object file: address, name, operands."""
    program = disassembler()
    assert program is not None
    text = subprocess.run(
        [program, "-d", "--no-show-raw-insn", path], capture_output=True, text=True, check=True
    ).stdout
    found: dict[str, list[tuple[int, str, str]]] = {}
    for line in text.splitlines():
        if line.endswith(">:"):
            found[line.partition("<")[2][:-2]] = current = []
        elif match := LINE.match(line):
            current.append((int(match[1], 16), match[2], match[3]))
    return found


def blocks_of(instructions: list[tuple[int, str, str]]) -> dict[int, Block]:
    """The blocks of a function by their first address."""
    jumps: dict[int, tuple[str, int | None]] = {}
    inside = {address for address, _, _ in instructions}
    leaders = {instructions[0][0]}
    for i, (address, name, operands) in enumerate(instructions):
        if name.startswith("j"):
            match = JUMP_TARGET.match(operands)
            to = int(match[1], 16) if match and int(match[1], 16) in inside else None
            jumps[address] = name, to
            leaders |= {to} if to is not None else set()
        if name.startswith(("j", "ret")) and i + 1 < len(instructions):
            leaders.add(instructions[i + 1][0])
    blocks: dict[int, Block] = {}
    for i, (address, name, _) in enumerate(instructions):
        if address in leaders:
            blocks[address] = block = Block()
        block.arithmetic += bool(ARITHMETIC.match(name))
        block.calls += name.startswith("call")
        last = i + 1 == len(instructions) or instructions[i + 1][0] in leaders
        if address in jumps and jumps[address][1] is not None:
            block.after.append(jumps[address][1])
        if last and not name.startswith(("jmp", "ret")) and i + 1 < len(instructions):
            block.after.append(instructions[i + 1][0])
    return blocks


def loops_of(blocks: dict[int, Block]) -> dict[int, set[int]]:
    """Natural loops: header -> the blocks from which it is reached again without leaving them."""
    before: dict[int, list[int]] = defaultdict(list)
    for address, block in blocks.items():
        for to in block.after:
            before[to].append(address)
    nearest = nearest_dominators(blocks, before)
    loops: dict[int, set[int]] = defaultdict(set)
    for address in nearest:
        for header in blocks[address].after:
            if dominates(header, address, nearest):
                body, waiting = loops[header] | {header}, [address]
                while waiting:
                    one = waiting.pop()
                    if one not in body:
                        body.add(one)
                        waiting += [way for way in before[one] if way in nearest]
                loops[header] = body
    return loops


def dominates(header: int, single: int, nearest: dict[int, int]) -> bool:
    """Whether every way to a block goes through another, or these are the same."""
    while single != header and nearest[single] != single:
        single = nearest[single]
    return single == header


def nearest_dominators(blocks: dict[int, Block], before: dict[int, list[int]]) -> dict[int, int]:
    """For each block that is reached the last one through which every way to it goes; of the first block itself.

    Cooper, Harvey & Kennedy (2001), A simple, fast dominance algorithm.
    """
    order = from_the_start(blocks)
    place = {one: i for i, one in enumerate(order)}
    nearest = {order[0]: order[0]}
    changed = True
    while changed:
        changed = False
        for one in order[1:]:
            common, *ways = (way for way in before[one] if way in nearest)
            for other in ways:
                while other != common:
                    later = max(other, common, key=place.__getitem__)
                    other, common = nearest[later], min(other, common, key=place.__getitem__)
            changed = changed or nearest.get(one) != common
            nearest[one] = common
    return nearest


def from_the_start(blocks: dict[int, Block]) -> list[int]:
    """The blocks that are reached, each before those that are only reached through it (reversed postorder)."""
    first = next(iter(blocks))
    finished, seen, waiting = [], {first}, [(first, iter(blocks[first].after))]
    while waiting:
        _, ways = waiting[-1]
        new = next((to for to in ways if to not in seen), None)
        if new is None:
            finished.append(waiting.pop()[0])
        else:
            seen.add(new)
            waiting.append((new, iter(blocks[new].after)))
    return finished[::-1]


def loop_over_steps(blocks: dict[int, Block], loops: dict[int, set[int]]) -> int:
    """The header of the loop over steps: of loops within each other, the innermost that still has most of the arithmetic."""

    def size(header: int) -> int:
        return sum(blocks[one].arithmetic for one in loops[header])

    header = max(loops, key=size)
    while True:
        within = [one for one in loops if loops[one] < loops[header]]
        largest = max(within, key=size, default=header)
        if largest == header or size(largest) < MOST * size(header):
            return header
        header = largest


def work_of(blocks: dict[int, Block]) -> int:
    """Arithmetic instructions of the loop over steps."""
    loops = loops_of(blocks)
    body, work = loops[loop_over_steps(blocks, loops)], 0
    for one in body:
        depth = sum(one in loop for loop in loops.values() if loop < body)
        work += (blocks[one].arithmetic + OUTSIDE * blocks[one].calls) * ROUNDS**depth
    return work


def work_of_step(path: Path) -> int:
    """Arithmetic instructions of the loop over steps, and of the functions that were not put into their place."""
    found = functions(path)
    kernel = next(name for name in found if KERNEL in name)
    outside = (code for name, code in found.items() if name != kernel and not name.startswith(GRADIENTS))
    apart = sum(bool(ARITHMETIC.match(mnemonic)) for code in outside for _, mnemonic, _ in code)
    return work_of(blocks_of(found[kernel])) + apart


def figures(scene: str) -> dict[str, dict[str, float]]:
    """Work of a step by each method, and the processor time to compile it over that of PLAIN; for a process of its own."""
    with tempfile.TemporaryDirectory() as name:
        folder, found = Path(name), {}
        # The first one makes Clang's precompiled header too.
        plain = [compiled(plan_of(SCENES[PLAIN[0]](), PLAIN[1]), folder / f"plain {i}")[1] for i in range(2)]
        for method in METHODS:
            path, seconds = compiled(plan_of(SCENES[scene](), method), folder / method)
            found[method] = {"work": work_of_step(path), "compile": round(seconds / plain[1], 2)}
        return found


def work_repeated(scene: str, method: str, times: int) -> int:
    """Work of a step of the scene with each of its terms so many times; for a process of its own."""
    with tempfile.TemporaryDirectory() as name:
        return work_of_step(compiled(plan_of(repeated(SCENES[scene](), times), method), Path(name))[0])


def repeated(scene: Scene, times: int) -> Scene:
    """The scene with each term so many times."""
    again = [dataclasses.replace(term, name=f"{term.key}_{i}") for i in range(1, times) for term in scene.terms]
    return dataclasses.replace(scene, terms=(*scene.terms, *again))


def recorded() -> dict[str, dict[str, dict[str, float]]]:
    """The table: scene -> method -> figures."""
    table: dict[str, dict[str, dict[str, float]]] = json.loads(TABLE.read_text())
    return table


def main() -> None:
    """Print the figures, and with --write record them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="into the table; default: print only")
    write = parser.parse_args().write
    from tests.support import hot_loops  # by its name, not as the program

    table: dict[str, Any] = {}
    for scene in SCENES:
        table[scene] = own_process.call(hot_loops.figures, scene)
        print(f"{scene}: {table[scene]}", flush=True)
    if write:
        TABLE.write_text(json.dumps(table, indent=1) + "\n")


if __name__ == "__main__":
    main()
