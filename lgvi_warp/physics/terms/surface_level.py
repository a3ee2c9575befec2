# SPDX-License-Identifier: Apache-2.0
"""Height of the surface over time, for terms, events and sensors that depend on the depth below it."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.physics.terms.base import Array, Numbers, Packed, Term, own


class SurfaceLevel(Term):
    """Base class of terms with a height of the surface that changes with time. Abstract.

    Methods:
        height: Height of the surface above the depth 0.
        mean_height: Mean of the height over time.
        highest: Largest height that the surface can reach.
        level_rows: Rows of the table for device code that reads the height (lgvi_kernels/tide.py).
    """

    unique: ClassVar[bool] = True
    timed: ClassVar[bool] = True
    device: ClassVar[str] = "lgvi_kernels.tide"

    def present(self, numbers: Numbers) -> bool:
        # It has no force: those who look at it have its rows.
        return False

    def height(self, numbers: Numbers, time: Array) -> Array:
        """Height of the surface above the depth 0.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).
            time: Times (k,) [s].

        Returns:
            Heights (k, n) [m].
        """
        raise NotImplementedError

    def mean_height(self, numbers: Numbers) -> Array:
        """Mean of the height over time.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).

        Returns:
            Mean heights (n,) [m].
        """
        raise NotImplementedError

    def highest(self, numbers: Numbers) -> Array:
        """The largest height that the surface can reach.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).

        Returns:
            Largest heights (n,) [m].
        """
        raise NotImplementedError

    def level_rows(self, numbers: Numbers) -> tuple[Array, dict[str, int]]:
        """Rows of the table for device code that reads the height.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).

        Returns:
            The rows (n, rows), and the counts of knots and harmonics by field.
        """
        raise NotImplementedError


def level_of(terms: Sequence[Any]) -> SurfaceLevel | None:
    """The surface level among the terms of a scene; None if the surface stays at the depth 0."""
    return next((term for term in terms if isinstance(term, SurfaceLevel)), None)


def below(thing: Any, terms: Sequence[Any]) -> Any:
    """The term, event or sensor, with the surface level if it depends on the depth below the surface."""
    level = level_of(terms) if thing.looks_at_surface else None
    if level is thing.surface_level:
        return thing
    thing = copy.copy(thing)
    object.__setattr__(thing, "surface_level", level)
    return thing


def with_level(thing: Any, packed: Packed, parameters: Numbers) -> Packed:
    """The packed numbers of a term, with the rows of the surface level after its own rows."""
    if thing.surface_level is None:
        return packed
    rows, counts = thing.surface_level.level_rows(own(thing.surface_level, parameters))
    before = packed.rows if isinstance(packed.rows, tuple) else () if packed.rows is None else (packed.rows,)
    first = sum(part.shape[1] for part in before)
    return packed._replace(values=packed.values | {"tide_row": first} | counts, rows=(*before, rows))


def rise_above(thing: Any, time: Array, parameters: Numbers) -> Any:
    """Height (k, n) [m] of the surface at times (k,) [s], from the surface level of a thing; 0 if it has none."""
    return (
        0.0
        if thing.surface_level is None
        else thing.surface_level.height(own(thing.surface_level, parameters), np.asarray(time))
    )


def rise_at_start(terms: Sequence[Any], parameters: Numbers) -> Any:
    """Height (n,) [m] of the surface at t = 0 from the terms of a scene; 0 if the surface stays at the depth 0."""
    level = level_of(terms)
    return 0.0 if level is None else level.height(own(level, parameters), np.zeros(1))[0]
