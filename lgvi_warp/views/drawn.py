# SPDX-License-Identifier: Apache-2.0
"""Drawing data of one run: poses of the drawn members at the drawn times, and curves of all members."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.arguments import members_of
from lgvi_warp.common.errors import NothingToDraw, refusal
from lgvi_warp.common.status import Status, stop_time, under_way
from lgvi_warp.control.signals import CHANNELS, ENERGY_USED
from lgvi_warp.physics import notation
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.results.outcomes import outcomes
from lgvi_warp.views import choice as choices
from lgvi_warp.views.choice import Shown, finite_rows, of_members, pieces, select_members
from lgvi_warp.views.fleet import OUTCOME_STYLES, energy_curve

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result

NEEDED = ("position", "attitude", "velocity")
# What is drawn of a filter; the name of the curve of its error.
BELIEFS = ("measured_position", "estimate_sigma", "nees")
OFF = "position_error"
# Levels of a fan: smallest, largest, and quantiles between.
LEVELS = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)
# Levels of the spread along each axis of the covariance, as those of two standard deviations of a normal distribution.
SPREAD = (0.025, 0.975)


@dataclass(frozen=True, eq=False)
class Fan:
    """Quantiles of one number against time, over the members under way.

    name: Name of its entity, as "height"; title: name and unit in words.
    levels: Values at LEVELS, shape (7, f); NaN at times when no member is under way.
    believed: Value that the filters estimate for this number, shape (f,); None without a filter.
    """

    name: str
    title: str
    unit: str
    levels: np.ndarray
    believed: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Spread:
    """Ellipsoids around the members under way, with axes from their covariance.

    at: Indices of the frames with an ellipsoid, shape (e,); center, half: centres and semi-axes, shape (e, 3) [m].
    axes: Rotations whose columns are the axes, shape (e, 3, 3).
    """

    at: np.ndarray
    center: np.ndarray
    half: np.ndarray
    axes: np.ndarray


@dataclass(frozen=True, eq=False)
class Drawn:
    """Drawing data of one run.

    source: The members whose samples were kept: the result itself, or its kept members; choice: the drawn members of these.
    few: The drawn members at the drawn times, in memory; counted: mask of those under way at each time, shape (f, m).
    label, rgb: Name and colour of the run in a comparison; "" and None for a single run, which is coloured by outcome.
    shares: Share of all members by status at each time, shape (f,) each; OK for those under way.
    bins: Edges of the depths' histogram [m], shape (b + 1,).
    heights: Number of members under way in each bin at each time, shape (f, b), of the members used for quantiles.
    above: Number of all members that rise above depth 0.
    """

    result: Result
    source: Result
    choice: Shown
    few: Result
    label: str
    rgb: tuple[int, int, int] | None
    counted: np.ndarray
    shares: dict[Status, np.ndarray]
    fans: tuple[Fan, ...]
    spread: Spread
    bins: np.ndarray
    heights: np.ndarray
    above: int

    @property
    def text(self) -> str:
        """Number of drawn members and of all members."""
        return of_members(len(self.choice.members), self.result.members)

    @property
    def members(self) -> np.ndarray:
        """Indices of the drawn members in the whole result, shape (m,)."""
        return self.choice.members if self.source is self.result else self.result.kept_members[self.choice.members]

    @property
    def time(self) -> np.ndarray:
        """Drawn times [s], shape (f,)."""
        return self.few.time

    @property
    def position(self) -> np.ndarray:
        """Drawn positions [m], float32, shape (f, m, 3)."""
        return self.few.position.astype(np.float32)

    @property
    def watered(self) -> bool:
        """Whether the water has a surface: it has none if a member is more than a metre above depth 0."""
        return not np.nanmax(self.fans[0].levels, initial=-np.inf) > 1.0

    def color(self, code: Status) -> tuple[int, int, int]:
        """Choose the colour of members with this outcome."""
        return self.rgb or OUTCOME_STYLES[code].rgb

    def path(self, head: str, *parts: str) -> str:
        """Name an entity of this run."""
        import rerun as rr

        return str(rr.new_entity_path([*head.split("/"), *([self.label] if self.label else []), *parts]))

    def groups(self) -> list[tuple[Status, np.ndarray]]:
        """Divide the drawn members by their outcome until each time: masks (f, m) by status, OK for those under way."""
        status = np.asarray(self.few.status)
        is_finite = finite_rows(self.few.position)
        ended = ((code, is_finite & ~self.counted & (status == code)) for code in outcomes(self.few) if code)
        return [(Status.OK, is_finite & self.counted), *ended]


def drawn_of(result: Result, members: Any = None, label: str = "", rgb: tuple[int, int, int] | None = None) -> Drawn:
    """Read the drawing data of a single run, or of one of several runs with labels and colours."""
    source = result.kept if not result.samples and result.kept is not None else result
    if missing := [name for name in NEEDED if source.samples and name not in source.samples]:
        names = ", ".join(missing)
        raise NothingToDraw(f"{names} were not kept: a recording needs them. Add them to SaveAt(fields=...)")
    choice = select_members(source)
    if members is not None:
        kept = np.arange(result.members) if source is result else result.kept_members
        choice = dataclasses.replace(choice, members=places_of(members, result.members, kept))
    few = choices.few(source, choice.members, (*FIELDS, *CHANNELS, ENERGY_USED, *BELIEFS), choice.frames)
    counted = under_way(few)
    fans, ranked, above = _survey(source, choice, _directions(few, counted))
    fans = tuple(streamed(result, fan, choice.frames) for fan in fans)
    position, count = ranked["position"], ranked["counted"]
    energy = energy_curve(few) if set(FIELDS) <= set(few.samples) else None
    if energy is not None and np.isfinite(energy.values).any():
        levels = at_levels(energy.values, counted, LEVELS)
        title = f"{energy.name} [J] of {of_members(len(choice.members), result.members)}"
        fans = (*fans, Fan("energy", title, "J", levels))
    if ENERGY_USED in few.samples:
        title = f"Energy used [J] of {of_members(len(choice.members), result.members)}"
        fans = (*fans, Fan(ENERGY_USED, title, "J", at_levels(few.energy_used, counted, LEVELS)))
    fans = (*fans, *_navigation(few, counted, of_members(len(choice.members), result.members)))
    depth = np.where(count, position[..., 2], np.nan)
    finite = depth[np.isfinite(depth)]
    bins = np.linspace(*_range(finite), 41)
    heights = np.stack([np.histogram(row[np.isfinite(row)], bins)[0] for row in depth])
    shares = _shares(result, choice.frames)
    spread = _spread(position, count)
    return Drawn(result, source, choice, few, label, rgb, counted, shares, fans, spread, bins, heights, above)


def _navigation(few: Result, counted: np.ndarray, text: str) -> Iterator[Fan]:
    """Fans of the distance between true and estimated position, and of NEES, if their samples were saved."""
    if {"measured_position", "estimate_sigma"} <= set(few.samples):
        off = np.linalg.norm(few.measured_position - few.position, axis=-1)
        title = f"Off the estimated place [m] of {text}; orange: as filters believe"
        yield Fan(OFF, title, "m", at_levels(off, counted, LEVELS), believed_sigma(few, counted))
    if "nees" in few.samples:
        yield Fan("nees", f"NEES, 15 for a consistent filter, of {text}", "1", at_levels(few.nees, counted, LEVELS))


def believed_sigma(few: Result, counted: np.ndarray) -> np.ndarray:
    """Standard deviation (f,) [m] of the position that filters report: square root of the trace, median of members."""
    sigma = np.linalg.norm(few.estimate_sigma[..., :3], axis=-1)
    return np.asarray(at_levels(sigma, counted, [0.5])[0])


def places_of(members: Any, total: int, kept: np.ndarray) -> np.ndarray:
    """Find the positions of the user's indices among the kept members."""
    indices = members_of("members", members, total)
    if len(lost := np.setdiff1d(indices, kept)):
        raise refusal("members", int(lost[0]), "has no samples", f"keep them: keep={[int(index) for index in indices]}")
    return np.flatnonzero(np.isin(kept, indices))


# Fan -> quantity of the run's own statistics, and its sign.
STREAMED = {"height": ("depth", -1.0), "speed": ("speed", 1.0)}


def streamed(result: Result, fan: Fan, frames: np.ndarray) -> Fan:
    """Replace a fan by the run's own quantiles and extremes of all members, if the samples of all were not kept."""
    quantity, sign = STREAMED.get(fan.name, ("", 1.0))
    levels, replaced = np.full_like(fan.levels, np.nan), False
    for estimate in result.statistics.values() if not result.samples else ():
        kind, at_all_times = estimate.settings["type"], len(estimate.time) == len(result.time)
        if estimate.settings.get("of") != quantity or kind not in ("quantiles", "extremes") or not at_all_times:
            continue
        rows = {0.0: estimate["minimum"], 1.0: estimate["maximum"]} if kind == "extremes" else dict(
            zip(estimate.coordinates["level"].tolist(), np.moveaxis(estimate.value, 1, 0), strict=True)
        )  # fmt: skip
        for level, row in rows.items():
            at = np.isclose(LEVELS, level if sign > 0.0 else 1.0 - level)
            levels[at], replaced = sign * row[frames, 0], True
    title = f"{fan.title}, by the run's statistics"
    return dataclasses.replace(fan, title=title, levels=levels) if replaced else fan


def roll_pitch_heading(attitude: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute roll, pitch and heading [deg], float32, from rotations (..., 3, 3) from body to inertial axes."""
    part = {place: attitude[..., *place].astype(np.float32) for place in ((0, 0), (1, 0), (2, 0), (2, 1), (2, 2))}
    roll = np.degrees(np.arctan2(part[2, 1], part[2, 2]))
    pitch = np.degrees(np.arcsin(np.clip(-part[2, 0], -1.0, 1.0)))
    return roll, pitch, np.degrees(np.arctan2(part[1, 0], part[0, 0]))


def _directions(few: Result, counted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean directions [deg] of roll and heading, shape (f, 1) each, continuous in time, as the middle for angles."""
    directions = []
    for angle in roll_pitch_heading(few.attitude)[::2]:
        arm = np.where(counted & np.isfinite(angle), np.exp(1j * np.radians(angle)), 0.0).sum(axis=1)
        directions.append(np.degrees(np.unwrap(np.angle(arm)))[:, None].astype(np.float32))
    return directions[0], directions[1]


def about(angle: np.ndarray, direction: np.ndarray, turn: float) -> np.ndarray:
    """Shift angles by whole turns to within half a turn of a direction; turn: 2 pi [rad] or 360 [deg]."""
    off = angle - direction
    return np.asarray(direction + off - turn * np.round(off / turn))


# Name, title and unit of the curves of all members.
CURVES = (
    ("height", "Height [m], 0 is the surface", "m"),
    ("roll", "Roll [deg]", "deg"),
    ("pitch", "Pitch [deg]", "deg"),
    ("heading", "Heading [deg], from north to east", "deg"),
    ("speed", "Speed [m/s]", "m/s"),
)


def _survey(
    result: Result, choice: Shown, directions: tuple[np.ndarray, np.ndarray]
) -> tuple[tuple[Fan, ...], dict[str, np.ndarray], int]:
    """Compute (fans: extremes of all members, quantiles of the ranked ones; positions of these; members above depth 0)."""
    frames, counted = choice.frames, under_way(result)[choice.frames]
    low, high = (np.full((len(CURVES), len(frames)), np.nan, np.float32) for _ in range(2))
    rows: list[list[np.ndarray]] = [[] for _ in CURVES]
    positions, counts, above = [], [], 0
    for members, samples in pieces(result, NEEDED):
        at = {name: values[frames] if len(frames) < len(result.time) else values for name, values in samples.items()}
        # A path that is not finite any more counts as little as one that has ended.
        position = at["position"].astype(np.float32)
        counts_here = counted[:, members] & finite_rows(position)
        roll, pitch, heading = roll_pitch_heading(at["attitude"])
        speed = np.sqrt(sum(np.square(at["velocity"][..., axis], dtype=np.float32) for axis in range(3)))
        roll, heading = about(roll, directions[0], 360.0), about(heading, directions[1], 360.0)
        values = (-position[..., 2], roll, pitch, heading, speed)
        above += int(np.count_nonzero(np.logical_or.reduce(counts_here & (position[..., 2] < 0.0), axis=0)))
        ranked = choice.ranked_of(members)
        for i, value in enumerate(values):
            masked = np.where(counts_here, value, np.float32(np.nan))
            low[i] = np.fmin(low[i], np.fmin.reduce(masked, axis=1))
            high[i] = np.fmax(high[i], np.fmax.reduce(masked, axis=1))
            rows[i].append(value[:, ranked])
        positions.append(position[:, ranked])
        counts.append(counts_here[:, ranked])
    count = np.concatenate(counts, axis=1)
    fans = []
    for i, curve in enumerate(CURVES):
        levels = at_levels(np.concatenate(rows[i], axis=1), count, LEVELS)
        levels[0], levels[-1] = low[i], high[i]
        fans.append(Fan(*curve, levels))
    return tuple(fans), {"position": np.concatenate(positions, axis=1), "counted": count}, above


def at_levels(values: np.ndarray, counted: np.ndarray, levels: Sequence[float]) -> np.ndarray:
    """Quantiles (m, f) of values (f, n) over the members that count at each time, with linear interpolation.

    A value that is not finite never counts. At times when no value counts, the quantiles are NaN.
    """
    ranked = np.sort(np.where(counted & np.isfinite(values), values, np.inf), axis=1)
    counts = np.isfinite(ranked).sum(axis=1)
    place = np.multiply.outer(np.asarray(levels), np.maximum(counts - 1, 0))
    below = place.astype(int)
    above = np.minimum(below + 1, np.maximum(counts - 1, 0))
    row = np.arange(len(values))
    lower, upper = ranked[row, below].astype(np.float64), ranked[row, above].astype(np.float64)
    with np.errstate(invalid="ignore"):
        return np.where(counts > 0, lower + (place - below) * (upper - lower), np.nan)


def _spread(position: np.ndarray, counted: np.ndarray) -> Spread:
    """Ellipsoids at times with four or more members under way: semi-axes from quantiles along the covariance's axes."""
    at = np.flatnonzero(counted.sum(axis=1) >= 4)
    center, half, axes = np.empty((len(at), 3)), np.empty((len(at), 3)), np.empty((len(at), 3, 3))
    for i, k in enumerate(at):
        points = position[k, counted[k]]
        mean = points.mean(axis=0, dtype=np.float64)
        points = points - mean.astype(np.float32)
        _, turn = np.linalg.eigh(points.T @ points)
        turn[:, 0] *= np.sign(np.linalg.det(turn))
        low, high = at_levels((points @ turn).T, np.ones((3, len(points)), bool), SPREAD)
        center[i], half[i], axes[i] = mean + turn @ (0.5 * (low + high)), 0.5 * (high - low), turn
    return Spread(at, center, half, axes)


def _shares(result: Result, frames: np.ndarray) -> dict[Status, np.ndarray]:
    """Share of all members under way at each time, as OK, and of the ended members by outcome."""
    counted = under_way(result)[frames]
    status = np.asarray(result.status)
    ended = {code: (~counted[:, status == code]).sum(axis=1) for code in outcomes(result) if code}
    return {code: sums / result.members for code, sums in ({Status.OK: counted.sum(axis=1)} | ended).items()}


def _range(values: np.ndarray) -> tuple[float, float]:
    """Limits of a histogram of finite values; they always differ a little."""
    first, last = (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)
    wide = max(last - first, 1e-3 * max(abs(first), abs(last)), 1e-6)
    return first - 0.01 * wide, last + 0.01 * wide


def first_ended(result: Result, code: Status) -> float:
    """Time at which the first member ended with this outcome [s]."""
    return float(stop_time(result)[np.asarray(result.status) == code].min())


def quaternion_xyzw(attitude: np.ndarray) -> np.ndarray:
    """Quaternions (..., 4), scalar last, float32, for the viewer, from rotations (..., 3, 3)."""
    return notation.quaternion_from_matrix(attitude)[..., [1, 2, 3, 0]].astype(np.float32)
