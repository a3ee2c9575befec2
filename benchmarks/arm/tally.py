# SPDX-License-Identifier: Apache-2.0
"""Floating-point operations of ARM instructions (the package capstone), by the lanes of each.

Additions, subtractions and multiplications count, a fused pair as two; divisions and square roots apart. What changes a
sign, compares, chooses, converts or moves does not count.
"""

import re
from typing import NamedTuple

from benchmarks.arm.core import EXECUTABLE, segments

FUSED = {"fmla", "fmls", "fmadd", "fmsub", "fnmadd", "fnmsub", "fmad", "fmsb", "fnmad", "fnmsb", "fnmla", "fnmls"}
SINGLE = {"fadd", "fsub", "fsubr", "fmul", "fnmul", "fabd", "faddp", "faddv", "faddvl"}
SLOW = {"fdiv", "fdivr", "fsqrt"}
BYTES = {"s": 4, "d": 8}


class Tally(NamedTuple):
    """Count of instructions' work by lane: operations, those with an instruction of their own, slow ones.

    operations: additions and multiplications, 2 for a fused pair. instructions: the same, 1 for a fused pair.
    slow: divisions and square roots. vector, scalar: instructions of either kind, slow ones too, not by lane.
    """

    operations: float = 0
    instructions: float = 0
    slow: float = 0
    vector: float = 0
    scalar: float = 0

    def plus(self, second, times=1):
        """This and `times` the other."""
        return Tally(*(a + times * b for a, b in zip(self, second, strict=True)))

    def over(self, count):
        """Its part in one of so many."""
        return Tally(*(number / count for number in self))


def lanes(operands):
    """Count of numbers that an instruction produces, by its first operand: v0.2d, z0.d, d0.

    And whether these are side by side.
    """
    vector = re.match(r"v\d+\.(\d+)[sd]", operands)
    if vector:
        return int(vector[1]), True
    scalable = re.match(r"z\d+\.([sd])", operands)
    if scalable:
        return 16 // BYTES[scalable[1]], True
    return 1, False


def of_one(mnemonic, operands):
    """The tally of one instruction."""
    if mnemonic not in FUSED | SINGLE | SLOW:
        return Tally()
    count, is_vector = lanes(operands)
    kinds = {"vector": int(is_vector), "scalar": int(not is_vector)}
    if mnemonic in SLOW:
        return Tally(slow=count, **kinds)
    return Tally(operations=count * (2 if mnemonic in FUSED else 1), instructions=count, **kinds)


def of_code(code, address=0):
    """The tally of machine code, each instruction once."""
    import capstone

    total = Tally()
    decoder = capstone.Cs(capstone.CS_ARCH_ARM64, capstone.CS_MODE_ARM)
    decoder.skipdata = True
    for _, _, mnemonic, operands in decoder.disasm_lite(code, address):
        total = total.plus(of_one(mnemonic, operands))
    return total


def of_file(path):
    """The tally of all the code of an ELF file, each instruction once."""
    total = Tally()
    for address, code in segments(path.read_bytes(), EXECUTABLE):
        total = total.plus(of_code(code, address))
    return total


def of_visits(core):
    """The tally of all that a core has run."""
    total = Tally()
    for (address, size), count in core.visits.items():
        total = total.plus(of_code(core.read(address, size), address), count)
    return total
