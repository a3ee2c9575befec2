# SPDX-License-Identifier: Apache-2.0
"""The step of a method with its lead, and the loop over steps that takes the time of a run."""

import functools
from typing import Any, NamedTuple

import warp as wp

from lgvi_kernels.advance.events import Watch, make_watch
from lgvi_kernels.advance.method import Step, make_method
from lgvi_kernels.advance.monitor import make_backward, make_drag_rate
from lgvi_kernels.advance.spec import make_types
from lgvi_kernels.lanes.arithmetic import add, mul, sub  # noqa: F401
from lgvi_kernels.lanes.sums import settled
from lgvi_kernels.laws import drag_directions


class Stepping(NamedTuple):
    """Functions of a kernel's steps.

    method: see Step; watch: see Watch, None without events. at_step: (x, k, h) -> x with the number and the time of step k;
    opened: (x, c, length) -> x moved by the lead; one_step, stepped: one step, and a number of steps.
    feed, respond, recall: a controller's tick (see make_feed); held: a number of steps and the ticks between them; all of
    these are `step` where there is no controller.
    """

    method: Step
    watch: Watch | None
    at_step: Any
    opened: Any
    one_step: Any
    stepped: Any
    feed: Any
    respond: Any
    recall: Any
    held: Any


@functools.cache
def make_stepping(spec):
    """The steps of this Spec."""
    types, real = make_types(spec), spec.real
    State, Constants, Monitor = types.State, types.Constants, types.Monitor
    method = make_method(spec)
    step, lead = method.step, method.lead
    timed, has_lead, lead_time = spec.timed, spec.lead is not None, spec.drifted_time
    composed, paired, compensated = spec.composed, spec.paired, spec.compensated
    backward, watched = spec.backward, spec.watched
    watch = make_watch(spec.events, types.View, "origin" in spec.parts, real) if watched else None
    # step stands in for functions that this Spec does not ask for; it is not called in their place.
    to_event = watch.alarm if watched else step
    drag_back = step
    if backward:
        rate = make_drag_rate(spec.laws[0] is drag_directions, spec.drag, method.velocities_of_forces, 1.0)
        drag_back = make_backward(rate)

    @wp.func
    def at_step(x: State, k: int, h: wp.float64):
        """The number of step k and the time after its lead: a product, since a sum over the steps would add up round-off."""
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
        """Step k, and the checks of each step."""
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
                # The lead that ends this step and the one that opens the next, in one.
                x = lead(x, c, opening + opening)
        if wp.static(compensated):
            x = settled(x)
        if wp.static(backward):
            x = drag_back(x, c, monitor.backward)
        if wp.static(watched):
            x = to_event(x, c, real(h))
        return x

    @wp.func(inline=spec.explicit is not None)
    def stepped(x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, n: int, h: wp.float64,
                stage_h: wp.array(dtype=real), lead_h: wp.array(dtype=real), first_h: real, opening: real):  # fmt: skip
        """The steps k to k + n: the loop that takes the time, apart from all else, which would spoil its schedule."""
        # Copies of what lies behind the references: only such can the loop keep in registers.
        y = x
        y.prepared = 0
        own = c
        limits = monitor
        for j in range(n):
            y = one_step(y, own, limits, k + j, h, stage_h, lead_h, first_h, opening)
        x = y

    feed, respond, recall = step, step, step
    if spec.control:
        # A tick's code takes as long to load as all the rest: here, where a scene has one.
        from lgvi_kernels.advance.feeding import make_feed

        feed, respond, recall = make_feed(spec, types, method, at_step, opened)

    held = make_held(types, real, one_step, feed) if spec.control else step
    return Stepping(method, watch, at_step, opened, one_step, stepped, feed, respond, recall, held)


def make_held(types, real, one_step, feed):
    """The function that makes a number of steps, and the ticks of a controller between them."""
    State, Constants, Monitor = types.State, types.Constants, types.Monitor

    @wp.func(inline=False)
    def held(x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, n: int, h: wp.float64,
             stage_h: wp.array(dtype=real), lead_h: wp.array(dtype=real), first_h: real, opening: real):  # fmt: skip
        """The steps k to k + n, and a tick of the controller at each of its times between and after them.

        The ticks are around the loop over steps: a test in it would cost more, and a chunk that ends at each of them most.
        """
        own = c
        limits = monitor
        at = k
        while at < k + n:
            m = wp.min(k + n - at, limits.every - at % limits.every)
            y = x
            y.prepared = 0
            for j in range(m):
                y = one_step(y, own, limits, at + j, h, stage_h, lead_h, first_h, opening)
            x = y
            at += m
            if at % limits.every == 0:
                feed(x, c, monitor, at, h, opening)

    return held
