# SPDX-License-Identifier: Apache-2.0
"""A Doppler velocity log: the velocities along four beams."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.cells import grid_fields
from lgvi_kernels.lanes.noise import noise_key
from lgvi_kernels.law import *
from lgvi_kernels.laws.control.altimeter import range_to_floor
from lgvi_kernels.laws.control.readings import remember3, remembered3
from lgvi_kernels.laws.control.sensor import drawn, is_due, lost_in_bursts


@wp.func
def beam(ahead: Any, down: Any, i: int):
    """The direction of beam i: 45 degrees to starboard of the bow, then every 90; ahead: its part along bow and starboard."""
    x = ahead
    y = ahead
    if i == 1 or i == 2:
        x = -ahead
    if i > 1:
        y = -ahead
    return vec3(x, y, down)


@wp.func
def either(a: Any, b: Any, c: Any, d: Any):
    """The velocity along a beam, by the three others: those of opposite beams add up to the same."""
    return positive(d, a, b + c)


@functools.cache
def made(features):
    """The device code of a log.

    features: "noise", "dropout", "burst", "outlier", "silent" where some member has them, "floor" or "grid" where there is
    one, flat or on a grid, "tilt" where it is lost by an angle, and "handed" where a filter takes the beams.
    """
    noisy, lossy, bursting, wild, floored, gridded, silent, tilted, handed = (
        name in features
        for name in ("noise", "dropout", "burst", "outlier", "floor", "grid", "silent", "tilt", "handed")
    )
    first = 0 if handed else 11

    def params(width, real):
        """Params: the numbers by member; key of the random numbers; first of its rows of memory, and of what it hands on.

        floor: its depth; or most, how far the beams look, and the grid. least_down: cosine of the greatest tilt.
        """
        names = ("noise", "ahead", "down", "every", "dropout", "least_range", "greatest_range")
        ground = ("most",) if gridded else ("floor",)
        more = ("begins", "stays") * bursting + ("outlier", "outlier_std") * wild + ("least_down",) * tilted
        lanes = dict.fromkeys((*names, *ground, "silent_from", "silent_to", *more), lane(width, real))
        words = dict.fromkeys(("memory", "handed"), wp.int32)
        grid = grid_fields(width, real) if gridded else {}
        return struct("DVL", place=lane3(width, real), **lanes, **grid, key=noise_key(width), **words)

    @wp.func
    def quiet(y: Any, p: Any):
        """0 while it is silent, or not due; else 1."""
        fresh = is_due(y.tick, p.every)
        unity = ones(fresh)
        if wp.static(silent):
            # A tick and the beginning are the same where they differ by less than this part of the step.
            t = (y.t + y.h.dtype(1e-3) * y.h) * unity
            off = positive(t - p.silent_from, positive(p.silent_to - t, unity, unity - unity), unity - unity)
            fresh = positive(off, unity - unity, fresh)
        if wp.static(tilted):
            fresh = positive(p.least_down - y.down.z, unity - unity, fresh)
        return fresh

    @wp.func
    def echo(fresh: Any, altitude: Any, down: Any, p: Any):
        """`fresh` where the beam meets the flat floor within its range; else 0."""
        unity = ones(fresh)
        zero = unity - unity
        near = positive(p.least_range * down - altitude, zero, fresh)
        within = positive(altitude - p.greatest_range * down, zero, near)
        return positive(down, within, zero)

    @wp.func
    def echo_of_grid(fresh: Any, y: Any, u: Any, p: Any):
        """`fresh` where the beam meets the floor within its range; else 0."""
        zero = ones(fresh) - ones(fresh)
        start = y.position + to_inertial(y, p.place)
        reading = range_to_floor(y, p, start, to_inertial(y, u))
        near = positive(reading - p.least_range, fresh, zero)
        return positive(p.most - reading, near, zero)

    @wp.func
    def solved(y: Any, p: Any, at: Any):
        """The velocity by least squares of the beams, where three or four of them are new."""
        unity = ones(p.noise)
        part = unity.dtype(0.25) * unity
        a = remembered(y, at)
        b = remembered(y, at + 1)
        c = remembered(y, at + 2)
        d = remembered(y, at + 3)
        fa = remembered(y, at + 4)
        fb = remembered(y, at + 5)
        fc = remembered(y, at + 6)
        fd = remembered(y, at + 7)
        enough = fa + fb + fc + fd - unity.dtype(2.5) * unity
        first = either(a, b, d - c, fa)
        second = either(b, a, c - d, fb)
        third = either(c, b, d - a, fc)
        fourth = either(d, a, c - b, fd)
        across = part / p.ahead
        v = vec3(
            across * (first - second - third + fourth),
            across * (first + second - third - fourth),
            (part / p.down) * (first + second + third + fourth),
        )
        return v, enough

    @wp.func
    def measure(y: Any, p: Any):
        """Hand the beams on, or let y have the velocity that follows from three of them or four; else the last, first 0."""
        unity = ones(y.position.x)
        zero = unity - unity
        v = y.velocity + cross(y.angular_velocity, p.place)
        four = drawn(unity, p.key, y.tick, 0)
        chance = four
        if wp.static(lossy):
            chance = drawn(unity, p.key, y.tick, 1)
        size = four
        stray = four
        if wp.static(wild):
            size = drawn(unity, p.key, y.tick, 2)
            stray = drawn(unity, p.key, y.tick, 3)
        new = quiet(y, p)
        altitude = zero
        if wp.static(floored):
            altitude = p.floor - y.position.z - dot(y.down, p.place)
        at = p.handed
        if wp.static(not handed):
            at = p.memory + 3
        for i in range(4):
            u = beam(p.ahead, p.down, i)
            along = dot(u, v)
            fresh = new
            if wp.static(noisy):
                along = along + p.noise * quarter(four, i)
            if wp.static(wild):
                along = along + positive(p.outlier - quarter(stray, i), p.outlier_std * quarter(size, i), zero)
            if wp.static(bursting):
                lost = lost_in_bursts(y, p, quarter(chance, i), p.memory + wp.static(first) + i)
                fresh = positive(lost, zero, fresh)
            elif wp.static(lossy):
                fresh = positive(p.dropout - quarter(chance, i), zero, fresh)
            if wp.static(floored):
                fresh = echo(fresh, altitude, dot(u, y.down), p)
            if wp.static(gridded):
                fresh = echo_of_grid(fresh, y, u, p)
            remember(y, at + i, along)
            remember(y, at + 4 + i, fresh)
        if wp.static(not handed):
            solution, enough = solved(y, p, at)
            held = positive(enough, solution, remembered3(y, p.memory))
            remember3(y, p.memory, held)
            y.velocity = held
        return y

    return device(__name__, features, params=params, measure=measure)
