# SPDX-License-Identifier: Apache-2.0
"""The parts of a controller that play one role, as one function."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.maps.compose import plays

ROLES = ("measure", "guide", "control", "allocate", "send")


def _with_all(function, role):
    """A part's function with the arguments of all roles: (what is handed on, reference, measurement, numbers)."""
    if role in ("measure", "send"):

        @wp.func
        def of_measurement(s: Any, r: Any, y: Any, p: Any):
            return function(s, p)

        return of_measurement
    if role in ("control", "foresee"):

        @wp.func
        def of_all(s: Any, r: Any, y: Any, p: Any):
            return function(s, r, y, p)

        return of_all

    @wp.func
    def of_two(s: Any, r: Any, y: Any, p: Any):
        return function(s, y, p)

    return of_two


@functools.cache
def in_turn(parts, role):
    """(s, r, y, params) -> s: the functions of this role one after another, the first part's first. None if no part has it.

    s: what the role hands on: of "measure" and "send" the measurement, of "guide" the reference, of "foresee" a later one,
        else the wrench.
    """
    if not any(plays(part, role) for part in parts):
        return None
    function, rest = plays(parts[0], role), in_turn(parts[1:], role)
    if function is None:

        @wp.func
        def others(s: Any, r: Any, y: Any, p: Any):
            return rest(s, r, y, p.rest)

        return others
    first_function = _with_all(function, role)
    if rest is None:

        @wp.func
        def alone(s: Any, r: Any, y: Any, p: Any):
            return first_function(s, r, y, p.own)

        return alone

    @wp.func
    def each(s: Any, r: Any, y: Any, p: Any):
        return rest(first_function(s, r, y, p.own), r, y, p.rest)

    return each
