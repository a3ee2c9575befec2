# SPDX-License-Identifier: Apache-2.0
"""A sensor: what is measured in place of the truth. What no member's sensor has is no code."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device, tide
from lgvi_kernels.lanes.noise import noise_key
from lgvi_kernels.law import *
from lgvi_kernels.laws.control.readings import make_reading, remember3, remembered3
from lgvi_kernels.swell import head, head_finite

# Features that draw random numbers, and those by which a reading is not that of its own tick.
DRAWING = ("noise", "drift", "dropout", "outlier")
KEEPING = ("every", "latency", "dropout", "deepest")
# Those by which a depth is read by the pressure: of still water, of waves in deep water and in water with a floor.
PRESSURE = {"still": None, "waves": head, "finite": head_finite}


# Not inlined, for the sake of the compiler: a scene may have many sensors.
@wp.func(inline=False)
def drawn(like: Any, key: Any, tick: int, stream: int):
    """Four standard normals of a tick, side by side."""
    return normals(like, key.member, tick, key.channel + stream, key.seed0, key.seed1)


@wp.func
def is_due(tick: int, every: Any):
    """1 at each `every`-th tick, else 0."""
    unity = ones(every)
    half = every.dtype(0.5) * unity
    now = every.dtype(tick) * unity
    rest = now - every * below((now + half) / every)
    return positive(half - rest, unity, unity - unity)


@wp.func
def on_grid(v: Any, q: Any):
    """v rounded to whole numbers of quanta; as it is where a quantum is 0."""
    unity = ones(v.x)
    size = vec3(positive(q.x, q.x, unity), positive(q.y, q.y, unity), positive(q.z, q.z, unity))
    return vec3(
        positive(q.x, size.x * rounded(v.x / size.x), v.x),
        positive(q.y, size.y * rounded(v.y / size.y), v.y),
        positive(q.z, size.z * rounded(v.z / size.z), v.z),
    )


@wp.func
def lost_in_bursts(y: Any, p: Any, z: Any, row: int):
    """A chain of two states (Gilbert 1960, a row of the memory): `stays` lost, or `begins` to be; at first by its share."""
    unity = ones(z)
    zero = unity - unity
    level = positive(remembered(y, row), p.stays, p.begins)
    if y.step == y.start:
        level = p.dropout
    lost = level - z
    remember(y, row, positive(lost, unity, zero))
    return lost


@wp.func
def strayed(chance: Any, z: Any, size: Any):
    """`size` where a standard normal is below that of the chance, else 0: an outlier."""
    zero = z - z
    far = chance - z
    return vec3(positive(far, size.x, zero), positive(far, size.y, zero), positive(far, size.z, zero))


def make_kept(reading, rare, late, before):
    """(y, p, lost) -> y with the reading that has arrived by now; before: rows of the memory before those that it keeps."""
    rows, put, taken = reading.rows, reading.put, reading.taken

    @wp.func
    def kept(y: Any, p: Any, lost: Any):
        """The reading that has arrived by now; `lost` is positive where that of this tick never will."""
        at = p.memory + wp.static(before)
        unity = ones(y.position.x)
        half = y.h.dtype(0.5) * unity
        age = at
        fresh = at + 1
        kept_sets = fresh + wp.static(rows)
        put(y, fresh)
        hold = lost
        if wp.static(rare):
            ticks = remembered(y, age)
            waiting = p.every - half - unity - ticks
            hold = positive(waiting, unity, hold)
            remember(y, age, positive(waiting, ticks + unity, unity - unity))
        first = y.step == y.start
        if first:
            hold = unity - unity
            if wp.static(rare):
                remember(y, age, unity - unity)
        for j in range(wp.static(rows)):
            value = positive(hold, remembered(y, kept_sets + j), remembered(y, fresh + j))
            arrived = value
            for s in range(p.sets):
                # Members may keep more readings than they need: none depends on how many there are.
                older = remembered(y, kept_sets + s * wp.static(rows) + j)
                if first:
                    # What has not arrived at the start is the first reading.
                    older = value
                remember(y, kept_sets + s * wp.static(rows) + j, value)
                if wp.static(late):
                    arrived = positive(half - absolute(y.h.dtype(s) * unity - p.latency), value, arrived)
                value = older
            remember(y, fresh + j, arrived)
        return taken(y, fresh)

    return kept


def make_given(count, noisy, drifting, lossy, bursting, wild):
    """(y, p, e) -> e with walk and noise, and whether the reading is lost, by the normals that the call gives."""
    # Functions that this sensor needs alone; a kernel without given draws has none of them.
    from lgvi_kernels.lanes.given_draws import first_of_tick, scalar_of_tick, vector_of_tick

    drawn_noise = first_of_tick if count == 1 else vector_of_tick

    @wp.func
    def given(y: Any, p: Any, e: Any):
        """As a tick that draws."""
        lost = ones(y.position.x) - ones(y.position.x)
        if wp.static(noisy):
            e = e + p.noise * drawn_noise(y, p.key.row + p.key.noise)
        if wp.static(lossy):
            chance = scalar_of_tick(y, p.key.row + p.key.dropout)
            if wp.static(bursting):
                lost = lost_in_bursts(y, p, chance, p.memory + wp.static(count * drifting))
            else:
                lost = p.dropout - chance
        if wp.static(wild):
            size = p.outlier_std * drawn_noise(y, p.key.row + p.key.outlier_std)
            e = e + strayed(p.outlier, scalar_of_tick(y, p.key.row + p.key.outlier), size)
        if wp.static(drifting):
            spread = root(y.period * ones(y.position.x))
            if wp.static(count == 1):
                walk = remembered(y, p.memory)
                e.x = e.x + walk
                remember(y, p.memory, walk + spread * p.drift.x * scalar_of_tick(y, p.key.row + p.key.drift))
            else:
                walks = remembered3(y, p.memory)
                e = e + walks
                remember3(y, p.memory, walks + spread * (p.drift * vector_of_tick(y, p.key.row + p.key.drift)))
        return e, lost

    return given


@functools.cache
def made(features):
    """The device code of a sensor.

    features: what it reads (see readings.py), its numbers that are not idle, and "given" where the call gives its normals.
    """
    of, *others = features
    handed, deep, placed = (name in others for name in ("handed", "deepest", "place"))
    tidal = "tide" in others
    by_pressure = [name for name in others if name in PRESSURE]
    in_waves = by_pressure not in ([], ["still"])
    head_of = PRESSURE[by_pressure[0]] if in_waves else head
    reading = make_reading(of)
    count, values, with_values, shifted = reading.count, reading.values, reading.with_values, reading.shifted
    biased, noisy, drifting, quantised, rare, late, lossy, bursting, wild = (
        name in others
        for name in ("bias", "noise", "drift", "quantum", "every", "latency", "dropout", "burst", "outlier")
    )
    listed = "given" in others and any(name in others for name in DRAWING)
    draws = not listed and any(name in others for name in DRAWING)
    keeps = any(name in others for name in KEEPING) and not handed
    kept = make_kept(reading, rare, late, count * drifting + bursting)
    given = make_given(count, noisy, drifting, lossy, bursting, wild) if listed else kept

    def fields(width, real):
        """Of Params: the numbers by member; key of the random numbers; first of its rows of the memory; readings it keeps.

        Its rows: the walk; whether it is lost, in bursts; how many ticks the last reading is old; that of this tick; `sets`
        readings, the latest first.
        """
        Lane, Lane3 = lane(width, real), lane3(width, real)
        vectors = {name: Lane3 for name in others if name in ("bias", "noise", "drift", "quantum", "outlier_std")}
        lanes = {name: Lane for name in others if name in (*KEEPING, "outlier")}
        lanes |= {"begins": Lane, "stays": Lane} if bursting else {}
        key = {"key": noise_key(width)} if draws else {}
        if listed:
            from lgvi_kernels.lanes.given_draws import given_ticks

            key = {"key": given_ticks()}
        words = {"memory": wp.int32, "sets": wp.int32} | ({"handed": wp.int32} if handed else {})
        vectors |= {"place": Lane3} if placed else {}
        words |= {"first": wp.int32, "waves": wp.int32} if in_waves else {}
        words |= dict.fromkeys(("first", *tide.FIELDS), wp.int32) if tidal else {}
        return vectors | lanes | key | words

    def params(width, real):
        return struct("Sensor", **fields(width, real))

    @wp.func
    def hand_on(y: Any, p: Any, lost: Any):
        """Write the reading for an estimator, and 1 where it is new."""
        unity = ones(y.position.x)
        fresh = unity
        if wp.static(rare):
            fresh = is_due(y.tick, p.every)
        v = values(y)
        if wp.static(count == 1):
            remember(y, p.handed, v.x)
        else:
            remember3(y, p.handed, v)
        remember(y, p.handed + wp.static(count), positive(lost, unity - unity, fresh))

    @wp.func
    def measure(y: Any, p: Any):
        """The truth, plus bias, walk and noise, rounded to the quantum; then what has arrived of it."""
        unity = ones(y.position.x)
        zero = unity - unity
        if wp.static(handed):
            before = y
        at = y.b
        if wp.static(placed):
            arm = to_inertial(y, p.place)
            at = at + arm
            if wp.static(count == 1):
                arm = vec3(zero, zero, arm.z)
            y.position = y.position + arm
        if wp.static(len(by_pressure) > 0):
            depth = y.position.z
            if wp.static(tidal):
                height = tide.rise(y, p)
                depth = depth + height
                at = vec3(at.x, at.y, at.z + height)
            if wp.static(in_waves):
                depth = depth + head_of(y, p.first, p.waves, at)
            y.position = vec3(y.position.x, y.position.y, greatest(depth, zero))
        e = vec3(zero, zero, zero)
        lost = zero
        if wp.static(biased):
            e = e + p.bias
        if wp.static(draws):
            four = drawn(unity, p.key, y.tick, 0)
            if wp.static(noisy):
                e = e + p.noise * vec3(quarter(four, 0), quarter(four, 1), quarter(four, 2))
            if wp.static(bursting):
                lost = lost_in_bursts(y, p, quarter(four, 3), p.memory + wp.static(count * drifting))
            elif wp.static(lossy):
                lost = p.dropout - quarter(four, 3)
            if wp.static(wild):
                stray = drawn(unity, p.key, y.tick, 2)
                size = p.outlier_std * vec3(quarter(stray, 0), quarter(stray, 1), quarter(stray, 2))
                e = e + strayed(p.outlier, quarter(stray, 3), size)
            if wp.static(drifting):
                spread = root(y.period * unity)
                if wp.static(count == 1):
                    walk = remembered(y, p.memory)
                    e.x = e.x + walk
                    remember(y, p.memory, walk + spread * p.drift.x * quarter(four, 1))
                else:
                    walks = remembered3(y, p.memory)
                    e = e + walks
                    more = drawn(unity, p.key, y.tick, 1)
                    steps = vec3(quarter(more, 0), quarter(more, 1), quarter(more, 2))
                    remember3(y, p.memory, walks + spread * (p.drift * steps))
        if wp.static(listed):
            e, lost = given(y, p, e)
        if wp.static(deep):
            lost = positive(y.position.z - p.deepest, unity, lost)
        if wp.static(biased or noisy or drifting or wild):
            y = shifted(y, e)
        if wp.static(quantised):
            y = with_values(y, on_grid(values(y), p.quantum))
        if wp.static(keeps):
            y = kept(y, p, lost)
        if wp.static(handed):
            hand_on(y, p, lost)
            y = before
        return y

    return device(__name__, features, params=params, fields=fields, measure=measure)
