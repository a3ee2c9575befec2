"""The quantity that two results are compared in: any that statistics know, with its unit and its distance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.errors import SceneError
from lgvi_warp.runs.quantities import samples_of
from lgvi_warp.runs.result import Result
from lgvi_warp.statistics.functional import Functional, functional

# What results are always compared in, with its units. Attitude is the angle between the two.
QUANTITIES = {"position": "m", "attitude": "rad", "velocity": "m/s", "angular_velocity": "rad/s", "energy": "J"}


@dataclass(frozen=True)
class Compared:
    """What errors are of. functional: its numbers, at each time; None for those of QUANTITIES."""

    name: str
    unit: str
    functional: Functional | None = None

    def values(self, result: Result) -> np.ndarray:
        """(k, n, components), float64."""
        if self.functional is None:
            return np.asarray(getattr(result, self.name), dtype=np.float64).reshape(
                len(result.time), result.members, -1
            )
        return self.functional(*samples_of(result))

    def distance(self, result: Result, reference: Result) -> np.ndarray:
        """(k, n), the length of the difference; of angles [rad] the short way round."""
        with np.errstate(invalid="ignore"):
            apart = self.values(result) - self.values(reference)
            if self.unit == "rad":
                apart -= 2.0 * np.pi * np.round(apart / (2.0 * np.pi))
        return np.linalg.norm(apart, axis=-1)

    def largest(self, result: Result) -> float:
        """The largest number of it."""
        values = getattr(result, self.name) if self.functional is None else self.values(result)
        return float(np.nanmax(np.abs(values)))


def compared_in(of: Any) -> Compared:
    """What `of` means: a name, "depth", "position[2]", "norm(velocity)", or a lw.Quantity.

    Raises:
        SceneError: for what is not known, and for what has no number at each time.
    """
    if isinstance(of, Compared):
        return of
    if isinstance(of, str) and of.strip() in QUANTITIES:
        return Compared(of.strip(), QUANTITIES[of.strip()])
    if isinstance(of, list | tuple):
        raise SceneError([f"of = {of!r}: is several quantities; errors are of one of them: give its name"])
    found = functional("of", of)
    if found.over_path:
        remedy = f"give {found.quantity.name!r}, whose largest error over the path is told"
        raise SceneError(
            [f"of = {found.label!r}: looks over the path, and errors are of a quantity at each time; {remedy}"]
        )
    return Compared(found.label, found.unit or "1", found)
