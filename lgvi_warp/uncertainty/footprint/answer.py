# SPDX-License-Identifier: Apache-2.0
"""Answer of `footprint`: regions, centre and covariance of the members' positions on the map."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any, ClassVar, Self

import numpy as np

from lgvi_warp.common.summaries import plural
from lgvi_warp.criteria.files import Saved, finite_or_none, with_missing_as
from lgvi_warp.uncertainty.footprint.density import MAIN, Polygon, enclosed


@dataclass(frozen=True, eq=False)
class Region:
    """Smallest region that contains a given share of the members, and a circle and an ellipse with the same share.

    Attributes:
        share: Share of the members, as a fraction.
        area: Area [m2]; NaN if all positions are at one point or on a line.
        low, high: 95 % interval of the area [m2]; high is infinite if there are too few members to bound the area.
        radius: Radius of the circle about the centre that contains the share [m].
        ellipse_area: Area of the ellipse that would contain the share if the positions were normally distributed [m2].
        polygons: Parts of the region. Each is a tuple of rings (k, 2), north and east [m]: the outline, then its holes.
    """

    share: float
    area: float
    low: float
    high: float
    radius: float
    ellipse_area: float
    polygons: tuple[Polygon, ...] = field(default=(), repr=False)

    @property
    def percent(self) -> str:
        """Text of the share in percent, such as "95 %"."""
        return f"{100.0 * self.share:g} %"

    @property
    def area_text(self) -> str:
        """Text of the area with its interval, such as "112 m2 (107 to 118)"."""
        return _area_text(self.area, self.low, self.high)

    @property
    def scattered(self) -> bool:
        """True if the region has several parts and the circle is much larger than the region."""
        return len(self.polygons) > 1 and math.pi * self.radius**2 > WIDE * self.area

    @property
    def largest(self) -> tuple[np.ndarray, float]:
        """Centroid (2,) of the region's largest part, and radius of the circle about it that contains this part [m]."""
        ring = max(self.polygons, key=lambda rings: enclosed([rings]))[0]
        away = ring - ring[0]
        parts = away[:-1, 1] * away[1:, 0] - away[1:, 1] * away[:-1, 0]
        centre = ring[0] + parts @ (away[:-1] + away[1:]) / (3.0 * parts.sum())
        return centre, float(np.hypot(*(ring - centre).T).max())


@dataclass(frozen=True, eq=False)
class Footprint(Saved):
    """Positions of the members on the map, and regions that contain shares of them; result of `lw.studies.footprint`.

    Attributes:
        at: When members are located: "end", the name of an event or outcome, such as "floor", or a time [s] as text.
        members: Number of members that have a position at this end or time.
        lacking: Number of members without such a position, by outcome, such as {"ok": 700, "non_finite": 3}.
        centre: Mean of the positions (2,), north and east of the origin [m]. Far outliers, up to 5 % of the members,
            are left out; a message gives their number.
        covariance: Covariance of the same positions (2, 2) [m2].
        regions: The regions with shares of 50, 90, 95 and 99 %, if there are enough members for them.
        growth: For 1/8, 1/4, 1/2 and all members: (number of members, area of the 95 % region, low, high) [m2].
        origin: Latitude and longitude of the axes' origin [deg]; None if the scene does not give them.
        places: North and east of some members (m, 2) [m], for figures; at most 1,000, chosen at random.
        messages: Notes for the user.
        provenance: Scene, ensemble, settings, versions and machine of the run.
    """

    study: ClassVar[str] = "footprint"
    endings: ClassVar[tuple[str, ...]] = ("json", "csv", "txt")

    at: str
    members: int
    lacking: Mapping[str, int]
    centre: np.ndarray
    covariance: np.ndarray
    regions: tuple[Region, ...]
    growth: tuple[tuple[int, float, float, float], ...]
    origin: tuple[float, float] | None
    places: np.ndarray = field(repr=False)
    messages: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict, repr=False)

    @property
    def main(self) -> Region:
        """The region of the answer: the 95 % region, or the largest region for which there are enough members."""
        return max((region for region in self.regions if region.share <= MAIN), key=lambda region: region.share)

    @property
    def answer(self) -> str:
        """The answer in one sentence."""
        region, time = self.main, time_of(self.at)
        before = "" if time is None else f"At {self.at} s "
        are = "are" if before else {"end": "end", "floor": "reach the floor"}.get(self.at, f"end by {self.at}")
        share = region.percent if region.radius > 0.0 else "all" if before else "All"
        if self.lacking:
            failed = before or self.at == "end"
            who = f"{self.members:,} members that {'did not fail' if failed else are}"
            share, are = f"{share} of the {who}", are if failed else "do so"
        centre, radius = region.largest if region.scattered else (self.centre, region.radius)
        within = f"within {number_text(radius, radius)} m of" if radius > 0.0 else "at"
        if region.scattered:
            total = number_text(region.area, region.area)
            within = f"in {len(region.polygons)} areas, {total} m2 in total, the largest {within}"
        return f"{before}{share} {are} {within} {place_text(centre, radius or 1.0)}."

    def _report(self) -> Iterator[str]:
        lines = [f"footprint   {plural(self.members, 'member')}, at {self.at}{' s' * (time_of(self.at) is not None)}"]
        if self.lacking:
            counts = ", ".join(f"{name} {count:,}" for name, count in self.lacking.items())
            lines.append(f"left out    {plural(sum(self.lacking.values()), 'member')} without such a place: {counts}")
        for each in self.regions:
            size = number_text(each.radius, each.radius)
            lines.append(
                f"{each.percent:<11} {each.area_text}"
                f"{f' in {len(each.polygons)} parts' * (len(each.polygons) > 1)}; within {size} m of the centre; "
                f"ellipse {number_text(each.ellipse_area, each.ellipse_area)} m2"
            )
        growth = [each for each in self.growth if math.isfinite(each[1]) and (each[2] > 0.0 or math.isfinite(each[3]))]
        if len(growth) > 1:
            lines += [
                f"growth      {self.main.percent} of {plural(n, 'member')}: {_area_text(*areas)}"
                for n, *areas in growth
            ]
        return iter([*lines, *(f"note        {text}" for text in self.messages)])

    def _content(self) -> dict[str, Any]:
        content = {item.name: getattr(self, item.name) for item in fields(self) if item.name != "provenance"}
        content |= {"regions": [asdict(region) for region in self.regions]}
        return dict(finite_or_none(content)) | {"provenance": self.provenance}

    @classmethod
    def _of_content(cls, content: dict[str, Any]) -> Self:
        arrays = {name: np.array(content[name], np.float64) for name in ("centre", "covariance")}
        places = np.array(content["places"], np.float64).reshape(-1, 2)
        return cls(**content | arrays | {
            "places": places,
            "regions": tuple(_region(entry) for entry in content["regions"]),
            "growth": tuple((n, *with_missing_as(areas, math.inf)) for n, *areas in content["growth"]),
            "origin": content["origin"] and tuple(content["origin"]),
            "messages": tuple(content["messages"]),
        })  # fmt: skip

    def rows(self) -> Iterator[dict[str, Any]]:
        for region in self.regions:
            yield {"share": region.share, "area": region.area, "low": region.low, "high": region.high,
                   "parts": len(region.polygons), "radius": region.radius, "ellipse_area": region.ellipse_area,
                   "north": float(self.centre[0]), "east": float(self.centre[1])}  # fmt: skip


# Of a region in several parts: a circle so many times as large tells little.
WIDE = 2.0


def _region(entry: Mapping[str, Any]) -> Region:
    """Read a region from a JSON file; without an area it is a point or a line."""
    polygons = tuple(tuple(np.array(ring, np.float64) for ring in rings) for rings in entry["polygons"])
    missing = math.nan if entry["low"] is None else math.inf
    numbers = {name: with_missing_as(entry[name], missing) for name in ("area", "low", "high")}
    return Region(**{**entry, **numbers, "polygons": polygons})


def time_of(at: str) -> float | None:
    """Read a time [s]; None for the name of an end."""
    try:
        return float(at)
    except ValueError:
        return None


def _area_text(area: float, low: float, high: float) -> str:
    """Text of an area with its interval."""
    if math.isnan(area):
        return "no area"
    if not math.isfinite(area):
        return f"at least {number_text(low, low)} m2" if 0.0 < low < area else "too few members for an area"
    if low == 0.0 and not math.isfinite(high):
        return f"{number_text(area, area)} m2 (too few members for an interval)"
    upper = f"to {number_text(high, high)}" if math.isfinite(high) else "or more"
    return f"{number_text(area, area)} m2 ({number_text(low, low)} {upper})"


def number_text(value: float, scale: float) -> str:
    """Text of a number, without an exponent, to three digits of a scale or more."""
    digits = 2 - math.floor(math.log10(scale)) if 0.0 < scale < math.inf else 2
    return f"{value:,.{max(0, digits)}f}"


def place_text(place: Sequence[float] | np.ndarray, scale: float) -> str:
    """Text of a position, north and east [m], to three digits of a scale."""
    words = []
    for value, names in zip(place, (("north", "south"), ("east", "west")), strict=True):
        text = number_text(abs(float(value)), scale)
        words += [f"{text} m {names[int(value < 0.0)]}"] if float(text.replace(",", "")) else []
    return f"a point {' and '.join(words)} of the origin" if words else "the origin"
