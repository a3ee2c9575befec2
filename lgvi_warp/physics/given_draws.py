# SPDX-License-Identifier: Apache-2.0
"""Standard normal numbers for noise: streams of a term or a sensor, their columns in a run, and values given by a call."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from lgvi_warp.common.errors import refusal


class Stream(NamedTuple):
    """Standard normal numbers of one kind that a term or a sensor draws, and their source among the counters' numbers.

    name: Name of the noise that they drive. size: Count of numbers of a draw. number: 0 or 1, the stream of the counters.
    place: Index of the first of a counter's four normal numbers. at_start: Whether the host draws them once, at the start.
    """

    name: str
    size: int = 3
    number: int = 0
    place: int = 0
    at_start: bool = False


@dataclass(frozen=True)
class NoiseDraws:
    """Standard normal draws that one stream of a noisy term, or of a sensor, uses in a run.

    Attributes:
        of: Key of the term or of the sensor.
        stream: Name of the noise that the draws drive. White noise has "force" and "torque"; a random current has "current",
            and "start" for its value at t = 0; a sensor has "noise", "drift", "dropout", "outlier" and "outlier_std". A law
            that you write has "0" and "1", the numbers of its streams.
        first: Time of the first draw [s].
        spacing: Time from one draw to the next [s].
        count: Number of draws.
        size: Count of normal numbers in one draw: 3 for axes x, y, z, or 1.
        column: First column of these draws in the argument xi of a call. Columns are ordered by draw, then by axis.
        source: The stream of the counter-based generator that gives these numbers if the caller gives none.
    """

    of: str
    stream: str
    first: float
    spacing: float
    count: int
    size: int
    column: int
    source: Stream

    @property
    def numbers(self) -> int:
        """Count of normal numbers."""
        return self.count * self.size

    @property
    def columns(self) -> slice:
        """Columns of these draws in the array xi of all draws."""
        return slice(self.column, self.column + self.numbers)

    @property
    def times(self) -> np.ndarray:
        """Times of the draws (count,) [s]."""
        return self.first + self.spacing * np.arange(self.count)


class DrawTimes(NamedTuple):
    """Times at which a term or a sensor draws: time between two draws [s], and their number."""

    spacing: float
    draws: int


class DrawLayout:
    """The draws of a run in the order of their columns; for each term or sensor, draws of the start come last.

    Args:
        streams: For each term or sensor: its key, its streams and its times of draws.
    """

    def __init__(self, streams: Iterable[tuple[str, Sequence[Stream], DrawTimes]]):
        draws, self._by_key, column = list[NoiseDraws](), dict[str, dict[str, NoiseDraws]](), 0
        for key, each, times in streams:
            for source in sorted(each, key=lambda stream: stream.at_start):
                count = 1 if source.at_start else times.draws
                entry = NoiseDraws(key, source.name, 0.0, times.spacing, count, source.size, column, source)
                column += entry.numbers
                draws.append(entry)
                self._by_key.setdefault(key, {})[source.name] = entry
        self.draws, self.count = tuple(draws), column

    def __eq__(self, other: object) -> bool:
        return isinstance(other, DrawLayout) and self.draws == other.draws

    __hash__ = None  # type: ignore[assignment]

    def __iter__(self) -> Iterator[NoiseDraws]:
        return iter(self.draws)

    def of(self, key: str) -> Mapping[str, NoiseDraws]:
        """The draws of a term or a sensor by stream.

        Args:
            key: Key of the term or sensor.

        Returns:
            {stream: draws}, in the order of their columns.

        Raises:
            SceneError: If it has no draws, since the numbers with which it acts on some member were not named as varied.
        """
        if key not in self._by_key:
            remedy = "name what varies of it: prepare(scene, vary=[...], draws='given')"
            raise refusal("xi", "...", f"has no draws for {key}, which acts on some member", remedy)
        return self._by_key[key]

    def owner(self, column: int) -> str:
        """The owner of a column of the array xi of all draws.

        Args:
            column: Index of the column.

        Returns:
            The stream and its owner, as text.
        """
        entry = next(entry for entry in self.draws if column < entry.columns.stop)
        return f"{entry.of}, {entry.stream}"


@dataclass(frozen=True, eq=False)
class GivenDraws:
    """Standard normal numbers of members, used instead of those drawn from counters.

    Args:
        layout: The draws to which the columns belong.
        values: Normal numbers (n, m), in the columns of the layout; (1, m) if members share them.
    """

    layout: DrawLayout
    values: np.ndarray

    def of_members(self, chosen: slice | np.ndarray) -> GivenDraws:
        """Select members.

        Args:
            chosen: Positions of the members.

        Returns:
            The normal numbers of these members.
        """
        return self if len(self.values) == 1 else replace(self, values=self.values[chosen])

    def of_stream(self, key: str, stream: str) -> np.ndarray:
        """Return the normal numbers of one stream.

        Args:
            key: Key of the term or of the sensor.
            stream: Name of the stream.

        Returns:
            Normal numbers (1 or n, numbers).
        """
        return self.values[:, self.layout.of(key)[stream].columns]

    def rows(self, key: str) -> np.ndarray | None:
        """Return the normal numbers that the device code of a term or a sensor reads.

        Args:
            key: Key of the term or sensor.

        Returns:
            Normal numbers (1 or n, rows); None if it draws nothing.
        """
        entries = [entry for entry in self.layout if entry.of == key and not entry.source.at_start]
        if not entries:
            return None
        return self.values[:, entries[0].column : entries[-1].columns.stop]

    def places(self, key: str) -> dict[str, int]:
        """Find the streams that the device code of a term or a sensor reads.

        Args:
            key: Key of the term or sensor.

        Returns:
            {stream: its first row among those of `rows`}.
        """
        entries = [entry for entry in self.layout.of(key).values() if not entry.source.at_start]
        return {entry.stream: entry.column - entries[0].column for entry in entries}
