# SPDX-License-Identifier: Apache-2.0
"""The kernel: a launch makes the steps k0 to k1, in chunks between two looks at the alarms, and writes the samples due.

A chunk with an alarm is made again from its start, one step at a time. So healthy steps pay one test a chunk, and a failing
lane is frozen at its last good state; the other lanes repeat their bits.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from lgvi_kernels.advance.beginning import make_constants
from lgvi_kernels.advance.chunks import make_chunks
from lgvi_kernels.advance.spec import Types, make_types
from lgvi_kernels.lanes.flags import CPU_FLAGS
from lgvi_kernels.lanes.subnormals import flush_subnormals, put_back
from lgvi_kernels.maps.bounded import bounded_spec
from lgvi_kernels.maps.seeing import seeing_spec


class Advance(NamedTuple):
    """A kernel and its types."""

    kernel: Any
    types: Types


@functools.cache
def make_advance(spec):
    """Build (without compiling) the kernel for this Spec."""
    spec = seeing_spec(bounded_spec(spec))
    types, real = make_types(spec), spec.real
    Lane, Number, Ints, Monitor = types.Lane, types.Number, types.Ints, types.Monitor
    Constants, Inertia, Params, Events = types.Constants, types.Inertia, types.Params, types.Events
    constants, chunks = make_constants(spec), make_chunks(spec)
    composed, lead_coefficient = spec.composed, spec.lead[1] if spec.lead is not None else 0.0

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": CPU_FLAGS})
    def advance(
        # vehicles, laws and events, one entry (shared) or one a packet
        inertia: wp.array(dtype=Inertia),
        params: wp.array(dtype=Params),
        events: wp.array(dtype=Events),
        table: wp.array2d(dtype=Number),
        tolerance: real,
        force_tolerance: real,
        # method: length of each stage [s], in pairs where it has two halves; of the lead after each, and before the first
        h: wp.float64,
        stage_h: wp.array(dtype=real),
        lead_h: wp.array(dtype=real),
        # time: this launch makes the steps k0 to k1, and writes the samples due after the steps sample_step[s0:]; how it
        # begins (see beginning.py)
        k0: int,
        k1: int,
        s0: int,
        begins: int,
        sample_step: wp.array(dtype=int),
        # in and out
        state: wp.array2d(dtype=Lane),
        memory: wp.array2d(dtype=Lane),
        status: wp.array(dtype=Ints),
        failed_step: wp.array(dtype=Ints),
        failed_size: wp.array(dtype=Lane),
        # limits and results of looks
        monitor: Monitor,
        # out: numbers of a sample, and the column of each of SAMPLE_FIELDS among them, -1 if not saved
        numbers: int,
        columns: wp.vec4i,
        out: wp.array2d(dtype=Lane),
    ):
        mode = flush_subnormals()
        i = wp.tid()
        c = Constants()
        constants(c, i, inertia, params, events, table, memory, tolerance, force_tolerance, monitor, h)
        # Times 1: a plain assignment would be a reference into the array, read anew in each step.
        first_h = real(1.0) * stage_h[0]
        opening = real(1.0) * lead_h[lead_h.shape[0] - 1]
        if wp.static(not composed):
            # Computed from first_h, the compiler keeps one number in a register for the stage and its leads.
            opening = real(wp.static(lead_coefficient)) * first_h
        chunks(c, monitor, k0, k1, s0, begins, sample_step, h, stage_h, lead_h, first_h, opening, state, status, failed_step,
               failed_size, numbers, columns, out)  # fmt: skip
        put_back(mode)

    return Advance(advance, types)
