# SPDX-License-Identifier: Apache-2.0
"""The sum of laws is a law: an absent term is no code, no parameter and no time."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import lane, lane3
from lgvi_kernels.lanes.noise import noise_key
from lgvi_kernels.lanes.state import struct
from lgvi_kernels.lanes.tick import delayed_key, held_key
from lgvi_kernels.maps.bounded import bounds_struct

# The end of a role that only laws play which a controller drives.
OF_ACTUATORS = " of actuators"
# The begin of a role that a law may play from what its `settle` has kept at this time, in place of the whole role.
SETTLED = "settled_"
# What a law keeps at the end of a step no longer holds at the start of the next one if it follows from the time alone.
ANEW = "settle anew"


def plays(law, role):
    """The function of a law's module for this role, or None.

    A role is the name of a function: "law", "damping", "flow", "evolve", "distance". "potential" and "force" are those of
    "law" that follow from a potential, and those that do not; "matrix" is "damping" of a law that has no "push"; "law
    of actuators" and so on: of laws that report where they are. A law whose `held` is true settles once a step.
    """
    if role.endswith(OF_ACTUATORS):
        return plays(law, role.removesuffix(OF_ACTUATORS)) if hasattr(law, "report") else None
    if role == ANEW:
        return None if hasattr(law, "follow") else getattr(law, "settle", None)
    if role == "settle_later":
        if getattr(law, "held", False):
            return None
        return getattr(law, role, None) or plays(law, "settle")
    if role.startswith(SETTLED):
        return getattr(law, role, None) or plays(law, role.removeprefix(SETTLED))
    if role == "matrix":
        return None if hasattr(law, "push") else getattr(law, "damping", None)
    if role in ("potential", "force"):
        wanted = getattr(law, "POTENTIAL", False) == (role == "potential")
        return getattr(law, "law", None) if wanted else None
    return getattr(law, role, None)


def numbers_struct(law, numbers, width, real):
    """A law's struct of declared numbers, given by name and kind (see field_type)."""
    name = getattr(law, "__name__", "").rpartition(".")[2]
    name = f"numbers_{name}" if name.isidentifier() else "numbers"  # a user's file may have any name
    fields = {key: field_type(kind, width, real) for key, kind in numbers}
    return struct(name, **fields or {"unused": wp.uint8})


def field_type(kind, width, real):
    """The type of a field: 1, a lane; 3, a 3-vector of lanes; "step", "grid": the key of noise (see lanes/noise.py).

    "given": that of noise whose normals a call gives; "held", "delayed": where an actuator finds the commands of a controller
    (see lanes/tick.py).
    """
    if kind in ("held", "delayed"):
        return held_key() if kind == "held" else delayed_key()
    if kind == "given":
        # Its functions are there for runs that are given their draws alone.
        from lgvi_kernels.lanes.given_draws import given_key

        return given_key()
    if kind in ("step", "grid"):
        return noise_key(width, kind == "grid")
    return {1: lane, 3: lane3}[kind](width, real)


@functools.cache
def params_of(laws, numbers, width, real):
    """The parameters of several laws, nested: `own`, those of the first law, and `rest`, the same struct of the others.

    The functions of superpose nest alike: each hands `rest` on and reads `own`, without a name for each law. numbers: for each
    law the (name, kind) of the numbers that its Term declares, of which the struct of a law without `params` is made; one with
    `params` takes their types as further arguments.
    """
    if not laws:
        return struct("NoParams", unused=wp.uint8)
    make = getattr(laws[0], "params", None)
    if make:
        own = make(width, real, *(field_type(kind, width, real) for _, kind in numbers[0]))
    else:
        own = numbers_struct(laws[0], numbers[0], width, real)
    if getattr(laws[0], "BOUNDED", False):
        own = struct("BoundedParams", own=own, bounds=bounds_struct())
    return struct("Params", own=own, rest=params_of(laws[1:], numbers[1:], width, real))


@functools.cache
def superpose(laws, role):
    """Fold the functions of this role into one, (sum, view, params) -> sum. None if no law has it.

    The last law is added first; this order is part of the bits of a result.
    """
    if not any(plays(law, role) for law in laws):
        return None
    if any(_sees(law, role) for law in laws):
        return _handing_on(_superpose_seeing(laws, role))
    function, rest = plays(laws[0], role), superpose(laws[1:], role)
    if function is None:

        @wp.func
        def others(w: Any, view: Any, p: Any):
            return rest(w, view, p.rest)

        return others
    if rest is None:

        @wp.func
        def alone(w: Any, view: Any, p: Any):
            return function(w, view, p.own)

        return alone

    @wp.func
    def total(w: Any, view: Any, p: Any):
        return function(rest(w, view, p.rest), view, p.own)

    return total


def _sees(law, role):
    """Whether a law looks at the water in this role."""
    return role.removeprefix(SETTLED) in getattr(law, "SEES", ())


def _handing_on(nested):
    """(sum, view, params) -> sum of laws of which some look at the water, for which they also get the params of all laws."""

    @wp.func
    def handing_on(w: Any, view: Any, p: Any):
        return nested(w, view, p, p)

    return handing_on


def _superpose_seeing(laws, role):
    """Sum like superpose, (sum, view, params, params of all laws) -> sum."""
    if not any(plays(law, role) for law in laws):
        return None
    function, rest = plays(laws[0], role), _superpose_seeing(laws[1:], role)
    seeing = _sees(laws[0], role)

    @wp.func
    def total(w: Any, view: Any, p: Any, sea: Any):
        if wp.static(rest is not None):
            w = rest(w, view, p.rest, sea)
        if wp.static(function is not None and seeing):
            w = function(w, view, p.own, sea)
        if wp.static(function is not None and not seeing):
            w = function(w, view, p.own)
        return w

    return total


@functools.cache
def superpose_loads(laws, without_push=False):
    """Fold the loads of laws that look at the water, (D, w, view, params) -> (D, w). None if there are none.

    without_push: only those of laws that have no `push`.
    """
    nested = _superpose_loads(laws, without_push)
    if nested is None:
        return None

    @wp.func
    def loads(D: Any, w: Any, view: Any, p: Any):
        D, w = nested(D, w, view, p, p)
        return D, w

    return loads


def _superpose_loads(laws, without_push):
    if not laws:
        return None
    rest, load = _superpose_loads(laws[1:], without_push), getattr(laws[0], "load", None)
    load = None if without_push and hasattr(laws[0], "push") else load
    if rest is None and load is None:
        return None

    @wp.func
    def total(D: Any, w: Any, view: Any, p: Any, sea: Any):
        if wp.static(rest is not None):
            D, w = rest(D, w, view, p.rest, sea)
        if wp.static(load is not None):
            D, w = load(D, w, view, p.own, sea)
        return D, w

    return total
