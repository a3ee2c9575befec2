"""The one fused kernel: a packet of vehicles through all its steps, with only what the scene has."""

import functools
from typing import Any, NamedTuple

import warp as wp

from lgvi_kernels import monitor as monitors
from lgvi_kernels.compose import params_of, superpose
from lgvi_kernels.events import FIRST, make_arrival, make_watch
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
    positive,
    sub,  # noqa: F401
)
from lgvi_kernels.method import make_method
from lgvi_kernels.packet import failures, renormalise, turned_too_far
from lgvi_kernels.rows import PACE_FIELDS, SAMPLE_FIELDS, STATE_FIELDS, make_rows, make_sample
from lgvi_kernels.state import alarm_struct, damping_struct, inertia_struct, state_struct, struct, view_struct
from lgvi_kernels.sums import at_rest, choose, settled
from lgvi_kernels.terms import drag, drag_directions

# Steps between two looks at the alarms. A chunk with an alarm is repeated one step at a time by the same code.
CHUNK = 128

# Where every step is a sample, steps between two looks at the energy: it is then found out so many late.
SINGLE_LOOKS = 8

# A step without a solution is divided into at most so many.
MOST_PARTS = 1024


class Spec(NamedTuple):
    """Everything that decides what code a kernel holds.

    maps: the sub-maps after the leading one, as (letter, coefficient); lead: the sub-map that opens a step and merges with
    the end of the step before, or None; laws: modules of laws, drag by its exact flow first if it is there; events: modules
    of events; drag: the parts of drag along the axes (by its exact flow, or as rates), or none; mass: shape of M
    ("isotropic", "diagonal", "full"); parts: what the inertia holds besides (see inertia_struct); coupling: which of U12,
    U13, U23 and of the three pitches some member has; flow: "none", "steady" (uniform, the same for ever), "uniform",
    "varying"; timed: whether a law looks at the time; averages: alpha and beta of (15), (16), or None for conservative
    maps; composed: more than one stage a step, or one, whose constants then are made once for all steps; paired: a stage is
    two halves, each with a length of its own; gauss: numbers of a collocation method, or none; lead_time: the part of a step
    that the lead drifts for; explicit: an explicit method, which has no maps; compensated: sums of two float32 (see sums).
    looks: rows of warnings (see monitor); energy: whether its growth is a failure; backward: whether drag is looked at for
    stages that go backward; substep: whether a step that has no solution is divided.
    """

    width: int
    real: Any
    maps: tuple
    lead: tuple | None
    laws: tuple
    mass: str
    solver: str
    iterations: int
    adaptive: bool
    checked: bool
    fields: tuple
    events: tuple = ()
    drag: tuple = ()
    parts: tuple = ()
    coupling: tuple = (False,) * 6
    flow: str = "none"
    timed: bool = False
    memory: bool = False
    averages: tuple | None = None
    composed: bool = False
    paired: bool = False
    gauss: tuple = ()
    lead_time: float = 0.0
    explicit: Any = None
    compensated: bool = False
    looks: tuple = ()
    energy: bool = False
    backward: bool = False
    substep: bool = False

    @property
    def scaled(self) -> bool:
        """Whether momenta and inertia are divided by max J: for (24), and where a step is chosen, for its tolerance."""
        return self.explicit is None or self.explicit.adaptive

    @property
    def inertial(self) -> bool:
        """Whether the state holds R p in place of p."""
        return self.explicit is not None and self.explicit.kind == "inertial"

    @property
    def still(self) -> bool:
        """Whether the water that a stopped member was in is kept: it goes on changing."""
        return bool(self.events) and self.flow in ("uniform", "varying")

    @property
    def state_fields(self) -> int:
        """Numbers of a packet's state."""
        paced = self.explicit is not None and self.explicit.adaptive
        return STATE_FIELDS * (1 + self.compensated) + PACE_FIELDS * paced

    @property
    def sample_fields(self) -> dict[str, int]:
        """Field -> numbers per sample, in the order they are written; a compensated position is b and then its low part."""
        numbers = {name: SAMPLE_FIELDS[name] for name in self.fields}
        if self.compensated and "position" in numbers:
            numbers["position"] = 6
        return numbers


class Advance(NamedTuple):
    """A kernel and the types of its arguments."""

    kernel: Any
    Lane: Any
    Inertia: Any
    Params: Any
    Events: Any
    Limits: Any
    Monitor: Any


@functools.cache
def make_advance(spec):
    """Build (without compiling) the kernel for this Spec."""
    width, real, checked = spec.width, spec.real, spec.checked
    Lane, Ints = lane(width, real), int_lane(width)
    State, Alarm, View = (
        state_struct(width, real, spec.compensated),
        alarm_struct(width, real),
        view_struct(width, real),
    )
    Inertia = inertia_struct(width, real, spec.mass, spec.parts)
    Params, Events = params_of(spec.laws, width, real), params_of(spec.events, width, real)
    DragFlow = drag.flow_struct(width, real)
    dragged, remembers, timed = bool(spec.drag) and spec.explicit is None, spec.memory, spec.timed
    Constants = struct(
        "Constants",
        inertia=Inertia,
        params=Params,
        tolerance=real,
        force_tolerance=real,
        table=wp.array2d(dtype=Lane),
        memory=wp.array2d(dtype=Lane),
        packet=wp.int32,
        entry=wp.int32,
        **({"events": Events} if spec.events else {}),
        **({"drag": DragFlow} if dragged else {}),
    )
    method = make_method(spec)
    step, lead, prepare, momentum = method.step, method.lead, method.prepare, method.momentum
    has_lead, watched = spec.lead is not None, bool(spec.events)
    watch = make_watch(spec.events, View, "origin" in spec.parts, real) if watched else None
    to_event = watch.alarm if watched else step
    lead_coefficient = spec.lead[1] if has_lead else 0.0
    # A drift that leads has passed half of its time when a step begins; with stages, of the first one's.
    lead_time = spec.lead_time if has_lead and spec.lead[0] in ("Ab", "T", "B") else 0.0
    renormalised, composed, paired = real == wp.float32, spec.composed, spec.paired
    # A packet that chooses its steps goes on with them in the next launch, and waits for no frozen lane.
    paced, compensated = spec.explicit is not None and spec.explicit.adaptive, spec.compensated
    turned = any(letter[0] == "R" for letter, _ in spec.maps)
    per_sample = sum(spec.sample_fields.values())
    looks, energetic, backward, substepped, stills = spec.looks, spec.energy, spec.backward, spec.substep, spec.still
    Monitor = monitors.monitor_struct(width, real, looks, energetic, backward, substepped, spec.still)
    apart = spec.explicit is None
    warned, looking = bool(looks), bool(looks) or energetic
    look_at, energies, supplies, growth, drag_back = _watchers(spec, method)

    read, write, back_up = make_rows(Lane, State, paced, compensated)
    sample = make_sample(Lane, spec.fields, compensated, method, superpose(spec.laws, "flow") is not None, spec.still)

    @wp.func
    def at_step(x: State, k: int, h: wp.float64):
        """The number of step k and the time after its lead, exact: never summed up."""
        if wp.static(timed):
            x.time = wp.float64(k) * h + wp.float64(wp.static(lead_time)) * h
            x.step = k
        return x

    @wp.func
    def opened(x: State, c: Constants, length: real):
        """The lead of the first step; with `length` negative, the state at a step's end without that of the next."""
        if wp.static(has_lead):
            x = lead(x, c, length)
        return x

    @wp.func
    def one_step(x: State, c: Constants, monitor: Monitor, k: int, h: wp.float64, stage_h: wp.array(dtype=real),
                 lead_h: wp.array(dtype=real), first_h: real, opening: real):  # fmt: skip
        """Step k, and what is looked at in each."""
        x = at_step(x, k, h)
        if wp.static(composed):
            for g in range(lead_h.shape[0] - 1):
                if wp.static(paired):
                    x = step(x, c, stage_h[2 * g], stage_h[2 * g + 1])
                else:
                    x = step(x, c, stage_h[g])
                if wp.static(has_lead):
                    x = lead(x, c, lead_h[g])
        else:
            x = step(x, c, first_h)
            if wp.static(has_lead):
                x = lead(x, c, opening + opening)
        if wp.static(compensated):
            x = settled(x)
        if wp.static(backward):
            x = drag_back(x, c, monitor.backward)
        if wp.static(watched):
            x = to_event(x, c, real(h))
        return x

    @wp.func(inline=False)
    def stepped(x: State, c: Constants, monitor: Monitor, k: int, n: int, h: wp.float64, stage_h: wp.array(dtype=real),
                lead_h: wp.array(dtype=real), first_h: real, opening: real):  # fmt: skip
        """The steps k to k + n: the loop that takes the time, apart from all else, which would spoil its schedule."""
        for j in range(n):
            x = one_step(x, c, monitor, k + j, h, stage_h, lead_h, first_h, opening)
        return x

    # What follows is for rare looks and repairs: no part of it is to be mixed with the loop over the steps, whose schedule
    # and registers it would spoil (a fifth of the speed).
    @wp.func
    def closed(x: State, c: Constants, k: int, h: wp.float64, opening: real):
        """The state after k steps without the lead of the next, with p in body axes."""
        y = opened(at_step(x, k, h), c, -opening)
        if wp.static(momentum is not None):
            y.p = momentum(y)
        return y

    @wp.func
    def created(y: State, c: Constants, monitor: Monitor, t: real):
        """Energy that came from nowhere since the start, over what there was to exchange."""
        e = monitor.energy
        return growth(y, c, t, e[c.packet, 0], e[c.packet, 1], e[c.packet, 2])

    @wp.func(inline=False)
    def energy_alarm(x: State, c: Constants, monitor: Monitor, k: int, h: wp.float64, opening: real, among: Lane):
        """The alarm after k steps, with that of the lanes, among these, whose energy explodes."""
        g = created(closed(x, c, k, h, opening), c, monitor, real(wp.float64(k) * h))
        one = ones(g)
        over = positive(among, g - real(wp.static(monitors.MOST_ENERGY)) * one, one - one)
        alarm = x.alarm
        alarm.size = positive(alarm.code, alarm.size, positive(over, g * g, alarm.size))
        grew = real(wp.static(float(monitors.ENERGY_GREW))) * one
        alarm.code = positive(alarm.code, alarm.code, positive(over, grew, one - one))
        return alarm

    @wp.func
    def warn(y: State, c: Constants, monitor: Monitor, k: int, h: wp.float64, frozen: Lane):
        """Note which rows are crossed after k steps; of the most serious one, when it was first so, and its value."""
        g = frozen
        if wp.static(energetic):
            g = created(y, c, monitor, real(wp.float64(k) * h))
        seen = look_at(y, c, monitor.limits[c.packet % monitor.limits.shape[0]], g)
        bits = positive(frozen, frozen - frozen, seen.bits)
        if any_positive(bits):
            for j in range(wp.static(width)):
                old = monitor.warned[c.packet][j]
                new = int(bits[j]) & ~old
                if new > old:
                    monitor.warned_step[c.packet][j] = k
                    monitor.warned_size[c.packet][j] = seen.size[j]
                monitor.warned[c.packet][j] = old | new

    @wp.func(inline=False)
    def begin(x: State, c: Constants, monitor: Monitor, h: wp.float64, frozen: Lane):
        """Look at the start, whose energy later ones are compared with."""
        y = x
        if wp.static(momentum is not None):
            y.p = momentum(x)
        if wp.static(energetic):
            T, U = energies(y, c)
            monitor.energy[c.packet, 0] = T
            monitor.energy[c.packet, 1] = U
            monitor.energy[c.packet, 2] = supplies(y, c, T)
        if wp.static(warned):
            warn(y, c, monitor, 0, h, frozen)

    @wp.func(inline=False)
    def note(x: State, c: Constants, monitor: Monitor, k: int, h: wp.float64, opening: real, frozen: Lane):
        """Look at the state after k steps, without the lead of the next."""
        warn(closed(x, c, k, h, opening), c, monitor, k, h, frozen)

    @wp.func(inline=False)
    def in_parts(x: State, c: Constants, k: int, h: wp.float64, part: real, parts: int, stage_h: wp.array(dtype=real),
                 lead_h: wp.array(dtype=real), opening: real, among: Lane):  # fmt: skip
        """So many equal parts of step k, `part` of its length each, from and to a state that the lead has opened for h.

        among: the lanes that are looked at; what a packet that chooses its steps does depends on them alone.
        """
        stages = lead_h.shape[0] - 1
        x.alarm = Alarm()
        if wp.static(paced):
            x.alarm.code = ones(among) - among
            x.pace.stride = real(0.0)
            x.pace.before = real(0.0)
        if wp.static(remembers):
            back_up(c.memory, c.packet, 1, 0)
        x = at_step(x, k, h)
        x = opened(opened(x, c, -opening), c, part * opening)
        for _ in range(parts):
            for g in range(stages):
                if wp.static(paired):
                    x = step(x, c, part * stage_h[2 * g], part * stage_h[2 * g + 1])
                else:
                    x = step(x, c, part * stage_h[g])
                if wp.static(has_lead):
                    if wp.static(composed):
                        x = lead(x, c, part * lead_h[g])
                    else:
                        x = lead(x, c, part * (opening + opening))
            if wp.static(compensated):
                x = settled(x)
        if wp.static(turned):
            x.alarm = turned_too_far(x.alarm)
        return opened(opened(x, c, -(part * opening)), c, opening)

    @wp.func(inline=False)
    def retried(good: State, x: State, code: Lane, c: Constants, k: int, h: wp.float64, stage_h: wp.array(dtype=real),
                lead_h: wp.array(dtype=real), opening: real):  # fmt: skip
        """(state, code) after step k: where it had no solution, by 2, 4, ... equal parts, as soon as those have one."""
        one = ones(code)
        zero = one - one
        left = code + zero
        pending = zero
        for j in range(wp.static(width)):
            if code[j] == real(1.0) or code[j] == real(2.0) or code[j] == real(4.0):
                pending[j] = real(1.0)
        parts = int(1)
        while parts < wp.static(MOST_PARTS) and any_positive(pending):
            parts = 2 * parts
            y = choose(pending, good, at_rest(good))
            y = in_parts(y, c, k, h, real(1.0) / real(parts), parts, stage_h, lead_h, opening, pending)
            if wp.static(watched):
                y = to_event(y, c, real(h))
            wrong = failures(y, one - pending)
            solved = one - one
            for j in range(wp.static(width)):
                # An event is no failure, but what becomes of the lane.
                if pending[j] > real(0.0) and (wrong[j] <= real(0.0) or wrong[j] >= real(wp.static(float(FIRST)))):
                    solved[j] = real(1.0)
                    pending[j] = real(0.0)
                    left[j] = wrong[j]
            x = choose(solved, y, x)
        return x, left

    arrival = step
    if watched:
        water = method.water_velocity if spec.still else None
        arrival = make_arrival(watch.nearest, in_parts, choose, water, real, width, MOST_PARTS if substepped else 1)

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": CPU_FLAGS})
    def advance(
        # vehicles, laws and events, one entry (shared) or one a packet
        inertia: wp.array(dtype=Inertia),
        params: wp.array(dtype=Params),
        events: wp.array(dtype=Events),
        table: wp.array2d(dtype=Lane),
        tolerance: real,
        force_tolerance: real,
        # method: length of each stage [s], in pairs where it has two halves; of the lead after each, and before the first
        h: wp.float64,
        stage_h: wp.array(dtype=real),
        lead_h: wp.array(dtype=real),
        # time: this launch makes steps k0 to k1, and writes the samples due after the steps sample_step[s0:]
        k0: int,
        k1: int,
        s0: int,
        sample_step: wp.array(dtype=int),
        # in and out
        state: wp.array2d(dtype=Lane),
        memory: wp.array2d(dtype=Lane),
        status: wp.array(dtype=Ints),
        failed_step: wp.array(dtype=Ints),
        failed_size: wp.array(dtype=Lane),
        # what is looked at now and then
        monitor: Monitor,
        # out
        out: wp.array2d(dtype=Lane),
    ):
        i = wp.tid()
        c = Constants()
        c.inertia = inertia[i % inertia.shape[0]]
        c.params = params[i % params.shape[0]]
        c.tolerance = tolerance
        c.force_tolerance = force_tolerance
        c.table = table
        c.memory = memory
        c.packet = i
        c.entry = i % table.shape[0]
        if wp.static(watched):
            c.events = events[i % events.shape[0]]
        if wp.static(dragged):
            c.drag = prepare(DragFlow(), c.params.own, real(h))
        stages = lead_h.shape[0] - 1
        first_h = real(1.0) * stage_h[0]
        opening = real(1.0) * lead_h[stages]
        if wp.static(not composed):
            # From the one number that the compiler then keeps for the stage and its leads.
            opening = real(wp.static(lead_coefficient)) * first_h
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
        if k0 == 0:
            if wp.static(looking):
                begin(x, c, monitor, h, frozen)
            x = opened(x, c, opening)
        k = k0
        s = s0
        if wp.static(looking):
            suspects = zero
            last = sample_step[sample_step.shape[0] - 2]
        singles = int(0)
        while k < k1:
            n = wp.min(wp.static(CHUNK) - k % wp.static(CHUNK), wp.min(k1, sample_step[s]) - k)
            if singles > 0:
                n = 1
            good = x
            if wp.static(remembers and checked):
                back_up(memory, i, 0, 1)
            x.alarm = Alarm()
            if wp.static(paced):
                x.alarm.code = frozen
            if wp.static(apart):
                x = stepped(x, c, monitor, k, n, h, stage_h, lead_h, first_h, opening)
            else:
                for j in range(n):
                    x = one_step(x, c, monitor, k + j, h, stage_h, lead_h, first_h, opening)
            repeat = int(0)
            if wp.static(checked):
                if wp.static(turned):
                    x.alarm = turned_too_far(x.alarm)
                if wp.static(energetic):
                    if singles > 0:
                        # Of a chunk that is made again, only those lanes are looked at that made it necessary.
                        x.alarm = energy_alarm(x, c, monitor, k + n, h, opening, suspects)
                    elif n > 1 or (k + n) % wp.static(SINGLE_LOOKS) == 0 or k + n == last:
                        x.alarm = energy_alarm(x, c, monitor, k + n, h, opening, one - frozen)
                code = failures(x, frozen)
                if wp.static(substepped):
                    if n == 1 and any_positive(code):
                        was = code
                        x, code = retried(good, x, was, c, k, h, stage_h, lead_h, opening)
                        for j in range(wp.static(width)):
                            if code[j] != was[j]:
                                monitor.substeps[i][j] = monitor.substeps[i][j] + 1
                                x.alarm.size[j] = real(0.0)
                if any_positive(code):
                    if n > 1:
                        repeat = n
                        if wp.static(looking):
                            suspects = code
                    else:
                        landed = good
                        if wp.static(watched):
                            # The failed lanes keep their last good state, those that an event stops the state at it.
                            begun = at_step(good, k, h)
                            landed, code, part, still = arrival(begun, x, code, c, k, h, stage_h, lead_h, opening)
                            for j in range(wp.static(width)):
                                if code[j] >= real(wp.static(float(FIRST))):
                                    x.alarm.size[j] = part[j] * part[j]
                                if wp.static(stills):
                                    if code[j] > real(0.0):
                                        monitor.still[i, 0][j] = still.x[j]
                                        monitor.still[i, 1][j] = still.y[j]
                                        monitor.still[i, 2][j] = still.z[j]
                            if wp.static(remembers):
                                # Laws of the other lanes are to remember the whole step.
                                back_up(memory, i, 1, 0)
                                begun = one_step(begun, c, monitor, k, h, stage_h, lead_h, first_h, opening)
                        for j in range(wp.static(width)):
                            if code[j] > real(0.0):
                                status[i][j] = int(code[j])
                                failed_step[i][j] = k
                                failed_size[i][j] = x.alarm.size[j]
                        kept = choose(code, landed, kept)
                        frozen = frozen + code
                        any_frozen = True
                if any_frozen:
                    x = choose(frozen, at_rest(x), x)
            if repeat > 0:
                x = good
                singles = repeat
                if wp.static(remembers and checked):
                    back_up(memory, i, 1, 0)
            else:
                k += n
                if singles > 0:
                    singles -= 1
                if wp.static(warned):
                    if k % wp.static(CHUNK) == 0 or k == last:
                        note(x, c, monitor, k, h, opening, frozen)
                if wp.static(renormalised):
                    if k % wp.static(CHUNK) == 0:
                        x = renormalise(x, tolerance)
                if k == sample_step[s]:
                    y = x
                    if any_frozen:
                        y = choose(frozen, kept, x)
                    y = opened(at_step(y, k, h), c, -opening)
                    sample(out, i, (s - s0) * wp.static(per_sample), y, c, real(h), monitor, frozen)
                    s += 1
        if any_frozen:
            x = choose(frozen, kept, x)
        write(state, i, x)

    return Advance(advance, Lane, Inertia, Params, Events, monitors.limits_struct(width, real, looks), Monitor)


def _watchers(spec, method):
    """(look_at, energies, supplies, growth, drag_back) of monitor.py; the step in place of what a Spec does not ask for."""
    width, real, laws = spec.width, spec.real, spec.laws
    View, Damping = view_struct(width, real), damping_struct(width, real)
    directions = bool(laws) and laws[0] is drag_directions
    velocities, of_forces = method.velocities, method.velocities_of_forces
    look_at, energies, supplies, growth, drag_back = (method.step,) * 5
    if spec.looks:
        rates = []
        damping = superpose(laws, "damping")
        if "drag" in spec.looks and spec.drag:
            rates.append(monitors.make_drag_rate(directions, spec.drag, of_forces, 2.0))
        if "drag" in spec.looks and damping is not None:
            rates.append(monitors.make_matrix_rate(View, Damping, damping, of_forces))
        rate = monitors.make_sum(*rates) if len(rates) == 2 else (*rates, None)[0]
        look_at = monitors.make_look(spec.looks, width, real, velocities, rate)
    if spec.energy:
        energies, supplies, growth = monitors.make_energy(laws, real, View, velocities, "origin" in spec.parts)
    if spec.backward:
        drag_back = monitors.make_backward(monitors.make_drag_rate(directions, spec.drag, of_forces, 1.0))
    return look_at, energies, supplies, growth, drag_back
