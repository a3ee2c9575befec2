# SPDX-License-Identifier: Apache-2.0
"""Height of the surface over time, and the terms, events and sensors that look at the depth below it."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.physics.terms.base import Array, Numbers, Packed, Term, own


class SurfaceLevel(Term):
    """A height of the surface that changes with time. Abstract.

    Methods:
        height: Height of the surface above the depth 0.
        mean_height: Its mean over time.
        highest: The largest height that it reaches.
        level_rows: Rows of the table for device code that looks at it (lgvi_kernels/tide.py).
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
            (k, n) [m].
        """
        raise NotImplementedError

    def mean_height(self, numbers: Numbers) -> Array:
        """Mean of the height over time.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).

        Returns:
            (n,) [m].
        """
        raise NotImplementedError

    def highest(self, numbers: Numbers) -> Array:
        """The largest height that it may reach.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).

        Returns:
            (n,) [m].
        """
        raise NotImplementedError

    def level_rows(self, numbers: Numbers) -> tuple[Array, dict[str, int]]:
        """Rows of the table for device code that looks at it.

        Args:
            numbers: The term's numbers by field, each of shape (n, ...).

        Returns:
            (n, rows), and the counts of knots and harmonics by field.
        """
        raise NotImplementedError


def level_of(terms: Sequence[Any]) -> SurfaceLevel | None:
    """The height of the surface among the terms of a scene; None where it stays at the depth 0."""
    return next((term for term in terms if isinstance(term, SurfaceLevel)), None)


def below(thing: Any, terms: Sequence[Any]) -> Any:
    """A term, an event or a sensor that knows the height of the surface, if it looks at the depth below it."""
    level = level_of(terms) if thing.looks_at_surface else None
    if level is thing.surface_level:
        return thing
    thing = copy.copy(thing)
    object.__setattr__(thing, "surface_level", level)
    return thing


def with_level(thing: Any, packed: Packed, parameters: Numbers) -> Packed:
    """The packed numbers of a term, with rows of the height of the surface behind its own."""
    if thing.surface_level is None:
        return packed
    rows, counts = thing.surface_level.level_rows(own(thing.surface_level, parameters))
    before = packed.rows if isinstance(packed.rows, tuple) else () if packed.rows is None else (packed.rows,)
    first = sum(part.shape[1] for part in before)
    return packed._replace(values=packed.values | {"tide_row": first} | counts, rows=(*before, rows))


def rise_above(thing: Any, time: Array, parameters: Numbers) -> Any:
    """Height (k, n) [m] of the surface at times (k,) [s] for a thing that may know it; 0 where it does not."""
    return (
        0.0
        if thing.surface_level is None
        else thing.surface_level.height(own(thing.surface_level, parameters), np.asarray(time))
    )


def rise_at_start(terms: Sequence[Any], parameters: Numbers) -> Any:
    """Height (n,) [m] of the surface at t = 0 by the terms of a scene; 0 where it stays at the depth 0."""
    level = level_of(terms)
    return 0.0 if level is None else level.height(own(level, parameters), np.zeros(1))[0]
