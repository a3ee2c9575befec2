# SPDX-License-Identifier: Apache-2.0
"""An error-state Kalman filter for inertial navigation: Sola 2017, arXiv:1711.02508, chapters 5 and 6.

Blocks of the error: 0 position, 1 velocity (inertial), 2 attitude (body axes), 3 and 4 biases of accelerometer and gyroscope;
from 5 on the positions at the ticks of fixes that are on their way.
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.lanes.arithmetic import any_positive, element, set_element
from lgvi_kernels.law import *
from lgvi_kernels.laws.control.complementary_filter import orthonormal
from lgvi_kernels.laws.control.convergence import count_unconverged
from lgvi_kernels.laws.control.readings import (
    heading,
    put_attitude,
    remember3,
    remembered3,
    taken_attitude,
    turn_to,
    turned,
)
from lgvi_warp.extensions.navigation.device.covariance import (
    add_block,
    add_noise,
    copy_block,
    foreseen,
    squared_size,
    turn_block,
    updated,
)
from lgvi_warp.extensions.navigation.device.dvl import beam
from lgvi_warp.extensions.navigation.device.gate import AIDS, DELAYED_FIX, DEPTH, FIX, HEADING, gate_fields, make_gate

# Rows of its memory: position, velocity, attitude, both biases, rate, its last mean; of each fix on its way the position as it
# was sent, the fix, and ticks to wait; the error, rows to work with, the covariance; a Cholesky factor; rejections in a row.
VELOCITY, ATTITUDE, BIAS_A, BIAS_W, RATE, MEAN, THEN = 3, 6, 15, 18, 21, 24, 27
# Rows of what it believes: sigmas, biases, NEES, NIS, how many numbers; innovations, their sigmas. Behind them are counts of
# what the gate rejects, and two rows that tell whether it diverged.
BELIEF_BIAS, BELIEF_NEES, BELIEF_NIS, BELIEF_COUNT, BELIEF_INNOVATION, BELIEF_SIGMA, BELIEF = 15, 21, 22, 23, 24, 36, 48
TURN = 6.283185307179586
# The square of the bow's level part, up to which it has no heading: 6 degrees from the vertical.
LEVEL = 0.01
# Variance of the rate at a tick, from the means of two periods, over that of a mean.
OF_RATE = 2.5
# NEES above which it counts as diverged: ten times that of a consistent filter, which has it with a chance of 1e-24.
DIVERGED = 150.0


@functools.cache
def make_struct(gated, width, real):
    """Params: variances over a period and of readings, places of the sensors; rows of memory and of what sensors hand on.

    lever: place of the unit; arm: that of the log less it; fix_lever and so on: lever less the places of these.
    size: rows of the covariance, count: those of the estimate; copies: fixes that may be on their way. error, work,
    covariance, tally: rows of the memory from its first on; watched: those at which an event looks; diverged: rows of the bus.
    """
    Lane, Lane3 = lane(width, real), lane3(width, real)
    names = ("lever", "arm", "gained_q", "turned_q", "bias_a_q", "bias_w_q", "fix_r", "delayed_fix_r")
    names += ("fix_lever", "delayed_fix_lever", "depth_lever")
    lanes = ("gravity", "ahead", "down", "dvl_r", "depth_r", "heading_r", "latency")
    words = ("memory", "size", "count", "imu", "dvl", "fix", "delayed_fix", "depth", "heading", "belief")
    words += ("copies", "error", "work", "covariance", "tally", "watched", "diverged")
    kinds = dict.fromkeys(names, Lane3) | dict.fromkeys(lanes, Lane) | dict.fromkeys(words, wp.int32)
    return struct("ErrorStateFilter", **kinds, **(gate_fields(width, real) if gated else {}))


@wp.func
def unit_x(like: Any):
    return vec3(ones(like), ones(like) - ones(like), ones(like) - ones(like))


@wp.func
def unit_y(like: Any):
    return vec3(ones(like) - ones(like), ones(like), ones(like) - ones(like))


@wp.func
def unit_z(like: Any):
    return vec3(ones(like) - ones(like), ones(like) - ones(like), ones(like))


@wp.func
def axis(like: Any, i: int):
    """The unit vector of number i."""
    v = unit_z(like)
    if i == 0:
        v = unit_x(like)
    if i == 1:
        v = unit_y(like)
    return v


@wp.func
def direction(z: Any, i: int):
    """Row i of the attitude."""
    v = z.down
    if i == 0:
        v = z.north
    if i == 1:
        v = z.east
    return v


@wp.func
def number_of(v: Any, i: int):
    """Number i of a vector."""
    s = v.z
    if i == 0:
        s = v.x
    if i == 1:
        s = v.y
    return s


@wp.func
def right_jacobian(w: Any, e: Any):
    """J e, where Exp(w + d) = Exp(w) Exp(J d) to first order: (I - a hat(w) + b hat(w)^2) e, by their series."""
    unity = ones(w.x)
    n = dot(w, w)
    a = unity - n / (n.dtype(90.0) * unity)
    a = unity - n / (n.dtype(56.0) * unity) * a
    a = unity - n / (n.dtype(30.0) * unity) * a
    a = n.dtype(0.5) * (unity - n / (n.dtype(12.0) * unity) * a)
    b = unity - n / (n.dtype(110.0) * unity)
    b = unity - n / (n.dtype(72.0) * unity) * b
    b = unity - n / (n.dtype(42.0) * unity) * b
    b = unity / (n.dtype(6.0) * unity) * (unity - n / (n.dtype(20.0) * unity) * b)
    turned_once = cross(w, e)
    return e - a * turned_once + b * cross(w, turned_once)


@wp.func
def started(y: Any, p: Any):
    """The truth with the errors that lie in the rows of the estimate."""
    at = p.memory
    z = turned(y, remembered3(y, at + wp.static(ATTITUDE)))
    rate = y.angular_velocity
    remember3(y, at, y.position + to_inertial(y, p.lever) + remembered3(y, at))
    v = to_inertial(y, y.velocity + cross(rate, p.lever))
    remember3(y, at + wp.static(VELOCITY), v + remembered3(y, at + wp.static(VELOCITY)))
    put_attitude(z, at + wp.static(ATTITUDE))
    remember3(y, at + wp.static(RATE), rate)
    remember3(y, at + wp.static(MEAN), rate)


@wp.func
def spread_by_motion(rows: Any, k: int, z: Any, p: Any, gained: Any, turn: Any, T: Any):
    """The covariance over a period: F P F^T + Q, one block after another. z: with the attitude before."""
    P = p.memory + p.covariance
    n = p.size
    x = unit_x(gained.x)
    y = unit_y(gained.x)
    d = unit_z(gained.x)
    half = T.dtype(0.5) * T
    # The position goes on by the mean of the velocities before and after.
    add_block(rows, k, P, n, 0, 1, half * x, half * y, half * d)
    gx = to_inertial(z, cross(x, gained))
    gy = to_inertial(z, cross(y, gained))
    gz = to_inertial(z, cross(d, gained))
    add_block(rows, k, P, n, 1, 2, gx, gy, gz)
    rx = vec3(z.north.x, z.east.x, z.down.x)
    ry = vec3(z.north.y, z.east.y, z.down.y)
    rz = vec3(z.north.z, z.east.z, z.down.z)
    add_block(rows, k, P, n, 1, 3, -T * rx, -T * ry, -T * rz)
    add_noise(rows, k, P, 1, p.gained_q, rx, ry, rz)
    add_block(rows, k, P, n, 0, 1, half * x, half * y, half * d)
    jx = right_jacobian(turn, x)
    jy = right_jacobian(turn, y)
    jz = right_jacobian(turn, d)
    # Exp(-turn), by turning the three axes of an attitude that is none.
    w = z
    w.north = x
    w.east = y
    w.down = d
    w = turned(w, turn)
    turn_block(rows, k, P, n, 2, w.north, w.east, w.down)
    add_block(rows, k, P, n, 2, 4, -T * jx, -T * jy, -T * jz)
    add_noise(rows, k, P, 2, p.turned_q, jx, jy, jz)
    add_noise(rows, k, P, 3, p.bias_a_q, x, y, d)
    add_noise(rows, k, P, 4, p.bias_w_q, x, y, d)


@wp.func
def propagated(y: Any, p: Any):
    """Over one period, by what the unit has gained."""
    at = p.memory
    T = y.period * ones(y.position.x)
    gained = remembered3(y, p.imu) - T * remembered3(y, at + wp.static(BIAS_A))
    turn = remembered3(y, p.imu + 3) - T * remembered3(y, at + wp.static(BIAS_W))
    z = taken_attitude(y, at + wp.static(ATTITUDE))
    spread_by_motion(y.memory, y.packet, z, p, gained, turn, T)
    v0 = remembered3(y, at + wp.static(VELOCITY))
    v = v0 + to_inertial(z, gained)
    v = vec3(v.x, v.y, v.z + T * p.gravity)
    remember3(y, at, remembered3(y, at) + (T.dtype(0.5) * T) * (v0 + v))
    remember3(y, at + wp.static(VELOCITY), v)
    z = turned(z, turn)
    put_attitude(z, at + wp.static(ATTITUDE))
    # At the tick: on the line through the means of the last two periods.
    mean = (ones(T) / T) * turn
    last = remembered3(y, at + wp.static(MEAN))
    remember3(y, at + wp.static(RATE), mean + y.h.dtype(0.5) * (mean - last))
    remember3(y, at + wp.static(MEAN), mean)


@wp.func(inline=False)
def note_innovation(rows: Any, k: int, belief: int, slot: int, innovation: Any, s: Any, right: Any, new: Any):
    """Write an innovation, its standard deviation, and its part of the sums; right: mean square of those that are taken."""
    zero = ones(s) - ones(s)
    set_row(rows, k, belief + wp.static(BELIEF_INNOVATION) + slot, positive(new, innovation, zero))
    set_row(rows, k, belief + wp.static(BELIEF_SIGMA) + slot, positive(new, root(s), zero))
    add_row(rows, k, belief + wp.static(BELIEF_NIS), positive(new, innovation * innovation / right, zero))
    add_row(rows, k, belief + wp.static(BELIEF_COUNT), positive(new, ones(s), zero))


@wp.func
def set_row(rows: Any, k: int, row: int, value: Any):
    set_element(rows, k, row, 0, value)


@wp.func
def add_row(rows: Any, k: int, row: int, value: Any):
    set_element(rows, k, row, 0, element(rows, k, row, 0) + value)


def make_take(reports, gated):
    """(y, p, slot, b, hb, hv, ht, hw, difference, r, new): take one number that was measured into the error."""
    gate = make_gate(reports) if gated else None

    @wp.func
    def take(y: Any, p: Any, slot: int, b: int, hb: Any, hv: Any, ht: Any, hw: Any, difference: Any, r: Any, new: Any):
        if any_positive(new):
            P = p.memory + p.covariance
            x = p.memory + p.error
            g = p.memory + p.work
            innovation, seen = foreseen(y.memory, y.packet, P, x, g, p.size, b, hb, hv, ht, hw, difference)
            kept = new
            if wp.static(gated):
                kept, seen, share = gate(y, p, slot, innovation, seen, r, new)
            s = updated(y.memory, y.packet, P, x, g, p.size, innovation, seen, r, kept)
            right = s
            if wp.static(gated):
                right = share * s
            if wp.static(reports):
                note_innovation(y.memory, y.packet, p.belief, slot, innovation, s, right, kept)

    return take


def make_by_beams(take):
    """(y, z, p): the velocities along the beams of the log."""

    @wp.func
    def by_beams(y: Any, z: Any, p: Any):
        """u.(R^T v + w x arm): R u, u x R^T v and u x arm are its slopes."""
        none = p.arm - p.arm
        v = to_body(z, remembered3(y, p.memory + wp.static(VELOCITY)))
        rate_q = y.h.dtype(wp.static(OF_RATE)) / (y.period * y.period) * p.turned_q
        at_log = v + cross(remembered3(y, p.memory + wp.static(RATE)), p.arm)
        for i in range(4):
            u = beam(p.ahead, p.down, i)
            difference = remembered(y, p.dvl + i) - dot(u, at_log)
            new = remembered(y, p.dvl + 4 + i)
            swing = cross(u, p.arm)
            r = p.dvl_r + dot(rate_q, swing * swing)
            take(y, p, i, 0, none, to_inertial(z, u), cross(u, v), swing, difference, r, new)

    return by_beams


def make_by_position(take):
    """(y, z, p, ...): numbers of the position of a sensor's place."""

    @wp.func
    def by_number(y: Any, z: Any, p: Any, slot: int, i: int, lever: Any, read: Any, r: Any, new: Any):
        """e_i, and row i of R hat(lever); lever: from the sensor's place to the unit."""
        none = p.arm - p.arm
        place = remembered3(y, p.memory) - to_inertial(z, lever)
        turn = cross(direction(z, i), lever)
        take(y, p, slot, 0, axis(r, i), none, turn, none, read - number_of(place, i), r, new)

    return by_number


def make_by_delayed(take):
    """(y, z, p): as a fix is sent the position is copied with its covariances; as it arrives it corrects the copy.

    Stochastic cloning: Roumeliotis & Burdick 2002.
    """

    @wp.func
    def copied(y: Any, z: Any, p: Any, c: int, sent: Any):
        P = p.memory + p.covariance
        x = p.memory + p.error
        like = p.latency
        copy_block(y.memory, y.packet, P, p.size, 5 + c, 0, sent)
        # The copy is that of the sensor's place: less the lever's turn.
        some = positive(sent, ones(like), ones(like) - ones(like))
        a = some * cross(p.delayed_fix_lever, unit_x(like))
        b = some * cross(p.delayed_fix_lever, unit_y(like))
        d = some * cross(p.delayed_fix_lever, unit_z(like))
        a = to_inertial(z, a)
        b = to_inertial(z, b)
        d = to_inertial(z, d)
        add_block(y.memory, y.packet, P, p.size, 5 + c, 2, a, b, d)
        t = remembered3(y, x + 6)
        copy = remembered3(y, x) + t.x * a + t.y * b + t.z * d
        own = x + 15 + 3 * c
        remember3(y, own, positive(sent, copy, remembered3(y, own)))
        then = p.memory + wp.static(THEN) + 3 * c
        place = remembered3(y, p.memory) - to_inertial(z, p.delayed_fix_lever)
        remember3(y, then, positive(sent, place, remembered3(y, then)))
        fix = p.memory + wp.static(THEN) + 3 * (p.copies + c)
        remember3(y, fix, positive(sent, remembered3(y, p.delayed_fix), remembered3(y, fix)))

    @wp.func
    def by_delayed(y: Any, z: Any, p: Any):
        unity = ones(p.latency)
        half = unity.dtype(0.5) * unity
        left = remembered(y, p.delayed_fix + 3)
        none = p.arm - p.arm
        for c in range(p.copies):
            row = p.memory + wp.static(THEN) + 6 * p.copies + c
            waiting = remembered(y, row)
            free = positive(waiting + half, unity - unity, unity)
            sent = positive(left, free, unity - unity)
            if any_positive(sent):
                copied(y, z, p, c, sent)
            # The first free copy takes a fix.
            left = positive(sent, unity - unity, left)
            waiting = positive(sent, p.latency, waiting)
            new = positive(half - absolute(waiting), unity, unity - unity)
            then = p.memory + wp.static(THEN) + 3 * c
            difference = remembered3(y, then + 3 * p.copies) - remembered3(y, then)
            for i in range(3):
                take(
                    y, p, wp.static(DELAYED_FIX) + i, 5 + c, axis(half, i), none, none, none, number_of(difference, i),
                    number_of(p.delayed_fix_r, i), new,
                )  # fmt: skip
            still = positive(waiting + half, waiting - unity, waiting)
            remember(y, row, still)

    return by_delayed


def make_by_heading(take):
    """(y, z, p): the heading."""

    @wp.func
    def by_heading(y: Any, z: Any, p: Any):
        """Its slopes by the turns about the body's second and third axis."""
        none = p.arm - p.arm
        n = z.north
        e = z.east
        least = y.h.dtype(wp.static(LEVEL)) * ones(n.x)
        level = greatest(n.x * n.x + e.x * e.x, least)
        turn = vec3(level - level, (e.x * n.z - n.x * e.z) / level, (n.x * e.y - e.x * n.y) / level)
        round_turn = y.h.dtype(wp.static(TURN)) * ones(level)
        difference = remembered(y, p.heading) - heading(z)
        difference = difference - round_turn * rounded(difference / round_turn)
        # Where the bow is nearly vertical it has no heading.
        new = positive(level - least, remembered(y, p.heading + 1), least - least)
        take(y, p, wp.static(HEADING), 0, none, none, turn, none, difference, p.heading_r, new)

    return by_heading


@wp.func
def injected(y: Any, p: Any):
    """Put the error into the estimate, and turn its covariance with the attitude (section 6.3)."""
    at = p.memory
    x = at + p.error
    t = remembered3(y, x + 6)
    remember3(y, at, remembered3(y, at) + remembered3(y, x))
    for j in range(3):
        row = at + wp.static(VELOCITY) + j
        remember(y, row, remembered(y, row) + remembered(y, x + 3 + j))
        row_a = at + wp.static(BIAS_A) + j
        remember(y, row_a, remembered(y, row_a) + remembered(y, x + 9 + j))
        row_w = at + wp.static(BIAS_W) + j
        remember(y, row_w, remembered(y, row_w) + remembered(y, x + 12 + j))
        row_r = at + wp.static(RATE) + j
        remember(y, row_r, remembered(y, row_r) - remembered(y, x + 12 + j))
        row_m = at + wp.static(MEAN) + j
        remember(y, row_m, remembered(y, row_m) - remembered(y, x + 12 + j))
    for j in range(3 * p.copies):
        row_t = at + wp.static(THEN) + j
        remember(y, row_t, remembered(y, row_t) + remembered(y, x + 15 + j))
    z = orthonormal(turned(taken_attitude(y, at + wp.static(ATTITUDE)), t))
    put_attitude(z, at + wp.static(ATTITUDE))
    half = y.h.dtype(0.5)
    a = unit_x(t.x)
    b = unit_y(t.x)
    c = unit_z(t.x)
    a = a - half * cross(t, a)
    b = b - half * cross(t, b)
    c = c - half * cross(t, c)
    turn_block(y.memory, y.packet, at + p.covariance, p.size, 2, a, b, c)


@wp.func(inline=False)
def note_spread(rows: Any, k: int, p: Any):
    """Write the standard deviations of the estimate."""
    for i in range(p.count):
        at = p.memory + p.covariance + i * (i + 3) // 2
        set_row(rows, k, p.belief + i, root(element(rows, k, at, 0)))


@wp.func
def note_belief(y: Any, z: Any, p: Any):
    """Write sigmas, biases and NEES; y is the truth, z has the attitude that is estimated."""
    at = p.memory
    note_spread(y.memory, y.packet, p)
    a = remembered3(y, at + wp.static(BIAS_A))
    w = remembered3(y, at + wp.static(BIAS_W))
    remember3(y, p.belief + wp.static(BELIEF_BIAS), a)
    remember3(y, p.belief + wp.static(BELIEF_BIAS) + 3, w)
    e = at + p.error
    v = to_inertial(y, y.velocity + cross(y.angular_velocity, p.lever))
    remember3(y, e, y.position + to_inertial(y, p.lever) - remembered3(y, at))
    remember3(y, e + 3, v - remembered3(y, at + wp.static(VELOCITY)))
    remember3(y, e + 6, turn_to(z, y))
    remember3(y, e + 9, remembered3(y, p.imu + 6) - a)
    remember3(y, e + 12, remembered3(y, p.imu + 9) - w)
    P = at + p.covariance
    nees = squared_size(y.memory, y.packet, P, p.count, e, P + p.size * (p.size + 1) // 2)
    remember(y, p.belief + wp.static(BELIEF_NEES), nees)
    # Counted in the filter's memory, which a tick that measures for the notes alone puts back.
    tally = at + p.tally
    count_unconverged(y, tally, nees - y.h.dtype(wp.static(DIVERGED)) * ones(nees))
    remember(y, p.diverged, remembered(y, tally))
    remember(y, p.diverged + 1, remembered(y, tally + 1))


@wp.func
def note_spread_of_position(y: Any, p: Any):
    """Write the standard deviation of the position, and the time, for an event."""
    P = p.memory + p.covariance
    spread = remembered(y, P) + remembered(y, P + 2) + remembered(y, P + 5)
    remember(y, p.watched, root(spread))
    remember(y, p.watched + 1, y.t * ones(spread))


@functools.cache
def made(features):
    """The device code of a filter.

    features: the sensors that it has, "report" where it notes what it believes, "gate" where it rejects readings, and
    "watched" where an event looks at the standard deviation of its position.
    """
    has = {name: name in features for name in (*AIDS, "report", "gate", "watched")}
    take = make_take(has["report"], has["gate"])
    by_beams, by_number, by_delayed, by_heading = (
        make(take) for make in (make_by_beams, make_by_position, make_by_delayed, make_by_heading)
    )

    @wp.func
    def corrected(y: Any, z: Any, p: Any):
        """All that has been measured at this tick, one number after another."""
        zero = ones(p.dvl_r) - ones(p.dvl_r)
        for j in range(p.work - p.error):
            remember(y, p.memory + p.error + j, zero)
        if wp.static(has["report"]):
            for j in range(wp.static(BELIEF_NIS), wp.static(BELIEF)):
                remember(y, p.belief + j, zero)
        if wp.static(has["dvl"]):
            by_beams(y, z, p)
        if wp.static(has["fix"]):
            read = remembered3(y, p.fix)
            new = remembered(y, p.fix + 3)
            for i in range(3):
                r = number_of(p.fix_r, i)
                by_number(y, z, p, wp.static(FIX) + i, i, p.fix_lever, number_of(read, i), r, new)
        if wp.static(has["delayed_fix"]):
            by_delayed(y, z, p)
        if wp.static(has["depth"]):
            read_depth = remembered(y, p.depth)
            by_number(y, z, p, wp.static(DEPTH), 2, p.depth_lever, read_depth, p.depth_r, remembered(y, p.depth + 1))
        if wp.static(has["heading"]):
            by_heading(y, z, p)
        injected(y, p)
        # What a lane remembers must not tell whether another one had a reading.
        for j in range(p.work - p.error):
            remember(y, p.memory + p.work + j, zero)

    @wp.func
    def measure(y: Any, p: Any):
        """The estimate in place of the motion: position, attitude, velocity and angular velocity."""
        if y.step == y.start:
            started(y, p)
        else:
            propagated(y, p)
        corrected(y, taken_attitude(y, p.memory + wp.static(ATTITUDE)), p)
        z = taken_attitude(y, p.memory + wp.static(ATTITUDE))
        if wp.static(has["report"]):
            note_belief(y, z, p)
        if wp.static(has["watched"]):
            note_spread_of_position(y, p)
        rate = remembered3(y, p.memory + wp.static(RATE))
        z.position = remembered3(y, p.memory) - to_inertial(z, p.lever)
        z.velocity = to_body(z, remembered3(y, p.memory + wp.static(VELOCITY))) - cross(rate, p.lever)
        z.angular_velocity = rate
        return z

    return device(__name__, features, params=functools.partial(make_struct, has["gate"]), measure=measure)
