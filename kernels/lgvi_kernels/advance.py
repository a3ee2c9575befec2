"""The one fused kernel: a packet of vehicles through all its steps, with only the terms that the scene has."""

import functools
from typing import Any, NamedTuple

import warp as wp

from lgvi_kernels.compose import superpose
from lgvi_kernels.flags import CPU_FLAGS
from lgvi_kernels.lanes import (
    add,  # noqa: F401
    any_positive,
    div,  # noqa: F401
    int_lane,
    lane,
    mul,  # noqa: F401
    neg,  # noqa: F401
    ones,
    sub,  # noqa: F401
    vec3,
)
from lgvi_kernels.packet import at_rest, choose, failures, put, renormalise
from lgvi_kernels.rotation import rotation_struct
from lgvi_kernels.solve import make_solve
from lgvi_kernels.state import alarm_struct, inertia_struct, state_struct, view_struct, wrench_struct
from lgvi_kernels.submaps import Ap, T, anisotropic_velocity, fold, isotropic_velocity, make_Ab, make_D, make_K

# Steps between two looks at the alarms. A chunk with an alarm is repeated one step at a time by the same code.
CHUNK = 128

# Numbers of a packet's state in `state[packet, field]`: R row by row, b, p, pi.
STATE_FIELDS = 18

# Sampled quantity -> numbers per sample, in the order they are written.
SAMPLE_FIELDS = {"position": 3, "attitude": 9, "velocity": 3, "angular_velocity": 3}


class Spec(NamedTuple):
    """Everything that decides what code a kernel holds.

    maps: the sub-maps after the leading one, as (letter, coefficient); lead: the sub-map that opens a step and merges with
    the end of the step before, or None; terms: names of laws; mass: shape of M ("isotropic", "diagonal", "full").
    """

    width: int
    real: Any
    maps: tuple
    lead: tuple | None
    terms: tuple
    mass: str
    solver: str
    iterations: int
    adaptive: bool
    checked: bool
    fields: tuple


class Advance(NamedTuple):
    """A kernel and the types of its arguments."""

    kernel: Any
    Lane: Any
    Inertia: Any
    Params: Any


@functools.cache
def make_advance(spec):
    """Build (without compiling) the kernel for this Spec."""
    width, real, checked = spec.width, spec.real, spec.checked
    Lane, Ints = lane(width, real), int_lane(width)
    State, Alarm, View = (make(width, real) for make in (state_struct, alarm_struct, view_struct))
    Inertia = inertia_struct(width, real, spec.mass)
    law, Params = superpose(spec.terms, width, real)

    @wp.struct
    class Constants:
        inertia: Inertia
        params: Params
        tolerance: real

    velocity = isotropic_velocity if spec.mass == "isotropic" else anisotropic_velocity
    solve = make_solve(real, spec.solver, spec.iterations, spec.adaptive, checked)
    letters = {
        "Ab": make_Ab(velocity),
        "Ap": Ap,
        "T": T,
        "D": make_D(rotation_struct(width, real), solve),
        "K": make_K(View, wrench_struct(width, real), law),
    }
    step = fold(tuple((letters[letter], coefficient) for letter, coefficient in spec.maps))
    has_lead = spec.lead is not None
    lead = letters[spec.lead[0]] if has_lead else step
    lead_coefficient = spec.lead[1] if has_lead else 0.0
    renormalised = real == wp.float32
    fields, per_sample = spec.fields, sum(SAMPLE_FIELDS[name] for name in spec.fields)

    @wp.func
    def read(state: wp.array2d(dtype=Lane), i: int):
        x = State()
        x.R0 = vec3(state[i, 0], state[i, 1], state[i, 2])
        x.R1 = vec3(state[i, 3], state[i, 4], state[i, 5])
        x.R2 = vec3(state[i, 6], state[i, 7], state[i, 8])
        x.b = vec3(state[i, 9], state[i, 10], state[i, 11])
        x.p = vec3(state[i, 12], state[i, 13], state[i, 14])
        x.pi = vec3(state[i, 15], state[i, 16], state[i, 17])
        return x

    @wp.func
    def write(state: wp.array2d(dtype=Lane), i: int, x: State):
        put(state, i, 0, x.R0)
        put(state, i, 3, x.R1)
        put(state, i, 6, x.R2)
        put(state, i, 9, x.b)
        put(state, i, 12, x.p)
        put(state, i, 15, x.pi)

    @wp.func
    def sample(out: wp.array2d(dtype=Lane), i: int, first: int, x: State, c: Constants):
        """Write the chosen fields of one sample: b, R, nu = M^-1 p, Om = J^-1 pi."""
        o = first
        if wp.static("position" in fields):
            put(out, i, o, x.b)
            o += 3
        if wp.static("attitude" in fields):
            put(out, i, o, x.R0)
            put(out, i, o + 3, x.R1)
            put(out, i, o + 6, x.R2)
            o += 9
        if wp.static("velocity" in fields):
            put(out, i, o, velocity(c.inertia, x.p))
            o += 3
        if wp.static("angular_velocity" in fields):
            put(out, i, o, x.pi / c.inertia.J)

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": CPU_FLAGS})
    def advance(
        # vehicles and laws, one entry (shared) or one a packet
        inertia: wp.array(dtype=Inertia),
        params: wp.array(dtype=Params),
        tolerance: real,
        # method: h g_i of each stage, and the merged lead's h (g_i + g_i+1); the lead of the first stage comes first
        stage_h: wp.array(dtype=real),
        lead_h: wp.array(dtype=real),
        # time: this launch makes steps k0 to k1, and writes the samples due after the steps sample_step[s0:]
        k0: int,
        k1: int,
        s0: int,
        sample_step: wp.array(dtype=int),
        # in and out
        state: wp.array2d(dtype=Lane),
        status: wp.array(dtype=Ints),
        failed_step: wp.array(dtype=Ints),
        failed_size: wp.array(dtype=Lane),
        # out
        out: wp.array2d(dtype=Lane),
    ):
        i = wp.tid()
        c = Constants()
        c.inertia = inertia[i % inertia.shape[0]]
        c.params = params[i % params.shape[0]]
        c.tolerance = tolerance
        stages = stage_h.shape[0]
        x = read(state, i)
        one = ones(x.b.x)
        zero = one - one
        frozen = zero
        any_frozen = bool(False)
        if wp.static(checked):
            for j in range(wp.static(width)):
                frozen[j] = real(status[i][j])
            any_frozen = any_positive(frozen)
        kept = x
        if any_frozen:
            x = choose(frozen, at_rest(x), x)
        if wp.static(has_lead):
            if k0 == 0:
                x = lead(x, c, real(wp.static(lead_coefficient)) * stage_h[0])
        k = k0
        s = s0
        singles = int(0)
        while k < k1:
            n = wp.min(wp.static(CHUNK) - k % wp.static(CHUNK), wp.min(k1, sample_step[s]) - k)
            if singles > 0:
                n = 1
            good = x
            x.alarm = Alarm()
            for j in range(n):
                for g in range(stages):
                    x = step(x, c, stage_h[g])
                    if wp.static(has_lead):
                        x = lead(x, c, real(wp.static(lead_coefficient)) * lead_h[g])
            repeat = int(0)
            if wp.static(checked):
                code = failures(x, frozen)
                if any_positive(code):
                    if n > 1:
                        repeat = n
                    else:
                        for j in range(wp.static(width)):
                            if code[j] > real(0.0):
                                status[i][j] = int(code[j])
                                failed_step[i][j] = k
                                failed_size[i][j] = x.alarm.size[j]
                        kept = choose(code, good, kept)
                        frozen = frozen + code
                        any_frozen = True
                if any_frozen:
                    x = choose(frozen, at_rest(x), x)
            if repeat > 0:
                x = good
                singles = repeat
            else:
                k += n
                if singles > 0:
                    singles -= 1
                if wp.static(renormalised):
                    if k % wp.static(CHUNK) == 0:
                        x = renormalise(x, tolerance)
                if k == sample_step[s]:
                    y = x
                    if any_frozen:
                        y = choose(frozen, kept, x)
                    if wp.static(has_lead):
                        y = lead(y, c, -(real(wp.static(lead_coefficient)) * stage_h[0]))
                    sample(out, i, (s - s0) * wp.static(per_sample), y, c)
                    s += 1
        if any_frozen:
            x = choose(frozen, kept, x)
        write(state, i, x)

    return Advance(advance, Lane, Inertia, Params)
