# SPDX-License-Identifier: Apache-2.0
"""Numbers that pictures draw: a quantity of the members under way at each time, read in pieces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import result_of, whole_number
from lgvi_warp.common.errors import NothingToDraw, refusal
from lgvi_warp.common.status import under_way
from lgvi_warp.physics import energy as invariants
from lgvi_warp.results.quantities import EndQuantity, OfResult, samples_of
from lgvi_warp.statistics.values.functional import quantity
from lgvi_warp.statistics.values.quantity import Quantity
from lgvi_warp.views.choice import AT_ONCE, Shown, few, select_members
from lgvi_warp.views.drawn import about
from lgvi_warp.views.plots.words import DEPTHS, events, is_depth

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result
    from lgvi_warp.statistics.estimates.estimate import Estimate

# Angles that go around: they are drawn about their mean direction.
CIRCULAR = ("euler[0]", "euler[2]")


@dataclass(frozen=True, eq=False)
class ValuesUnderWay:
    """One number of the members under way at each time drawn [s].

    values: Numbers of the members that quantiles are taken of, shape (f, q); counted: which of them count.
    low, high: Smallest and largest number of all members, shape (f,); NaN where none counts.
    under_way: Number of members under way, shape (f,).
    last: The last number of every member, shape (n,).
    above: Number of members that are above the surface at some time; 0 for other quantities than depth.
    """

    of: Quantity
    time: np.ndarray
    values: np.ndarray
    counted: np.ndarray
    low: np.ndarray
    high: np.ndarray
    under_way: np.ndarray
    last: np.ndarray
    above: int
    total: int

    @property
    def ranked(self) -> int:
        """Number of members that quantiles are taken of."""
        return self.values.shape[1]


def with_samples(result: Result) -> Result:
    """Give the result whose samples are drawn."""
    if result_of(result).samples:
        return result
    if result.kept is not None:
        return result.kept
    raise NothingToDraw(
        'no samples were kept: there is nothing to draw. Give keep="all", or indices of members to keep, '
        "or draw what the statistics tell: lw.plots.statistics, lw.plots.outcomes"
    )


def selected(result: Result, most: int, fields: tuple[str, ...], picture: str) -> tuple[Result, Shown, Result]:
    """Choose the members that a picture draws: the result that has samples, the choice, and what it has of them, in memory."""
    result = with_samples(result)
    check_fields(result, fields, picture)
    choice = select_members(result, whole_number("most", most, 1))
    return result, choice, few(result, choice.members, fields, choice.frames)


def check_fields(result: Result, fields: tuple[str, ...], picture: str) -> None:
    """Refuse to draw what was not kept."""
    if missing := [name for name in fields if name not in result.samples]:
        raise NothingToDraw(
            f"{', '.join(missing)} not kept: {picture} needs {'them' if len(missing) > 1 else 'it'}; "
            "name all in SaveAt(fields=...)"
        )


def quantity_of(of: Any) -> Quantity:
    """Read a quantity that has one number a member and time."""
    meaning = quantity("of", of)
    if meaning.size > 1:
        raise refusal("of", of, f"has {meaning.size} components", f"name one: {', '.join(meaning.labels)}")
    return meaning


def energy_of(result: Result) -> Quantity:
    """Energy [J], as the quantity "energy error", E(t) - E(0), where the scene's laws conserve it."""
    energy = quantity("of", "energy")
    if "energy" not in invariants.conserved(result):
        return energy

    def error(samples: Any, members: Any) -> np.ndarray:
        values = np.asarray(energy.function(samples, members))
        return values - values[:1]

    return Quantity("energy error", error, energy.unit, energy.fields)


def unbounded_text(result: Result, survey: ValuesUnderWay) -> str:
    """Say how many members leave water that has no surface."""
    if not survey.above or any(event["type"] == "surface" for event in events(result)):
        return ""
    who = "the vehicle passes" if survey.total == 1 else f"{survey.above:,} of {survey.total:,} members pass"
    return f"unbounded water: {who} above depth 0"


def survey_of(result: Result, of: Quantity, at_once: int = AT_ONCE) -> ValuesUnderWay:
    """Read one number of all members, in pieces: a large run never lies in memory whole."""
    check_fields(result, of.fields, of.name)
    choice = select_members(result) if "position" in result.samples else everyone(result)
    frames = choice.frames
    going = under_way(result)[frames]
    direction = _direction(result, of, choice, going)
    # The frame at which each member was under way for the last time.
    ended = np.maximum(going.sum(axis=0) - 1, 0)
    low, high = (np.full(len(frames), np.nan) for _ in range(2))
    last, rows, counts, above = np.empty(result.members), [], [], 0
    # Energy reads 18 numbers of a member, and makes as many more.
    step = max(1, at_once // len(frames) // (10 if len(of.fields) > 2 else 1))
    for first in range(0, result.members, step):
        members = slice(first, min(first + step, result.members))
        values = values_of(result, of, members, frames)
        last[members] = values[-1]
        if direction is not None:
            last[members] = about(values[-1], direction[ended[members], 0], 2.0 * np.pi)
            values = about(values, direction, 2.0 * np.pi)
        counted = going[:, members] & np.isfinite(values)
        masked = np.where(counted, values, np.nan)
        low, high = np.fmin(low, np.fmin.reduce(masked, axis=1)), np.fmax(high, np.fmax.reduce(masked, axis=1))
        above += int((masked < 0.0).any(axis=0).sum()) if is_depth(of) else 0
        ranked = choice.ranked_of(members)
        rows.append(values[:, ranked])
        counts.append(counted[:, ranked])
    if not np.isfinite(low).any():
        raise NothingToDraw(f"no member has a finite {of.name}: there is nothing to draw. See result.status")
    values, counted = np.concatenate(rows, axis=1), np.concatenate(counts, axis=1)
    sums = going.sum(axis=1)
    return ValuesUnderWay(of, result.time[frames], values, counted, low, high, sums, last, above, result.members)


def everyone(result: Result) -> Shown:
    """All members at all times, where no positions were kept by which some could be chosen."""
    members = np.arange(result.members)
    return Shown(members, np.arange(len(result.time)), members, result.members)


def values_of(
    result: Result, of: Quantity, members: slice | np.ndarray, frames: np.ndarray | None = None
) -> np.ndarray:
    """Compute a quantity of some members at these times, by default at all: float64, shape (f, m)."""
    part = few(result, members, of.fields, frames)
    with np.errstate(invalid="ignore"):
        return of(*samples_of(part))[:, 0].astype(np.float64)


def _direction(result: Result, of: Quantity, choice: Shown, going: np.ndarray) -> np.ndarray | None:
    """Mean direction of an angle at each time [rad], shape (f, 1), continuous in time; None for other quantities.

    It is of the members drawn; of the one that goes on longest where these have ended; where all have, the last one stays.
    """
    if of.name not in CIRCULAR:
        return None
    arm = np.zeros(len(choice.frames), complex)
    for members in (choice.members, going.sum(axis=0).argmax(keepdims=True)):
        angle = values_of(result, of, members, choice.frames)
        counted = going[:, members] & np.isfinite(angle)
        sums = np.where(counted, np.exp(1j * np.where(counted, angle, 0.0)), 0.0).sum(axis=1)
        arm = np.where(arm == 0.0, sums, arm)
    known = np.maximum.accumulate(np.where(arm != 0.0, np.arange(len(arm)), 0))
    return np.unwrap(np.angle(arm[known]))[:, None]


def at_one_time(
    result: Result, of: OfResult, members: np.ndarray, frame: int = -1
) -> tuple[np.ndarray, list[str], str]:
    """Compute a quantity of interest of m members at one time: numbers (m, c), names of the c components, and the unit."""
    check_fields(result, of.fields, of.label)
    frame = frame % len(result.time)
    all_so_far = of.over_path or of.is_function or isinstance(of, EndQuantity)
    frames = np.arange(frame + 1) if all_so_far else np.array([frame])
    values = of.values(few(result, members, of.fields, frames))
    return values, of.labels(values.shape[1]), of.unit


def estimate_for(result: Result, of: str, types: tuple[str, ...]) -> tuple[Estimate, int] | None:
    """Find a statistic of a quantity, and the index of its component; None where there is none."""
    names = DEPTHS if of in DEPTHS else (of,)
    for kind in types:
        for estimate in result.statistics.values():
            labels = [str(label) for label in estimate.coordinates.get("component", ())]
            for name in names:
                if estimate.settings["type"] == kind and len(estimate.time) > 1 and name in labels:
                    return estimate, labels.index(name)
    return None
