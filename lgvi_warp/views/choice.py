# SPDX-License-Identifier: Apache-2.0
"""Choice of the members and times that pictures and recordings show, and of the members of their quantiles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import result_of
from lgvi_warp.common.errors import NothingToDraw, refusal
from lgvi_warp.common.real_numbers import is_whole
from lgvi_warp.common.status import Status, under_way
from lgvi_warp.results import member_fields
from lgvi_warp.results.outcomes import outcomes

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result

# More bodies than this cannot be told apart in a window, and cost time and file size.
MOST_BODIES = 1000
# Most times that are drawn.
MOST_FRAMES = 240
# Most members that quantiles are taken of: their error is then below 0.4 % of the members.
MOST_RANKED = 20_000
# Most states of members that are read at once, at all times together.
AT_ONCE = 2_000_000


@dataclass(frozen=True, eq=False)
class Shown:
    """Selection of a run for a picture or a recording.

    Attributes:
        members: Increasing indices of the drawn members, shape (m,).
        frames: Increasing indices of the drawn samples, shape (f,), including the first and the last.
        ranked: Increasing indices of the members from which quantiles are computed, shape (q,).
        total: Number of members of the result.
    """

    members: np.ndarray
    frames: np.ndarray
    ranked: np.ndarray
    total: int

    @property
    def text(self) -> str:
        """Number of drawn members and of all members, as "1,000 of 100,000 members"."""
        return of_members(len(self.members), self.total)

    def ranked_of(self, members: slice) -> np.ndarray:
        """Positions, in a slice of members, of those from which quantiles are computed."""
        return self.ranked[(self.ranked >= members.start) & (self.ranked < members.stop)] - members.start


def of_members(count: int, total: int) -> str:
    """Write a number of members out of all, as "1,000 of 100,000 members"."""
    if count < total:
        return f"{count:,} of {total:,} members"
    return f"{total:,} member{'s' * (total != 1)}"


def select_members(result: Result, most: int = MOST_BODIES) -> Shown:
    """Choose the members that pictures and recordings show when they draw only some.

    The members that reach farthest along each axis come first. Up to a third of the choice are members that did not end
    "ok", divided evenly between the outcomes. The other members are chosen by a hash of their index. This choice is
    representative for grids, tables, Sobol points and random draws, and always the same for the same run. At most 240
    evenly spaced times are shown. Quantiles are computed from at most 20,000 members, chosen by the same hash.

    Args:
        result: A result with positions, in memory or in a store.
        most: Largest number of members to draw.

    Returns:
        The indices of the chosen members, of the times, and of the members for quantiles.

    Raises:
        NothingToDraw: No samples were kept, or no member has a finite start.
        SceneError: `most` is not a whole number of at least 1, or `result` is not a result.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, save=lw.SaveAt(every=1.0))
        >>> lw.select_members(result, most=3).members.tolist()
        [0, 1, 3]
    """
    result_of(result)
    if not is_whole(most, 1):
        raise refusal("most", most, "draws no member", "give a number from 1")
    if "position" not in result.samples:
        raise NothingToDraw(
            'no positions were kept: there is nothing to draw. Give keep="all", or indices of members to keep'
        )
    frames = frames_of(result.time)
    finite, farthest = _survey(result, frames)
    if not finite.any():
        raise NothingToDraw("no member has a finite start: there is nothing to draw. See result.status")
    rank = np.argsort(mixed(np.arange(result.members)), kind="stable")
    rank = rank[finite[rank]]
    first = list(dict.fromkeys([*farthest, *_ended(result, rank, most // 3), *rank.tolist()]))
    return Shown(np.sort(first[:most]), frames, np.sort(rank[:MOST_RANKED]), result.members)


def frames_of(time: np.ndarray, most: int = MOST_FRAMES) -> np.ndarray:
    """Choose samples at evenly spaced times from increasing times (k,) [s]."""
    if len(time) <= most:
        return np.arange(len(time))
    wanted = np.linspace(time[0], time[-1], most)
    after = np.clip(np.searchsorted(time, wanted), 1, len(time) - 1)
    nearer = wanted - time[after - 1] < time[after] - wanted
    return np.unique(np.where(nearer, after - 1, after))


def mixed(index: np.ndarray) -> np.ndarray:
    """Hash whole numbers so that neighbours are far apart: the finalizer of SplitMix64.

    Different numbers have different hashes. Steele, Lea & Flood 2014, Fast splittable pseudorandom number generators,
    OOPSLA.
    """
    z = (index.astype(np.uint64) + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


def pieces(result: Result, fields: tuple[str, ...]) -> Iterator[tuple[slice, Mapping[str, np.ndarray]]]:
    """Read samples (k, members, ...) of slices of the members: a large stored run is never in memory as a whole."""
    many = max(1, AT_ONCE // len(result.time))
    for first in range(0, result.members, many):
        members = slice(first, min(first + many, result.members))
        yield members, samples_of(result, fields, members)


def samples_of(
    result: Result, fields: tuple[str, ...], members: slice | np.ndarray, frames: np.ndarray | None = None
) -> dict[str, np.ndarray]:
    """Read samples (k, members, ...) of some members by name, at the times `frames`, by default at all.

    They are views if the result is in memory, `members` is a slice and all times are read.
    """
    at: Any = slice(None) if frames is None else frames
    if result.store is not None:
        stored = result.samples.part(members)  # type: ignore[attr-defined]
        return {name: stored[name][at] for name in fields}
    index = (at, members) if frames is None or isinstance(members, slice) else np.ix_(frames, members)
    return {name: result.samples[name][index] for name in fields}


def _survey(result: Result, frames: np.ndarray) -> tuple[np.ndarray, list[int]]:
    """Mask (n,) of the members with a finite start, and the members that reach farthest along each axis while under way."""
    finite = np.empty(result.members, bool)
    best: dict[tuple[int, int], tuple[float, int]] = {}
    counted = under_way(result)[frames]
    for members, samples in pieces(result, ("position",)):
        position = samples["position"] if len(frames) == len(result.time) else samples["position"][frames]
        is_finite = finite_rows(position)
        finite[members] = is_finite[0]
        for axis in range(3):
            values = np.where(counted[:, members] & is_finite, position[..., axis], np.nan)
            for sign, extremes in ((-1, -np.fmin.reduce(values, axis=0)), (1, np.fmax.reduce(values, axis=0))):
                i = int(np.where(np.isnan(extremes), -np.inf, extremes).argmax())
                if extremes[i] > best.get((axis, sign), (-np.inf, 0))[0]:
                    best[axis, sign] = float(extremes[i]), members.start + i
    return finite, [member for _, member in best.values() if finite[member]]


def finite_rows(vectors: np.ndarray) -> np.ndarray:
    """Tell which vectors (..., 3) are finite."""
    # One sum and one test: reducing a short axis takes several times as long.
    with np.errstate(invalid="ignore", over="ignore"):
        return np.isfinite(0.0 * vectors[..., 0] + 0.0 * vectors[..., 1] + 0.0 * vectors[..., 2])


def _ended(result: Result, rank: np.ndarray, places: int) -> list[int]:
    """Members that did not end ok, at most `places`, divided between the outcomes as evenly as possible."""
    status = np.asarray(result.status)[rank]
    groups = [rank[status == code] for code in outcomes(result) if code != Status.OK]
    chosen: list[int] = []
    for i, group in enumerate(groups := sorted(groups, key=len)):
        share = -(-(places - len(chosen)) // (len(groups) - i))
        chosen += group[:share].tolist()
    return chosen


def few(
    result: Result, members: slice | np.ndarray, fields: tuple[str, ...], frames: np.ndarray | None = None
) -> Result:
    """Read some members at some times (by default all times) into memory."""
    samples = samples_of(result, tuple(name for name in fields if name in result.samples), members, frames)
    of_members = {item.name: getattr(result, item.name)[members] for item in member_fields.EVERY}
    time = result.time if frames is None else result.time[frames]
    parameters = _Part(result.parameters, members)
    return replace(result, time=time, samples=samples, parameters=parameters, store=None, kept=None, **of_members)


class _Part(Mapping[str, np.ndarray]):
    """Parameters of some members, read at their first use: most pictures need none."""

    def __init__(self, samples: Mapping[str, np.ndarray], members: slice | np.ndarray):
        self._of_all, self._members = samples, members

    def __getitem__(self, name: str) -> np.ndarray:
        values = self._of_all[name]
        return values[self._members] if len(values) > 1 else values

    def __iter__(self) -> Iterator[str]:
        return iter(self._of_all)

    def __len__(self) -> int:
        return len(self._of_all)
