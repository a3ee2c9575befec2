# SPDX-License-Identifier: Apache-2.0
"""Outcomes of a run's members in words: one sentence for each status that occurs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from lgvi_warp.common.status import Status, Warnings, failed, stop_time, stopped
from lgvi_warp.common.summaries import counted, plural
from lgvi_warp.methods.limits import too_large
from lgvi_warp.methods.method import Method

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result


def outcomes(result: Result) -> list[Status]:
    """List the statuses that occur among the members of a result.

    Args:
        result: Result of a run.

    Returns:
        The statuses in order of their codes: OK first.
    """
    return [Status(int(code)) for code in np.unique(np.asarray(result.status))]


# Ways to end of one member, and of several.
ENDS = {"ends ok": "end ok", "is stopped by an event": "are stopped by an event", "fails": "fail"}


def answer_of(result: Result) -> str:
    """Write one sentence on the outcomes of a run's members."""
    status, run = np.asarray(result.status), result.provenance
    end = run.get("start", {}).get("time", 0.0) + run["step"] * run["steps"]
    texts = []
    for (one, several), members in zip(
        ENDS.items(), (status == Status.OK, stopped(status), failed(status)), strict=True
    ):
        if count := int(members.sum()):
            names = counted(result.status[members].counts())
            first = f"({names}), the first at {stop_time(result)[members].min():.4g} s"
            when = f"at {end:.6g} s" if status[members][0] == Status.OK else first
            texts.append(f"{count:,} {one if count == 1 else several} {when}")
    if len(texts) != 1:
        return f"Of {plural(len(status), 'member')} {'; '.join(texts) or 'none ran'}."
    return f"{'The member' if len(status) == 1 else f'All {len(status):,} members'} {texts[0].partition(' ')[2]}."


def outcome_text(result: Result, code: Status) -> str:
    """Describe one status: how many members have it, which of them had it first, and what it means."""
    members = np.flatnonzero(np.asarray(result.status) == code)
    many = f"{code.name.lower()}, {len(members):,} of {result.members:,} members"
    if code == Status.OK:
        return f"{many}: {code.text}"
    first = int(members[stop_time(result)[members].argmin()])
    value = "" if code.stopped else f", value {result.failure_value[first]:.4g}"
    text = too_large(Method(result.provenance["method"]["name"])) if code == Status.STEP_TOO_LARGE else code.text
    return f"{many} (first: member {first} at {stop_time(result)[first]:g} s{value}): {text}"


def above_surface(warnings: np.ndarray, value: np.ndarray) -> tuple[str, ...]:
    """Count the members that rose above the surface without a term or an event for it.

    warnings: Bits of `Warnings` of each member, (n,).
    value: Value of the most serious warning, (n,).
    """
    bits = np.asarray(warnings)
    high = np.flatnonzero(bits & np.uint16(Warnings.ABOVE_SURFACE)) if bits.any() else bits[:0]
    if not len(high):
        return ()
    some = f"{RISEN}{len(high):,} of {len(bits):,} members rise above the surface, where no water is"
    known = high[bits[high] < 2 * int(Warnings.ABOVE_SURFACE)]
    if not len(known):
        return (f"{some}; {STOP}",)
    height = np.asarray(value)[known]
    most = f"the highest, member {known[int(height.argmax())]}, by {height.max():.4g} m"
    return (f"{some} ({most}); {STOP}",)


RISEN = "position: "
STOP = "stop members there by the event lw.events.Surface(), or let them float by lw.terms.SurfaceBuoyancy(...)"


def begun_beyond(status: np.ndarray, failure_time: np.ndarray) -> tuple[str, ...]:
    """Report members that an event stopped before their first step.

    status: Status of each member, (n,).
    failure_time: Time at which each member was stopped or failed [s], (n,).
    """
    begun = stopped(status) & (np.asarray(failure_time) == 0.0)
    if not begun.any():
        return ()
    codes, numbers = np.unique(np.asarray(status)[begun], return_counts=True)
    by = ", ".join(f"{Status(int(code)).name.lower()} {number:,}" for code, number in zip(codes, numbers, strict=True))
    some = f"{int(begun.sum()):,} of {len(status):,} members begin at or beyond an event ({by}; the first: member "
    return (
        f"{some}{int(begun.argmax())}) and count as stopped at t = 0. Start them before it, or leave the event out",
    )


def remarks_on(fields: Mapping[str, np.ndarray]) -> tuple[str, ...]:
    """List the messages that follow from the records of members: arrays (n,) by name."""
    bits, time, value = (fields[name] for name in ("warnings", "warning_time", "warning_value"))
    begun = begun_beyond(fields["status"], fields["failure_time"])
    kinds = (Warnings.CONTROL_NOT_CONVERGED, Warnings.FILTER_DIVERGED)
    counted = [text for kind in kinds for text in ticks_with(bits, time, value, kind)]
    return (*above_surface(bits, value), *begun, *counted)


def ticks_with(warnings: np.ndarray, time: np.ndarray, value: np.ndarray, kind: Warnings) -> tuple[str, ...]:
    """Report members with a warning from their ticks, such as iterations that did not converge.

    warnings, time, value: Warning bits of each member, time and value at the first of the most serious warning, (n,).
    """
    bits, bit = np.asarray(warnings), int(kind)
    count = int(np.count_nonzero(bits & bit))
    if not count:
        return ()
    # Time and value are those of the most serious warning.
    of, times = np.flatnonzero((bits & bit > 0) & (bits < 2 * bit)), ""
    if len(of):
        first = int(of[np.asarray(time)[of].argmin()])
        times = f" ({int(np.asarray(value)[of].max()):,} times at most, first in member {first} at {time[first]:g} s)"
    return (f"{count:,} of {len(bits):,} members{times}: {kind.text}",)


def failure_text(result: Result) -> str:
    """Describe each kind of failure in one line with a remedy."""
    failures = [code for code in outcomes(result) if code != Status.OK and not code.stopped]
    return "\n".join(outcome_text(result, code) for code in failures)
