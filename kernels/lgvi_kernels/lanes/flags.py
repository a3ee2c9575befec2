# SPDX-License-Identifier: Apache-2.0
"""Compiler flags of every kernel here."""

# The lanes are SIMD already: the flags let everything inline into one function, let the compiler join a multiplication
# and an addition into one instruction (which reorders nothing), leave out a sum with zero, and let 512-bit registers be used
# where they exist. The stack is aligned for them: else nearly every register that is put there for a while lies across two
# lines of the cache. No fast-math: it would remove the tests for NaN and the compensated sums.
CPU_FLAGS = (
    "-march=native -mprefer-vector-width=512 -mllvm=-inline-threshold=100000 "
    "-ffp-contract=fast -fno-signed-zeros -mstackrealign"
)
