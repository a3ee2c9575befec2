# SPDX-License-Identifier: Apache-2.0
"""The quantity in which two results are compared, with its unit and its distance."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.sentences import sentences
from lgvi_warp.physics.fields import FIELDS, TABLE
from lgvi_warp.results.quantities import samples_of
from lgvi_warp.results.result import Result
from lgvi_warp.statistics.values.functional import Functional, functional

# Quantities that results are always compared in, and their units. Attitudes differ by the angle between them.
QUANTITIES = {name: TABLE[name].unit for name in (*FIELDS, "energy")} | {"attitude": "rad"}


@dataclass(frozen=True)
class Distance:
    """Quantity in which errors are measured.

    functional: computes the quantity at each time; None for the names in QUANTITIES.
    mean: True if the error is the error of the mean over the members, False for the largest error of a member.
    """

    name: str
    unit: str
    functional: Functional | None = None
    mean: bool = False

    def values(self, result: Result) -> np.ndarray:
        """The quantity at each time (k, n, components), float64 [unit]."""
        if self.functional is None:
            values = np.asarray(getattr(result, self.name), dtype=np.float64)
            return values.reshape(len(result.time), result.members, -1)
        return self.functional(*samples_of(result))

    def distance(self, result: Result, reference: Result) -> np.ndarray:
        """Length of the difference of two results (k, n) [unit]; angles differ by the shorter way round [rad].

        For a mean, it is the upper end of the 95 % interval of the difference of the means, the same for every member.
        The members of both results are paired.
        """
        with np.errstate(invalid="ignore"):
            apart = self.values(result) - self.values(reference)
            if self.unit == "rad":
                apart -= 2.0 * np.pi * np.round(apart / (2.0 * np.pi))
            if self.mean:
                return np.broadcast_to(_bias(apart)[:, None], apart.shape[:2])
        return np.linalg.norm(apart, axis=-1)

    def largest(self, result: Result) -> float:
        """The largest size over times, members and components [unit]."""
        return float(np.nanmax(np.abs(self.values(result))))


def _bias(apart: np.ndarray) -> np.ndarray:
    """Length (k,) of |mean| plus two standard errors, per component, of paired differences (k, n, components)."""
    n = apart.shape[1]
    error = 2.0 * apart.std(axis=1, ddof=1) / np.sqrt(n) if n > 1 else np.zeros(apart[:, 0].shape)
    return np.asarray(np.linalg.norm(np.abs(apart.mean(axis=1)) + error, axis=-1))


# What begins the name of a mean over the members, as lw.statistics.Mean has it.
MEAN = "mean "


def compared_in(of: Any) -> Distance:
    """The quantity that a name ("depth", "mean position[0]"), a lw.statistics.Quantity or a Distance means."""
    if isinstance(of, Distance):
        return of
    if isinstance(of, str) and of.strip() in QUANTITIES:
        return Distance(of.strip(), QUANTITIES[of.strip()])
    if isinstance(of, str) and of.strip().startswith(MEAN):
        entry = compared_in(of.strip().removeprefix(MEAN))
        if entry.name == "attitude" or entry.mean:
            remedy = "give the mean of an entry, such as 'mean attitude[2,2]'"
            raise SceneError([sentences(f"of = {of!r}", "is not a mean of numbers", remedy)])
        inner = entry.functional or functional("of", entry.name)
        return replace(entry, name=MEAN + entry.name, functional=inner, mean=True)
    if not callable(of) and items_of(of) is not None:
        raise SceneError([f"of = {of!r} is several quantities, and an error is of one of them. Give its name"])
    parsed = functional("of", of)
    if parsed.over_path:
        problem = "is taken over the whole path, and errors are of a quantity at each time"
        remedy = f"give {parsed.inner.name!r}, whose largest error over the path is reported"
        raise SceneError([sentences(f"of = {parsed.label!r}", problem, remedy)])
    return Distance(parsed.label, parsed.unit or "1", parsed)
