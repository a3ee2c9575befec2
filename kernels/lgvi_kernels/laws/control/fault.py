# SPDX-License-Identifier: Apache-2.0
"""A fault of an actuator or of a sensor: for some time its command or its reading is another one."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *
from lgvi_kernels.laws.control.low_pass import TURN
from lgvi_kernels.laws.control.readings import COUNTS, make_reading, remember3, remembered3


@functools.cache
def made(features):
    """The device code of a fault.

    features: what it changes: "command", "delayed" (commands that act with a delay), "rows" (numbers in rows of the bus), or
    the name of a reading (see readings.py). Then what some member's fault has: "until", "duty"; "held" (a number that is kept
    or follows slowly), "placed" (where the actuator is), "late"; "angle" where differences are within half a turn; of sensors
    of an estimator "flagged" (readings are new at some ticks) and "lost".
    """
    of = features[0]
    names = ("until", "duty", "held", "placed", "late", "angle", "flagged", "lost")
    ends, comes_and_goes, held, placed, late, angle, flagged, lost = (name in features for name in names)
    delayed, reads = of == "delayed", of in COUNTS
    count = COUNTS.get(of, 1)
    reading = make_reading(of) if reads else None
    values, with_values = (reading.values, reading.with_values) if reads else (None, None)
    keeps = flagged and (held or late)

    def params(width, real):
        """Params: numbers by member, times in ticks; first row that it changes, of how many; rows of what it keeps.

        acting, before: first rows of delayed commands, as of Delay; flag, flags: first row that says whether a reading is new,
        and from one channel's to the next; place_row: of where the actuator is; sets: numbers that a late one waits for.
        """
        lanes = ["begin", "gain", "offset"] + ["end"] * ends + ["cycle", "on"] * comes_and_goes
        lanes += ["holds", "share"] * held + ["stuck"] * placed + ["late", "ticks"] * late + ["loses"] * lost
        words = ["row", "count", "acting", "before", "memory", "work", "channel", "flag", "flags", "sets"]
        words += ["place_row"] * placed
        each = dict.fromkeys(lanes, lane(width, real)) | dict.fromkeys(words, wp.int32)
        return struct(f"Fault_{'_'.join(features)}", **each)

    @wp.func
    def acts(y: Any, p: Any, tick: int):
        """Above 0 where the fault acts at a tick."""
        unity = ones(p.begin)
        zero = unity - unity
        half = y.h.dtype(0.5) * unity
        age = y.h.dtype(tick) * unity - p.begin
        now = age + half
        if wp.static(ends):
            now = positive(p.end - half - y.h.dtype(tick) * unity, now, zero)
        if wp.static(comes_and_goes):
            phase = age - p.cycle * below((age + half) / p.cycle)
            now = positive(p.on - half - phase, now, zero)
        return now

    @wp.func
    def hit(y: Any, p: Any, row: int, i: int, now: Any, onset: Any):
        """Change number i, in the row of that number.

        docs/theory/control_loop.md, (C5).
        """
        unity = ones(p.begin)
        zero = unity - unity
        half = y.h.dtype(0.5) * unity
        first = y.step == y.start
        at = p.memory + i * (wp.static(int(keeps) + int(held)) + p.sets)
        seen = remembered(y, row)
        x = seen
        old = seen
        if wp.static(delayed):
            x = remembered(y, p.acting + i)
            old = remembered(y, p.before + i)
        before = old
        current = x
        if wp.static(keeps):
            # A reading that is not new stands for the last one that was.
            x = positive(remembered(y, p.flag + i * p.flags), x, remembered(y, at))
            if first:
                x = seen
            remember(y, at, x)
            at += 1
        out = p.gain * x + p.offset
        old = p.gain * old + p.offset
        sent = p.gain * seen + p.offset
        if wp.static(held):
            last = remembered(y, at)
            if first:
                last = x
            e = x - last
            if wp.static(angle):
                turn = y.h.dtype(wp.static(TURN)) * unity
                e = e - turn * rounded(e / turn)
            kept = positive(p.share, last + p.share * e, last)
            if wp.static(placed):
                kept = positive(p.stuck, positive(onset, remembered(y, p.place_row + i), last), kept)
            kept = positive(now, kept, x)
            remember(y, at, kept)
            out = positive(p.holds, kept, out)
            old = positive(p.holds, positive(p.share, last, kept), old)
            sent = positive(p.holds, kept, sent)
            at += 1
        if wp.static(late):
            value = x
            arrived = x
            earlier = x
            for s in range(p.sets):
                # Without the fault all are the last one: what comes after its onset has to wait.
                older = remembered(y, at + s)
                if first:
                    older = x
                here = half - absolute(y.h.dtype(s) * unity - p.ticks)
                earlier = positive(here, older, earlier)
                arrived = positive(here, value, arrived)
                remember(y, at + s, positive(now, value, x))
                value = older
            out = positive(p.late, arrived, out)
            old = positive(p.late, earlier, old)
            sent = positive(p.late, arrived, sent)
        if wp.static(delayed):
            remember(y, row, positive(now, sent, seen))
            remember(y, p.acting + i, positive(now, out, current))
            remember(y, p.before + i, positive(now, old, before))
        else:
            remember(y, row, positive(now, out, seen))
        if wp.static(lost):
            flag = remembered(y, p.flag + i * p.flags)
            remember(y, p.flag + i * p.flags, positive(now, positive(p.loses, zero, flag), flag))

    @wp.func
    def change(y: Any, p: Any, row: int):
        """Change the numbers from a row on; above 0 where the fault acts."""
        now = acts(y, p, y.tick)
        onset = now
        if wp.static(placed):
            if y.step != y.start:
                onset = positive(acts(y, p, y.tick - 1), now - now, now)
        for i in range(p.count):
            hit(y, p, row + i, i, now, onset)
        return now

    @wp.func
    def in_rows(y: Any, p: Any):
        """Change commands, or numbers that a sensor has written."""
        change(y, p, p.row)
        return y

    @wp.func
    def in_reading(y: Any, p: Any):
        """Change numbers of the reading."""
        v = values(y)
        if wp.static(count == 1):
            remember(y, p.work, v.x)
        else:
            remember3(y, p.work, v)
        now = change(y, p, p.work + p.channel)
        if wp.static(count == 1):
            v.x = remembered(y, p.work)
        else:
            v = remembered3(y, p.work)
        if wp.static(of == "attitude"):
            # Angles there and back are not the same bits: lanes without the fault keep theirs.
            z = with_values(y, v)
            y.north = positive(now, z.north, y.north)
            y.east = positive(now, z.east, y.east)
            y.down = positive(now, z.down, y.down)
        else:
            y = with_values(y, v)
        return y

    role = {"send": in_rows} if of in ("command", "delayed") else {"measure": in_reading if reads else in_rows}
    return device(__name__, features, params=params, **role)
