# SPDX-License-Identifier: Apache-2.0
"""Laws that were not written here: whatever they index, they see their own rows of table and memory, and the bus."""

import functools
from types import ModuleType
from typing import Any

import warp as wp

from lgvi_kernels.lanes.state import struct, view_struct

# Where a law's own rows lie: in the table, in the memory, and how many rows of the memory's bus all laws see.
BOUNDS = ("first_row", "last_row", "first_memory", "last_memory", "bus")
ROLES = (
    "law",
    "damping",
    "push",
    "flow",
    "evolve",
    "follow",
    "steady_force",
    "energy",
    "supply",
    "steady_size",
    "report",
    "carried_inertia",
    "carried_momentum",
    "depart",
    "settle",
    "settle_later",
    "settled_law",
    "settled_push",
    "power",
)


def written_here(law):
    """Whether a law's device code is one of this package's: its reads follow from what its term has packed."""
    return isinstance(law, ModuleType) and law.__name__.startswith(("lgvi_kernels.", "lgvi_warp."))


class BoundedLaw:
    """A law, or an event, whose functions get a View that holds them to their own rows; all else is the law's own."""

    BOUNDED = True

    def __init__(self, law, bounded):
        self.device = law
        roles = {role: _held(getattr(law, role), bounded) for role in ROLES if hasattr(law, role)}
        if hasattr(law, "distance"):
            roles["distance"] = _held_distance(law.distance, bounded)
        vars(self).update(roles)

    def __getattr__(self, name):
        return getattr(self.device, name)


@functools.cache
def bounded_law(law, width, real, shared=False):
    """The law itself if it was written here; else a law that does the same within its own rows."""
    return law if written_here(law) else BoundedLaw(law, make_bounded(width, real, shared))


def bounded_spec(spec):
    """The Spec with its laws and events held to their rows."""
    hold = functools.partial(bounded_law, width=spec.lanes, real=spec.real, shared=spec.shared_rows)
    return spec._replace(laws=tuple(map(hold, spec.laws)), events=tuple(map(hold, spec.events)))


def bounds_struct():
    """The struct of a law's BOUNDS."""
    return struct("Bounds", **dict.fromkeys(BOUNDS, wp.int32))


@functools.cache
def make_bounded(width, real, shared):
    """(view, bounds) -> the same View, with the rows within these bounds alone."""
    Bounded = view_struct(width, real, shared, True)

    @wp.func
    def bounded(view: Any, bounds: Any):
        own = Bounded()
        own.north = view.north
        own.east = view.east
        own.down = view.down
        own.b = view.b
        own.nu = view.nu
        own.Om = view.Om
        own.t = view.t
        own.h = view.h
        own.step = view.step
        own.second = view.second
        own.packet = view.packet
        own.entry = view.entry
        own.table.rows = view.table
        own.table.first = bounds.first_row
        own.table.last = bounds.last_row
        own.memory.rows = view.memory
        own.memory.first = bounds.first_memory
        own.memory.last = bounds.last_memory
        own.memory.common = bounds.bus
        return own

    return bounded


def make_unbounded(View):
    """A View within bounds -> the View that it was made of, as laws that move the water read it."""

    @wp.func
    def unbounded(own: Any):
        view = View()
        view.north = own.north
        view.east = own.east
        view.down = own.down
        view.b = own.b
        view.nu = own.nu
        view.Om = own.Om
        view.t = own.t
        view.h = own.h
        view.step = own.step
        view.second = own.second
        view.packet = own.packet
        view.entry = own.entry
        view.table = own.table.rows
        view.memory = own.memory.rows
        return view

    return unbounded


def _held(role, bounded):
    @wp.func
    def held(w: Any, view: Any, p: Any):
        return role(w, bounded(view, p.bounds), p.own)

    return held


def _held_distance(distance, bounded):
    @wp.func
    def held_distance(view: Any, p: Any):
        return distance(bounded(view, p.bounds), p.own)

    return held_distance
